#include "drivers/capture/synthetic/actor.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/core/pinned_math.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

/// x to the right of the heading, y up, z along the heading.
Axes facing(Vec3 heading) noexcept { return {{heading.z, 0, -heading.x}, {0, 1, 0}, heading}; }

Axes turned_about_y(const Axes& a, double angle) noexcept {
  const double c = pinned_cos(angle);
  const double s = pinned_sin(angle);
  return {a.x * c - a.z * s, a.y, a.x * s + a.z * c};
}

/// Rolled forward: the top moves along z.
Axes rolled(const Axes& a, double angle) noexcept {
  const double c = pinned_cos(angle);
  const double s = pinned_sin(angle);
  return {a.x, a.y * c + a.z * s, a.z * c - a.y * s};
}

/// Builds shapes from points in the actor's own axes.
class Body {
 public:
  Body(PosedActor& out, Vec3 foot, const Axes& axes) noexcept : out_(out), foot_(foot), axes_(axes) {}

  [[nodiscard]] Vec3 world(Vec3 p) const noexcept { return foot_ + axes_.to_world(p); }
  [[nodiscard]] const Axes& axes() const noexcept { return axes_; }
  void limb(Vec3 a, Vec3 b, double radius, int material) const {
    out_.shapes.push_back(capsule(world(a), world(b), radius, axes_.x, material));
  }
  void rod(Vec3 a, Vec3 b, double radius, Vec3 side, int material) const {
    out_.shapes.push_back(cylinder(world(a), world(b), radius, side, material));
  }
  void egg(Vec3 center, Vec3 radii, int material) const {
    out_.shapes.push_back(ellipsoid(world(center), axes_, radii, material));
  }
  void block(Vec3 center, Vec3 half, int material) const {
    out_.shapes.push_back(box(world(center), axes_, half, material));
  }
  /// Dark under it, as if a sphere lay there.
  void contact(Vec3 center, double radius) const {
    out_.contacts.push_back(ellipsoid(world(center), axes_, {radius, radius, radius}, 0));
  }

 private:
  PosedActor& out_;
  Vec3 foot_;
  Axes axes_;
};

/// A point at `distance` from `from`, `angle` forward of straight down.
Vec3 hang(Vec3 from, double distance, double angle) noexcept {
  return from + Vec3{0, -distance * pinned_cos(angle), distance * pinned_sin(angle)};
}

/// materials: shirt, trousers, skin, hair, shoes.
void pose_walker(const Actor& actor, const Place3& place, PosedActor& out) {
  const double s = actor.size.x / 1.75;
  const double angle = actor.phase + kTurn * place.travelled / (1.45 * s);
  const double swing = 0.08 + 0.36 * place.pace;
  struct Leg {
    double thigh, shin;
  };
  const auto leg = [&](double a) {
    const double forward = std::max(0.0, pinned_cos(a));  // > 0 while the foot is off the floor
    return Leg{swing * pinned_sin(a), swing * pinned_sin(a) - 0.08 - 0.95 * place.pace * forward * forward};
  };
  const Leg left = leg(angle);
  const Leg right = leg(angle + std::numbers::pi);
  constexpr double kThigh = 0.44;
  constexpr double kShin = 0.43;
  constexpr double kAnkle = 0.075;
  const auto reach = [&](const Leg& l) { return s * (kThigh * pinned_cos(l.thigh) + kShin * pinned_cos(l.shin)); };
  // The longer leg stands on the floor; the hip rides on it.
  const double hip = std::max(reach(left), reach(right)) + kAnkle * s;
  const Body body(out, place.position, facing(place.heading));

  const auto draw_leg = [&](const Leg& l, double side) {
    const Vec3 top{side * 0.09 * s, hip, 0};
    const Vec3 knee = hang(top, kThigh * s, l.thigh);
    const Vec3 ankle = hang(knee, kShin * s, l.shin);
    body.limb(top, knee, 0.082 * s, actor.materials[1]);
    body.limb(knee, ankle, 0.058 * s, actor.materials[1]);
    const Vec3 heel = ankle + Vec3{0, -0.03 * s, -0.03 * s};
    body.limb(heel, hang(heel, 0.17 * s, 0.5 * std::numbers::pi + 0.6 * l.shin), 0.045 * s, actor.materials[4]);
    body.contact(heel + Vec3{0, 0.08 * s, 0.06 * s}, 0.12 * s);
  };
  draw_leg(left, -1.0);
  draw_leg(right, 1.0);

  const double lean = 0.05 * place.pace;
  const double shoulder = hip + 0.52 * s;
  body.egg({0, hip + 0.03 * s, 0}, {0.165 * s, 0.13 * s, 0.125 * s}, actor.materials[1]);
  body.egg({0, hip + 0.29 * s, lean * 0.3 * s}, {0.185 * s, 0.31 * s, 0.13 * s}, actor.materials[0]);
  body.limb({-0.14 * s, shoulder - 0.02 * s, lean * 0.5 * s}, {0.14 * s, shoulder - 0.02 * s, lean * 0.5 * s},
            0.075 * s, actor.materials[0]);
  body.limb({0, shoulder, lean * 0.5 * s}, {0, shoulder + 0.1 * s, lean * 0.6 * s}, 0.055 * s, actor.materials[2]);
  body.egg({0, shoulder + 0.2 * s, lean * 0.8 * s + 0.015 * s}, {0.082 * s, 0.115 * s, 0.1 * s}, actor.materials[2]);
  body.egg({0, shoulder + 0.235 * s, lean * 0.8 * s - 0.012 * s}, {0.09 * s, 0.1 * s, 0.105 * s}, actor.materials[3]);
  const auto draw_arm = [&](double side, double a) {
    const double upper = 0.85 * swing * pinned_sin(a);
    const Vec3 top{side * 0.2 * s, shoulder - 0.03 * s, lean * 0.5 * s};
    const Vec3 elbow = hang(top, 0.28 * s, upper) + Vec3{side * 0.03 * s, 0, 0};
    const Vec3 wrist = hang(elbow, 0.25 * s, upper + 0.25 + 0.25 * place.pace);
    body.limb(top, elbow, 0.052 * s, actor.materials[0]);
    body.limb(elbow, wrist, 0.043 * s, actor.materials[0]);
    body.egg(hang(wrist, 0.06 * s, upper + 0.3), {0.035 * s, 0.06 * s, 0.045 * s}, actor.materials[2]);
  };
  draw_arm(-1.0, angle + std::numbers::pi);
  draw_arm(1.0, angle);
}

