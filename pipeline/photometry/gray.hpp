#pragma once

#include <algorithm>
#include <cstdint>

#include "pipeline/core/image_view.hpp"
#include "pipeline/frame.hpp"
#include "pipeline/photometry/colour_kernel.hpp"

namespace stereotrack {

/// Luma of one pixel, full range.
///     Y = 0.299 R + 0.587 G + 0.114 B                                     (3.1), ITU-R BT.601
/// in integers: weights of 14 bits that add to 2^14, rounded half up. 0..255 in, 0..255 out; the same
/// bits as the Y of OpenCV's COLOR_BGR2YCrCb (COLOR_BGR2GRAY differs by 1 in 0.3 % of all colours).
[[nodiscard]] constexpr std::uint8_t luma(int b, int g, int r) noexcept {
  return static_cast<std::uint8_t>((4899 * r + 9617 * g + 1868 * b + (1 << 13)) >> 14);
}

/// Gray picture of a raw one (3.1). A grey source is copied, so that the sensor's memory is read once.
/// out: picture's size. O(pixels). Any thread, no state.
inline void gray(const Picture& in, ImageView<std::uint8_t> out) noexcept {
  for (int y = 0; y < out.height; ++y) {
    if (in.format == PixelFormat::kBgr8) {
      luma_row(in.row(y), out.width, out.row(y));
    } else {
      std::copy_n(in.row(y), out.width, out.row(y));
    }
  }
}

}  // namespace stereotrack
