#pragma once

#include <cmath>

namespace stereotrack::capture::synthetic {

/// A point, direction or colour of the synthetic world. Only + - * / sqrt: the same bits everywhere.
///
/// World: x right, y up, z away from the rig, metres; the floor is y = 0.
/// Colours: linear light, x red, y green, z blue.
struct Vec3 {
  double x = 0;
  double y = 0;
  double z = 0;

  friend Vec3 operator+(Vec3 a, Vec3 b) noexcept { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vec3 operator-(Vec3 a, Vec3 b) noexcept { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vec3 operator*(Vec3 a, double s) noexcept { return {a.x * s, a.y * s, a.z * s}; }
  /// Element by element: light times reflectance.
  friend Vec3 operator*(Vec3 a, Vec3 b) noexcept { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
};

[[nodiscard]] inline double dot(Vec3 a, Vec3 b) noexcept { return a.x * b.x + a.y * b.y + a.z * b.z; }
[[nodiscard]] inline double length(Vec3 a) noexcept { return std::sqrt(dot(a, a)); }
[[nodiscard]] inline Vec3 normalized(Vec3 a) noexcept { return a * (1.0 / length(a)); }
[[nodiscard]] inline Vec3 mix(Vec3 a, Vec3 b, double t) noexcept { return a + (b - a) * t; }
[[nodiscard]] inline double mix(double a, double b, double t) noexcept { return a + (b - a) * t; }
[[nodiscard]] inline double clamp(double v, double low, double high) noexcept {
  return v < low ? low : (v > high ? high : v);
}
/// 0 below `a`, 1 above `b`, a cubic with level ends between.
[[nodiscard]] inline double smoothstep(double a, double b, double v) noexcept {
  const double t = clamp((v - a) / (b - a), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

/// Two unit directions across a third, and across each other; `side` is level.
struct Across {
  explicit Across(Vec3 along) noexcept
      : side(normalized({along.z, 0, -along.x})),
        up{along.y * side.z, along.z * side.x - along.x * side.z, -along.y * side.x} {}
  Vec3 side;
  Vec3 up;
};

/// The unit axes of a body, in world coordinates.
struct Axes {
  Vec3 x{1, 0, 0};
  Vec3 y{0, 1, 0};
  Vec3 z{0, 0, 1};

  [[nodiscard]] Vec3 to_local(Vec3 v) const noexcept { return {dot(x, v), dot(y, v), dot(z, v)}; }
  [[nodiscard]] Vec3 to_world(Vec3 v) const noexcept { return x * v.x + y * v.y + z * v.z; }
};

}  // namespace stereotrack::capture::synthetic
