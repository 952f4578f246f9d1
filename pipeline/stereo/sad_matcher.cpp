#include "pipeline/stereo/sad_matcher.hpp"

#include <cstdlib>

#include "pipeline/core/simd.hpp"

namespace stereotrack {

Result<SadMatcher> SadMatcher::create(const Config& config, Arena& arena) noexcept {
  constexpr int kLargestSide = 8192;
  SadMatcher m;
  m.config_ = config;
  Config& c = m.config_;
  if (c.right_width == 0) c.right_width = c.width;
  if (c.region_disparities == 0) c.region_disparities = c.range.count();
  const bool sizes_fit = c.width >= 1 && c.width <= kLargestSide && c.height >= 1 && c.height <= kLargestSide &&
                         c.right_width >= 1 && c.right_width <= kLargestSide && std::abs(c.offset) <= kLargestSide;
  const bool block_fits = c.block >= 3 && c.block <= 21 && c.block % 2 == 1;
  const bool ranges_fit = c.range.valid() && c.region_disparities >= 1 && c.region_disparities <= kLargestDisparity + 1;
  if (!sizes_fit || !block_fits || !ranges_fit) return fail(Fault::kBadConfig);

  m.spans_ = arena.array<Span>(static_cast<std::size_t>(c.height));
  m.scratch_ = SadScratch::create(c.width, c.block, std::max(c.range.count(), c.region_disparities), arena);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return m;
}

Result<DisparityCounts> SadMatcher::run(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                        ImageView<std::uint16_t> out) noexcept {
  return run_region(left, right, {0, 0, config_.width, config_.height}, {}, config_.range, out);
}

Result<DisparityCounts> SadMatcher::run_region(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                               Rect roi, ImageView<const std::uint8_t> mask, DisparityRange range,
                                               ImageView<std::uint16_t> out) noexcept {
  const Config& c = config_;
  if (left.width != c.width || left.height != c.height || right.width != c.right_width || right.height != c.height ||
      !out.same_size(left) || (!mask.empty() && !mask.same_size(left))) {
    return fail(Fault::kBadSize);
  }
  if (!range.valid() || range.count() > std::max(c.range.count(), c.region_disparities)) {
    return fail(Fault::kBadConfig);
  }
  roi = intersect(roi, {0, 0, c.width, c.height});
  SadTask task{{c.width, c.right_width, c.block / 2, c.offset, range}, left, right, mask, {}, out};
  task.wanted = find_wanted(mask, roi, spans_);
  if (task.wanted.box.empty()) return DisparityCounts{};
  const bool plain = simd_in_use() == SimdTarget::kScalar || c.block > kLargestSadLaneBlock;
  return plain ? sad_reference(task, scratch_) : sad_lanes(task, scratch_);
}

}  // namespace stereotrack
