#include "drivers/capture/synthetic/view.hpp"

#include <algorithm>
#include <cmath>
#include <thread>

namespace stereotrack::capture::synthetic {
namespace {

constexpr float kSkyDepth = 1e6F;

/// Where a pixel's four rays go: a rotated grid, every row and column of a 4 x 4 grid once.
constexpr std::array<Offset, View::kSamples> kOffsets{
    {{-0.125, -0.375}, {0.375, -0.125}, {-0.375, 0.125}, {0.125, 0.375}}};

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
Vec3 into_sun(const Light& light, Offset offset) noexcept {
  const Vec3 side = normalized({light.to_sun.z, 0, -light.to_sun.x});
  const Vec3 up = {light.to_sun.y * side.z, light.to_sun.z * side.x - light.to_sun.x * side.z,
                   -light.to_sun.y * side.x};
  return normalized(light.to_sun + (side * offset.x + up * offset.y) * light.sun_radius);
}

Vec3 skylight(const Light& light, Vec3 normal) noexcept { return mix(light.bounce, light.sky, 0.5 + 0.5 * normal.y); }

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

/// Is there a point of sphere b between sphere a and the sun?
bool may_shade(Vec3 a, double a_radius, Vec3 b, double b_radius, Vec3 to_sun) noexcept {
  const Vec3 to = b - a;
  const double along = dot(to, to_sun);
  const double reach = a_radius + b_radius + 0.03 * std::abs(along);
  return along > -reach && dot(to, to) - along * along < reach * reach;
}

}  // namespace

View::View(const Scene& scene, const PinholeCamera& camera)
    : scene_(scene), camera_(camera), frame_{0, 0, camera.width, camera.height} {
  for (std::size_t s = 0; s < kSamples; ++s) to_sun_[s] = into_sun(scene.light, kSunDisc[s]);
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  sky_light_.resize(3 * pixels);
  sun_light_.resize(3 * pixels);
  if (scene.lamp) lamp_light_.resize(3 * pixels);
  normal_.resize(3 * pixels);
  center_depth_.resize(pixels);
  still_depth_.resize(kSamples * pixels);
  who_.resize(kSamples * pixels);
  shadow_.resize(pixels);
  contact_.resize(pixels);
  row_span_.resize(static_cast<std::size_t>(camera.height));
  row_.resize(3 * static_cast<std::size_t>(camera.width));
  cast_statics();
  depth_ = still_depth_;
}

void View::cast_statics() {
  std::vector<Rect> boxes;
  for (const Shape& s : scene_.statics) boxes.push_back(screen_box(camera_, s));
  // Rows do not depend on each other: two halves, two threads, the same numbers.
  const int middle = camera_.height * 11 / 20;
  std::thread upper([&] { cast_statics_rows(0, middle, boxes); });
  cast_statics_rows(middle, camera_.height, boxes);
  upper.join();
}

void View::cast_statics_rows(int first, int last, std::span<const Rect> boxes) {
  constexpr int kTile = 16;
  std::array<Vec3, kStillOffsets.size()> sun;
  for (std::size_t s = 0; s < sun.size(); ++s) sun[s] = into_sun(scene_.light, kSunDisc[s]);
  std::vector<Caster> casters;
  std::vector<Vec3> origins;
  std::vector<std::size_t> shaders;  // all but paint, and the floor, which lies under everything
  for (std::size_t i = 0; i < scene_.statics.size(); ++i) {
    casters.emplace_back(scene_.statics[i]);
    origins.push_back(casters.back().origin(camera_.position));
    if (scene_.statics[i].casts_shadow && i > 0) shaders.push_back(i);
  }
  std::size_t last_shader = 0;    // what hid the sun last is likely to hide it again
  std::vector<std::size_t> near;  // shapes that this tile may show
  // Nothing is higher than the lamp on the way to it.
  const auto lamp_on = [&](Vec3 point, Vec3 normal) {
    const Vec3 light = scene_.lamp->on(point, normal);
    if (light.y <= 0) return light;
    const Vec3 to = normalized(scene_.lamp->position - point);
    const bool hidden = std::any_of(shaders.begin(), shaders.end(),
                                    [&](std::size_t i) { return blocks(scene_.statics[i], point, to); });
    return hidden ? Vec3{} : light;
  };

  for (int top = first; top < last; top += kTile) {
    for (int left = 0; left < camera_.width; left += kTile) {
      const Rect tile = intersect({left, top, kTile, std::min(kTile, last - top)}, frame_);
      near.clear();
      for (std::size_t i = 0; i < boxes.size(); ++i) {
        const Rect grown{boxes[i].left - 1, boxes[i].top - 1, boxes[i].width + 2, boxes[i].height + 2};
        if (!boxes[i].empty() && !intersect(tile, grown).empty()) near.push_back(i);
      }
      for (int y = tile.top; y < tile.bottom(); ++y) {
        for (int x = tile.left; x < tile.right(); ++x) {
          const std::size_t pixel = index(x, y);
          Vec3 sky_sum;
          Vec3 sun_sum;
          Vec3 lamp_sum;
          Vec3 center_normal;
          double center_open = 1.0;
          for (std::size_t k = kStillOffsets.size(); k-- > 0;) {
            const Vec3 ray = camera_.ray(x + kStillOffsets[k].x, y + kStillOffsets[k].y);
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
            if (k < kSamples) still_depth_[kSamples * pixel + k] = stored;
            if (center) center_depth_[pixel] = stored;
            if (depth == kMiss) {
              sky_sum = sky_sum + sky_colour(scene_, ray);
              continue;
            }
            const Shape& shape = scene_.statics[which];
            const Vec3 point = camera_.position + ray * depth;
            const Vec3 local = shape.axes.to_local(point - shape.center);
            const Vec3 flat = local_normal(shape, local);
            const Vec3 normal = shape.axes.to_world(flat);
            // The centre comes first; the few pixels across an edge take its ambient openness too.
            if (center) {
              center_normal = normal;
              center_open = openness(scene_, point, normal);
            }
            const Vec3 colour =
                reflectance(scene_.materials[static_cast<std::size_t>(shape.material)], shape, local, flat);
            sky_sum = sky_sum + colour * skylight(scene_.light, normal) * center_open;
            const Vec3 above = point + normal * 1e-3;
            if (scene_.lamp) lamp_sum = lamp_sum + colour * lamp_on(above, normal);
            const double facing = dot(normal, sun[k]);
            if (facing <= 0) continue;
            bool hidden = blocks(scene_.statics[shaders[last_shader]], above, sun[k]);
            for (std::size_t i = 0; i < shaders.size() && !hidden; ++i) {
              hidden = blocks(scene_.statics[shaders[i]], above, sun[k]);
              if (hidden) last_shader = i;
            }
            if (!hidden) sun_sum = sun_sum + colour * scene_.light.sun * facing;
          }
          const double weight = 1.0 / static_cast<double>(kStillOffsets.size());
          const auto store = [&](std::vector<float>& plane, Vec3 v) {
            plane[3 * pixel] = static_cast<float>(v.x);
            plane[3 * pixel + 1] = static_cast<float>(v.y);
            plane[3 * pixel + 2] = static_cast<float>(v.z);
          };
          store(sky_light_, sky_sum * weight);
          store(sun_light_, sun_sum * weight);
          if (scene_.lamp) store(lamp_light_, lamp_sum * weight);
          store(normal_, center_normal);
        }
      }
    }
  }
}

void View::mark(const Rect& box) noexcept {
  for (int y = box.top; y < box.bottom(); ++y) {
    auto& span = row_span_[static_cast<std::size_t>(y)];
    span = {std::min(span[0], box.left), std::max(span[1], box.right())};
  }
}

void View::cast_actors(std::span<const PosedActor> actors) {
  for (const Rect& box : dirty_) {
    for (int y = box.top; y < box.bottom(); ++y) {
      const std::size_t from = index(box.left, y);
      const auto count = static_cast<std::size_t>(box.width);
      std::copy_n(&still_depth_[kSamples * from], kSamples * count, &depth_[kSamples * from]);
      std::fill_n(&who_[kSamples * from], kSamples * count, std::uint16_t{0});
      std::fill_n(&shadow_[from], count, std::uint8_t{0});
      std::fill_n(&contact_[from], count, std::uint8_t{0});
    }
  }
  dirty_.clear();
  std::fill(row_span_.begin(), row_span_.end(), std::array<int, 2>{camera_.width, 0});

  part_count_ = 0;
  for (std::size_t a = 0; a < actors.size(); ++a) {
    for (const Shape& shape : actors[a].shapes) {
      if (part_count_ == parts_.size()) parts_.emplace_back();
      Part& part = parts_[part_count_++];
      part.shape = shape;
      part.actor = static_cast<int>(a);
    }
  }
  for (std::size_t p = 0; p < part_count_; ++p) {
    const Rect box = intersect(screen_box(camera_, parts_[p].shape), frame_);
    if (!box.empty()) {
      dirty_.push_back(box);
      mark(box);
      const auto who = static_cast<std::uint16_t>(p + 1);
      cast(camera_, parts_[p].shape, box, kOffsets, [&](int x, int y, std::size_t s, double depth) {
        const std::size_t at = kSamples * index(x, y) + s;
        if (static_cast<float>(depth) >= depth_[at]) return;
        depth_[at] = static_cast<float>(depth);
        who_[at] = who;
      });
    }
    cast_shadow(parts_[p]);
  }
  for (const PosedActor& actor : actors) {
    for (const Shape& sphere : actor.contacts) cast_contact(sphere);
  }
  std::size_t first = 0;
  for (const PosedActor& actor : actors) {
    find_shaders(first, actor.shapes.size());
    first += actor.shapes.size();
  }
}

/// Looks from every pixel that the shadow can reach towards four points of the sun.
void View::cast_shadow(const Part& part) {
  const Shape& shape = part.shape;
  // The shadow lies between the shape and where its edge rays meet the floor.
  Rect box;
  const auto sweep = [&](Vec3 center, double radius) {
    const double fall = std::max(center.y + radius, 0.0) / scene_.light.to_sun.y;
    const Vec3 down = center - scene_.light.to_sun * fall;
    box = unite(box, unite(screen_box(camera_, center, radius),
                           screen_box(camera_, down, radius / scene_.light.to_sun.y + 0.03 * fall)));
  };
  if (shape.kind == ShapeKind::kCapsule || shape.kind == ShapeKind::kCylinder) {
    sweep(shape.center - shape.axes.y * shape.half.y, shape.half.x);
    sweep(shape.center + shape.axes.y * shape.half.y, shape.half.x);
  } else {
    sweep(shape.center, shape.bounding_radius);
  }
  box = intersect(box, frame_);
  if (box.empty()) return;

  const Caster caster(shape);
  std::array<Vec3, kSamples> direction;
  for (std::size_t s = 0; s < kSamples; ++s) direction[s] = caster.direction(to_sun_[s]);
  constexpr std::uint8_t kAll = (1U << kSamples) - 1;
  const Vec3 sun = scene_.light.to_sun;
  Rect touched;
  for (int y = box.top; y < box.bottom(); ++y) {
    int low = camera_.width;
    int high = 0;
    for (int x = box.left; x < box.right(); ++x) {
      const std::size_t pixel = index(x, y);
      if (shadow_[pixel] == kAll || sun_light_[3 * pixel + 1] <= 0.0F) continue;
      const Vec3 point = camera_.position + camera_.ray(x, y) * static_cast<double>(center_depth_[pixel]);
      const Vec3 to = shape.center - point;
      const double along = dot(to, sun);
      const double reach = shape.bounding_radius + scene_.light.sun_radius * std::abs(along);
      if (along < -reach || dot(to, to) - along * along > reach * reach) continue;
      const Vec3 origin = caster.origin(point);
      for (std::size_t s = 0; s < kSamples; ++s) {
        if (caster.hit(origin, direction[s]) < kMiss) shadow_[pixel] |= static_cast<std::uint8_t>(1U << s);
      }
      if (shadow_[pixel] != 0) {
        low = std::min(low, x);
        high = std::max(high, x + 1);
      }
    }
    if (low < high) touched = unite(touched, {low, y, high - low, 1});
  }
  if (touched.empty()) return;
  // The shadow is smoothed over 3 x 3 pixels.
  touched = intersect({touched.left - 1, touched.top - 1, touched.width + 2, touched.height + 2}, frame_);
  dirty_.push_back(touched);
  mark(touched);
}

/// The skylight that a sphere takes from what stands still beside it: cos (r / d)^2, faded out at 4 r.
void View::cast_contact(const Shape& sphere) {
  const double r = sphere.half.x;
  constexpr double kReach = 4.0;
  const Rect box =
      intersect(screen_box(camera_, {sphere.center.x, 0.5 * sphere.center.y, sphere.center.z}, 2.5 * r), frame_);
  if (box.empty() || sphere.center.y > kReach * r) return;
  dirty_.push_back(box);
  mark(box);
  for (int y = box.top; y < box.bottom(); ++y) {
    for (int x = box.left; x < box.right(); ++x) {
      const std::size_t pixel = index(x, y);
      const Vec3 point = camera_.position + camera_.ray(x, y) * static_cast<double>(center_depth_[pixel]);
      const Vec3 to = sphere.center - point;
      const double d2 = std::max(dot(to, to), r * r);
      if (d2 > kReach * kReach * r * r) continue;
      const Vec3 normal{normal_[3 * pixel], normal_[3 * pixel + 1], normal_[3 * pixel + 2]};
      const double facing = dot(normal, to);
      if (facing <= 0) continue;
      const double taken = (r * r / d2 - 1.0 / (kReach * kReach)) * facing / std::sqrt(d2);
      const double left = (1.0 - contact_[pixel] / 255.0) * (1.0 - 0.75 * clamp(taken, 0.0, 1.0));
      contact_[pixel] = static_cast<std::uint8_t>((1.0 - left) * 255.0);
    }
  }
}

void View::find_shaders(std::size_t first, std::size_t count) {
  for (std::size_t p = first; p < first + count; ++p) {
    Part& part = parts_[p];
    part.shaders.clear();
    part.static_shaders.clear();
    const Shape& s = part.shape;
    for (std::size_t other = 0; other < part_count_; ++other) {
      const Shape& o = parts_[other].shape;
      if (other != p && may_shade(s.center, s.bounding_radius, o.center, o.bounding_radius, scene_.light.to_sun)) {
        part.shaders.push_back(static_cast<std::uint16_t>(other));
      }
    }
    for (std::size_t other = 0; other < scene_.statics.size(); ++other) {
      const Shape& o = scene_.statics[other];
      if (!o.casts_shadow || !may_shade(s.center, s.bounding_radius, o.center, o.bounding_radius, scene_.light.to_sun))
        continue;
      // The floor and walls behind are in every sphere but shade nothing in front of them.
      if (o.kind == ShapeKind::kBox && o.bounding_radius > 15.0) continue;
      part.static_shaders.push_back(static_cast<std::uint16_t>(other));
    }
  }
}

Vec3 View::shade(const Part& part, std::size_t sample, double u, double v, double depth,
                 const LightLevel& level) const noexcept {
  const Shape& shape = part.shape;
  const Vec3 point = camera_.position + camera_.ray(u, v) * depth;
  const Vec3 local = shape.axes.to_local(point - shape.center);
  const Vec3 flat = local_normal(shape, local);
  const Vec3 normal = shape.axes.to_world(flat);
  const Vec3 colour = reflectance(scene_.materials[static_cast<std::size_t>(shape.material)], shape, local, flat);
  // Near the floor less of the sky is seen.
  const double open = mix(0.62, 1.0, smoothstep(0.0, 0.7, point.y + 0.35 * normal.y));
  Vec3 light = skylight(scene_.light, normal) * (open * level.sky);
  const double facing = dot(normal, to_sun_[sample]);
  if (facing > 0) {
    const Vec3 above = point + normal * 2e-3;
    const bool hidden = std::any_of(part.shaders.begin(), part.shaders.end(),
                                    [&](std::uint16_t i) { return blocks(parts_[i].shape, above, to_sun_[sample]); }) ||
                        std::any_of(part.static_shaders.begin(), part.static_shaders.end(),
                                    [&](std::uint16_t i) { return blocks(scene_.statics[i], above, to_sun_[sample]); });
    if (!hidden) light = light + scene_.light.sun * (facing * level.sun);
  }
  if (lamp_ > 0) light = light + scene_.lamp->on(point, normal) * level.lamp;
  return colour * light;
}

/// Hidden part of the sun, smoothed with 1 2 1 in x and y.
double View::shadow(int x, int y) const noexcept {
  constexpr std::array<int, 16> kBitCount{0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4};
  int sum = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    const int row = std::clamp(y + dy, 0, camera_.height - 1);
    for (int dx = -1; dx <= 1; ++dx) {
      const int column = std::clamp(x + dx, 0, camera_.width - 1);
      sum += (2 - std::abs(dx)) * (2 - std::abs(dy)) * kBitCount[shadow_[index(column, row)]];
    }
  }
  return static_cast<double>(sum) / (16.0 * kSamples);
}

