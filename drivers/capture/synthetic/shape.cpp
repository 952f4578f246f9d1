#include "drivers/capture/synthetic/shape.hpp"

#include <algorithm>
#include <cmath>

namespace stereotrack::capture::synthetic {
namespace {

Shape between(ShapeKind kind, Vec3 a, Vec3 b, double radius, Vec3 side, int material) noexcept {
  Shape s;
  s.kind = kind;
  s.center = (a + b) * 0.5;
  const Vec3 along = b - a;
  const double size = length(along);
  s.axes.y = along * (1.0 / size);
  const auto across = [&](Vec3 v) { return v - s.axes.y * dot(v, s.axes.y); };
  Vec3 sideways = across(side);
  if (length(sideways) < 0.1 * length(side)) sideways = across({0, 1, 0});
  if (length(sideways) < 0.1) sideways = across({0, 0, 1});
  s.axes.x = normalized(sideways);
  s.axes.z = {s.axes.x.y * s.axes.y.z - s.axes.x.z * s.axes.y.y, s.axes.x.z * s.axes.y.x - s.axes.x.x * s.axes.y.z,
              s.axes.x.x * s.axes.y.y - s.axes.x.y * s.axes.y.x};
  s.half = {radius, size * 0.5, radius};
  s.material = material;
  s.bounding_radius = kind == ShapeKind::kCapsule ? size * 0.5 + radius : length({radius, size * 0.5, 0});
  return s;
}

/// Does the ray pass the sphere at a t that is not far before its start?
bool passes(Vec3 center, double radius, Vec3 origin, Vec3 unit_direction) noexcept {
  const Vec3 to = center - origin;
  const double along = dot(to, unit_direction);
  return along >= -radius && dot(to, to) - along * along <= radius * radius;
}

}  // namespace

Shape ellipsoid(Vec3 center, const Axes& axes, Vec3 radii, int material) noexcept {
  return {ShapeKind::kEllipsoid, center, axes, radii, material, true, std::max({radii.x, radii.y, radii.z})};
}

Shape box(Vec3 center, const Axes& axes, Vec3 half, int material) noexcept {
  return {ShapeKind::kBox, center, axes, half, material, true, length(half)};
}

Shape cylinder(Vec3 a, Vec3 b, double radius, Vec3 side, int material) noexcept {
  return between(ShapeKind::kCylinder, a, b, radius, side, material);
}

Shape capsule(Vec3 a, Vec3 b, double radius, Vec3 side, int material) noexcept {
  return between(ShapeKind::kCapsule, a, b, radius, side, material);
}

bool blocks(const Shape& shape, Vec3 origin, Vec3 unit_direction) noexcept {
  if (!passes(shape.center, shape.bounding_radius, origin, unit_direction)) return false;
  const Caster caster(shape);
  return caster.hit(caster.origin(origin), caster.direction(unit_direction)) < kMiss;
}

Blocker::Blocker(const Shape& shape, Vec3 unit_direction) noexcept
    : caster_(shape),
      center_(shape.center),
      radius_(shape.bounding_radius),
      toward_(unit_direction),
      direction_(caster_.direction(unit_direction)) {}

bool Blocker::blocks(Vec3 origin) const noexcept {
  return passes(center_, radius_, origin, toward_) && caster_.hit(caster_.origin(origin), direction_) < kMiss;
}

Vec3 local_normal(const Shape& shape, Vec3 p) noexcept {
  const Vec3& h = shape.half;
  switch (shape.kind) {
    case ShapeKind::kEllipsoid: return normalized({p.x / (h.x * h.x), p.y / (h.y * h.y), p.z / (h.z * h.z)});
    case ShapeKind::kBox: {
      // The face whose plane is nearest: a point on the surface lies on it up to rounding.
      const double x = std::abs(p.x) - h.x;
      const double y = std::abs(p.y) - h.y;
      const double z = std::abs(p.z) - h.z;
      if (x >= y && x >= z) return {p.x > 0 ? 1.0 : -1.0, 0, 0};
      if (y >= z) return {0, p.y > 0 ? 1.0 : -1.0, 0};
      return {0, 0, p.z > 0 ? 1.0 : -1.0};
    }
    case ShapeKind::kCylinder: {
      const double radial = std::sqrt(p.x * p.x + p.z * p.z) - h.x;
      if (std::abs(p.y) - h.y > radial) return {0, p.y > 0 ? 1.0 : -1.0, 0};
      return normalized({p.x, 0, p.z});
    }
    case ShapeKind::kCapsule: break;
  }
  return normalized({p.x, p.y - clamp(p.y, -h.y, h.y), p.z});
}

double distance(const Shape& shape, Vec3 world) noexcept {
  const Vec3 p = shape.axes.to_local(world - shape.center);
  const Vec3& h = shape.half;
  switch (shape.kind) {
    case ShapeKind::kEllipsoid: {
      const double k = length({p.x / h.x, p.y / h.y, p.z / h.z});
      return (k - 1.0) * std::min({h.x, h.y, h.z});
    }
    case ShapeKind::kBox: {
      const Vec3 q{std::max(std::abs(p.x) - h.x, 0.0), std::max(std::abs(p.y) - h.y, 0.0),
                   std::max(std::abs(p.z) - h.z, 0.0)};
      return length(q);
    }
    case ShapeKind::kCylinder: {
      const double radial = std::max(std::sqrt(p.x * p.x + p.z * p.z) - h.x, 0.0);
      const double axial = std::max(std::abs(p.y) - h.y, 0.0);
      return std::sqrt(radial * radial + axial * axial);
    }
    case ShapeKind::kCapsule: break;
  }
  return length({p.x, p.y - clamp(p.y, -h.y, h.y), p.z}) - h.x;
}

}  // namespace stereotrack::capture::synthetic