/// materials: coat, ears and tail, legs.
void pose_dog(const Actor& actor, const Place3& place, PosedActor& out) {
  const double s = actor.size.x / 0.62;
  const double angle = actor.phase + kTurn * place.travelled / (0.75 * s);
  const double belly = 0.40 * s + 0.012 * s * pinned_sin(2.0 * angle);
  const Body body(out, place.position, facing(place.heading));
  body.limb({0, belly, -0.26 * s}, {0, belly + 0.02 * s, 0.2 * s}, 0.125 * s, actor.materials[0]);
  body.egg({0, belly + 0.02 * s, 0.22 * s}, {0.14 * s, 0.16 * s, 0.17 * s}, actor.materials[0]);
  body.limb({0, belly + 0.06 * s, 0.28 * s}, {0, belly + 0.2 * s, 0.42 * s}, 0.07 * s, actor.materials[0]);
  body.egg({0, belly + 0.24 * s, 0.46 * s}, {0.08 * s, 0.085 * s, 0.11 * s}, actor.materials[0]);
  body.limb({0, belly + 0.21 * s, 0.52 * s}, {0, belly + 0.19 * s, 0.62 * s}, 0.042 * s, actor.materials[1]);
  for (const double side : {-1.0, 1.0}) {
    body.egg({side * 0.06 * s, belly + 0.32 * s, 0.42 * s}, {0.025 * s, 0.06 * s, 0.035 * s}, actor.materials[1]);
    for (const double end : {-1.0, 1.0}) {
      const double a = angle + (side * end > 0 ? 0.0 : std::numbers::pi);  // a trot: diagonal legs together
      const double upper = 0.5 * pinned_sin(a);
      const double bend = 0.75 * std::max(0.0, pinned_cos(a));
      const Vec3 hip{side * 0.08 * s, belly - 0.02 * s, end > 0 ? 0.2 * s : -0.27 * s};
      const Vec3 knee = hang(hip, 0.19 * s, upper);
      // The paw of a standing leg touches the floor whatever the angles.
      Vec3 paw = hang(knee, 0.17 * s, upper - bend);
      if (bend < 0.05) paw.y = 0.03 * s;
      paw.y = std::max(paw.y, 0.03 * s);
      body.limb(hip, knee, 0.05 * s, actor.materials[0]);
      body.limb(knee, paw, 0.032 * s, actor.materials[2]);
    }
  }
  const double wag = 0.10 * s * pinned_sin(1.7 * angle);
  body.limb({0, belly + 0.06 * s, -0.36 * s}, {wag, belly + 0.26 * s, -0.52 * s}, 0.026 * s, actor.materials[1]);
  body.contact({0, 0.12 * s, 0.2 * s}, 0.13 * s);
  body.contact({0, 0.12 * s, -0.25 * s}, 0.13 * s);
}

