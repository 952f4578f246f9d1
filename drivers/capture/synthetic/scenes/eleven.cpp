#include "drivers/capture/synthetic/scenes/eleven.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>

#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kAct_s = 20.0;       ///< what a cast's promises are about
constexpr double kLastExit_s = 23.5;  ///< everybody has left by then
constexpr double kPrelude_s = 6.0;    ///< the first one starts at most this much before an act

/// The eleven: see the header.
class Casting : private Troupe {
 public:
  Casting(const Scene& scene, const Wardrobe& wardrobe, std::uint64_t key)
      : Troupe(scene, wardrobe, key, {-kPrelude_s, kLastExit_s}) {}

  /// Nothing when somebody finds no way.
  std::optional<std::vector<Actor>> draw() {
    const bool all = robot() && crate() && tall_walker() && bystander() && child() && cart() && dog() && beach_ball() &&
                     football() && small_ball() && drone();
    if (!all) return std::nullopt;
    return cast_;
  }

 private:
  /// The one that is there from the first frame on.
  bool robot() {
    return place([&] {
      Actor a = base(ActorKind::kRobot, {at(0.95, 1.1), 0, 0}, wear_.robot);
      a.spin = either_way(0.25, 0.5);
      a.path = enter({across({random_.sign(), {at(7.6, 8.4), at(6.8, 8.4), at(7.0, 8.6), at(7.6, 8.6)}, 0.4}),
                      at(-3.0, -1.8), at(0.62, 0.72)});
      return a;
    });
  }
  bool crate() {
    return place([&] {
      Actor a = base(ActorKind::kCrate, {at(0.5, 0.54), at(1.12, 1.2), at(0.45, 0.5)}, wear_.crate);
      a.spin = either_way(0.3, 0.6);
      a.path = enter(
          {across({random_.sign(), {at(5.0, 5.3), at(4.85, 5.1), at(4.9, 5.3)}, 0.9}), at(7.5, 10.5), at(0.85, 1.05)});
      return a;
    });
  }
  bool tall_walker() {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.74, 1.88), 0, 0}, wear_.tall);
      a.path = enter({across({random_.sign(), {at(5.6, 7), at(5.8, 7), at(6, 7.5), at(6, 8)}, 0.5}), at(1.2, 2.4),
                      at(1.15, 1.45)});
      return a;
    });
  }
  bool bystander() {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.6, 1.74), 0, 0}, wear_.bystander);
      a.path = enter({across({random_.sign(), {at(7, 8.2), at(7.6, 9), at(7, 9), at(6.6, 8.6)}, 0.5}), at(3.0, 6.0),
                      at(1.05, 1.3), at(3.0, 4.5), at(1.2, 2.0)});
      return a;
    });
  }
  /// In, about, and out on the side it came from.
  bool child() {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.12, 1.28), 0, 0}, wear_.child);
      const double side = random_.sign();
      const double in = at(6.8, 7.8);
      const double out = at(8.7, 9.3);
      const double turn = -side * at(0.4, 1.8);
      a.path = enter({{{side * off_stage(in, 0.4), 0, in},
                       {side * at(1.4, 2.4), 0, at(6.6, 7.8)},
                       {turn, 0, at(7.2, 8.2)},
                       {turn + side * at(0.2, 0.6), 0, at(8.8, 9.3)},
                       {side * at(1.8, 2.8), 0, at(8.6, 9.3)},
                       {side * off_stage(out, 0.4), 0, out}},
                      at(4.0, 7.5),
                      at(1.05, 1.3)});
      return a;
    });
  }
  bool cart() {
    return place([&] {
      Actor a = base(ActorKind::kCart, {at(0.34, 0.4), at(0.72, 0.85), at(0.55, 0.65)}, wear_.cart);
      a.path =
          enter({across({random_.sign(), {at(6, 7), at(6, 7.2), at(6.2, 7.4)}, 0.8}), at(10.0, 14.5), at(0.95, 1.3)});
      return a;
    });
  }
  bool dog() {
    return place([&] {
      Actor a = base(ActorKind::kDog, {at(0.58, 0.68), 0, 0}, wear_.dog);
      a.path = enter({across({random_.sign(), {at(5.6, 8.4), at(5.6, 8.8), at(5.8, 9), at(6, 8.8)}, 0.6}),
                      at(5.0, 14.5), at(1.5, 2.1)});
      return a;
    });
  }
  bool beach_ball() {
    return place([&] {
      Actor a = base(ActorKind::kBall, {at(0.24, 0.3), 0, 0}, {wear_.beach_ball, 0, 0, 0, 0});
      a.path =
          enter({across({random_.sign(), {at(5.4, 7.6), at(5.8, 8), at(6, 8.8)}, 0.3}), at(2.5, 14.0), at(1.2, 1.9)});
      return a;
    });
  }
  bool football() {
    return place([&] {
      Actor a = base(ActorKind::kBouncingBall, {0.115, 0, 0}, {wear_.football, 0, 0, 0, 0});
      a.throw_height = at(1.0, 1.7);
      a.path =
          enter({across({random_.sign(), {at(5.6, 7.4), at(6, 8.2), at(6.6, 8.8)}, 0.2}), at(3.0, 16.5), at(2.3, 3.2)});
      return a;
    });
  }
  /// Comes from behind the container and goes along the wall: the smallest in the picture.
  bool small_ball() {
    return place([&] {
      Actor a = base(ActorKind::kBall, {at(0.088, 0.092), 0, 0}, {wear_.small_ball, 0, 0, 0, 0});
      const double side = random_.sign();
      const double z = at(12.35, 12.6);
      a.path = enter(
          {across({side, {z, z + at(-0.1, 0.1), at(12.3, 12.6), at(12.3, 12.6)}, 0.2}), at(2.0, 8.0), at(1.15, 1.45)});
      return a;
    });
  }
  bool drone() {
    return place([&] {
      Actor a = base(ActorKind::kDrone, {at(0.75, 0.9), 0, 0}, wear_.drone);
      a.spin = at(-0.3, 0.3);
      const double side = random_.sign();
      const double in = at(6.6, 8.4);
      const double out = at(6.6, 9);
      a.path = enter({{{side * off_stage(in, 0.6), at(2.05, 2.5), in},
                       {side * at(1.4, 2.6), at(2.05, 2.5), at(6.2, 8)},
                       {side * at(-0.8, 0.4), at(2.05, 2.5), at(8, 9.6)},
                       {-side * at(1.4, 2.0), at(2.05, 2.5), at(6.4, 8)},
                       {-side * off_stage(out, 0.6), at(2.05, 2.5), out}},
                      at(1.5, 8.0),
                      at(0.85, 1.15)});
      return a;
    });
  }
};