void View::expose(const LightLevel& level, double exposure, const Sensor& sensor, std::uint64_t frame,
                  std::uint8_t* bgr) {
  const auto sky = static_cast<float>(level.sky);
  const auto sun = static_cast<float>(level.sun);
  lamp_ = lamp_light_.empty() ? 0.0F : static_cast<float>(level.lamp);
  for (int y = 0; y < camera_.height; ++y) {
    const std::size_t start = 3 * index(0, y);
    for (std::size_t i = 0; i < row_.size(); ++i) row_[i] = sky_light_[start + i] * sky + sun_light_[start + i] * sun;
    if (lamp_ > 0) {
      for (std::size_t i = 0; i < row_.size(); ++i) row_[i] += lamp_light_[start + i] * lamp_;
    }
    const auto [first, last] = row_span_[static_cast<std::size_t>(y)];
    for (int x = first; x < last; ++x) {
      const std::size_t pixel = index(x, y);
      const auto lit = static_cast<float>(level.sun * (1.0 - shadow(x, y)));
      const auto open = static_cast<float>(level.sky * (1.0 - contact_[pixel] / 255.0));
      const std::size_t out = 3 * static_cast<std::size_t>(x);
      for (std::size_t c = 0; c < 3; ++c) {
        row_[out + c] = sky_light_[3 * pixel + c] * open + sun_light_[3 * pixel + c] * lit;
      }
      if (lamp_ > 0) {
        const float lamp = lamp_ * (1.0F - static_cast<float>(contact_[pixel]) / 255.0F);
        for (std::size_t c = 0; c < 3; ++c) row_[out + c] += lamp_light_[3 * pixel + c] * lamp;
      }
      const std::uint16_t* who = &who_[kSamples * pixel];
      Vec3 sum;
      int covered = 0;
      for (std::size_t s = 0; s < kSamples; ++s) {
        if (who[s] == 0) continue;
        ++covered;
        sum = sum + shade(parts_[who[s] - 1U], s, x + kOffsets[s].x, y + kOffsets[s].y,
                          static_cast<double>(depth_[kSamples * pixel + s]), level);
      }
      if (covered == 0) continue;
      const float still = static_cast<float>(static_cast<int>(kSamples) - covered) / kSamples;
      row_[out] = row_[out] * still + static_cast<float>(sum.x / kSamples);
      row_[out + 1] = row_[out + 1] * still + static_cast<float>(sum.y / kSamples);
      row_[out + 2] = row_[out + 2] * still + static_cast<float>(sum.z / kSamples);
    }
    sensor.expose(row_.data(), y, frame, bgr + start, exposure);
  }
}

