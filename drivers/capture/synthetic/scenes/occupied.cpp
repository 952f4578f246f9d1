#include "drivers/capture/synthetic/scenes/occupied.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kLastExit_s = 23.5;
constexpr double kPrelude_s = 6.0;
constexpr double kSettled_s = 1.0;  ///< standing ones are put up so long before the first frame, and come to rest
constexpr std::size_t kStanding = 6;
constexpr double kStandingGone_s = 13.2;
constexpr std::uint32_t kIdsAnAct = 16;

class Casting : private Troupe {
 public:
  Casting(const Scene& scene, const Wardrobe& wardrobe, std::uint64_t key)
      : Troupe(scene, wardrobe, key, {-kPrelude_s, kLastExit_s}) {
    for (std::size_t i = kStanding - 1; i > 0; --i) {
      std::swap(slots_[i], slots_[static_cast<std::size_t>(random_.below(static_cast<int>(i) + 1))]);
    }
  }

  /// Nothing when somebody finds no way. The first kStanding of the first act stand.
  std::optional<std::vector<Actor>> draw(bool first_act) {
    const bool standing = !first_act || (tall() && crate() && dog() && ball() && cart() && robot());
    if (!standing || !bystander() || !child() || !football()) return std::nullopt;
    return cast_;
  }

 private:
  struct Stand {
    double near_z = 0;
    double far_z = 0;
    double reach = 0;  ///< half its width
    double leaves_s = 0;
    double speed = 1;  ///< [m/s]
  };
  /// Stands in the slot's part of the picture, goes off to one side.
  void stand(Actor& a, std::size_t slot, const Stand& s) {
    const Vec3 spot{slots_[slot] + at(-0.25, 0.25), 0, at(s.near_z, s.far_z)};
    const double side = random_.sign();
    const double out = at(s.near_z, s.far_z);
    Path::Timing timing;
    timing.start_s = -kSettled_s;
    timing.speed_m_s = s.speed;
    timing.pause_at_s = -kSettled_s;
    timing.pause_s = s.leaves_s + kSettled_s;
    const double edge = side * off_stage(out, s.reach);
    a.path = Path({spot, {mix(spot.x, edge, 0.45), 0, mix(spot.z, out, 0.6)}, {edge, 0, out}}, timing);
    a.undecided_until_s = s.leaves_s;
  }

