#include "drivers/capture/synthetic/still_picture.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <thread>

namespace stereotrack::capture::synthetic {
namespace {

/// What stands still: the same four, then eight more, then the centre.
constexpr std::array<Offset, 13> kStillOffsets{{{-0.125, -0.375},
                                                {0.375, -0.125},
                                                {-0.375, 0.125},
                                                {0.125, 0.375},
                                                {-0.42, -0.42},
                                                {0.16, -0.44},
                                                {0.44, -0.40},
                                                {-0.20, -0.10},
                                                {0.14, 0.06},
                                                {0.44, 0.20},
                                                {-0.44, 0.44},
                                                {-0.12, 0.20},
                                                {0, 0}}};

/// Directions into the sun's disc for the rays of kStillOffsets, in radii.
constexpr std::array<Offset, 13> kSunDisc{{{-0.5, -0.5},
                                           {0.5, -0.5},
                                           {-0.5, 0.5},
                                           {0.5, 0.5},
                                           {0.9, 0.1},
                                           {-0.9, 0.1},
                                           {0.1, 0.9},
                                           {0.1, -0.9},
                                           {0.3, 0.2},
                                           {-0.3, -0.2},
                                           {0.7, -0.6},
                                           {-0.7, 0.6},
                                           {0, 0}}};

/// A direction `offset` radii off the middle of the sun.
Vec3 toward_sun(const Light& light, Offset offset) noexcept {
  const auto [side, up] = Across(light.to_sun);
  return normalized(light.to_sun + (side * offset.x + up * offset.y) * light.sun_radius);
}

/// The part of the skylight that what stands still leaves to a point, from its distances along the normal.
double openness(const Scene& scene, Vec3 point, Vec3 normal) noexcept {
  constexpr std::array<double, 3> kReach{0.12, 0.4, 1.1};
  std::array<double, 3> nearest = kReach;
  for (const Shape& s : scene.statics) {
    if (!s.casts_shadow) continue;
    const double room = length(s.center - point) - s.bounding_radius;
    if (room > 2.0 * kReach.back()) continue;
    for (std::size_t i = 0; i < kReach.size(); ++i) {
      nearest[i] = std::min(nearest[i], std::max(0.0, distance(s, point + normal * kReach[i])));
    }
  }
  double open = 1.0;
  for (std::size_t i = 0; i < kReach.size(); ++i) open *= mix(0.72, 1.0, nearest[i] / kReach[i]);
  return open;
}

Vec3 sky_colour(const Scene& scene, Vec3 direction) noexcept {
  const Vec3 d = normalized(direction);
  const double up = std::max(d.y, 0.0);
  const Vec3 clear = mix(scene.horizon_colour, scene.zenith_colour, smoothstep(-0.02, 0.30, up));
  const double cloud = fractal_noise(d.x * 5.0, (up + 0.02) * 22.0, 4, static_cast<std::uint32_t>(scene.seed) + 91);
  return mix(clear, {0.80, 0.81, 0.83}, 0.65 * smoothstep(-0.1, 0.5, cloud));
}

/// What stands between points and one place on the sun's disc. Seen from there each shape lies within a circle, and a
/// grid tells which circles are near: few are left to be met by a ray.
class Sunlight {
 public:
  /// `shaders`: of the scene's statics.
  Sunlight(const Scene& scene, std::span<const std::size_t> shaders, Vec3 toward) : toward_(toward), across_(toward) {
    constexpr double kRounding = 1e-6;  // [m], far more than the sums below lose
    for (const std::size_t i : shaders) {
      const Shape& shape = scene.statics[i];
      blockers_.emplace_back(shape, toward);
      circles_.push_back(
          {dot(across_.side, shape.center), dot(across_.up, shape.center), shape.bounding_radius + kRounding});
    }
    lay_grid();
  }

  [[nodiscard]] Vec3 toward() const noexcept { return toward_; }

  /// `last`: index in shaders of what hid the sun from a neighbour, which is likely to hide it again; kept.
  [[nodiscard]] bool is_hidden(Vec3 from, std::size_t& last) const noexcept {
    if (last < blockers_.size() && blockers_[last].blocks(from)) return true;
    const double u = dot(across_.side, from);
    const double v = dot(across_.up, from);
    const auto cell = static_cast<std::size_t>(row_of(v) * kCells + column_of(u));
    for (std::size_t k = starts_[cell]; k < starts_[cell + 1]; ++k) {
      const std::size_t i = near_[k];
      const Circle& circle = circles_[i];
      const double du = circle.u - u;
      const double dv = circle.v - v;
      if (du * du + dv * dv > circle.radius * circle.radius || !blockers_[i].blocks(from)) continue;
      last = i;
      return true;
    }
    return false;
  }