View::Owner View::owner(int x, int y) const noexcept {
  const std::size_t pixel = index(x, y);
  const auto still = [&] {
    const float depth = center_depth_[pixel];
    return Owner{-1, depth < kSkyDepth ? 1.0 / static_cast<double>(depth) : 0.0};
  };
  const auto [first, last] = row_span_[static_cast<std::size_t>(y)];
  if (x < first || x >= last) return still();
  std::array<int, kSamples> actor{};
  for (std::size_t s = 0; s < kSamples; ++s) {
    const std::uint16_t who = who_[kSamples * pixel + s];
    actor[s] = who == 0 ? -1 : parts_[who - 1U].actor;
  }
  Owner best;
  int most = 0;
  for (std::size_t s = 0; s < kSamples; ++s) {
    int votes = 0;
    double inverse = 0;
    for (std::size_t k = 0; k < kSamples; ++k) {
      if (actor[k] != actor[s]) continue;
      ++votes;
      inverse += 1.0 / static_cast<double>(depth_[kSamples * pixel + k]);
    }
    if (votes > most) {
      most = votes;
      best = {actor[s], inverse / votes};
    }
  }
  return best.actor < 0 ? still() : best;
}

double View::darkening(int x, int y) const noexcept {
  const auto [first, last] = row_span_[static_cast<std::size_t>(y)];
  if (x < first || x >= last) return 0.0;
  const std::size_t pixel = index(x, y);
  double sky = 0;
  double sun = 0;
  constexpr std::array<double, 3> kLuma{0.299, 0.587, 0.114};
  for (std::size_t c = 0; c < 3; ++c) {
    sky += kLuma[c] * static_cast<double>(sky_light_[3 * pixel + c]);
    sun += kLuma[c] * static_cast<double>(sun_light_[3 * pixel + c]);
  }
  double lamp = 0;
  if (lamp_ > 0) {
    for (std::size_t c = 0; c < 3; ++c) lamp += kLuma[c] * static_cast<double>(lamp_ * lamp_light_[3 * pixel + c]);
  }
  const double lost = (sky + lamp) * (contact_[pixel] / 255.0) + sun * shadow(x, y);
  const double all = sky + sun + lamp;
  return all > 0 ? lost / all : 0.0;
}

}  // namespace stereotrack::capture::synthetic
