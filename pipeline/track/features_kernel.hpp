#pragma once

#include <array>
#include <cstdint>

#include "pipeline/core/image_view.hpp"

namespace stereotrack {

// What Features does at each pixel of a window. Each function has its definition beside it, NAME_reference(), which
// every instruction set of pipeline/core/simd.hpp equals bit for bit. Any thread, no state.

inline constexpr int kPatchSide = 9;  ///< [px]
inline constexpr int kPatchReach = kPatchSide / 2;
inline constexpr int kPatchArea = kPatchSide * kPatchSide;
using Patch = std::array<std::uint8_t, kPatchArea>;

/// How badly a patch fits at each of the places (x, y) ... (x + count - 1, y), its middle there:
///     cost = sum |kPatchArea (p - q) - sum (p - q)| / kPatchArea    over pairs of the patch's and the picture's
///     pixels,
/// kPatchArea times the sum of absolute differences, each patch less its mean. All of the patches must lie in the
/// picture; count: 1..kMostPlaces. About 5 ns a place.
inline constexpr int kMostPlaces = 129;
void patch_costs(const Patch& patch, ImageView<const std::uint8_t> luma, int x, int y, int count,
                 std::int32_t* costs) noexcept;
void patch_costs_reference(const Patch& patch, ImageView<const std::uint8_t> luma, int x, int y, int count,
                           std::int32_t* costs) noexcept;

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
