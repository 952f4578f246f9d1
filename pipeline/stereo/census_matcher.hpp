#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/stereo/census_kernel.hpp"
#include "pipeline/stereo/disparity.hpp"
#include "pipeline/stereo/disparity_filter.hpp"

namespace stereotrack {

/// Block matching by census, the robust preset's matcher: it compares the order of greys, not greys, so a
/// different exposure or gain of the two cameras changes nothing.
///
/// 1. Census (Zabih and Woodfill 1994): one bit for each of the 24 neighbours on the white squares of a 7x7
///    chessboard, set where the neighbour is darker than the centre. At borders the border pixel is repeated.
/// 2. Cost of (pixel, d): Hamming distance of the two codes, summed over the block, clipped as in SadMatcher
///    and scaled to the whole block's number of columns. Smallest cost wins, of equal ones the smaller d.
/// 3. Gates, each counted: no candidate (border); mean |L(x+1) - L(x-1)| over the block under `texture`;
///    second best cost (d not beside the best) not over (100 + uniqueness) % of the best; left-right: the right
///    pixel's best left pixel, taken from the same costs along the diagonal x - d = const, is more than
///    `left_right_px` away.
/// 4. Sub-pixel: two lines of equal and opposite slope through the three costs around the best ("equiangular",
///    Shimizu and Okutomi 2001): Hamming costs form a V, on which a parabola is biased towards whole pixels.
/// 5. DisparityFilter: 3x3 median, speckles away, narrow gaps filled from the farther side.
///
/// In: rectified greys, 0..255. Out: disparity in 1/16 px (see disparity.hpp), only wanted pixels written.
/// Faults: kBadConfig, kOutOfMemory at create(); kBadSize (pictures or mask of another size), kBadConfig
/// (range outside the stated maximum) at run, `out` then untouched.
/// Cost: O(1) a pixel and disparity whatever the block: one Hamming distance, two column sums into the window,
/// one comparison for the right view; in vector lanes, see census_kernel.hpp. A region costs (area + its margin of half
/// a block) x range, in memory too; candidates outside of the right picture cost nothing. Blocks over
/// kLargestCensusLaneBlock take the plain way.
/// Memory: (block + 3) bytes x width x largest range, 18 bytes a pixel for the filter. One instance a thread.
class CensusMatcher {
 public:
  static constexpr int kReach = 3;  ///< columns and rows that a code takes in around its pixel [px]

  struct Config {
    int width = 0;        ///< left picture [px], 1..8192
    int height = 0;       ///< both pictures [px], 1..8192
    int right_width = 0;  ///< right picture [px], 0 = as the left one
    int offset = 0;       ///< right column = left column - disparity - offset [px], -8192..8192
    int block = 9;        ///< odd, 3..21 [px]
    DisparityRange range{0, 63};
    int region_disparities = 0;  ///< most disparities that a region may ask for; 0 = as many as `range` has
    int texture = 8;             ///< smallest mean gradient [1/16 grey level], 0..4080, 0 = off
    int uniqueness = 3;          ///< [%], 0..100, 0 = off
    int left_right_px = 1;       ///< 0..255 [px], -1 = off
    DisparityFilter::Config filter;
  };

  [[nodiscard]] static Result<CensusMatcher> create(const Config& config, Arena& arena) noexcept;

  /// The whole picture over the configured range.
  [[nodiscard]] Result<DisparityCounts> run(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                            ImageView<std::uint16_t> out) noexcept;

  /// Only the pixels of `roi` (clipped to the picture) where `mask` (picture size; empty = all) is not 0.
  /// Costs, gates of texture and uniqueness and sub-pixel are those of run() with the same range. The
  /// left-right check knows only the costs of this region's pixels: rivals outside the region do not count,
  /// so a region keeps every pixel that run() keeps before filtering, and some more. Filters see wanted pixels.
  [[nodiscard]] Result<DisparityCounts> run_region(ImageView<const std::uint8_t> left,
                                                   ImageView<const std::uint8_t> right, Rect roi,
                                                   ImageView<const std::uint8_t> mask, DisparityRange range,
                                                   ImageView<std::uint16_t> out) noexcept;

 private:
  CensusMatcher() noexcept = default;

  Config config_;
  CensusScratch scratch_;
  std::span<Span> spans_;  ///< of the rows of the running call
  ImageView<std::uint16_t> raw_;
  DisparityFilter filter_;
};
static_assert(RealTimeStage<CensusMatcher, &CensusMatcher::run, &CensusMatcher::run_region>);

}  // namespace stereotrack
