#include "pipeline/track/depth_segments.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "pipeline/shape/region.hpp"
#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {

namespace {

constexpr std::uint16_t kFar = 0xFFFF;
constexpr std::uint16_t kLoose = 0xFFFF;   // belongs to no large component
constexpr std::uint16_t kUnseen = 0xFFFE;  // not reached by the flood yet
constexpr int kSweeps = 2;
constexpr int kLumaStep = 4;
constexpr double kSmallPart = 0.05;
constexpr double kSmallKnown = 0.6;

}  // namespace

Result<DepthSegments> DepthSegments::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (!(config.jump > 0) || !(config.jump_px > 0) || config.min_px < 1 || !(config.min_part >= 0) ||
      !(config.min_known >= 0) || !(config.min_part <= 0.5)) {
    return fail(Fault::kBadConfig);
  }
  if (width < 1 || height < 1 || width > 8192 || height > 8192) return fail(Fault::kBadSize);
  DepthSegments self;
  self.config_ = config;
  self.filled_ = arena.image<std::uint16_t>(width, height);
  self.segment_ = arena.image<std::uint16_t>(width, height);
  self.cost_ = arena.image<std::uint16_t>(width, height);
  self.queue_ = arena.array<Place>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

// Values travel from where cost_ is 0 to where it is kFar, along the cheapest paths.
void DepthSegments::spread(const Input& in, const Blob& blob, ImageView<std::uint16_t> value) noexcept {
  const Rect& box = blob.box;
  const auto relax = [&](int x, int y, int u, int v) {
    if (u < box.left || u >= box.right() || v < box.top || v >= box.bottom()) return;
    if (in.labels.at(u, v) != blob.label || cost_.at(u, v) == kFar) return;
    const int step = 1 + std::abs(in.y.at(x, y) - in.y.at(u, v)) / kLumaStep;
    const int cost = cost_.at(u, v) + step;
    if (cost >= cost_.at(x, y)) return;
    cost_.at(x, y) = static_cast<std::uint16_t>(cost);
    value.at(x, y) = value.at(u, v);
  };
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for_each_pixel(in.labels, box, blob.label, [&](int x, int y) {
      relax(x, y, x - 1, y);
      relax(x, y, x - 1, y - 1);
      relax(x, y, x, y - 1);
      relax(x, y, x + 1, y - 1);
    });
    for (int y = box.bottom() - 1; y >= box.top; --y) {
      for (int x = box.right() - 1; x >= box.left; --x) {
        if (in.labels.at(x, y) != blob.label) continue;
        relax(x, y, x + 1, y);
        relax(x, y, x + 1, y + 1);
        relax(x, y, x, y + 1);
        relax(x, y, x - 1, y + 1);
      }
    }
  }
}

// Components of continuous disparity; those under `least` pixels become kLoose.
int DepthSegments::flood(const Input& in, const Blob& blob, int least) noexcept {
  int found = 0;
  for_each_pixel(in.labels, blob.box, blob.label, [&](int x, int y) { segment_.at(x, y) = kUnseen; });
  for_each_pixel(in.labels, blob.box, blob.label, [&](int x0, int y0) {
    if (segment_.at(x0, y0) != kUnseen) return;
    std::size_t last = 0;
    std::size_t known = 0;
    queue_[last++] = {static_cast<std::uint16_t>(x0), static_cast<std::uint16_t>(y0)};
    segment_.at(x0, y0) = static_cast<std::uint16_t>(found);
    for (std::size_t first = 0; first < last; ++first) {
      const Place p = queue_[first];
      const int here = filled_.at(p.x, p.y);
      known += in.disparity.at(p.x, p.y) != kNoDisparity ? 1U : 0U;
      constexpr std::array<std::array<int, 2>, 4> kSteps{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
      for (const auto& [dx, dy] : kSteps) {
        const int x = p.x + dx;
        const int y = p.y + dy;
        if (!in.labels.contains(x, y) || in.labels.at(x, y) != blob.label || segment_.at(x, y) != kUnseen) continue;
        const int there = filled_.at(x, y);
        if (std::abs(there - here) >
            std::max(config_.jump_px * kDisparityScale, config_.jump * std::max(here, there))) {
          continue;
        }
        segment_.at(x, y) = static_cast<std::uint16_t>(found);
        queue_[last++] = {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
      }
    }
    // A small one must be sure of itself.
    const double needed = static_cast<double>(last) < kSmallPart * blob.area ? kSmallKnown : config_.min_known;
    const bool sure = static_cast<double>(known) >= needed * static_cast<double>(last);
    if (last >= static_cast<std::size_t>(least) && sure && found < kMost) {
      ++found;
    } else {
      for (std::size_t i = 0; i < last; ++i) segment_.at(queue_[i].x, queue_[i].y) = kLoose;
    }
  });
  return found;
}

int DepthSegments::run(const Input& in, const Blob& blob) noexcept {
  bool any = false;
  for_each_pixel(in.labels, blob.box, blob.label, [&](int x, int y) {
    const std::uint16_t d = in.disparity.at(x, y);
    filled_.at(x, y) = d;
    segment_.at(x, y) = 0;
    cost_.at(x, y) = d == kNoDisparity ? kFar : std::uint16_t{0};
    any = any || d != kNoDisparity;
  });
  if (!any) return 1;
  spread(in, blob, filled_);
  const int least = std::max(config_.min_px, static_cast<int>(config_.min_part * blob.area + 1));
  const int found = flood(in, blob, least);
  if (found <= 1) {
    for_each_pixel(in.labels, blob.box, blob.label, [&](int x, int y) { segment_.at(x, y) = 0; });
    return 1;
  }
  for_each_pixel(in.labels, blob.box, blob.label,
                 [&](int x, int y) { cost_.at(x, y) = segment_.at(x, y) == kLoose ? kFar : std::uint16_t{0}; });
  spread(in, blob, segment_);
  // Two sweeps may leave a pixel in a far corner of a winding blob.
  for_each_pixel(in.labels, blob.box, blob.label, [&](int x, int y) {
    if (segment_.at(x, y) == kLoose) segment_.at(x, y) = 0;
  });
  return found;
}

}  // namespace stereotrack
