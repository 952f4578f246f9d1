#pragma once

#include <cstdint>

#include "pipeline/core/image_view.hpp"

namespace stereotrack {

/// 3x3 binomial smoothing, weights 1 2 1 each way, rounded half up, border replicated. White noise of
/// standard deviation s leaves with 0.375 s. in and out: one size, different memory. O(pixels).
inline void smooth3x3(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) noexcept {
  for (int y = 0; y < out.height; ++y) {
    const std::uint8_t* a = in.row(y > 0 ? y - 1 : 0);
    const std::uint8_t* b = in.row(y);
    const std::uint8_t* c = in.row(y + 1 < out.height ? y + 1 : y);
    std::uint8_t* result = out.row(y);
    const auto column = [&](int x) { return a[x] + 2 * b[x] + c[x]; };
    for (int x = 0; x < out.width; ++x) {
      const int before = column(x > 0 ? x - 1 : 0);
      const int after = column(x + 1 < out.width ? x + 1 : x);
      result[x] = static_cast<std::uint8_t>((before + 2 * column(x) + after + 8) >> 4);
    }
  }
}

}  // namespace stereotrack
