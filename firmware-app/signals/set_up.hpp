#pragma once

#include <chrono>
#include <vector>

#include "config/configuration.hpp"
#include "drivers/gpio/input_lines.hpp"
#include "drivers/gpio/line.hpp"
#include "firmware-app/signals/signal_rules.hpp"

namespace stereotrack::signals {

/// The lines that the configuration's [[signal]] tables name, in their order: bit i is signal i. Throws config::Error.
[[nodiscard]] std::vector<gpio::LineSpec> line_specs(const config::Configuration& configuration);

/// The rules that its [[zone]] and [[signal]] tables state. `unit_m`: metres in one unit of the calibration's T, 0: not
/// known. `stale_after`: see SignalRules. Throws config::Error; what load() and check_metres() let pass does not.
[[nodiscard]] SignalRules make_rules(const config::Configuration& configuration, double unit_m,
                                     std::chrono::nanoseconds stale_after);

/// Words of the configuration in the driver's own.
[[nodiscard]] gpio::Edges edges_of(config::InputEdge edge) noexcept;
[[nodiscard]] gpio::Bias bias_of(config::InputBias bias) noexcept;

}  // namespace stereotrack::signals
