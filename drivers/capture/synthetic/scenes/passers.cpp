#include "drivers/capture/synthetic/scenes/passers.hpp"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kLastExit_s = 23.5;
constexpr double kPrelude_s = 6.0;
constexpr double kPromise_s = 13.0;

class Casting : private Troupe {
 public:
  Casting(const Scene& scene, const Wardrobe& wardrobe, const Passers& passers, std::uint64_t key)
      : Troupe(scene, wardrobe, key, {-kPrelude_s, kLastExit_s}), passers_(passers) {}

  /// Nothing when somebody finds no way.
  std::optional<std::vector<Actor>> draw() {
    const bool all = robot() && crate() && tall() && bystander() && child() && cart() && dog() && ball() && football();
    if (!all) return std::nullopt;
    return cast_;
  }

 private:
  /// A place between near (0) and far (1).
  double depth(double low, double high) { return mix(passers_.near_z, passers_.far_z, at(low, high)); }

  bool robot() {
    return place([&] {
      Actor a = base(ActorKind::kRobot, {at(0.95, 1.1), 0, 0}, wear_.robot);
      a.spin = either_way(0.25, 0.5);
      a.path = enter(
          {across({random_.sign(), {depth(0.5, 1), depth(0.4, 1), depth(0.5, 1)}, 0.4}), at(-1.5, 0.0), at(0.7, 0.85)});
      return a;
    });
  }
  bool crate() {
    return place([&] {
      Actor a = base(ActorKind::kCrate, {at(0.42, 0.5), at(0.9, 1.1), at(0.4, 0.48)}, wear_.crate);
      a.spin = either_way(0.3, 0.6);
      a.path = enter(
          {across({random_.sign(), {depth(0, 0.3), depth(0, 0.2), depth(0, 0.3)}, 0.9}), at(5.5, 7.0), at(0.95, 1.15)});
      return a;
    });
  }
  bool tall() {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.74, 1.88), 0, 0}, wear_.tall);
      a.path = enter({across({random_.sign(), {depth(0.1, 0.6), depth(0.1, 0.7), depth(0.1, 0.8)}, 0.5}), at(0.4, 1.4),
                      at(1.2, 1.45)});
      return a;
    });
  }
  bool bystander() {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.6, 1.74), 0, 0}, wear_.bystander);
      a.path = enter({across({random_.sign(), {depth(0.5, 1), depth(0.6, 1), depth(0.5, 1)}, 0.5}), at(2.8, 4.2),
                      at(1.1, 1.35), at(1.8, 3.0), at(1.2, 2.0)});
      return a;
    });
  }
  bool child() {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.12, 1.28), 0, 0}, wear_.child);
      a.path = enter(
          {across({random_.sign(), {depth(0.2, 1), depth(0.3, 1), depth(0.4, 1)}, 0.4}), at(5.8, 8.2), at(1.15, 1.4)});
      return a;
    });
  }
  bool cart() {
    return place([&] {
      Actor a = base(ActorKind::kCart, {at(0.34, 0.4), at(0.72, 0.85), at(0.55, 0.65)}, wear_.cart);
      a.path = enter({across({random_.sign(), {depth(0.2, 0.8), depth(0.2, 0.8), depth(0.2, 0.8)}, 0.8}), at(1.8, 3.6),
                      at(1.05, 1.35)});
      return a;
    });
  }
  bool dog() {
    return place([&] {
      Actor a = base(ActorKind::kDog, {at(0.58, 0.68), 0, 0}, wear_.dog);
      a.path =
          enter({across({random_.sign(), {depth(0, 1), depth(0, 1), depth(0, 1)}, 0.6}), at(2.5, 9.0), at(1.5, 2.1)});
      return a;
    });
  }
  bool ball() {
    return place([&] {
      Actor a = base(ActorKind::kBall, {at(0.24, 0.3), 0, 0}, {wear_.beach_ball, 0, 0, 0, 0});
      a.path = enter(
          {across({random_.sign(), {depth(0, 0.8), depth(0, 0.9), depth(0.2, 1)}, 0.3}), at(3.5, 9.5), at(1.2, 1.9)});
      return a;
    });
  }
  bool football() {
    return place([&] {
      Actor a = base(ActorKind::kBouncingBall, {0.115, 0, 0}, {wear_.football, 0, 0, 0, 0});
      a.throw_height = at(1.0, 1.6);
      a.path = enter({across({random_.sign(), {depth(0, 0.6), depth(0.1, 0.8), depth(0.3, 1)}, 0.2}), at(6.5, 10.5),
                      at(2.3, 3.2)});
      return a;
    });
  }

  Passers passers_;
};

bool keeps_promises(const Scene& scene, const std::vector<Actor>& cast_list) {
  const Survey s = survey(scene, cast_list, 0.0, kPromise_s);
  return std::all_of(s.actors.begin(), s.actors.end(),
                     [](const Survey::PerActor& a) { return a.seconds_seen > 1.3 && a.hidden_s < 2.0; });
}

}  // namespace

void let_pass(Scene& scene, const Wardrobe& wardrobe, const Passers& passers) {
  scene.act_s = kPrelude_s + kLastExit_s;
  scene.prelude_s = kPrelude_s;
  Scene yard = scene;  // for planning, without a cast of its own
  scene.cast = [yard = std::move(yard), wardrobe, passers](std::uint32_t act) {
    for (std::uint64_t attempt = 0; attempt < 1000; ++attempt) {
      const std::uint64_t key = mix_bits((yard.seed + passers.salt) ^ mix_bits(act * 1000ULL + attempt));
      std::optional<std::vector<Actor>> drawn = Casting(yard, wardrobe, passers, key).draw();
      if (!drawn || !keeps_promises(yard, *drawn)) continue;
      for (Actor& actor : *drawn) {
        actor.id += act * static_cast<std::uint32_t>(drawn->size());
        actor.path.delay(act * yard.act_s);
      }
      return *drawn;
    }
    throw std::runtime_error("synthetic:" + yard.name + ": seed " + std::to_string(yard.seed) +
                             " finds no cast; take another seed");
  };
}

}  // namespace stereotrack::capture::synthetic
