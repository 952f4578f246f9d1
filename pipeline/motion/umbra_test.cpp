#include "pipeline/motion/umbra_test.hpp"

#include <algorithm>

#include "pipeline/shape/bits_kernel.hpp"

namespace stereotrack {

namespace {

constexpr int kHighest = 255;  // that heights_ can say

}  // namespace

Result<UmbraTest> UmbraTest::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (config.darkest_percent < 1 || config.darkest_percent > 99) return fail(Fault::kBadConfig);
  if (width < 1 || height < 1) return fail(Fault::kBadSize);
  UmbraTest self;
  self.config_ = config;
  self.heights_ = arena.image<std::uint8_t>(width, height);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

void UmbraTest::mark_column(ImageView<const std::uint8_t> y, ImageView<const std::uint8_t> y_background,
                            ImageView<const std::uint8_t> mask, int x, int foot) noexcept {
  bool deep = false;
  int top = foot;
  for (;; --top) {
    deep = deep || y.at(x, top) * 100 < y_background.at(x, top) * config_.darkest_percent;
    if (top == 0 || mask.at(x, top - 1) == 0 || y.at(x, top - 1) > y.at(x, top)) break;
  }
  if (!deep) return;
  for (int v = foot; v >= top; --v) heights_.at(x, v) = static_cast<std::uint8_t>(std::min(foot - v + 1, kHighest));
}

std::uint32_t UmbraTest::run(ImageView<const std::uint8_t> y, ImageView<const std::uint8_t> y_background,
                             ImageView<std::uint8_t> mask) noexcept {
  for (int v = 0; v + 1 < mask.height; ++v) {
    const std::uint8_t* below = mask.row(v + 1);
    for_each_set_run(mask.row(v), mask.width, [&](int begin, int end) {
      for (int x = begin; x < end; ++x) {
        if (below[x] == 0) mark_column(y, y_background, mask, x, v);
      }
    });
  }
  std::uint32_t cleared = 0;
  for (int v = mask.height - 2; v >= 0; --v) {
    std::uint8_t* row = mask.row(v);
    const std::uint8_t* below = mask.row(v + 1);
    std::uint8_t* heights = heights_.row(v);
    for_each_set_run(heights, mask.width, [&](int begin, int end) {
      for (int x = begin; x < end; ++x) {
        if (below[x] != 0) continue;
        const int left = x;
        std::int64_t sum = 0;
        for (; x < end && below[x] == 0; ++x) sum += heights[x];
        const std::int64_t width = x - left;
        if (kFlat * sum > width * width) continue;
        std::fill(row + left, row + x, std::uint8_t{0});
        cleared += static_cast<std::uint32_t>(width);
      }
      std::fill(heights + begin, heights + end, std::uint8_t{0});
    });
  }
  return cleared;
}

}  // namespace stereotrack
