#include "pipeline/motion/shadow_test.hpp"

#include <algorithm>
#include <cstdlib>

#include "pipeline/shape/bits_kernel.hpp"
#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {

namespace {

constexpr int kVerdictRows = 2;  // of zeros above and below the picture

/// Calls fn(from, to) for each run of pixels of [from, to) that are wanted.
template <class Wanted, class Fn>
void for_each_run(int from, int to, Wanted&& wanted, Fn&& fn) noexcept {
  for (int x = from; x < to; ++x) {
    if (!wanted(x)) continue;
    const int begin = x;
    while (x < to && wanted(x)) ++x;
    fn(begin, x);
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
  self.tolerances_ = {config.darkest_percent, config.chroma_tolerance, config.texture_tolerance};
  const ImageView<std::int8_t> framed = arena.image<std::int8_t>(width + 2 * kVerdictFrame, height + 2 * kVerdictRows);
  self.looks_ = arena.array<std::uint8_t>(static_cast<std::size_t>(width));
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  self.verdicts_ = framed.window(kVerdictFrame, kVerdictRows, width, height);
  return self;
}

void ShadowTest::look(const Input& in, int y, int from, int to) noexcept {
  look_row({in.y, in.cb, in.cr, in.y_background, in.cb_background, in.cr_background}, tolerances_, y, from, to,
           looks_.data());
}

bool ShadowTest::looks_like_background(const Input& in, int x, int y, bool wide) const noexcept {
  const bool weak = in.distance.at(x, y) * 100 < in.typical[in.labels.at(x, y)] * config_.weak_percent;
  const int sought = weak ? (wide ? kTextureWide : kTexture) : (wide ? kSameLookWide : kSameLook);
  return (looks_[x] & sought) != 0;
}

int ShadowTest::count_resembling(const Input& in, const Rect& box, std::uint16_t label) noexcept {
  const Rect part = intersect(box, {0, 0, verdicts_.width, verdicts_.height});
  int alike = 0;
  for (int y = part.top; y < part.bottom(); ++y) {
    const std::uint16_t* labels = in.labels.row(y);
    for_each_run(
        part.left, part.right(), [&](int x) { return labels[x] == label; },
        [&](int from, int to) {
          look(in, y, from, to);
          for (int x = from; x < to; ++x) alike += looks_like_background(in, x, y, true) ? 1 : 0;
        });
  }
  return alike;
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

void ShadowTest::judge_row(const Input& in, int y, const std::uint8_t* mask) noexcept {
  std::int8_t* verdicts = verdicts_.row(y);
  const auto by_depth = [&](int x) {
    switch (depth_of(in, x, y)) {
      case Depth::kNear: return kObject;
      case Depth::kBehind: return in.ghost[in.labels.at(x, y)] != 0 ? kBackground : kLook;
      case Depth::kOwn: return kLookWide;
      case Depth::kUnknown: break;
    }
    return kLook;
  };
  std::fill_n(verdicts, verdicts_.width, static_cast<std::int8_t>(kOutside));
  for_each_set_run(mask, verdicts_.width, [&](int begin, int end) {
    for (int x = begin; x < end; ++x) verdicts[x] = by_depth(x);
    for_each_run(
        begin, end, [&](int x) { return verdicts[x] >= kLook; },
        [&](int from, int to) {
          look(in, y, from, to);
          for (int x = from; x < to; ++x) {
            verdicts[x] = looks_like_background(in, x, y, verdicts[x] == kLookWide) ? kBackground : kObject;
          }
        });
  });
}

std::uint32_t ShadowTest::run(const Input& in, ImageView<std::uint8_t> mask) noexcept {
  for (int y = 0; y < mask.height; ++y) judge_row(in, y, mask.row(y));
  int cleared = 0;
  for (int y = 0; y < mask.height; ++y) cleared += clear_outvoted(verdicts_, y, mask.row(y));
  return static_cast<std::uint32_t>(cleared);
}

}  // namespace stereotrack