/// The picture of the whole small ball where it is farthest, at 640 x 480 [px].
double smallest_px(const Actor& ball) {
  double farthest = 0;
  for (double t = ball.path.start_s(); t < ball.path.end_s(); t += 0.2) {
    const Vec3 p = ball.path.at(t).position;
    if (std::abs(p.x) > 4.0) continue;
    farthest = std::max(farthest, 0.96 * p.z + 0.28 * (3.0 - ball.size.x));
  }
  if (farthest == 0) return kMiss;
  const double radius = 600.0 * ball.size.x / farthest;
  return std::numbers::pi * radius * radius;
}

bool keeps_promises(const Scene& scene, const std::vector<Actor>& cast_list) {
  constexpr std::size_t kCrateAt = 1;
  constexpr std::size_t kSmallBallAt = 9;
  if (smallest_px(cast_list[kSmallBallAt]) > 59.0) return false;
  const Survey s = survey(scene, cast_list, 0.0, kAct_s);
  if (s.occlusions < 8 || s.occlusions > 18 || s.pairs < 7) return false;
  if (s.actors[kCrateAt].largest_px < 20800.0 || s.actors[kCrateAt].largest_px > 28000.0) return false;
  for (std::size_t i = 0; i < s.actors.size(); ++i) {
    // The small ball spends some time behind the container.
    if (s.actors[i].seconds_seen < 2.5 || (i != kSmallBallAt && s.actors[i].hidden_s > 2.0)) return false;
  }
  return true;
}

}  // namespace

Scene make_eleven(std::uint64_t seed) {
  Scene scene;
  scene.name = "eleven";
  scene.seed = seed;
  Random random(seed * 1000003ULL + 11);
  build_yard(scene, random);
  const Wardrobe wardrobe = make_wardrobe(scene, random);
  scene.act_s = kPrelude_s + kLastExit_s;
  scene.prelude_s = kPrelude_s;

  Scene yard = scene;  // for planning, without a cast of its own
  scene.cast = [yard = std::move(yard), wardrobe, seed](std::uint32_t act) {
    // About one draw in three is kept: 400 are never needed.
    for (std::uint64_t attempt = 0; attempt < 400; ++attempt) {
      const std::uint64_t key = mix_bits(seed ^ mix_bits(act * 1000ULL + attempt));
      std::optional<std::vector<Actor>> drawn = Casting(yard, wardrobe, key).draw();
      if (!drawn || !keeps_promises(yard, *drawn)) continue;
      for (Actor& actor : *drawn) {
        actor.id += act * static_cast<std::uint32_t>(drawn->size());
        actor.path.delay(act * yard.act_s);
      }
      return *drawn;
    }
    throw std::runtime_error("synthetic:eleven: seed " + std::to_string(seed) + " finds no cast; take another seed");
  };
  return scene;
}

}  // namespace stereotrack::capture::synthetic
