#include "firmware-app/signals/zone.hpp"

#include <cmath>
#include <span>

namespace stereotrack::signals {
namespace {

[[nodiscard]] bool is_in(const Zone::Range& range, double value) noexcept {
  return value >= range.from && value <= range.to;  // false for NaN
}

/// Even-odd rule: a ray to the right crosses the edges an odd number of times. What is not finite is outside.
[[nodiscard]] bool is_in(std::span<const Zone::Corner> corners, double x, double y) noexcept {
  bool inside = false;
  for (std::size_t i = 0, before = corners.size() - 1; i < corners.size(); before = i++) {
    const Zone::Corner& a = corners[i];
    const Zone::Corner& b = corners[before];
    if ((a.y > y) == (b.y > y)) continue;
    if (x < a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x)) inside = !inside;
  }
  return inside;
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

bool contains(const Zone& zone, const TrackReport& target, double unit_m) noexcept {
  if (zone.kind == Zone::Kind::kSpace) {
    const Eigen::Vector3d at_m = target.position * unit_m;
    return target.has_depth && is_in(zone.x_m, at_m.x()) && is_in(zone.y_m, at_m.y()) && is_in(zone.z_m, at_m.z());
  }
  const bool bottom = zone.anchor == Zone::Anchor::kBottom;
  if (bottom && target.box.empty()) return false;
  const double y = bottom ? target.box.bottom() - 1 : target.image_y;
  return is_in(zone.corners.view(), target.image_x, y);
}

}  // namespace stereotrack::signals