 private:
  struct Circle {
    double u, v, radius;
  };
  static constexpr int kCells = 64;

  [[nodiscard]] static int index_of(double along) noexcept {
    return static_cast<int>(clamp(along, 0.0, static_cast<double>(kCells - 1)));
  }
  [[nodiscard]] int column_of(double u) const noexcept { return index_of((u - left_) * a_metre_across_); }
  [[nodiscard]] int row_of(double v) const noexcept { return index_of((v - low_) * a_metre_up_); }

  /// Cells at the border hold what is beyond, too.
  void lay_grid() {
    double right = 0;
    double high = 0;
    for (const Circle& c : circles_) {
      left_ = std::min(left_, c.u - c.radius);
      right = std::max(right, c.u + c.radius);
      low_ = std::min(low_, c.v - c.radius);
      high = std::max(high, c.v + c.radius);
    }
    a_metre_across_ = kCells / std::max(right - left_, 1.0);
    a_metre_up_ = kCells / std::max(high - low_, 1.0);
    std::vector<std::vector<std::size_t>> cells(static_cast<std::size_t>(kCells) * kCells);
    for (std::size_t i = 0; i < circles_.size(); ++i) {
      const Circle& c = circles_[i];
      for (int row = row_of(c.v - c.radius); row <= row_of(c.v + c.radius); ++row) {
        for (int column = column_of(c.u - c.radius); column <= column_of(c.u + c.radius); ++column) {
          cells[static_cast<std::size_t>(row * kCells + column)].push_back(i);
        }
      }
    }
    for (const std::vector<std::size_t>& cell : cells) {
      starts_.push_back(near_.size());
      near_.insert(near_.end(), cell.begin(), cell.end());
    }
    starts_.push_back(near_.size());
  }

  Vec3 toward_;
  Across across_;
  std::vector<Blocker> blockers_;  ///< in the order of shaders, as circles_
  std::vector<Circle> circles_;
  double left_ = 0;
  double low_ = 0;
  double a_metre_across_ = 1;
  double a_metre_up_ = 1;
  std::vector<std::size_t> starts_;  ///< of each cell in near_, and the end
  std::vector<std::size_t> near_;    ///< indices of circles_ that reach into a cell
};

/// Rows from `first` up to `last`.
struct Rows {
  int first = 0;
  int last = 0;
};

void cast_rows(const Scene& scene, const PinholeCamera& camera, StillRays rays, std::span<const Rect> boxes, Rows range,
               StillPicture& out) {
  const auto [first, last] = range;
  const Rect frame{0, 0, camera.width, camera.height};
  // The same four and the centre, or all.
  const auto is_cast = [rays](std::size_t k) {
    return rays == StillRays::kThirteen || k < kSamples || k == kStillOffsets.size() - 1;
  };
  const double weight = 1.0 / (rays == StillRays::kThirteen ? static_cast<double>(kStillOffsets.size()) : 5.0);
  constexpr int kTile = 16;
  std::vector<Caster> casters;
  std::vector<Vec3> origins;
  std::vector<std::size_t> shaders;  // all but paint, and the floor, which lies under everything
  for (std::size_t i = 0; i < scene.statics.size(); ++i) {
    casters.emplace_back(scene.statics[i]);
    origins.push_back(casters.back().origin(camera.position));
    if (scene.statics[i].casts_shadow && i > 0) shaders.push_back(i);
  }
  std::vector<Sunlight> sun;
  for (const Offset offset : kSunDisc) sun.emplace_back(scene, shaders, toward_sun(scene.light, offset));
  std::size_t last_shader = 0;    // what hid the sun last is likely to hide it again
  std::vector<std::size_t> near;  // shapes that this tile may show
  // Nothing is higher than the lamp on the way to it.
  const auto lamp_on = [&](Vec3 point, Vec3 normal) {
    const Vec3 light = scene.lamp->on(point, normal);
    if (light.y <= 0) return light;
    const Vec3 to = normalized(scene.lamp->position - point);
    const bool hidden =
        std::any_of(shaders.begin(), shaders.end(), [&](std::size_t i) { return blocks(scene.statics[i], point, to); });
    return hidden ? Vec3{} : light;
  };

  for (int top = first; top < last; top += kTile) {
    for (int left = 0; left < camera.width; left += kTile) {
      const Rect tile = intersect({left, top, kTile, std::min(kTile, last - top)}, frame);
      near.clear();
      for (std::size_t i = 0; i < boxes.size(); ++i) {
        const Rect grown{boxes[i].left - 1, boxes[i].top - 1, boxes[i].width + 2, boxes[i].height + 2};
        if (!boxes[i].empty() && !intersect(tile, grown).empty()) near.push_back(i);
      }
      for (int y = tile.top; y < tile.bottom(); ++y) {
        for (int x = tile.left; x < tile.right(); ++x) {
          const std::size_t pixel =
              static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x);
          Vec3 sky_sum;
          Vec3 sun_sum;
          Vec3 lamp_sum;
          Vec3 center_normal;
          double center_open = 1.0;
          for (std::size_t k = kStillOffsets.size(); k-- > 0;) {
            if (!is_cast(k)) continue;
            const Vec3 ray = camera.ray(x + kStillOffsets[k].x, y + kStillOffsets[k].y);
            double depth = kMiss;
            std::size_t which = 0;
            for (const std::size_t i : near) {
              const double t = casters[i].hit(origins[i], casters[i].direction(ray));
              if (t < depth) {
                depth = t;
                which = i;
              }
            }
            const bool center = k == kStillOffsets.size() - 1;
            const float stored = depth < kMiss ? static_cast<float>(depth) : kSkyDepth;
            if (k < kSamples) out.depth[kSamples * pixel + k] = stored;
            if (center) out.center_depth[pixel] = stored;
            if (depth == kMiss) {
              sky_sum = sky_sum + sky_colour(scene, ray);
              continue;
            }
            const Shape& shape = scene.statics[which];
            const Vec3 point = camera.position + ray * depth;
            const Vec3 local = shape.axes.to_local(point - shape.center);
            const Vec3 flat = local_normal(shape, local);
            const Vec3 normal = shape.axes.to_world(flat);
            // The centre comes first; the few pixels across an edge take its ambient openness too.
            if (center) {
              center_normal = normal;
              center_open = openness(scene, point, normal);
            }
            const Vec3 colour =
                reflectance(scene.materials[static_cast<std::size_t>(shape.material)], shape, local, flat);
            sky_sum = sky_sum + colour * skylight(scene.light, normal) * center_open;
            const Vec3 above = point + normal * 1e-3;
            if (scene.lamp) lamp_sum = lamp_sum + colour * lamp_on(above, normal);
            const double facing = dot(normal, sun[k].toward());
            if (facing <= 0) continue;
            if (!sun[k].is_hidden(above, last_shader)) sun_sum = sun_sum + colour * scene.light.sun * facing;
          }
          const auto store = [&](std::vector<float>& plane, Vec3 v) {
            plane[3 * pixel] = static_cast<float>(v.x);
            plane[3 * pixel + 1] = static_cast<float>(v.y);
            plane[3 * pixel + 2] = static_cast<float>(v.z);
          };
          store(out.sky_light, sky_sum * weight);
          store(out.sun_light, sun_sum * weight);
          if (scene.lamp) store(out.lamp_light, lamp_sum * weight);
          store(out.normal, center_normal);
        }
      }
    }
  }
}

}  // namespace

