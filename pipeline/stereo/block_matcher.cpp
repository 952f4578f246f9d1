#include "pipeline/stereo/block_matcher.hpp"

namespace stereotrack {

namespace {

// What both matchers are told alike.
template <class Matcher>
typename Matcher::Config config_of(const BlockMatcher::Config& config, const RectifiedGeometry& canvas) noexcept {
  typename Matcher::Config made;
  made.width = canvas.width_left;
  made.height = canvas.height;
  made.right_width = canvas.width_right;
  made.offset = canvas.offset;
  made.block = config.block;
  made.range = {0, config.max};
  made.region_disparities = config.region_disparities;
  return made;
}

}  // namespace

Result<BlockMatcher> BlockMatcher::create(const Config& config, const RectifiedGeometry& canvas,
                                          Arena& arena) noexcept {
  BlockMatcher self(config, canvas.offset);
  if (config.method == MatchMethod::kSad) {
    const auto made = SadMatcher::create(config_of<SadMatcher>(config, canvas), arena);
    if (!made.has_value()) return fail(made.error());
    self.sad_ = *made;
  } else {
    auto census = config_of<CensusMatcher>(config, canvas);
    census.filter.fill_px = 0;
    const auto made = CensusMatcher::create(census, arena);
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
