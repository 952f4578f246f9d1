#pragma once

#include <cstdint>
#include <optional>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/geometry/lazy_canvas.hpp"
#include "pipeline/geometry/rectified_geometry.hpp"
#include "pipeline/stereo/census_matcher.hpp"
#include "pipeline/stereo/sad_matcher.hpp"

namespace stereotrack {

enum class MatchMethod : std::uint8_t {
  kSad,     ///< the document's block matching
  kCensus,  ///< census, left-right check, sub-pixel
};

/// Both rectified views of one pair of pictures, drawn where somebody looks.
struct CanvasPair {
  LazyCanvas left;
  LazyCanvas right;
};

/// What of the right canvas the candidates of a part of the left one reach; may lie outside of it.
[[nodiscard]] inline Rect partners_of(const Rect& part, DisparityRange range, int offset) noexcept {
  return {part.left - offset - range.max, part.top, part.width + range.max - range.min, part.height};
}

/// Disparity pixel by pixel on a pair of canvases (3.6), by the method that the configuration names: SadMatcher or
/// CensusMatcher, whose headers say what they find and cost. Draws of the canvases what the search needs.
/// Out: left canvas, 1/16 px (disparity.hpp); only wanted pixels are written. One instance a thread.
class BlockMatcher {
 public:
  struct Config {
    MatchMethod method = MatchMethod::kCensus;
    int block = 9;               ///< odd, 3..21 [px]
    int max = 128;               ///< largest disparity of run(), 1..4000 [px]
    int region_disparities = 0;  ///< most disparities that run_region() may ask for; 0 = max + 1
  };

  /// Faults: those of the matchers.
  [[nodiscard]] static Result<BlockMatcher> create(const Config& config, const RectifiedGeometry& canvas,
                                                   Arena& arena) noexcept;

  /// The whole left canvas, disparities 0 to max. Faults: those of the matchers, out untouched.
  [[nodiscard]] Result<DisparityCounts> run(CanvasPair& pair, ImageView<std::uint16_t> out) noexcept;

  /// Only the pixels of `roi` where `wanted` (left canvas) is not 0.
  [[nodiscard]] Result<DisparityCounts> run_region(CanvasPair& pair, const Rect& roi,
                                                   ImageView<const std::uint8_t> wanted, DisparityRange range,
                                                   ImageView<std::uint16_t> out) noexcept;

 private:
  explicit BlockMatcher(const Config& config, int offset) noexcept : config_(config), offset_(offset) {}

  Config config_;
  int offset_ = 0;
  std::optional<SadMatcher> sad_;  // one of the two
  std::optional<CensusMatcher> census_;
};
static_assert(RealTimeStage<BlockMatcher, &BlockMatcher::run, &BlockMatcher::run_region>);

}  // namespace stereotrack
