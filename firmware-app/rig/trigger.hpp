#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "config/configuration.hpp"
#include "drivers/gpio/line.hpp"
#include "drivers/trigger/pulse_train.hpp"
#include "drivers/trigger/pwm.hpp"
#include "drivers/trigger/trigger.hpp"

namespace stereotrack {

/// What trigger.* asks for, opened: nothing is given yet.
struct TriggerSetup {
  std::unique_ptr<trigger::Trigger> told;      ///< for the cameras; null: pulses, if there are any, are not told
  std::unique_ptr<trigger::PulseTrain> train;  ///< for the trigger thread; null: no mode gpio
  std::unique_ptr<trigger::Pwm> pwm;           ///< null: no mode pwm
};

/// Throws std::runtime_error with one line naming line or chip and the way out. Nothing where source.name is not
/// "cameras".
[[nodiscard]] TriggerSetup open_trigger(const config::Configuration& configuration);

/// What --check-config says: what the trigger will do, one line. Nothing is requested or changed; throws
/// std::runtime_error, one line, for what this build, this kernel or the board has not got: a PWM chip, edges in time.
[[nodiscard]] std::string check_trigger(const config::Configuration& configuration);

/// Between two pulses, as camera.fps says.
[[nodiscard]] std::chrono::nanoseconds trigger_period(const config::Configuration& configuration);

/// For safe lines: what the trigger drives, inactive; none: nothing of that kind.
[[nodiscard]] std::optional<gpio::LineSpec> trigger_output(const config::Configuration& configuration);
[[nodiscard]] std::optional<trigger::Pwm::Config> trigger_pwm(const config::Configuration& configuration);

}  // namespace stereotrack