  bool tall() {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.74, 1.88), 0, 0}, wear_.tall);
      stand(a, 0, {5.8, 7.8, 0.5, at(0.4, 0.65), at(1.25, 1.5)});
      return a;
    });
  }
  bool crate() {
    return place([&] {
      Actor a = base(ActorKind::kCrate, {at(0.42, 0.5), at(0.9, 1.1), at(0.4, 0.48)}, wear_.crate);
      stand(a, 1, {5.4, 6.8, 0.9, at(1.0, 1.6), at(1.0, 1.3)});
      return a;
    });
  }
  bool dog() {
    return place([&] {
      Actor a = base(ActorKind::kDog, {at(0.58, 0.68), 0, 0}, wear_.dog);
      stand(a, 2, {5.6, 8.4, 0.6, at(2.5, 3.5), at(1.6, 2.1)});
      return a;
    });
  }
  bool ball() {
    return place([&] {
      Actor a = base(ActorKind::kBall, {at(0.24, 0.3), 0, 0}, {wear_.beach_ball, 0, 0, 0, 0});
      stand(a, 3, {5.4, 8.0, 0.3, at(2.3, 3.7), at(1.4, 1.9)});
      return a;
    });
  }
  bool cart() {
    return place([&] {
      Actor a = base(ActorKind::kCart, {at(0.34, 0.4), at(0.72, 0.85), at(0.55, 0.65)}, wear_.cart);
      stand(a, 4, {6.4, 8.6, 0.8, at(4.0, 5.3), at(1.1, 1.3)});
      return a;
    });
  }
  bool robot() {
    return place([&] {
      Actor a = base(ActorKind::kRobot, {at(0.95, 1.1), 0, 0}, wear_.robot);
      stand(a, 5, {6.6, 9.0, 0.4, at(7.4, 8.4), at(1.0, 1.2)});
      return a;
    });
  }
  bool bystander() {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.6, 1.74), 0, 0}, wear_.bystander);
      a.path = enter({across({random_.sign(), {at(6.4, 8.2), at(6.6, 9), at(6.4, 9), at(6.6, 8.6)}, 0.5}), at(1.2, 2.4),
                      at(1.1, 1.3), at(1.2, 2.6), at(3.8, 4.4)});
      return a;
    });
  }
  bool child() {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.12, 1.28), 0, 0}, wear_.child);
      const double side = random_.sign();
      const double in = at(5.8, 7.4);
      const double out = at(8.4, 9.2);
      const double turn = -side * at(0.0, 1.4);
      a.path = enter({{{side * off_stage(in, 0.4), 0, in},
                       {side * at(1.2, 2.2), 0, at(6.0, 7.4)},
                       {turn, 0, at(6.8, 8.0)},
                       {side * at(1.6, 2.6), 0, at(8.4, 9.2)},
                       {side * off_stage(out, 0.4), 0, out}},
                      at(4.0, 5.6),
                      at(1.2, 1.5)});
      return a;
    });
  }
  bool football() {
    return place([&] {
      Actor a = base(ActorKind::kBouncingBall, {0.115, 0, 0}, {wear_.football, 0, 0, 0, 0});
      a.throw_height = at(1.0, 1.6);
      a.path = enter(
          {across({random_.sign(), {at(5.4, 7.4), at(5.8, 8.2), at(6.2, 8.8)}, 0.2}), at(5.0, 9.0), at(2.3, 3.2)});
      return a;
    });
  }

  std::array<double, kStanding> slots_{-2.4, -1.45, -0.5, 0.5, 1.45, 2.4};  ///< x of whoever stands [m]
};

bool keeps_promises(const Scene& scene, const std::vector<Actor>& cast_list, bool first_act) {
  if (first_act) {
    const Survey start = survey(scene, cast_list, 0.0, 0.1);
    for (std::size_t i = 0; i < kStanding; ++i) {
      if (cast_list[i].path.end_s() > kStandingGone_s) return false;
      if (start.actors[i].largest_px < 350.0 || start.actors[i].hidden_s > 0) return false;
    }
    if (start.occlusions > 1) return false;
  }
  const Survey whole = survey(scene, cast_list, 0.0, 13.0);
  return std::all_of(whole.actors.begin(), whole.actors.end(),
                     [](const Survey::PerActor& a) { return a.seconds_seen > 1.3 && a.hidden_s < 2.0; });
}

}  // namespace

Scene make_occupied(std::uint64_t seed) {
  Scene scene;
  scene.name = "occupied";
  scene.seed = seed;
  Random random(seed * 1000003ULL + 211);
  build_yard(scene, random);
  const Wardrobe wardrobe = make_wardrobe(scene, random);
  scene.act_s = kPrelude_s + kLastExit_s;
  scene.prelude_s = kPrelude_s;

  Scene yard = scene;  // for planning, without a cast of its own
  scene.cast = [yard = std::move(yard), wardrobe, seed](std::uint32_t act) {
    for (std::uint64_t attempt = 0; attempt < 400; ++attempt) {
      const std::uint64_t key = mix_bits((seed + 211) ^ mix_bits(act * 1000ULL + attempt));
      std::optional<std::vector<Actor>> drawn = Casting(yard, wardrobe, key).draw(act == 0);
      if (!drawn || !keeps_promises(yard, *drawn, act == 0)) continue;
      for (Actor& actor : *drawn) {
        actor.id += act * kIdsAnAct;
        actor.path.delay(act * yard.act_s);
      }
      return *drawn;
    }
    throw std::runtime_error("synthetic:occupied: seed " + std::to_string(seed) + " finds no cast; take another seed");
  };
  return scene;
}

}  // namespace stereotrack::capture::synthetic
