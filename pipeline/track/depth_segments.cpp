#include "pipeline/track/depth_segments.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "pipeline/shape/region.hpp"
#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {

namespace {

constexpr std::uint16_t kFar = 0xFFFF;
constexpr std::uint16_t kLoose = 0xFFFF;    // belongs to no large component
constexpr std::uint16_t kUnseen = 0xFFFE;   // not reached by the flood yet
constexpr std::uint16_t kOutside = 0xFFFD;  // no pixel of the blob
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
  const auto framed = [&]() -> ImageView<std::uint16_t> {
    const ImageView<std::uint16_t> all = arena.image<std::uint16_t>(width + 2, height + 2);
    return all.empty() ? all : all.window(1, 1, width, height);
  };
  self.filled_ = arena.image<std::uint16_t>(width, height);
  self.segment_ = framed();
  self.cost_ = framed();
  self.places_ = arena.array<Place>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

// Values travel from where cost_ is 0 to where it is kFar, which are the first `count` places, along the cheapest
// paths.
void DepthSegments::spread(ImageView<const std::uint8_t> luma, std::size_t count,
                           ImageView<std::uint16_t> value) noexcept {
  const std::ptrdiff_t stride = cost_.stride;
  // `next` and `down`: where the four neighbours lie that were visited before this pixel.
  const auto relax = [&](Place p, std::ptrdiff_t next, int down) {
    std::uint16_t* here = &cost_.at(p.x, p.y);
    int least = *here;
    std::ptrdiff_t from_x = 0;
    int from_y = 0;
    const auto offer = [&](std::ptrdiff_t dx, int dy) {
      const int there = here[dx + dy * stride];
      if (there == kFar) return;
      const int step = 1 + std::abs(luma.at(p.x, p.y) - luma.row(p.y + dy)[p.x + dx]) / kLumaStep;
      if (there + step >= least) return;
      least = there + step;
      from_x = dx;
      from_y = dy;
    };
    offer(next, 0);
    offer(next, down);
    offer(0, down);
    offer(-next, down);
    if (least == *here) return false;
    *here = static_cast<std::uint16_t>(least);
    value.at(p.x, p.y) = value.row(p.y + from_y)[p.x + from_x];
    return true;
  };
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    bool changed = false;
    for (std::size_t i = 0; i < count; ++i) changed = relax(places_[i], -1, -1) || changed;
    // The sweep upwards has left nothing to do that another one would find.
    if (sweep > 0 && !changed) return;
    for (std::size_t i = count; i-- > 0;) (void)relax(places_[i], 1, 1);
  }
}

// Components of continuous disparity; those under `least` pixels become kLoose.
int DepthSegments::flood(const Input& in, const Blob& blob, int least) noexcept {
  int found = 0;
  const Rect& box = blob.box;
  for (int y = box.top - 1; y <= box.bottom(); ++y) std::fill_n(&segment_.at(box.left - 1, y), box.width + 2, kOutside);
  for_each_pixel(in.labels, box, blob.label, [&](int x, int y) { segment_.at(x, y) = kUnseen; });
  const double jump_px = config_.jump_px * kDisparityScale;
  const int surely_near = static_cast<int>(std::min(jump_px, 65535.0));
  const auto hang_together = [&](int a, int b) {
    const int apart = std::abs(a - b);
    return apart <= surely_near || apart <= std::max(jump_px, config_.jump * std::max(a, b));
  };
  for_each_pixel(in.labels, box, blob.label, [&](int x0, int y0) {
    if (segment_.at(x0, y0) != kUnseen) return;
    std::size_t last = 0;
    std::size_t known = 0;
    places_[last++] = {static_cast<std::uint16_t>(x0), static_cast<std::uint16_t>(y0)};
    segment_.at(x0, y0) = static_cast<std::uint16_t>(found);
    for (std::size_t first = 0; first < last; ++first) {
      const Place p = places_[first];
      const int here = filled_.at(p.x, p.y);
      known += in.disparity.at(p.x, p.y) != kNoDisparity ? 1U : 0U;
      const auto visit = [&](int x, int y) {
        if (segment_.at(x, y) != kUnseen || !hang_together(here, filled_.at(x, y))) return;
        segment_.at(x, y) = static_cast<std::uint16_t>(found);
        places_[last++] = {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
      };
      visit(p.x + 1, p.y);
      visit(p.x - 1, p.y);
      visit(p.x, p.y + 1);
      visit(p.x, p.y - 1);
    }
    // A small one must be sure of itself.
    const double needed = static_cast<double>(last) < kSmallPart * blob.area ? kSmallKnown : config_.min_known;
    const bool sure = static_cast<double>(known) >= needed * static_cast<double>(last);
    if (last >= static_cast<std::size_t>(least) && sure && found < kMost) {
      ++found;
    } else {
      for (std::size_t i = 0; i < last; ++i) segment_.at(places_[i].x, places_[i].y) = kLoose;
    }
  });
  return found;
}

// The blob's pixels that are known stay, the others are to be reached: their number, and that many places_.
template <class Known>
std::size_t DepthSegments::start_spread(const Input& in, const Blob& blob, Known&& known) noexcept {
  const Rect& box = blob.box;
  for (int y = box.top - 1; y <= box.bottom(); ++y) std::fill_n(&cost_.at(box.left - 1, y), box.width + 2, kFar);
  std::size_t count = 0;
  for_each_pixel(in.labels, box, blob.label, [&](int x, int y) {
    if (known(x, y)) {
      cost_.at(x, y) = 0;
    } else {
      places_[count++] = {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
    }
  });
  return count;
}

int DepthSegments::run(const Input& in, const Blob& blob) noexcept {
  const auto all_one = [&] {
    for_each_pixel(in.labels, blob.box, blob.label, [&](int x, int y) { segment_.at(x, y) = 0; });
    return 1;
  };
  bool any = false;
  const std::size_t unknown = start_spread(in, blob, [&](int x, int y) {
    const std::uint16_t d = in.disparity.at(x, y);
    filled_.at(x, y) = d;
    any = any || d != kNoDisparity;
    return d != kNoDisparity;
  });
  if (!any) return all_one();
  spread(in.y, unknown, filled_);
  const int least = std::max(config_.min_px, static_cast<int>(config_.min_part * blob.area + 1));
  const int found = flood(in, blob, least);
  if (found <= 1) return all_one();
  const std::size_t loose = start_spread(in, blob, [&](int x, int y) { return segment_.at(x, y) != kLoose; });
  spread(in.y, loose, segment_);
  // Two sweeps may leave a pixel in a far corner of a winding blob.
  for (std::size_t i = 0; i < loose; ++i) {
    std::uint16_t& segment = segment_.at(places_[i].x, places_[i].y);
    if (segment == kLoose) segment = 0;
  }
  return found;
}

}  // namespace stereotrack
