#pragma once

#include <algorithm>
#include <cstdint>

namespace stereotrack {

/// Luma of one pixel, full range.
///     Y = 0.299 R + 0.587 G + 0.114 B                                     (3.1), ITU-R BT.601
/// in integers: weights of 14 bits that add to 2^14, rounded half up. 0..255 in, 0..255 out; the same
/// bits as the Y of OpenCV's COLOR_BGR2YCrCb (COLOR_BGR2GRAY differs by 1 in 0.3 % of all colours).
[[nodiscard]] constexpr std::uint8_t luma(int b, int g, int r) noexcept {
  return static_cast<std::uint8_t>((4899 * r + 9617 * g + 1868 * b + (1 << 13)) >> 14);
}

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

}  // namespace stereotrack
