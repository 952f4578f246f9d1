#include "firmware-app/rig/trigger.hpp"

#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include "config/milliseconds.hpp"
#include "drivers/trigger/edges.hpp"
#include "firmware-app/formatted.hpp"
#include "firmware-app/rig/cameras.hpp"
#include "firmware-app/signals/set_up.hpp"

namespace stereotrack {

namespace {

using config::TriggerConfig;
using config::TriggerMode;

constexpr const char* kConsumer = "stereotrackd-trigger";

std::chrono::nanoseconds from_us(double us) { return config::from_ms(us * 1e-3); }

/// As said; kFreeRun of a source that has no cameras.
TriggerMode mode_of(const config::Configuration& configuration) {
  return configuration.source.name == kCameras ? configuration.trigger.mode : TriggerMode::kFreeRun;
}

gpio::InputSpec input_of(const TriggerConfig& said) {
  return {.name = gpio::parse_line_name(said.line),
          .active_low = said.active == config::ActiveLevel::kLow,
          .bias = signals::bias_of(said.bias),
          .edges = signals::edges_of(said.edge)};
}

std::string level_text(const TriggerConfig& said) {
  return said.active == config::ActiveLevel::kLow ? "active low" : "active high";
}

std::string exposure_text(const TriggerConfig& said) {
  return formatted("; exposures begin %.0f us after the %s edge", said.delay_us,
                   said.edge == config::InputEdge::kFalling ? "falling" : "rising");
}

}  // namespace

std::chrono::nanoseconds trigger_period(const config::Configuration& configuration) {
  return std::chrono::nanoseconds(std::llround(1e9 / configuration.camera.fps));
}

std::optional<gpio::LineSpec> trigger_output(const config::Configuration& configuration) {
  if (mode_of(configuration) != TriggerMode::kGpio) return std::nullopt;
  return gpio::LineSpec{.name = gpio::parse_line_name(configuration.trigger.line),
                        .active_low = configuration.trigger.active == config::ActiveLevel::kLow};
}

std::optional<trigger::Pwm::Config> trigger_pwm(const config::Configuration& configuration) {
  if (mode_of(configuration) != TriggerMode::kPwm) return std::nullopt;
  const TriggerConfig& said = configuration.trigger;
  trigger::Pwm::Config pwm;
  pwm.chip = said.pwm_chip;
  pwm.channel = static_cast<unsigned>(said.pwm_channel);
  pwm.period = trigger_period(configuration);
  pwm.width = from_us(said.pulse_us);
  pwm.active_low = said.active == config::ActiveLevel::kLow;
  return pwm;
}

TriggerSetup open_trigger(const config::Configuration& configuration) {
  const TriggerConfig& said = configuration.trigger;
  TriggerSetup setup;
  switch (mode_of(configuration)) {
    case TriggerMode::kFreeRun:
    case TriggerMode::kUnseen: break;
    case TriggerMode::kGpio: {
      const gpio::LineSpec line = *trigger_output(configuration);
      auto train = trigger::PulseTrain::create({.period = trigger_period(configuration),
                                                .width = from_us(said.pulse_us),
                                                .late = from_us(said.late_us),
                                                .falls = said.edge == config::InputEdge::kFalling},
                                               gpio::open_lines({&line, 1}, kConsumer));
      if (!train.has_value()) throw std::runtime_error("trigger.pulse_us: pulses do not fit into a period");
      setup.train = std::move(*train);
      setup.told = setup.train->trigger();
      break;
    }
    case TriggerMode::kPwm: setup.pwm = std::make_unique<trigger::Pwm>(*trigger_pwm(configuration)); break;
    case TriggerMode::kExternal: setup.told = std::make_unique<trigger::EdgeTrigger>(input_of(said), kConsumer); break;
  }
  return setup;
}

std::string check_trigger(const config::Configuration& configuration) {
  const TriggerConfig& said = configuration.trigger;
  switch (mode_of(configuration)) {
    case TriggerMode::kFreeRun: break;
    case TriggerMode::kUnseen:
      return formatted("trigger: unseen, %.1f exposures/s expected; silence of both cameras is no fault",
                       configuration.camera.fps);
    case TriggerMode::kGpio:
      return "trigger: gpio " + said.line + ", " + level_text(said) +
             formatted(": %.1f pulses/s of %.0f us", configuration.camera.fps, said.pulse_us) + exposure_text(said);
    case TriggerMode::kPwm: {
      const trigger::Pwm::Config pwm = *trigger_pwm(configuration);
      const trigger::PwmChip chip = trigger::find_pwm(pwm);
      return "trigger: pwm " + chip.name + (chip.device.empty() ? "" : " (" + chip.device + ")") +
             formatted(" channel %u, ", pwm.channel) + level_text(said) +
             formatted(": %.1f pulses/s of %.0f us; their times are not told: pairs are formed without",
                       configuration.camera.fps, said.pulse_us);
    }
    case TriggerMode::kExternal: {
      const gpio::InputSpec spec = input_of(said);
      gpio::check_inputs({&spec, 1});
      return "trigger: external " + said.line + ", " + level_text(said) +
             formatted(": %.1f pulses/s expected", configuration.camera.fps) + exposure_text(said);
    }
  }
  return "trigger: none, each camera runs by itself";
}

}  // namespace stereotrack
