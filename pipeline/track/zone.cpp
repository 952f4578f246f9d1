#include "pipeline/track/zone.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace stereotrack {
namespace {

[[nodiscard]] bool is_in(const Zone::Range& range, double value) noexcept {
  return value >= range.from && value <= range.to;  // false for NaN
}

/// Calls fn(x) for each place where an edge crosses the row y. An end of an edge belongs to it where the edge leads
/// upwards from there, so that a corner counts once.
template <class Fn>
void for_each_crossing(std::span<const Zone::Corner> corners, double y, Fn&& fn) noexcept {
  for (std::size_t i = 0, before = corners.size() - 1; i < corners.size(); before = i++) {
    const Zone::Corner& a = corners[i];
    const Zone::Corner& b = corners[before];
    if ((a.y > y) == (b.y > y)) continue;
    fn(a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x));
  }
}

/// Pixels [begin, end) of a row.
void set_bits(std::uint64_t* row, int begin, int end) noexcept {
  for (int x = begin; x < end;) {
    const int count = std::min(64 - x % 64, end - x);
    row[x / 64] |= ~std::uint64_t{0} >> (64 - count) << x % 64;
    x += count;
  }
}

[[nodiscard]] bool in_space(const Zone& zone, bool has_depth, const Eigen::Vector3d& position, double unit_m) noexcept {
  const Eigen::Vector3d at_m = position * unit_m;
  return has_depth && is_in(zone.x_m, at_m.x()) && is_in(zone.y_m, at_m.y()) && is_in(zone.z_m, at_m.z());
}

[[nodiscard]] bool in_picture(const Zone& zone, double x, double y, const Rect& box) noexcept {
  const bool bottom = zone.anchor == Zone::Anchor::kBottom;
  if (bottom && box.empty()) return false;
  return contains(zone.corners.view(), x, bottom ? box.bottom() - 1 : y);
}

}  // namespace

Result<void> check(const Zone& zone) noexcept {
  if (zone.kind == Zone::Kind::kSpace) {
    for (const Zone::Range& range : {zone.x_m, zone.y_m, zone.z_m}) {
      if (!std::isfinite(range.from) || !std::isfinite(range.to)) return fail(Fault::kNotFinite);
      if (range.from > range.to) return fail(Fault::kBadConfig);
    }
    return {};
  }
  if (zone.corners.size() < 3) return fail(Fault::kBadConfig);
  for (const Zone::Corner& corner : zone.corners) {
    if (!std::isfinite(corner.x) || !std::isfinite(corner.y)) return fail(Fault::kNotFinite);
  }
  return {};
}

bool contains(std::span<const Zone::Corner> polygon, double x, double y) noexcept {
  bool inside = false;
  for_each_crossing(polygon, y, [&](double crossing) {
    if (x < crossing) inside = !inside;
  });
  return inside;
}

void add_polygon(std::span<const Zone::Corner> polygon, const BitMask& mask) noexcept {
  std::array<double, Zone::kMaxCorners> crossings;
  for (int y = 0; y < mask.height; ++y) {
    std::size_t count = 0;
    for_each_crossing(polygon, y, [&](double crossing) {
      if (count < crossings.size()) crossings[count++] = crossing;
    });
    std::sort(crossings.begin(), crossings.begin() + static_cast<std::ptrdiff_t>(count));
    // Their number is even; from an odd one to the next, an odd number of them lies further right.
    const auto column = [&](double x) { return static_cast<int>(std::ceil(std::clamp(x, 0.0, mask.width + 0.0))); };
    for (std::size_t i = 0; i + 1 < count; i += 2) {
      set_bits(mask.row(y), column(crossings[i]), column(crossings[i + 1]));
    }
  }
}

bool contains(const Zone& zone, const TrackReport& target, double unit_m) noexcept {
  if (zone.kind == Zone::Kind::kSpace) return in_space(zone, target.has_depth, target.position, unit_m);
  return in_picture(zone, target.image_x, target.image_y, target.box);
}

bool contains(const Zone& zone, const Detection& detection, double unit_m) noexcept {
  if (zone.kind == Zone::Kind::kSpace) return in_space(zone, detection.has_depth, detection.position, unit_m);
  return in_picture(zone, detection.centre_x(), detection.centre_y(), detection.box);
}

}  // namespace stereotrack