Vec3 into_sun(const Light& light, std::size_t sample) noexcept { return toward_sun(light, kSunDisc[sample]); }

void StillPicture::resize(const Scene& scene, const PinholeCamera& camera) {
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  sky_light.resize(3 * pixels);
  sun_light.resize(3 * pixels);
  if (scene.lamp) lamp_light.resize(3 * pixels);
  normal.resize(3 * pixels);
  center_depth.resize(pixels);
  depth.resize(kSamples * pixels);
}

void cast_still(const Scene& scene, const PinholeCamera& camera, StillRays rays, StillPicture& out) {
  out.resize(scene, camera);
  std::vector<Rect> boxes;
  for (const Shape& s : scene.statics) boxes.push_back(screen_box(camera, s));
  // Rows do not depend on each other: two halves, two threads, the same numbers.
  const int middle = camera.height * 11 / 20;
  std::thread upper([&] { cast_rows(scene, camera, rays, boxes, {0, middle}, out); });
  cast_rows(scene, camera, rays, boxes, {middle, camera.height}, out);
  upper.join();
}

namespace {

/// The camera at rest with two pixels a pixel, so wide that what comes in at the edges is there.
PinholeCamera widened(const PinholeCamera& rest) noexcept {
  const int margin = 4 + rest.width / 64;
  PinholeCamera fine = rest;
  fine.f = 2.0 * rest.f;
  fine.cx = 2.0 * (rest.cx + margin) + 0.5;
  fine.cy = 2.0 * (rest.cy + margin) + 0.5;
  fine.width = 2 * (rest.width + 2 * margin);
  fine.height = 2 * (rest.height + 2 * margin);
  return fine;
}

}  // namespace

