#pragma once

#include <array>
#include <cstdint>

#include "pipeline/core/image_view.hpp"
#include "pipeline/core/rect.hpp"

namespace stereotrack {

// What Features does at each pixel of a window. Each function has its definition beside it, NAME_reference(), which
// every instruction set of pipeline/core/simd.hpp equals bit for bit. Any thread, no state.

inline constexpr int kPatchSide = 9;  ///< [px]
inline constexpr int kPatchReach = kPatchSide / 2;
inline constexpr int kPatchArea = kPatchSide * kPatchSide;
using Patch = std::array<std::uint8_t, kPatchArea>;

/// Where a patch fits best of all the places of `window`, its middle there; of equal ones the first, row by row:
///     cost = sum |kPatchArea (p - q) - sum (p - q)| / kPatchArea    over pairs of the patch's and the picture's
///     pixels,
/// kPatchArea times the sum of absolute differences, each patch less its mean. All of the patches must lie in the
/// picture; the window's width and height: 1..kMostPlaces. About 2 ns a place, less
/// where the patch fits in the window's middle and the picture has contrast.
inline constexpr int kMostPlaces = 129;
struct PatchPlace {
  std::int32_t cost = 0;
  int x = 0;
  int y = 0;
};
[[nodiscard]] PatchPlace best_place(const Patch& patch, ImageView<const std::uint8_t> luma,
                                    const Rect& window) noexcept;
[[nodiscard]] PatchPlace best_place_reference(const Patch& patch, ImageView<const std::uint8_t> luma,
                                              const Rect& window) noexcept;

/// Structure tensor [a b; b c] = sum [gx^2 gx gy; gx gy gy^2] of a pixel over the 5x5 around it; the gradients gx, gy
/// are differences of the neighbours to both sides.
inline constexpr int kTensorReach = 2;
struct Tensor {
  std::int32_t a = 0;
  std::int32_t b = 0;
  std::int32_t c = 0;
};

/// Of pixels (x, y) ... (x + count - 1, y), all at least kTensorReach + 1 from the picture's sides; count:
/// 1..kMostTensors. About 3 ns a pixel.
inline constexpr int kMostTensors = 64;
void tensors(ImageView<const std::uint8_t> luma, int x, int y, int count, Tensor* out) noexcept;
void tensors_reference(ImageView<const std::uint8_t> luma, int x, int y, int count, Tensor* out) noexcept;

}  // namespace stereotrack
