#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/capture/synthetic/actor.hpp"
#include "drivers/capture/synthetic/foliage.hpp"
#include "drivers/capture/synthetic/material.hpp"
#include "drivers/capture/synthetic/shape.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/geometry/calibration.hpp"

namespace stereotrack::capture::synthetic {

/// An ideal camera: no distortion. Pixel (0, 0) is the centre of the first pixel.
///     u = f x / z + cx,  v = f y / z + cy        x y z in `axes`: right, down, forward
struct PinholeCamera {
  Vec3 position;
  Axes axes;
  double f = 0;   ///< [px]
  double cx = 0;  ///< [px]
  double cy = 0;  ///< [px]
  int width = 0;
  int height = 0;

  /// The direction with z = 1, so that t along it is depth.
  [[nodiscard]] Vec3 ray(double u, double v) const noexcept {
    return axes.x * ((u - cx) / f) + axes.y * ((v - cy) / f) + axes.z;
  }
  [[nodiscard]] Vec3 to_camera(Vec3 world) const noexcept { return axes.to_local(world - position); }
};

/// How far a rig is turned from where it looks at rest, about its own axes; small [rad].
struct Sway {
  double yaw = 0;    ///< to the right: the picture goes to the left
  double pitch = 0;  ///< upwards: the picture goes down
  double roll = 0;   ///< clockwise: the picture turns counter-clockwise
};

/// Two cameras side by side on a mast, looking slightly down: rectified by construction.
struct Rig {
  double height_m = 3.0;
  double sin_pitch = 0.28;  ///< below the horizon; 7-24-25: exact
  double cos_pitch = 0.96;
  double focal_widths = 600.0 / 640.0;  ///< focal length in picture widths
  double baseline_m = 0.25;

  [[nodiscard]] PinholeCamera camera(int index, int width, int height) const noexcept;  ///< 0 left, 1 right
  /// The same while the mast sways: the rig turns as one about the middle between the cameras.
  [[nodiscard]] PinholeCamera camera(int index, int width, int height, const Sway& sway) const noexcept;
  [[nodiscard]] StereoCalibration calibration(int width, int height) const;
};

/// One sun and a sky.
struct Light {
  Vec3 to_sun{0, 1, 0};       ///< unit
  double sun_radius = 0.016;  ///< half the angle it fills, makes shadow edges soft [rad]
  Vec3 sun;                   ///< light on a surface that faces it
  Vec3 sky;                   ///< on a surface that faces up, without the sun
  Vec3 bounce;                ///< on a surface that faces down
};

/// A floodlight that hangs over the yard. It is wide: nobody throws a shadow in it but right beneath himself.
///     light on a surface = light facing cone / distance^2,   cone: 1 within cos_full of straight down, 0 from cos_none
struct Lamp {
  Vec3 position;
  Vec3 light;  ///< at 1 m
  double cos_full = 0.9;
  double cos_none = 0.7;

  [[nodiscard]] Vec3 on(Vec3 point, Vec3 normal) const noexcept {
    const Vec3 to = position - point;
    const double d2 = dot(to, to);
    const double d = std::sqrt(d2);
    const double facing = dot(to, normal);
    if (facing <= 0 || d2 <= 0) return {};
    return light * (facing / (d * d2) * smoothstep(cos_none, cos_full, to.y / d));
  }
};

/// Light that pulses faster than the frame rate, as a picture's rows catch it: row y of h gets
///     1 + amplitude cos(2 pi (phase + turns y / h))
/// of its light. turns 0: all rows are exposed at once.
struct Ripple {
  double amplitude = 0;
  double phase = 0;  ///< [turns]
  double turns = 0;  ///< from the first row to the last

  [[nodiscard]] double at(int y, int height) const noexcept;
};

/// What changes for all of both pictures from one moment to the next.
struct Moment {
  double exposure = 1;  ///< factor on the gain of both cameras
  double lamp = 0;      ///< how bright the scene's lamp burns
  Sway sway;            ///< where the scene sways
  Ripple ripple;
};

/// How one frame's pictures reach whoever pairs them.
struct Delivery {
  bool left = true;  ///< false: the picture never comes
  bool right = true;
  int right_off = 0;         ///< the right picture is that of so many frames later: -1, 0 or 1
  std::int64_t skew_ns = 0;  ///< what the time stamps say, right - left; far less than half a period
};

/// Everything that can be pictured, and who comes by.
struct Scene {
  std::string name;
  std::uint64_t seed = 1;
  Rig rig;
  Light light;
  std::vector<Material> materials;
  std::vector<Shape> statics;  ///< at least two; the first is the floor, which hides nothing from the sun
  std::optional<Lamp> lamp;
  std::optional<Foliage> foliage;
  std::function<Moment(double t_s)> moment;  ///< none: nothing changes but the clouds
  bool sways = false;                        ///< the mast; how says `moment`
  double shutter_s = 0;                      ///< how long a picture is exposed: over 0, what moves is blurred
  double noise = 1;                          ///< factor on the sensors' noise
  /// Frames from 1; none: every frame's pictures come, with one stamp. Pure.
  std::function<Delivery(std::uint64_t frame)> delivery;
  Vec3 horizon_colour;
  Vec3 zenith_colour;
  double act_s = 0;      ///< every so many seconds a new cast comes on, the old one gone
  double prelude_s = 0;  ///< its first one starts at most this much before the act
  /// Who comes on in an act (from 0), with times counted from the start of the sequence. Ids go on.
  std::function<std::vector<Actor>(std::uint32_t act)> cast;
};

/// A scene that can be asked for by name: one file each in scenes/, one line each in scenes/registry.cpp.
struct SceneEntry {
  std::string_view name;
  std::string_view what;
  Scene (*make)(std::uint64_t seed);
};
[[nodiscard]] const std::vector<SceneEntry>& scenes();
[[nodiscard]] std::string scene_names();  ///< "eleven, occupied..."

/// Pixels that the picture of a shape (a sphere) can touch, not clipped. Empty if all of it is nearer
/// than 0.2 m or behind the camera.
[[nodiscard]] Rect screen_box(const PinholeCamera& camera, const Shape& shape) noexcept;
[[nodiscard]] Rect screen_box(const PinholeCamera& camera, Vec3 center, double radius) noexcept;

/// Calls hit(x, y, sample, depth) for every ray through a pixel of `box` that meets the shape.
/// `offsets`: where in a pixel the rays go, from its centre [px].
struct Offset {
  double x = 0;
  double y = 0;
};
template <std::size_t N, class Hit>
void cast(const PinholeCamera& camera, const Shape& shape, const Rect& box, const std::array<Offset, N>& offsets,
          Hit&& hit) {
  const Caster caster(shape);
  const Vec3 origin = caster.origin(camera.position);
  const Vec3 step_x = caster.direction(camera.axes.x) * (1.0 / camera.f);
  const Vec3 step_y = caster.direction(camera.axes.y) * (1.0 / camera.f);
  const Vec3 ahead = caster.direction(camera.axes.z);
  for (int y = box.top; y < box.bottom(); ++y) {
    for (int x = box.left; x < box.right(); ++x) {
      for (std::size_t s = 0; s < N; ++s) {
        const Vec3 direction =
            ahead + step_x * (x + offsets[s].x - camera.cx) + step_y * (y + offsets[s].y - camera.cy);
        const double depth = caster.hit(origin, direction);
        if (depth < kMiss) hit(x, y, s, depth);
      }
    }
  }
}

}  // namespace stereotrack::capture::synthetic