TurnableStill::TurnableStill(const Scene& scene, const PinholeCamera& rest)
    : rest_(rest), fine_(widened(rest)), floats_(scene.lamp ? 9 : 6) {
  StillPicture fine;
  cast_still(scene, fine_, StillRays::kFive, fine);
  const auto width = static_cast<std::size_t>(fine_.width);
  const auto height = static_cast<std::size_t>(fine_.height);
  light_.resize(floats_ * width * height);
  const std::array<const std::vector<float>*, 3> planes{&fine.sky_light, &fine.sun_light, &fine.lamp_light};
  for (std::size_t y = 0; y + 1 < height; ++y) {
    for (std::size_t x = 0; x + 1 < width; ++x) {
      const std::size_t here = y * width + x;
      for (std::size_t c = 0; c < floats_; ++c) {
        const std::vector<float>& from = *planes[c / 3];
        const auto value = [&](std::size_t pixel) { return from[3 * pixel + c % 3]; };
        light_[floats_ * here + c] =
            0.25F * (value(here) + value(here + 1) + value(here + width) + value(here + width + 1));
      }
    }
  }
  normal_ = std::move(fine.normal);
  depth_ = std::move(fine.center_depth);
}

void TurnableStill::read(const PinholeCamera& turned, StillPicture& out) const noexcept {
  // A ray of the turned camera in the axes of the one at rest: linear in the pixel.
  const auto in_rest = [&](Vec3 world) { return rest_.axes.to_local(world); };
  const Vec3 across = in_rest(turned.axes.x) * (1.0 / turned.f);
  const Vec3 down = in_rest(turned.axes.y) * (1.0 / turned.f);
  const Vec3 ahead = in_rest(turned.axes.z);
  const Vec3 moved = in_rest(turned.position - rest_.position);
  const int last_x = fine_.width - 2;
  const int last_y = fine_.height - 2;
  const auto fine_width = static_cast<std::size_t>(fine_.width);
  const auto nearest = [&](double u, double v) {
    const int x = std::clamp(static_cast<int>(u + 0.5), 0, last_x);
    const int y = std::clamp(static_cast<int>(v + 0.5), 0, last_y);
    return static_cast<std::size_t>(y) * fine_width + static_cast<std::size_t>(x);
  };
  for (int y = 0; y < turned.height; ++y) {
    for (int x = 0; x < turned.width; ++x) {
      const std::size_t pixel =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(turned.width) + static_cast<std::size_t>(x);
      const Vec3 ray = ahead + across * (x - turned.cx) + down * (y - turned.cy);
      // Where it would be seen from the camera at rest: first as if it were far, then at the depth found there.
      const double u_far = fine_.f * ray.x / ray.z + fine_.cx;
      const double v_far = fine_.f * ray.y / ray.z + fine_.cy;
      const double along = (static_cast<double>(depth_[nearest(u_far, v_far)]) - moved.z) / ray.z;
      const Vec3 point = moved + ray * along;
      const double u = fine_.f * point.x / point.z + fine_.cx;
      const double v = fine_.f * point.y / point.z + fine_.cy;

      const auto depth_at = [&](double fine_u, double fine_v) {
        const float depth = depth_[nearest(fine_u, fine_v)];
        return depth < kSkyDepth ? static_cast<float>((static_cast<double>(depth) - moved.z) / ray.z) : kSkyDepth;
      };
      out.center_depth[pixel] = depth_at(u, v);
      for (std::size_t s = 0; s < kSamples; ++s) {
        out.depth[kSamples * pixel + s] = depth_at(u + 2.0 * kOffsets[s].x, v + 2.0 * kOffsets[s].y);
      }
      const std::size_t at = nearest(u, v);
      for (std::size_t c = 0; c < 3; ++c) out.normal[3 * pixel + c] = normal_[3 * at + c];

      const double place_u = clamp(u - 0.5, 0.0, last_x - 1.0);
      const double place_v = clamp(v - 0.5, 0.0, last_y - 1.0);
      const auto left = static_cast<std::size_t>(place_u);
      const auto top = static_cast<std::size_t>(place_v);
      const auto right_part = static_cast<float>(place_u - static_cast<double>(left));
      const auto low_part = static_cast<float>(place_v - static_cast<double>(top));
      const float* upper = &light_[floats_ * (top * fine_width + left)];
      const float* lower = upper + floats_ * fine_width;
      const auto value = [&](std::size_t c) {
        const float above = upper[c] + (upper[c + floats_] - upper[c]) * right_part;
        const float below = lower[c] + (lower[c + floats_] - lower[c]) * right_part;
        return above + (below - above) * low_part;
      };
      for (std::size_t c = 0; c < 3; ++c) {
        out.sky_light[3 * pixel + c] = value(c);
        out.sun_light[3 * pixel + c] = value(3 + c);
        if (floats_ > 6) out.lamp_light[3 * pixel + c] = value(6 + c);
      }
    }
  }
}

}  // namespace stereotrack::capture::synthetic
