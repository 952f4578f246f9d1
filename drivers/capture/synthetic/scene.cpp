#include "drivers/capture/synthetic/scene.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/core/pinned_math.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kNearest_m = 0.2;

/// Grows a box of picture points.
class Bounds {
 public:
  void add(double u, double v) noexcept {
    left_ = std::min(left_, u);
    right_ = std::max(right_, u);
    top_ = std::min(top_, v);
    bottom_ = std::max(bottom_, v);
  }
  void add_sphere(const PinholeCamera& camera, Vec3 center, double radius) noexcept {
    add_within(camera, center, {radius, radius, radius});
  }
  /// A body within center +- half, along the camera's axes: no point of it is seen further out than the near and far
  /// face of that box show.
  void add_within(const PinholeCamera& camera, Vec3 center, Vec3 half) noexcept {
    const Vec3 p = camera.to_camera(center);
    if (p.z + half.z < kNearest_m) return;
    for (const double z : {std::max(p.z - half.z, kNearest_m), p.z + half.z}) {
      add(camera.f * (p.x - half.x) / z + camera.cx, camera.f * (p.y - half.y) / z + camera.cy);
      add(camera.f * (p.x + half.x) / z + camera.cx, camera.f * (p.y + half.y) / z + camera.cy);
    }
  }
  [[nodiscard]] Rect rect() const noexcept {
    if (left_ > right_) return {};
    const auto whole = [](double v) { return static_cast<int>(clamp(v, -1e6, 1e6)); };
    const int left = whole(std::floor(left_));
    const int top = whole(std::floor(top_));
    return {left, top, whole(std::ceil(right_)) + 1 - left, whole(std::ceil(bottom_)) + 1 - top};
  }

 private:
  double left_ = kMiss;
  double right_ = -kMiss;
  double top_ = kMiss;
  double bottom_ = -kMiss;
};

}  // namespace

double Ripple::at(int y, int height) const noexcept {
  if (amplitude == 0) return 1.0;
  const double place = phase + turns * y / height;
  return 1.0 + amplitude * pinned_cos(2.0 * std::numbers::pi * (place - std::floor(place)));
}

PinholeCamera Rig::camera(int index, int width, int height) const noexcept {
  PinholeCamera camera;
  camera.position = {index * baseline_m, height_m, 0};
  camera.axes = {{1, 0, 0}, {0, -cos_pitch, -sin_pitch}, {0, -sin_pitch, cos_pitch}};
  camera.f = focal_widths * width;
  camera.cx = 0.5 * (width - 1);
  camera.cy = 0.5 * (height - 1);
  camera.width = width;
  camera.height = height;
  return camera;
}

PinholeCamera Rig::camera(int index, int width, int height, const Sway& sway) const noexcept {
  PinholeCamera camera = this->camera(index, width, height);
  const Axes rest = camera.axes;
  // In camera axes (right, down, forward): first roll about z, then pitch about x, then yaw about y.
  const double cr = pinned_cos(sway.roll), sr = pinned_sin(sway.roll);
  const double cp = pinned_cos(sway.pitch), sp = pinned_sin(sway.pitch);
  const double cy = pinned_cos(sway.yaw), sy = pinned_sin(sway.yaw);
  const auto turned = [&](Vec3 v) {
    v = {cr * v.x - sr * v.y, sr * v.x + cr * v.y, v.z};
    v = {v.x, cp * v.y - sp * v.z, sp * v.y + cp * v.z};
    v = {cy * v.x + sy * v.z, v.y, cy * v.z - sy * v.x};
    return rest.to_world(v);
  };
  camera.axes = {turned({1, 0, 0}), turned({0, 1, 0}), turned({0, 0, 1})};
  const double side = (index - 0.5) * baseline_m;
  camera.position = Vec3{0.5 * baseline_m, height_m, 0} + camera.axes.x * side;
  return camera;
}

StereoCalibration Rig::calibration(int width, int height) const {
  const PinholeCamera camera = this->camera(0, width, height);
  StereoCalibration result;
  result.left.width = width;
  result.left.height = height;
  result.left.fx = camera.f;
  result.left.fy = camera.f;
  result.left.cx = camera.cx;
  result.left.cy = camera.cy;
  result.right = result.left;
  result.t_right_left = {-baseline_m, 0, 0};
  return result;
}

Rect screen_box(const PinholeCamera& camera, Vec3 center, double radius) noexcept {
  Bounds bounds;
  bounds.add_sphere(camera, center, radius);
  return bounds.rect();
}

Rect screen_box(const PinholeCamera& camera, const Shape& shape) noexcept {
  Bounds bounds;
  if (shape.kind == ShapeKind::kCapsule || shape.kind == ShapeKind::kCylinder) {
    bounds.add_sphere(camera, shape.center - shape.axes.y * shape.half.y, shape.half.x);
    bounds.add_sphere(camera, shape.center + shape.axes.y * shape.half.y, shape.half.x);
    return bounds.rect();
  }
  if (shape.kind == ShapeKind::kEllipsoid) {
    // As far as it reaches along a direction d: |(half.x x.d, half.y y.d, half.z z.d)|.
    const auto reach = [&](Vec3 d) { return length(shape.axes.to_local(d) * shape.half); };
    bounds.add_within(camera, shape.center, {reach(camera.axes.x), reach(camera.axes.y), reach(camera.axes.z)});
    return bounds.rect();
  }
  int in_front = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 local{corner & 1 ? shape.half.x : -shape.half.x, corner & 2 ? shape.half.y : -shape.half.y,
                     corner & 4 ? shape.half.z : -shape.half.z};
    const Vec3 p = camera.to_camera(shape.center + shape.axes.to_world(local));
    if (p.z < kNearest_m) continue;
    ++in_front;
    bounds.add(camera.f * p.x / p.z + camera.cx, camera.f * p.y / p.z + camera.cy);
  }
  if (in_front == 0) return {};
  // A box that reaches behind the camera (the floor) can be anywhere.
  if (in_front < 8) return {0, 0, camera.width, camera.height};
  return bounds.rect();
}

}  // namespace stereotrack::capture::synthetic