/// materials: platform, load, tyres, metal, second load.
void pose_cart(const Actor& actor, const Place3& place, PosedActor& out) {
  const Vec3 h = actor.size;
  const Body body(out, place.position, facing(place.heading));
  constexpr double kWheel = 0.12;
  const double deck = 2.0 * kWheel + 0.07;
  body.block({0, deck, 0}, {h.x, 0.05, h.z}, actor.materials[0]);
  const double load = 0.5 * (h.y - deck - 0.05);
  body.block({0, deck + 0.05 + load, 0.22 * h.z}, {0.82 * h.x, load, 0.6 * h.z}, actor.materials[1]);
  body.block({0.1 * h.x, deck + 0.05 + 0.55 * load, -0.66 * h.z}, {0.6 * h.x, 0.55 * load, 0.22 * h.z},
             actor.materials[4]);
  for (const double side : {-1.0, 1.0}) {
    body.limb({side * 0.85 * h.x, deck, -h.z}, {side * 0.85 * h.x, 0.95, -1.12 * h.z}, 0.022, actor.materials[3]);
    for (const double end : {-1.0, 1.0}) {
      const Axes wheel = rolled(body.axes(), place.travelled / kWheel);
      const Vec3 hub = {side * 0.86 * h.x, kWheel, end * 0.74 * h.z};
      body.rod(hub - Vec3{0.035, 0, 0}, hub + Vec3{0.035, 0, 0}, kWheel, wheel.y, actor.materials[2]);
    }
  }
  body.limb({-0.85 * h.x, 0.95, -1.12 * h.z}, {0.85 * h.x, 0.95, -1.12 * h.z}, 0.024, actor.materials[3]);
  for (const double z : {-0.6, 0.0, 0.6}) body.contact({0, 0.25, z * h.z}, 0.3);
}

/// materials: all sides.
void pose_crate(const Actor& actor, const Place3& place, double t_s, PosedActor& out) {
  const Vec3 h = actor.size;
  const Body body(out, place.position,
                  turned_about_y(facing(place.heading), actor.phase + actor.spin * (t_s - actor.path.start_s())));
  body.block({0, 0.06 + 0.5 * h.y, 0}, {h.x, 0.5 * h.y, h.z}, actor.materials[0]);
  body.block({0, 0.05, 0}, {0.85 * h.x, 0.045, 0.85 * h.z}, actor.materials[1]);
  for (const double x : {-0.5, 0.5}) {
    for (const double z : {-0.5, 0.5}) body.contact({x * h.x, 0.35, z * h.z}, 0.42);
  }
}

/// materials: body, dome, base, eye.
void pose_robot(const Actor& actor, const Place3& place, double t_s, PosedActor& out) {
  const double h = actor.size.x;
  const double r = 0.29 * h;
  const Body body(out, place.position,
                  turned_about_y(facing(place.heading), actor.phase + actor.spin * (t_s - actor.path.start_s())));
  body.rod({0, 0.015, 0}, {0, 0.14 * h, 0}, 1.08 * r, body.axes().x, actor.materials[2]);
  body.rod({0, 0.14 * h, 0}, {0, 0.72 * h, 0}, r, body.axes().x, actor.materials[0]);
  body.egg({0, 0.72 * h, 0}, {r, 0.26 * h, r}, actor.materials[1]);
  body.egg({0, 0.82 * h, 0.72 * r}, {0.3 * r, 0.07 * h, 0.3 * r}, actor.materials[3]);
  body.contact({0, 0.8 * r, 0}, 1.1 * r);
}

/// materials: body, arms, rotors.
void pose_drone(const Actor& actor, const Place3& place, double t_s, PosedActor& out) {
  const double s = actor.size.x / 0.8;  // span
  const Body body(out, place.position, turned_about_y(facing(place.heading), actor.phase + actor.spin * t_s));
  body.egg({0, 0, 0}, {0.17 * s, 0.1 * s, 0.22 * s}, actor.materials[0]);
  body.egg({0, -0.1 * s, 0.1 * s}, {0.06 * s, 0.06 * s, 0.06 * s}, actor.materials[1]);
  for (const double x : {-1.0, 1.0}) {
    for (const double z : {-1.0, 1.0}) {
      const Vec3 tip{x * 0.28 * s, 0.04 * s, z * 0.28 * s};
      body.limb({0, 0.02 * s, 0}, tip, 0.028 * s, actor.materials[1]);
      body.rod(tip + Vec3{0, 0.035 * s, 0}, tip + Vec3{0, 0.055 * s, 0}, 0.15 * s, body.axes().x, actor.materials[2]);
    }
    body.limb({x * 0.15 * s, -0.2 * s, -0.15 * s}, {x * 0.15 * s, -0.2 * s, 0.15 * s}, 0.015 * s, actor.materials[1]);
    body.limb({x * 0.15 * s, -0.2 * s, 0}, {x * 0.08 * s, -0.05 * s, 0}, 0.015 * s, actor.materials[1]);
  }
}

