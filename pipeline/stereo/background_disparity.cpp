#include "pipeline/stereo/background_disparity.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdlib>

namespace stereotrack {

namespace {

constexpr int kLaterPasses = 10;      // times slower than the first
constexpr int kWidestGap = 64;        // [px]
constexpr int kWidestColumnGap = 16;  // [px]

// Bridges gaps of a row or column: `count` values, `step` apart.
void bridge_gaps(std::uint16_t* first, std::ptrdiff_t step, int count, int widest) noexcept {
  int last = -1;
  for (int i = 0; i < count; ++i) {
    if (first[i * step] == kNoDisparity) continue;
    const int gap = i - last;
    if (last >= 0 && gap > 1 && gap <= widest) {
      const int from = first[last * step];
      const int to = first[i * step];
      if (std::abs(to - from) <= std::max(2 * kDisparityScale, from / 10)) {
        for (int k = last + 1; k < i; ++k) {
          first[k * step] = static_cast<std::uint16_t>(from + (to - from) * (k - last) / gap);
        }
      }
    }
    last = i;
  }
}

}  // namespace

Result<BackgroundDisparity> BackgroundDisparity::create(const Config& config, ImageView<const std::uint8_t> shown,
                                                        Arena& arena) noexcept {
  if (config.frames < 1 || config.frames > 10000) return fail(Fault::kBadConfig);
  if (shown.empty()) return fail(Fault::kBadSize);
  BackgroundDisparity self;
  self.config_ = config;
  self.shown_ = shown;
  self.map_ = arena.image<std::uint16_t>(shown.width, shown.height);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  self.restart();
  return self;
}

void BackgroundDisparity::restart() noexcept {
  for (int y = 0; y < map_.height; ++y) std::fill_n(map_.row(y), map_.width, kNoDisparity);
  next_row_ = 0;
  complete_ = false;
}

void BackgroundDisparity::renew(CanvasPair& background, BlockMatcher& matcher, DisparityRange range) noexcept {
  const int height = map_.height;
  const int pass = config_.frames * (complete_ ? kLaterPasses : 1);
  const int rows = std::min((height + pass - 1) / pass, height);
  const Rect strip{0, next_row_, map_.width, std::min(rows, height - next_row_)};
  for (int y = strip.top; y < strip.bottom(); ++y) std::fill_n(map_.row(y), strip.width, kNoDisparity);
  (void)matcher.run_region(background, strip, shown_, range, map_);
  for (int y = strip.top; y < strip.bottom(); ++y) bridge_gaps(map_.row(y), 1, strip.width, kWidestGap);
  const int from = std::max(strip.top - kWidestColumnGap, 0);
  for (int x = 0; x < strip.width; ++x) {
    bridge_gaps(&map_.at(x, from), map_.stride, strip.bottom() - from, kWidestColumnGap);
  }
  next_row_ = strip.bottom();
  if (next_row_ < height) return;
  next_row_ = 0;
  complete_ = true;
}

}  // namespace stereotrack
