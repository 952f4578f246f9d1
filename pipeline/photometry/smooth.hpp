#pragma once

#include <cstdint>

#include "pipeline/core/image_view.hpp"

namespace stereotrack {

/// 3x3 binomial smoothing, weights 1 2 1 each way, rounded half up, border replicated. White noise of
/// standard deviation s leaves with 0.375 s. in and out: one size, different memory. The reference is the
/// definition, which every instruction set of pipeline/core/simd.hpp equals bit for bit. O(pixels), about
/// 0.1 ns a pixel. Any thread, no state.
void smooth3x3(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) noexcept;
void smooth3x3_reference(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) noexcept;

}  // namespace stereotrack