/// Height of a ball's lowest point after `t` seconds: parabolas, each bounce with 0.8 of the speed before.
double bounce_height(double top_m, double t) noexcept {
  constexpr double kGravity = 9.81;
  constexpr double kRestitution = 0.8;
  double speed = std::sqrt(2.0 * kGravity * top_m);
  for (int i = 0; i < 40; ++i) {
    const double flight = 2.0 * speed / kGravity;
    if (t <= flight) return t * (speed - 0.5 * kGravity * t);
    t -= flight;
    speed *= kRestitution;
    if (speed < 0.35) break;
  }
  return 0.0;
}

/// materials: all over.
void pose_ball(const Actor& actor, const Place3& place, double t_s, PosedActor& out) {
  const double r = actor.size.x;
  double above = r;
  if (actor.kind == ActorKind::kBouncingBall) above += bounce_height(actor.throw_height, t_s - actor.path.start_s());
  const Axes tilted = rolled(turned_about_y({}, actor.phase), actor.phase);
  const Axes base = facing(place.heading);
  const Axes roll = rolled(base, place.travelled / r);
  const Axes axes{roll.to_world(tilted.x), roll.to_world(tilted.y), roll.to_world(tilted.z)};
  const Vec3 center = place.position + Vec3{0, above, 0};
  out.shapes.push_back(ellipsoid(center, axes, {r, r, r}, actor.materials[0]));
  out.contacts.push_back(out.shapes.back());
}

}  // namespace

double Actor::footprint() const noexcept {
  switch (kind) {
    case ActorKind::kBall:
    case ActorKind::kBouncingBall: return size.x;
    case ActorKind::kCrate: return std::sqrt(size.x * size.x + size.z * size.z);
    case ActorKind::kCart: return std::sqrt(size.x * size.x + 1.25 * size.z * size.z);
    case ActorKind::kRobot: return 0.32 * size.x;
    case ActorKind::kWalker: return 0.22 * size.x;
    case ActorKind::kDog: return 0.95 * size.x;
    case ActorKind::kDrone: return 0.55 * size.x;
  }
  return 1.0;
}

double Actor::height() const noexcept {
  switch (kind) {
    case ActorKind::kBall: return 2.0 * size.x;
    case ActorKind::kBouncingBall: return 2.0 * size.x + throw_height;
    case ActorKind::kCrate: return size.y + 0.1;
    case ActorKind::kCart: return std::max(size.y, 1.0);
    case ActorKind::kRobot:
    case ActorKind::kWalker: return size.x;
    case ActorKind::kDog: return 1.2 * size.x;
    case ActorKind::kDrone: return 0.15 * size.x;
  }
  return 1.0;
}

bool pose(const Actor& actor, double t_s, PosedActor& out) {
  out.shapes.clear();
  out.contacts.clear();
  out.id = actor.id;
  out.undecided = t_s < actor.undecided_until_s;
  if (t_s < actor.path.start_s() || t_s > actor.path.end_s()) return false;
  const Place3 place = actor.path.at(t_s);
  switch (actor.kind) {
    case ActorKind::kBall:
    case ActorKind::kBouncingBall: pose_ball(actor, place, t_s, out); break;
    case ActorKind::kCrate: pose_crate(actor, place, t_s, out); break;
    case ActorKind::kRobot: pose_robot(actor, place, t_s, out); break;
    case ActorKind::kCart: pose_cart(actor, place, out); break;
    case ActorKind::kWalker: pose_walker(actor, place, out); break;
    case ActorKind::kDog: pose_dog(actor, place, out); break;
    case ActorKind::kDrone: pose_drone(actor, place, t_s, out); break;
  }
  Vec3 low = out.shapes[0].center;
  Vec3 high = low;
  for (const Shape& s : out.shapes) {
    low = {std::min(low.x, s.center.x), std::min(low.y, s.center.y), std::min(low.z, s.center.z)};
    high = {std::max(high.x, s.center.x), std::max(high.y, s.center.y), std::max(high.z, s.center.z)};
  }
  out.center = (low + high) * 0.5;
  out.radius = 0;
  for (const Shape& s : out.shapes)
    out.radius = std::max(out.radius, length(s.center - out.center) + s.bounding_radius);
  return true;
}

}  // namespace stereotrack::capture::synthetic
