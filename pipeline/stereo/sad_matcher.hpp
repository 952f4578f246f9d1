#pragma once

#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/stereo/disparity.hpp"
#include "pipeline/stereo/sad_kernel.hpp"

namespace stereotrack {

/// Block matching by mean absolute difference, thesis 3.6:
///     MAD(d) = 1/(m n) sum_{p,q} |A[p, q] - B_d[p, q]|        d* = argmin MAD(d)
/// A: m x n block around the left pixel, B_d: the block d + offset columns further left in the right picture.
/// The document tiles the picture into blocks and gives each block one disparity; here the block slides, so
/// that every pixel has its own. Where m n is the same for all candidates their sums are compared.
/// At borders the block is clipped to the pixels that exist in both pictures (m n is their number), and
/// candidates whose centre has no partner do not exist. Of equal means the smallest disparity wins.
/// Whole pixels, no gates: a pixel is empty only where no candidate exists.
///
/// In: rectified greys, 0..255. Out: disparity in 1/16 px (see disparity.hpp), only wanted pixels written.
/// Faults: kBadConfig, kOutOfMemory at create(); kBadSize (pictures or mask of another size), kBadConfig
/// (range outside the stated maximum) at run, `out` then untouched.
/// Cost: O(1) a pixel and disparity whatever the block: an absolute difference, and the one that leaves, into the
/// column sums, two column sums into the window; in vector lanes, see sad_kernel.hpp. Blocks over kLargestSadLaneBlock
/// take the plain way, some fifty times slower. A region costs (area + its margin of half a block) x range, in memory
/// too. Memory: (2 + block) bytes x width x largest range. One instance a thread.
class SadMatcher {
 public:
  struct Config {
    int width = 0;        ///< left picture [px], 1..8192
    int height = 0;       ///< both pictures [px], 1..8192
    int right_width = 0;  ///< right picture [px], 0 = as the left one
    int offset = 0;       ///< right column = left column - disparity - offset [px], -8192..8192
    int block = 9;        ///< odd, 3..21 [px]
    DisparityRange range{0, 63};
    int region_disparities = 0;  ///< most disparities that a region may ask for; 0 = as many as `range` has
  };

  [[nodiscard]] static Result<SadMatcher> create(const Config& config, Arena& arena) noexcept;

  /// The whole picture over the configured range.
  [[nodiscard]] Result<DisparityCounts> run(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                            ImageView<std::uint16_t> out) noexcept;

  /// Only the pixels of `roi` (clipped to the picture) where `mask` (picture size; empty = all) is not 0.
  /// Each gets exactly what run() with the same range gives it.
  [[nodiscard]] Result<DisparityCounts> run_region(ImageView<const std::uint8_t> left,
                                                   ImageView<const std::uint8_t> right, Rect roi,
                                                   ImageView<const std::uint8_t> mask, DisparityRange range,
                                                   ImageView<std::uint16_t> out) noexcept;

 private:
  SadMatcher() noexcept = default;

  Config config_;
  SadScratch scratch_;
  std::span<Span> spans_;  ///< of the rows of the running call
};
static_assert(RealTimeStage<SadMatcher, &SadMatcher::run, &SadMatcher::run_region>);

}  // namespace stereotrack
