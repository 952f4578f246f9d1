#pragma once

#include <algorithm>
#include <cstdint>

#include "pipeline/core/image_view.hpp"
#include "pipeline/frame.hpp"
#include "pipeline/photometry/colour_kernel.hpp"

namespace stereotrack {

/// Blue and red difference of one pixel to its luma, full range, 128 = no colour.
///     Cb = (B - Y) * 0.564 + 128                                          (3.18)
///     Cr = (R - Y) * 0.713 + 128                                          (3.19)
/// The document prints (3.18) with R and (3.19) with B, which exchanges the two against ITU-R BT.601;
/// we follow the standard. (3.17) is (3.1). Weights of 14 bits, rounded half up, clamped to 0..255; the
/// same bits as OpenCV's COLOR_BGR2YCrCb.
[[nodiscard]] constexpr std::uint8_t chroma_blue(int b, int y) noexcept {
  return static_cast<std::uint8_t>(std::clamp(((b - y) * 9241 + (128 << 14) + (1 << 13)) >> 14, 0, 255));
}
[[nodiscard]] constexpr std::uint8_t chroma_red(int r, int y) noexcept {
  return static_cast<std::uint8_t>(std::clamp(((r - y) * 11682 + (128 << 14) + (1 << 13)) >> 14, 0, 255));
}

/// Chroma planes of a colour picture, given its luma (3.17-3.19). `in` must be kBgr8; all sizes equal.
/// O(pixels). Any thread, no state.
inline void chroma(const Picture& in, ImageView<const std::uint8_t> luma_plane, ImageView<std::uint8_t> cb,
                   ImageView<std::uint8_t> cr) noexcept {
  for (int y = 0; y < cb.height; ++y) {
    chroma_row(in.row(y), luma_plane.row(y), cb.width, cb.row(y), cr.row(y));
  }
}

}  // namespace stereotrack
