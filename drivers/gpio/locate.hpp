#pragma once

#include "drivers/gpio/gpiod.hpp"
#include "drivers/gpio/line.hpp"
#include "drivers/gpio/simulated_chip.hpp"

namespace stereotrack::gpio {

[[nodiscard]] inline bool is_simulated(const LineName& name) { return name.chip == simulated_chip::kChip; }

/// Where a line is now, real or simulated. Throws as gpiod::find().
[[nodiscard]] inline gpiod::Found locate(const LineName& name) {
  return is_simulated(name) ? gpiod::Found{name.chip, 0} : gpiod::find(name);
}

}  // namespace stereotrack::gpio
