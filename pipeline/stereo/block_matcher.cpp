#include "pipeline/stereo/block_matcher.hpp"

namespace stereotrack {

Result<BlockMatcher> BlockMatcher::create(const Config& config, const RectifiedGeometry& canvas,
                                          Arena& arena) noexcept {
  BlockMatcher self(config, canvas.offset);
  const DisparityRange dense{0, config.max};
  if (config.method == MatchMethod::kSad) {
    const auto made = SadMatcher::create({.width = canvas.width_left,
                                          .height = canvas.height,
                                          .right_width = canvas.width_right,
                                          .offset = canvas.offset,
                                          .block = config.block,
                                          .range = dense,
                                          .region_disparities = config.region_disparities},
                                         arena);
    if (!made.has_value()) return fail(made.error());
    self.sad_ = *made;
  } else {
    const auto made = CensusMatcher::create({.width = canvas.width_left,
                                             .height = canvas.height,
                                             .right_width = canvas.width_right,
                                             .offset = canvas.offset,
                                             .block = config.block,
                                             .range = dense,
                                             .region_disparities = config.region_disparities,
                                             .filter = {.fill_px = 0}},
                                            arena);
    if (!made.has_value()) return fail(made.error());
    self.census_ = *made;
  }
  return self;
}

Result<DisparityCounts> BlockMatcher::run(CanvasPair& pair, ImageView<std::uint16_t> out) noexcept {
  const ImageView<const std::uint8_t> left = pair.left.whole();
  const ImageView<const std::uint8_t> right = pair.right.whole();
  return sad_ ? sad_->run(left, right, out) : census_->run(left, right, out);
}

Result<DisparityCounts> BlockMatcher::run_region(CanvasPair& pair, const Rect& roi,
                                                 ImageView<const std::uint8_t> wanted, DisparityRange range,
                                                 ImageView<std::uint16_t> out) noexcept {
  const Rect seen = grown(roi, config_.block / 2 + CensusMatcher::kReach);
  const ImageView<const std::uint8_t> left = pair.left.with(seen);
  const ImageView<const std::uint8_t> right = pair.right.with(partners_of(seen, range, offset_));
  return sad_ ? sad_->run_region(left, right, roi, wanted, range, out)
              : census_->run_region(left, right, roi, wanted, range, out);
}

}  // namespace stereotrack
