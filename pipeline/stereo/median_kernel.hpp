#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/image_view.hpp"

namespace stereotrack {

/// 3x3 median of disparities as DisparityFilter says: of those neighbours in the picture that have one, the upper of
/// an even number; pixels without a disparity stay without. `out` must be another picture of the same size.
/// The plain reference.
void median_reference(ImageView<const std::uint16_t> in, ImageView<std::uint16_t> out) noexcept;

/// The same bit for bit, pixels in vector lanes; the instruction set is Highway's choice (see use_simd). All nine are
/// sorted, "none" being the largest value, and each lane takes the one in the middle of what it has: two instructions a
/// pixel with AVX-512. `none_row`: at least in.width times kNoDisparity.
void median_lanes(ImageView<const std::uint16_t> in, std::span<const std::uint16_t> none_row,
                  ImageView<std::uint16_t> out) noexcept;

}  // namespace stereotrack
