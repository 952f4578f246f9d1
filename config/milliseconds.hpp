#pragma once

#include <chrono>
#include <cmath>

namespace stereotrack::config {

/// What a key in milliseconds says, to the nearest nanosecond.
[[nodiscard]] inline std::chrono::nanoseconds from_ms(double ms) noexcept {
  return std::chrono::nanoseconds(std::llround(ms * 1e6));
}

}  // namespace stereotrack::config
