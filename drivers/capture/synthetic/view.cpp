#include "drivers/capture/synthetic/view.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace stereotrack::capture::synthetic {
namespace {

/// Is there a point of sphere b between sphere a and the sun?
bool may_shade(Vec3 a, double a_radius, Vec3 b, double b_radius, Vec3 to_sun) noexcept {
  const Vec3 to = b - a;
  const double along = dot(to, to_sun);
  const double reach = a_radius + b_radius + 0.03 * std::abs(along);
  return along > -reach && dot(to, to) - along * along < reach * reach;
}

}  // namespace

View::View(const Scene& scene, const PinholeCamera& camera)
    : scene_(scene), camera_(camera), frame_{0, 0, camera.width, camera.height}, across_sun_(scene.light.to_sun) {
  for (std::size_t s = 0; s < kSamples; ++s) to_sun_[s] = into_sun(scene.light, s);
  for (const Shape& shape : scene.statics) {
    auto& blockers = static_blockers_.emplace_back();
    for (std::size_t s = 0; s < kSamples; ++s) blockers[s] = Blocker(shape, to_sun_[s]);
  }
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  who_.resize(kSamples * pixels);
  shadow_.resize(pixels);
  contact_.resize(pixels);
  row_span_.resize(static_cast<std::size_t>(camera.height));
  row_.resize(3 * static_cast<std::size_t>(camera.width));
  if (scene.foliage) leaf_shadow_.resize(pixels);
  if (scene.sways) {
    turnable_.emplace(scene, camera);
    still_.resize(scene, camera);
    turn(camera);
  } else {
    cast_still(scene, camera, StillRays::kThirteen, still_);
    depth_ = still_.depth;
    look_from_sun();
  }
}

View::SeenFromSun View::from_sun(Vec3 point) const noexcept {
  return {static_cast<float>(dot(across_sun_.side, point)), static_cast<float>(dot(across_sun_.up, point)),
          static_cast<float>(dot(scene_.light.to_sun, point))};
}

void View::look_from_sun() {
  seen_from_sun_.resize(still_.center_depth.size());
  for (int y = 0; y < camera_.height; ++y) {
    for (int x = 0; x < camera_.width; ++x) {
      const std::size_t pixel = index(x, y);
      seen_from_sun_[pixel] =
          from_sun(camera_.position + camera_.ray(x, y) * static_cast<double>(still_.center_depth[pixel]));
    }
  }
}

void View::turn(const PinholeCamera& camera) {
  camera_ = camera;
  turnable_->read(camera, still_);
  depth_ = still_.depth;
  look_from_sun();
}

void View::mark(const Rect& box) noexcept {
  for (int y = box.top; y < box.bottom(); ++y) {
    auto& span = row_span_[static_cast<std::size_t>(y)];
    span = {std::min(span[0], box.left), std::max(span[1], box.right())};
  }
}

