#pragma once

#include <cstdint>

#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"

namespace stereotrack {

/// Keeps strong edges.
///     P = 0 if P < threshold, 255 if P >= threshold                          (3.12)
/// The document prints "<" in both cases; its text ("edges which [have] an intensity value greater than
/// the threshold") makes the second the complement of the first: >=.
///
/// In, out: the same size, u8; they may be the same memory. threshold: 0 makes everything 255, 256
/// nothing. Fault: kBadSize, output untouched. O(pixels), no state.
[[nodiscard]] Result<void> threshold(ImageView<const std::uint8_t> in, int threshold,
                                     ImageView<std::uint8_t> out) noexcept;

}  // namespace stereotrack
