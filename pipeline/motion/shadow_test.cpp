#include "pipeline/motion/shadow_test.hpp"

#include <algorithm>
#include <cstdlib>

#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {

namespace {

constexpr int kReach = 2;
constexpr int kBrightestPercent = 97;  // above, the light is the same

template <class Fn>
void for_each_neighbour(int x, int y, int width, int height, Fn&& fn) noexcept {
  for (int v = std::max(y - kReach, 0); v <= std::min(y + kReach, height - 1); ++v) {
    for (int u = std::max(x - kReach, 0); u <= std::min(x + kReach, width - 1); ++u) fn(u, v);
  }
}

}  // namespace

Result<ShadowTest> ShadowTest::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (config.darkest_percent < 1 || config.darkest_percent > 99 || config.chroma_tolerance < 0 ||
      config.texture_tolerance < 0 || !(config.disparity_px >= 0)) {
    return fail(Fault::kBadConfig);
  }
  if (width < 1 || height < 1) return fail(Fault::kBadSize);
  ShadowTest self;
  self.config_ = config;
  self.verdicts_ = arena.image<std::uint8_t>(width, height);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

bool ShadowTest::looks_like_background(const Input& in, int x, int y, int slack) const noexcept {
  int now = 0;
  int before = 0;
  int count = 0;
  for_each_neighbour(x, y, verdicts_.width, verdicts_.height, [&](int u, int v) {
    now += in.y.at(u, v);
    before += in.y_background.at(u, v);
    ++count;
  });
  if (before == 0) return false;
  const int ratio = static_cast<int>(static_cast<std::int64_t>(now) * 256 / before);
  const std::uint16_t label = in.labels.at(x, y);
  const bool weak = in.distance.at(x, y) * 100 < in.typical[label] * config_.weak_percent;
  const bool darker = ratio * 100 * slack >= config_.darkest_percent * 256 && ratio * 100 < kBrightestPercent * 256;
  const bool lit = slack > 1 && ratio < 2 * 256;  // stereo has spoken: it may be brighter, too
  if (!weak && !darker && !lit) return false;
  const auto chroma_kept = [&](int value, int background) {
    return std::abs((value - 128) * 256 - (background - 128) * ratio) <= config_.chroma_tolerance * 256 * slack;
  };
  const bool colour_kept = in.cb.empty() || (chroma_kept(in.cb.at(x, y), in.cb_background.at(x, y)) &&
                                             chroma_kept(in.cr.at(x, y), in.cr_background.at(x, y)));
  int residual = 0;
  for_each_neighbour(x, y, verdicts_.width, verdicts_.height, [&](int u, int v) {
    residual += std::abs(in.y.at(u, v) * 256 - in.y_background.at(u, v) * ratio);
  });
  if (residual > (config_.texture_tolerance * 256 * slack) * count) return false;
  return weak || colour_kept;
}

ShadowTest::Depth ShadowTest::depth_of(const Input& in, int x, int y) const noexcept {
  if (in.disparity.empty() || in.disparity_background.empty()) return Depth::kUnknown;
  const int now = in.disparity.at(x, y);
  const int before = in.disparity_background.at(x, y);
  if (now == kNoDisparity || before == kNoDisparity) return Depth::kUnknown;
  const int tolerance = static_cast<int>(config_.disparity_px * kDisparityScale);
  if (now - before > tolerance) return Depth::kNear;
  return before - now > tolerance ? Depth::kBehind : Depth::kOwn;
}

void ShadowTest::weigh(const Input& in, int x, int y, Evidence& sum) const noexcept {
  switch (depth_of(in, x, y)) {
    case Depth::kUnknown: ++sum.unknown; break;
    case Depth::kNear: ++sum.near; break;
    case Depth::kOwn: ++sum.own; break;
    case Depth::kBehind: ++sum.behind; break;
  }
}

ShadowTest::Verdict ShadowTest::judge(const Input& in, int x, int y) const noexcept {
  switch (depth_of(in, x, y)) {
    case Depth::kNear: return kObject;
    case Depth::kBehind:
      if (in.ghost[in.labels.at(x, y)] != 0) return kBackground;
      break;
    case Depth::kOwn: return looks_like_background(in, x, y, kOwnSlack) ? kBackground : kObject;
    case Depth::kUnknown: break;
  }
  return looks_like_background(in, x, y, 1) ? kBackground : kObject;
}

std::uint32_t ShadowTest::run(const Input& in, ImageView<std::uint8_t> mask) noexcept {
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      verdicts_.at(x, y) = mask.at(x, y) == 0 ? kOutside : judge(in, x, y);
    }
  }
  std::uint32_t cleared = 0;
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      if (mask.at(x, y) == 0) continue;
      int shadow = 0;
      int object = 0;
      for_each_neighbour(x, y, mask.width, mask.height, [&](int u, int v) {
        shadow += verdicts_.at(u, v) == kBackground ? 1 : 0;
        object += verdicts_.at(u, v) == kObject ? 1 : 0;
      });
      if (shadow > object) {
        mask.at(x, y) = 0;
        ++cleared;
      }
    }
  }
  return cleared;
}

}  // namespace stereotrack
