#pragma once

#include <cstdint>

#include "pipeline/core/image_view.hpp"

namespace stereotrack {

/// Difference of background and picture.
///     g(x, y) = f(x, y) - h(x, y)                                         (3.8)
/// f background, h picture, all of one size. The document does not say what becomes of negative values;
/// an object may be darker or brighter than the background, so the absolute value is kept. O(pixels).
inline void difference(ImageView<const std::uint8_t> background, ImageView<const std::uint8_t> picture,
                       ImageView<std::uint8_t> out) noexcept {
  for (int y = 0; y < out.height; ++y) {
    const std::uint8_t* f = background.row(y);
    const std::uint8_t* h = picture.row(y);
    std::uint8_t* g = out.row(y);
    for (int x = 0; x < out.width; ++x) {
      g[x] = static_cast<std::uint8_t>(f[x] > h[x] ? f[x] - h[x] : h[x] - f[x]);
    }
  }
}

}  // namespace stereotrack
