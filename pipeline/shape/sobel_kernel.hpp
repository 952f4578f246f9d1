#pragma once

#include <cstdint>

namespace stereotrack {

/// A row and its neighbours; at a picture's upper and lower side the row itself stands in for the one outside.
struct SobelRows {
  const std::uint8_t* above = nullptr;
  const std::uint8_t* here = nullptr;
  const std::uint8_t* under = nullptr;
};

/// One row of Sobel: out = min(floor(sqrt(Gx^2 + Gy^2)), 255); the first and the last column stand in for those
/// outside. The reference is the definition, which every instruction set of pipeline/core/simd.hpp equals bit for bit.
/// About 0.2 ns a pixel. Any thread, no state.
void sobel_row(const SobelRows& in, int width, std::uint8_t* out) noexcept;
void sobel_row_reference(const SobelRows& in, int width, std::uint8_t* out) noexcept;

}  // namespace stereotrack
