#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "drivers/capture/synthetic/vec.hpp"

namespace stereotrack::capture::synthetic {

enum class ShapeKind {
  kEllipsoid,  ///< radii half.x half.y half.z
  kBox,        ///< half edges half.x half.y half.z
  kCylinder,   ///< around the local y axis: radius half.x, half length half.y, flat ends
  kCapsule,    ///< the same with round ends; half.y is that of the straight part
};

/// One solid body. What a picture shows is made of these.
struct Shape {
  ShapeKind kind = ShapeKind::kBox;
  Vec3 center;
  Axes axes;
  Vec3 half{1, 1, 1};
  int material = 0;            ///< index into the scene's materials
  bool casts_shadow = true;    ///< false: paint, posters and other flat things
  double bounding_radius = 0;  ///< of a sphere around `center`, set by the makers below
};

[[nodiscard]] Shape ellipsoid(Vec3 center, const Axes& axes, Vec3 radii, int material) noexcept;
[[nodiscard]] Shape box(Vec3 center, const Axes& axes, Vec3 half, int material) noexcept;
/// Between the points a and b. `side` fixes the turn about the axis, for texture; where it lies along the
/// axis, upwards does.
[[nodiscard]] Shape cylinder(Vec3 a, Vec3 b, double radius, Vec3 side, int material) noexcept;
[[nodiscard]] Shape capsule(Vec3 a, Vec3 b, double radius, Vec3 side, int material) noexcept;

inline constexpr double kMiss = std::numeric_limits<double>::max();

/// A shape in coordinates that make rays cheap: its own axes, ellipsoids scaled to unit spheres.
/// Rays are origin + t direction; the direction need not be of unit length.
class Caster {
 public:
  Caster() = default;
  explicit Caster(const Shape& shape) noexcept
      : kind_(shape.kind), center_(shape.center), axes_(shape.axes), half_(shape.half) {
    if (kind_ == ShapeKind::kEllipsoid) scale_ = {1.0 / half_.x, 1.0 / half_.y, 1.0 / half_.z};
  }

  [[nodiscard]] Vec3 origin(Vec3 world) const noexcept { return axes_.to_local(world - center_) * scale_; }
  /// Linear in `world`.
  [[nodiscard]] Vec3 direction(Vec3 world) const noexcept { return axes_.to_local(world) * scale_; }
  /// The first t > 0 at which the surface is met from outside, or kMiss. o, d: from origin(), direction().
  [[nodiscard]] double hit(Vec3 o, Vec3 d) const noexcept {
    switch (kind_) {
      case ShapeKind::kEllipsoid: return hit_sphere(o, d, 1.0);
      case ShapeKind::kBox: return hit_box(o, d);
      default: return hit_round(o, d);
    }
  }

 private:
  [[nodiscard]] static double hit_sphere(Vec3 o, Vec3 d, double radius2) noexcept {
    const double b = dot(o, d);
    if (b >= 0) return kMiss;
    const double a = dot(d, d);
    const double discriminant = b * b - a * (dot(o, o) - radius2);
    if (discriminant < 0) return kMiss;
    const double t = (-b - std::sqrt(discriminant)) / a;
    return t > 0 ? t : kMiss;
  }

  [[nodiscard]] double hit_box(Vec3 o, Vec3 d) const noexcept {
    double enter = 0;
    double leave = kMiss;
    const auto slab = [&](double from, double along, double half) {
      if (along > -1e-12 && along < 1e-12) return from >= -half && from <= half;
      const double inverse = 1.0 / along;
      const double one = (-half - from) * inverse;
      const double other = (half - from) * inverse;
      enter = std::max(enter, std::min(one, other));
      leave = std::min(leave, std::max(one, other));
      return enter <= leave;
    };
    if (!slab(o.x, d.x, half_.x) || !slab(o.y, d.y, half_.y) || !slab(o.z, d.z, half_.z)) return kMiss;
    return enter > 0 ? enter : kMiss;
  }

  [[nodiscard]] double hit_round(Vec3 o, Vec3 d) const noexcept {
    const double radius2 = half_.x * half_.x;
    const double a = d.x * d.x + d.z * d.z;
    if (a > 1e-14) {
      const double b = o.x * d.x + o.z * d.z;
      const double discriminant = b * b - a * (o.x * o.x + o.z * o.z - radius2);
      if (discriminant < 0) return kMiss;  // the ends lie inside the endless tube
      const double t = (-b - std::sqrt(discriminant)) / a;
      const double y = o.y + t * d.y;
      if (t > 0 && y >= -half_.y && y <= half_.y) return t;
    }
    if (kind_ == ShapeKind::kCapsule) {
      return std::min(hit_sphere({o.x, o.y - half_.y, o.z}, d, radius2),
                      hit_sphere({o.x, o.y + half_.y, o.z}, d, radius2));
    }
    if (d.y > -1e-12 && d.y < 1e-12) return kMiss;
    const double t = ((d.y > 0 ? -half_.y : half_.y) - o.y) / d.y;  // the end that faces the ray
    const double x = o.x + t * d.x;
    const double z = o.z + t * d.z;
    return t > 0 && x * x + z * z <= radius2 ? t : kMiss;
  }

  ShapeKind kind_ = ShapeKind::kBox;
  Vec3 center_;
  Axes axes_;
  Vec3 half_;
  Vec3 scale_{1, 1, 1};
};

/// True when the ray meets the shape at a t > 0. A cheap sphere comes first.
[[nodiscard]] bool blocks(const Shape& shape, Vec3 origin, Vec3 unit_direction) noexcept;

/// The same for many rays of one direction, to the bit.
class Blocker {
 public:
  Blocker() = default;
  Blocker(const Shape& shape, Vec3 unit_direction) noexcept;

  [[nodiscard]] bool blocks(Vec3 origin) const noexcept;

 private:
  Caster caster_;
  Vec3 center_;
  double radius_ = 0;
  Vec3 toward_;
  Vec3 direction_;  ///< toward_ as the caster has it
};

/// Outward unit normal at a point of the surface; both local.
[[nodiscard]] Vec3 local_normal(const Shape& shape, Vec3 local) noexcept;

/// Distance from a point outside to the surface (for ellipsoids a good estimate).
[[nodiscard]] double distance(const Shape& shape, Vec3 world) noexcept;

}  // namespace stereotrack::capture::synthetic
