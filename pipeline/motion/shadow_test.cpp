#include "pipeline/motion/shadow_test.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "pipeline/shape/bits_kernel.hpp"
#include "pipeline/shape/region.hpp"
#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {

namespace {

constexpr int kVerdictRows = 2;  // of zeros above and below the picture

/// The 75th percentile of `distance` over a region; 0 where it has no pixel.
std::uint8_t typical_of(const ShadowTest::Input& in, const Rect& box, std::uint16_t label) noexcept {
  // Neighbours are alike, and a count that has just been stored must be waited for: two tables in turns.
  std::array<std::array<std::int32_t, 256>, 2> histogram{};
  int area = 0;
  for_each_run(in.labels, box, label, [&](int y, int begin, int end) {
    const std::uint8_t* distance = in.distance.row(y);
    for (int x = begin; x < end; ++x) ++histogram[static_cast<std::size_t>(x & 1)][distance[x]];
    area += end - begin;
  });
  std::int32_t above = 0;
  std::size_t level = 255;
  const auto count = [&] { return histogram[0][level] + histogram[1][level]; };
  while (level > 0 && (above + count()) * 4 < std::max(area, 1)) {
    above += count();
    --level;
  }
  return static_cast<std::uint8_t>(level);
}

/// Calls fn(from, to) for each run of pixels of [from, to) that are wanted.
template <class Wanted, class Fn>
void for_each_wanted_run(int from, int to, Wanted&& wanted, Fn&& fn) noexcept {
  for (int x = from; x < to; ++x) {
    if (!wanted(x)) continue;
    const int begin = x;
    while (x < to && wanted(x)) ++x;
    fn(begin, x);
  }
}

}  // namespace

Result<ShadowTest> ShadowTest::create(const Config& config, int width, int height, int max_label,
                                      Arena& arena) noexcept {
  if (config.darkest_percent < 1 || config.darkest_percent > 99 || config.chroma_tolerance < 0 ||
      config.texture_tolerance < 0 || !(config.disparity_px >= 0) || max_label < 1 || max_label > 65535) {
    return fail(Fault::kBadConfig);
  }
  if (width < 1 || height < 1) return fail(Fault::kBadSize);
  ShadowTest self;
  self.config_ = config;
  self.tolerances_ = {config.darkest_percent, config.chroma_tolerance, config.texture_tolerance};
  const ImageView<std::int8_t> framed = arena.image<std::int8_t>(width + 2 * kVerdictFrame, height + 2 * kVerdictRows);
  self.regions_ = arena.array<Region>(static_cast<std::size_t>(max_label) + 1);
  self.looks_ = arena.array<std::uint8_t>(static_cast<std::size_t>(width));
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  self.verdicts_ = framed.window(kVerdictFrame, kVerdictRows, width, height);
  return self;
}

void ShadowTest::look(const Input& in, int y, int from, int to) noexcept {
  look_row({in.y, in.cb, in.cr, in.y_background, in.cb_background, in.cr_background}, tolerances_, y, from, to,
           looks_.data());
}

bool ShadowTest::looks_like_background(const Input& in, int x, int y, bool wide, int typical) const noexcept {
  const bool weak = in.distance.at(x, y) * 100 < typical * config_.weak_percent;
  const int sought = weak ? (wide ? kTextureWide : kTexture) : (wide ? kSameLookWide : kSameLook);
  return (looks_[x] & sought) != 0;
}

int ShadowTest::count_resembling(const Input& in, const Rect& box, std::uint16_t label) noexcept {
  const int typical = config_.weak_percent > 0 ? typical_of(in, box, label) : 0;
  int alike = 0;
  for_each_run(in.labels, box, label, [&](int y, int from, int to) {
    look(in, y, from, to);
    for (int x = from; x < to; ++x) alike += looks_like_background(in, x, y, true, typical) ? 1 : 0;
  });
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

ShadowTest::Evidence ShadowTest::evidence(const Input& in, const Rect& box, std::uint16_t label) const noexcept {
  Evidence sum;
  const bool has_depth = !in.disparity.empty() && !in.disparity_background.empty();
  const int tolerance = static_cast<int>(config_.disparity_px * kDisparityScale);
  for_each_run(in.labels, box, label, [&](int y, int begin, int end) {
    int known = 0;
    int near = 0;
    int behind = 0;
    if (has_depth) {
      // What depth_of() says of each, without a branch a pixel.
      const std::uint16_t* now = in.disparity.row(y);
      const std::uint16_t* before = in.disparity_background.row(y);
      for (int x = begin; x < end; ++x) {
        const int both = static_cast<int>(now[x] != kNoDisparity) & static_cast<int>(before[x] != kNoDisparity);
        known += both;
        near += both & static_cast<int>(now[x] - before[x] > tolerance);
        behind += both & static_cast<int>(before[x] - now[x] > tolerance);
      }
    }
    sum.near += near;
    sum.behind += behind;
    sum.own += known - near - behind;
    sum.unknown += end - begin - known;
  });
  return sum;
}

void ShadowTest::judge_row(const Input& in, int y, const std::uint8_t* mask) noexcept {
  std::int8_t* verdicts = verdicts_.row(y);
  const auto by_depth = [&](int x) {
    switch (depth_of(in, x, y)) {
      case Depth::kNear: return kObject;
      case Depth::kBehind: return regions_[in.labels.at(x, y)].ghost ? kBackground : kLook;
      case Depth::kOwn: return kLookWide;
      case Depth::kUnknown: break;
    }
    return kLook;
  };
  std::fill_n(verdicts, verdicts_.width, static_cast<std::int8_t>(kOutside));
  for_each_set_run(mask, verdicts_.width, [&](int begin, int end) {
    for (int x = begin; x < end; ++x) verdicts[x] = by_depth(x);
    for_each_wanted_run(
        begin, end, [&](int x) { return verdicts[x] >= kLook; },
        [&](int from, int to) {
          look(in, y, from, to);
          for (int x = from; x < to; ++x) {
            const int typical = regions_[in.labels.at(x, y)].typical;
            verdicts[x] = looks_like_background(in, x, y, verdicts[x] == kLookWide, typical) ? kBackground : kObject;
          }
        });
  });
}

std::uint32_t ShadowTest::run(const Input& in, std::span<const Blob> regions, ImageView<std::uint8_t> mask) noexcept {
  for (const Blob& region : regions) {
    const Evidence sum = evidence(in, region.box, region.label);
    regions_[region.label] = {typical_of(in, region.box, region.label), sum.behind > sum.near};
  }
  for (int y = 0; y < mask.height; ++y) judge_row(in, y, mask.row(y));
  int cleared = 0;
  for (int y = 0; y < mask.height; ++y) cleared += clear_outvoted(verdicts_, y, mask.row(y));
  return static_cast<std::uint32_t>(cleared);
}

}  // namespace stereotrack
