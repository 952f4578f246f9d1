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

/// A window of 15x15 pixels sums up to 57,375: what lanes of 16 bits hold.
inline constexpr int kLargestSadLaneBlock = 15;

/// Pixels between two chunks of lanes.
inline constexpr int kSadPixelStep = 128;

/// How windows clipped at the left end of the right picture compare with the whole ones of the same left column, for
/// blocks up to kLargestBlock: sum x weight + rank is the smaller, the smaller the mean; of equal means, the smaller
/// the disparity. Exact: weights are kMultiple / columns x kRanks, and 11 x 255 x kMultiple x kRanks < 2^32.
struct RankedKeys {
  static constexpr int kRanks = 8;
  static constexpr int kLargestBlock = 11;
  static constexpr int kMultiple = 27720;  ///< of 1..11
  /// Of whole windows where there is none: their sum is that of no other window.
  static constexpr std::uint32_t kNoWeight = 0xFFFF;

  [[nodiscard]] static constexpr std::uint32_t weight(int columns) noexcept {
    return static_cast<std::uint32_t>(kMultiple / columns * kRanks);
  }

  alignas(16) std::uint32_t weights[kRanks] = {};  ///< of falling disparities; 0 where there is none
  alignas(16) std::uint32_t ranks[kRanks] = {};    ///< from 1 up, whole ones have 0; 0xFFFFFFFF where there is none
  std::int32_t lane = 0;                           ///< of the first
};

/// Memory of both ways. A call touches what its region, its margin of half a block and its range need, no more.
struct SadScratch {
  [[nodiscard]] static SadScratch create(int width, int block, int disparities, Arena& arena) noexcept;

  std::span<std::uint8_t> distances;        ///< [row of the window][column of the region][lane]
  std::span<std::uint16_t> column_sums;     ///< [column of the region][lane], over the rows of the window; zeros before
  std::span<std::uint16_t> window_sums;     ///< [lane]
  std::span<std::uint16_t> batch_sums;      ///< [pixel of kSadPixelStep][lane], beside the borders
  std::span<std::uint32_t> reference_sums;  ///< [disparity], window sums of the plain way
  std::span<WindowLimits> limits;           ///< [column of the region]
  std::span<RankedKeys> ranked;             ///< [column of the region]
  std::span<std::uint32_t> whole_weights;   ///< [column of the region] of RankedKeys
  std::span<std::uint32_t> rank_zero;       ///< [column of the region] the id that rank 0 would have
  std::span<std::uint32_t> left_greys;      ///< [column of the region] four times, of the row that enters the window
  std::span<std::uint8_t> left_bytes;       ///< the same once; a kernel uses one of the two
  std::span<std::uint8_t> right_greys;     ///< [column of the region + lane] likewise once, 0 where there is no partner
  std::span<std::uint8_t> partner_exists;  ///< [column of the region + lane] 0 or 0xFF
  std::span<std::uint8_t> partner_clips;   ///< likewise: whether the right picture's left end clips its window
};

/// The plain reference, any block: the equations of SadMatcher, column sums and window sums kept up to date.
[[nodiscard]] DisparityCounts sad_reference(const SadTask& task, SadScratch& scratch) noexcept;

/// The same bit for bit with disparities in vector lanes, block <= kLargestSadLaneBlock; the instruction set is
/// Highway's choice (see use_simd). With AVX2 0.9 instructions a pixel and disparity far from the borders:
///   - absolute differences are made of bytes, and kept until their row leaves the window,
///   - a column's sums are brought to the new row in the pass that adds them to the window and takes the minimum,
///   - the larger half of a chunk of disparities is compared with the smaller one in a single minimum: an even sum is
///     of the one, an odd one of the other (x86 and 64-bit ARM, blocks up to 11; 16 bits hold no more),
///   - four pixels share the search for the smallest lane.
/// NEON 1.3. Where the right picture's left end clips windows about twice as many: those are compared as exact
/// fractions, four pixels at a time (RankedKeys). Other clipped windows pixel by pixel.
[[nodiscard]] DisparityCounts sad_lanes(const SadTask& task, SadScratch& scratch) noexcept;

}  // namespace stereotrack