void View::cast_actors(std::span<const PosedActor> actors, const PosedFoliage& foliage) {
  for (const Rect& box : dirty_) {
    for (int y = box.top; y < box.bottom(); ++y) {
      const std::size_t from = index(box.left, y);
      const auto count = static_cast<std::size_t>(box.width);
      std::copy_n(&still_.depth[kSamples * from], kSamples * count, &depth_[kSamples * from]);
      std::fill_n(&who_[kSamples * from], kSamples * count, std::uint16_t{0});
      std::fill_n(&shadow_[from], count, std::uint8_t{0});
      if (!leaf_shadow_.empty()) std::fill_n(&leaf_shadow_[from], count, std::uint8_t{0});
      std::fill_n(&contact_[from], count, std::uint8_t{0});
    }
  }
  dirty_.clear();
  std::fill(row_span_.begin(), row_span_.end(), std::array<int, 2>{camera_.width, 0});

  cast_leaves(foliage);

  part_count_ = 0;
  for (std::size_t a = 0; a < actors.size(); ++a) {
    for (const Shape& shape : actors[a].shapes) {
      if (part_count_ == parts_.size()) parts_.emplace_back();
      Part& part = parts_[part_count_++];
      part.shape = shape;
      part.actor = static_cast<int>(a);
      for (std::size_t s = 0; s < kSamples; ++s) part.blockers[s] = Blocker(shape, to_sun_[s]);
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

void View::cast_leaves(const PosedFoliage& foliage) {
  leaves_ = foliage.leaves;
  std::size_t first = 0;
  for (const std::size_t end : foliage.clump_ends) {
    Rect clump;
    for (std::size_t i = first; i < end; ++i) {
      const Rect box = intersect(screen_box(camera_, leaves_[i].shape), frame_);
      if (box.empty()) continue;
      clump = unite(clump, box);
      const auto who = static_cast<std::uint16_t>(kFirstLeaf + i);
      cast(camera_, leaves_[i].shape, box, kOffsets, [&](int x, int y, std::size_t s, double depth) {
        const std::size_t at = kSamples * index(x, y) + s;
        if (static_cast<float>(depth) >= depth_[at]) return;
        depth_[at] = static_cast<float>(depth);
        who_[at] = who;
      });
    }
    if (!clump.empty()) {
      dirty_.push_back(clump);
      mark(clump);
    }
    first = end;
  }
  for (const Shape& ball : foliage.shades) {
    // Only where the shadow meets the floor; smaller than that of what moves.
    const double fall = std::max(ball.center.y, 0.0) / scene_.light.to_sun.y;
    const Vec3 down = ball.center - scene_.light.to_sun * fall;
    const Rect box =
        screen_box(camera_, down, ball.bounding_radius / scene_.light.to_sun.y + scene_.light.sun_radius * fall);
    shade_still(ball, intersect(box, frame_), leaf_shadow_);
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
  shade_still(shape, intersect(box, frame_), shadow_);
}

void View::shade_still(const Shape& shape, const Rect& box, std::vector<std::uint8_t>& bits) {
  if (box.empty()) return;
  const Caster caster(shape);
  std::array<Vec3, kSamples> direction;
  for (std::size_t s = 0; s < kSamples; ++s) direction[s] = caster.direction(to_sun_[s]);
  constexpr std::uint8_t kAll = (1U << kSamples) - 1;
  const Vec3 sun = scene_.light.to_sun;
  const SeenFromSun center = from_sun(shape.center);
  const auto radius = static_cast<float>(shape.bounding_radius) + kRounding;
  const auto sun_radius = static_cast<float>(scene_.light.sun_radius);
  Rect touched;
  for (int y = box.top; y < box.bottom(); ++y) {
    int low = camera_.width;
    int high = 0;
    for (int x = box.left; x < box.right(); ++x) {
      const std::size_t pixel = index(x, y);
      const SeenFromSun& seen = seen_from_sun_[pixel];
      const float du = center.u - seen.u;
      const float dv = center.v - seen.v;
      const float within = radius + sun_radius * std::abs(center.w - seen.w);
      if (du * du + dv * dv > within * within || center.w - seen.w < -within) continue;
      if (bits[pixel] == kAll || still_.sun_light[3 * pixel + 1] <= 0.0F) continue;
      const Vec3 point = camera_.position + camera_.ray(x, y) * static_cast<double>(still_.center_depth[pixel]);
      const Vec3 to = shape.center - point;
      const double along = dot(to, sun);
      const double reach = shape.bounding_radius + scene_.light.sun_radius * std::abs(along);
      if (along < -reach || dot(to, to) - along * along > reach * reach) continue;
      const Vec3 origin = caster.origin(point);
      for (std::size_t s = 0; s < kSamples; ++s) {
        if (caster.hit(origin, direction[s]) < kMiss) bits[pixel] |= static_cast<std::uint8_t>(1U << s);
      }
      if (bits[pixel] != 0) {
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
  const SeenFromSun center = from_sun(sphere.center);
  const float within = static_cast<float>(kReach * r) + kRounding;
  for (int y = box.top; y < box.bottom(); ++y) {
    for (int x = box.left; x < box.right(); ++x) {
      const std::size_t pixel = index(x, y);
      const SeenFromSun& seen = seen_from_sun_[pixel];
      const float du = center.u - seen.u;
      const float dv = center.v - seen.v;
      const float dw = center.w - seen.w;
      if (du * du + dv * dv + dw * dw > within * within) continue;
      const Vec3 point = camera_.position + camera_.ray(x, y) * static_cast<double>(still_.center_depth[pixel]);
      const Vec3 to = sphere.center - point;
      const double d2 = std::max(dot(to, to), r * r);
      if (d2 > kReach * kReach * r * r) continue;
      const Vec3 normal{still_.normal[3 * pixel], still_.normal[3 * pixel + 1], still_.normal[3 * pixel + 2]};
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
                                    [&](std::uint16_t i) { return parts_[i].blockers[sample].blocks(above); }) ||
                        std::any_of(part.static_shaders.begin(), part.static_shaders.end(),
                                    [&](std::uint16_t i) { return static_blockers_[i][sample].blocks(above); });
    if (!hidden) light = light + scene_.light.sun * (facing * level.sun);
  }
  if (lamp_ > 0) light = light + scene_.lamp->on(point, normal) * level.lamp;
  return colour * light;
}

/// The side that the sun does not reach glows a little: leaves let light through.
Vec3 View::shade(const PosedLeaf& leaf, std::size_t sample, double u, double v, double depth,
                 const LightLevel& level) const noexcept {
  const Vec3 point = camera_.position + camera_.ray(u, v) * depth;
  const Vec3 local = leaf.shape.axes.to_local(point - leaf.shape.center);
  const Vec3 flat = local_normal(leaf.shape, local);
  const Vec3 normal = leaf.shape.axes.to_world(flat);
  const Vec3 colour = flat.y > 0 ? leaf.upper : leaf.under;
  const double facing = dot(normal, to_sun_[sample]);
  const double sun = leaf.lit * level.sun * (facing > 0 ? facing : -0.42 * facing);
  return colour * (skylight(scene_.light, normal) * (leaf.open * level.sky) + scene_.light.sun * sun);
}

/// What shadow() of (x - 1, y), (x, y) and (x + 1, y) reads in column x, in one.
unsigned View::shadows_of_column(int x, int y) const noexcept {
  const int column = std::clamp(x, 0, camera_.width - 1);
  unsigned bits = 0;
  for (int row = std::max(y - 1, 0); row <= std::min(y + 1, camera_.height - 1); ++row) {
    bits |= shadow_[index(column, row)];
    if (!leaf_shadow_.empty()) bits |= leaf_shadow_[index(column, row)];
  }
  return bits;
}

/// Hidden part of the sun, smoothed with 1 2 1 in x and y.
double View::shadow(int x, int y, Shaders shaders) const noexcept {
  constexpr std::array<int, 16> kBitCount{0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4};
  int sum = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    const int row = std::clamp(y + dy, 0, camera_.height - 1);
    for (int dx = -1; dx <= 1; ++dx) {
      const int column = std::clamp(x + dx, 0, camera_.width - 1);
      const std::size_t pixel = index(column, row);
      unsigned bits = shadow_[pixel];
      if (!leaf_shadow_.empty()) {
        const unsigned leaves = leaf_shadow_[pixel];
        bits = shaders == Shaders::kAll ? bits | leaves : (shaders == Shaders::kLeaves ? leaves : bits & ~leaves);
      }
      sum += (2 - std::abs(dx)) * (2 - std::abs(dy)) * kBitCount[bits];
    }
  }
  return static_cast<double>(sum) / (16.0 * kSamples);
}

void View::expose(const LightLevel& level, const Exposure& exposure, const Sensor& sensor, std::uint8_t* bgr) {
  lamp_ = still_.lamp_light.empty() ? 0.0F : static_cast<float>(level.lamp);
  for (int y = 0; y < camera_.height; ++y) {
    light_row(y, level);
    sensor.expose(row_.data(), y, exposure.frame, bgr + 3 * index(0, y),
                  exposure.gain * exposure.ripple.at(y, camera_.height));
  }
}

void View::gather(const LightLevel& level, bool first) {
  lamp_ = still_.lamp_light.empty() ? 0.0F : static_cast<float>(level.lamp);
  gathered_.resize(row_.size() * static_cast<std::size_t>(camera_.height));
  if (first) {
    std::fill(gathered_.begin(), gathered_.end(), 0.0F);
    gathers_ = 0;
  }
  ++gathers_;
  for (int y = 0; y < camera_.height; ++y) {
    light_row(y, level);
    float* sum = &gathered_[3 * index(0, y)];
    for (std::size_t i = 0; i < row_.size(); ++i) sum[i] += row_[i];
  }
}

void View::develop(const Exposure& exposure, const Sensor& sensor, std::uint8_t* bgr) {
  const float share = 1.0F / static_cast<float>(gathers_);
  for (int y = 0; y < camera_.height; ++y) {
    const float* sum = &gathered_[3 * index(0, y)];
    for (std::size_t i = 0; i < row_.size(); ++i) row_[i] = sum[i] * share;
    sensor.expose(row_.data(), y, exposure.frame, bgr + 3 * index(0, y),
                  exposure.gain * exposure.ripple.at(y, camera_.height));
  }
}

void View::light_row(int y, const LightLevel& level) noexcept {
  const auto sky = static_cast<float>(level.sky);
  const auto sun = static_cast<float>(level.sun);
  const std::size_t start = 3 * index(0, y);
  for (std::size_t i = 0; i < row_.size(); ++i)
    row_[i] = still_.sky_light[start + i] * sky + still_.sun_light[start + i] * sun;
  if (lamp_ > 0) {
    for (std::size_t i = 0; i < row_.size(); ++i) row_[i] += still_.lamp_light[start + i] * lamp_;
  }
  const auto [first, last] = row_span_[static_cast<std::size_t>(y)];
  unsigned before = first < last ? shadows_of_column(first - 1, y) : 0;
  unsigned here = first < last ? shadows_of_column(first, y) : 0;
  for (int x = first; x < last; ++x) {
    const std::size_t pixel = index(x, y);
    const unsigned after = shadows_of_column(x + 1, y);
    const unsigned shadows = before | here | after;
    before = std::exchange(here, after);
    const std::uint16_t* who = &who_[kSamples * pixel];
    const bool is_still = std::all_of(who, who + kSamples, [](std::uint16_t one) { return one == 0; });
    if (shadows == 0 && contact_[pixel] == 0 && is_still) continue;
    const auto lit = static_cast<float>(level.sun * (1.0 - shadow(x, y, Shaders::kAll)));
    const auto open = static_cast<float>(level.sky * (1.0 - contact_[pixel] / 255.0));
    const std::size_t out = 3 * static_cast<std::size_t>(x);
    for (std::size_t c = 0; c < 3; ++c) {
      row_[out + c] = still_.sky_light[3 * pixel + c] * open + still_.sun_light[3 * pixel + c] * lit;
    }
    if (lamp_ > 0) {
      const float lamp = lamp_ * (1.0F - static_cast<float>(contact_[pixel]) / 255.0F);
      for (std::size_t c = 0; c < 3; ++c) row_[out + c] += still_.lamp_light[3 * pixel + c] * lamp;
    }
    if (is_still) continue;
    Vec3 sum;
    int covered = 0;
    for (std::size_t s = 0; s < kSamples; ++s) {
      if (who[s] == 0) continue;
      ++covered;
      const double u = x + kOffsets[s].x;
      const double v = y + kOffsets[s].y;
      const auto depth = static_cast<double>(depth_[kSamples * pixel + s]);
      sum = sum + (who[s] >= kFirstLeaf ? shade(leaves_[who[s] - kFirstLeaf], s, u, v, depth, level)
                                        : shade(parts_[who[s] - 1U], s, u, v, depth, level));
    }
    const float still = static_cast<float>(static_cast<int>(kSamples) - covered) / kSamples;
    row_[out] = row_[out] * still + static_cast<float>(sum.x / kSamples);
    row_[out + 1] = row_[out + 1] * still + static_cast<float>(sum.y / kSamples);
    row_[out + 2] = row_[out + 2] * still + static_cast<float>(sum.z / kSamples);
  }
}

double View::still_inverse_depth(int x, int y) const noexcept {
  const float depth = still_.center_depth[index(x, y)];
  return depth < kSkyDepth ? 1.0 / static_cast<double>(depth) : 0.0;
}

View::Owner View::owner(int x, int y) const noexcept {
  const std::size_t pixel = index(x, y);
  const auto still = [&] { return Owner{-1, still_inverse_depth(x, y)}; };
  const auto [first, last] = row_span_[static_cast<std::size_t>(y)];
  if (x < first || x >= last) return still();
  constexpr int kNobody = -1;
  constexpr int kLeaves = -2;
  std::array<int, kSamples> actor{};
  for (std::size_t s = 0; s < kSamples; ++s) {
    const std::uint16_t who = who_[kSamples * pixel + s];
    actor[s] = who == 0 ? kNobody : (who >= kFirstLeaf ? kLeaves : parts_[who - 1U].actor);
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
  if (best.actor == kLeaves) return {-1, best.inverse_depth};
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
    sky += kLuma[c] * static_cast<double>(still_.sky_light[3 * pixel + c]);
    sun += kLuma[c] * static_cast<double>(still_.sun_light[3 * pixel + c]);
  }
  double lamp = 0;
  if (lamp_ > 0) {
    for (std::size_t c = 0; c < 3; ++c)
      lamp += kLuma[c] * static_cast<double>(lamp_ * still_.lamp_light[3 * pixel + c]);
  }
  int leaves = 0;
  for (std::size_t k = 0; k < kSamples; ++k) leaves += who_[kSamples * pixel + k] >= kFirstLeaf ? 1 : 0;
  if (2 * leaves >= static_cast<int>(kSamples)) return 0.0;
  const double lost = (sky + lamp) * (contact_[pixel] / 255.0) + sun * shadow(x, y, Shaders::kActors);
  if (!leaf_shadow_.empty()) sun *= 1.0 - shadow(x, y, Shaders::kLeaves);
  const double all = sky + sun + lamp;
  return all > 0 ? lost / all : 0.0;
}

}  // namespace stereotrack::capture::synthetic
