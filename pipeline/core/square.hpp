#pragma once

namespace stereotrack {

/// value * value, of what is too long to be written twice.
[[nodiscard]] constexpr double square(double value) noexcept { return value * value; }

}  // namespace stereotrack
