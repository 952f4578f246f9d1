#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/stereo/disparity.hpp"
#include "pipeline/stereo/lane_layout.hpp"

namespace stereotrack {

/// One call of SadMatcher, checked.
struct SadTask {
  BlockGeometry geometry;
  ImageView<const std::uint8_t> left;
  ImageView<const std::uint8_t> right;
  ImageView<const std::uint8_t> mask;  ///< picture size; empty = all
  WantedRows wanted;                   ///< not empty
  ImageView<std::uint16_t> out;
};

/// A candidate's mean without its number of rows, which all candidates of a pixel share.
struct SadCandidate {
  int disparity = -1;  ///< [px], -1 = none yet, from which every other is better
  std::uint32_t sum = 1;
  std::uint32_t columns = 0;

  /// Exact fractions: 21 x 21 x 255 x 21 < 2^32.
  [[nodiscard]] bool better_than(const SadCandidate& other) const noexcept {
    return sum * other.columns < other.sum * columns;
  }
};

/// Memory of both ways. A call touches what its region, its margin of half a block and its range need, no more.
struct SadScratch {
  [[nodiscard]] static SadScratch create(int width, int disparities, Arena& arena) noexcept;

  std::span<std::uint16_t> column_sums;     ///< [column of the region][lane], over the rows of the window
  std::span<std::uint16_t> window_sums;     ///< [lane]
  std::span<std::uint16_t> batch_sums;      ///< [pixel of kPixelStep][lane], beside the borders
  std::span<std::uint32_t> reference_sums;  ///< [disparity], window sums of the plain way
  std::span<WindowLimits> limits;           ///< [column of the region]
  std::span<std::uint16_t> left_enters;     ///< [column of the region] greys of the row that enters the window
  std::span<std::uint16_t> left_leaves;     ///< and of the one that leaves it
  std::span<std::uint16_t> right_enters;    ///< [column of the region + lane] likewise, 0 where there is no partner
  std::span<std::uint16_t> right_leaves;    ///< likewise
  std::span<std::uint16_t> partner_exists;  ///< [column of the region + lane] 0 or 0xFFFF
};

/// A window of 15x15 pixels sums up to 57,375: what lanes of 16 bits hold.
inline constexpr int kLargestSadLaneBlock = 15;

/// The plain reference, any block: the equations of SadMatcher, column sums and window sums kept up to date.
[[nodiscard]] DisparityCounts sad_reference(const SadTask& task, SadScratch& scratch) noexcept;

/// The same bit for bit with disparities in vector lanes, block <= kLargestSadLaneBlock; the instruction set is
/// Highway's choice (see use_simd). About one instruction a pixel and disparity: a column's sums are brought to the
/// new row in the pass that adds them to the window and takes the minimum, and eight pixels share the search for
/// the smallest lane. Windows that the right picture's ends clip are compared as exact fractions.
[[nodiscard]] DisparityCounts sad_lanes(const SadTask& task, SadScratch& scratch) noexcept;

}  // namespace stereotrack
