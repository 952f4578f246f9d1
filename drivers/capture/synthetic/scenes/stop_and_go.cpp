#include "drivers/capture/synthetic/scenes/stop_and_go.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scenes/acts.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kPrelude_s = 6.0;
constexpr double kLastExit_s = 39.0;
constexpr double kLongestHidden_s = 2.0;

class Casting : private Troupe {
 public:
  Casting(const Scene& yard, const Wardrobe& wardrobe, const Wardrobe& second, std::uint64_t key)
      : Troupe(yard, wardrobe, key, {-kPrelude_s, kLastExit_s}), second_(second) {}

  std::optional<std::vector<Actor>> draw() {
    const bool all = person(wear_.tall, 2, 4) && person(wear_.bystander, 4, 8) && person(second_.tall, 12, 15) &&
                     child() && cart(wear_.cart, 5, 8) && cart(second_.cart, 10, 15) && robot() && passer_by();
    if (!all) return std::nullopt;
    return cast_;
  }

 private:
  struct Stop {
    double near_z = 0;
    double far_z = 0;
    double reach = 0;  ///< half its width
    double speed = 1;  ///< [m/s]
    double least_s = 0;
    double most_s = 0;
  };
  /// Straight to a place in the picture, and on to either side.
  Path stop(const Stop& s) {
    const double z = at(s.near_z, s.far_z);
    // What the picture shows there is off_stage() without its margin.
    const double seen = 0.72 * (off_stage(z, 0) - 1.85) - s.reach;
    const Vec3 place{at(-seen, seen), 0, z};
    const double side = random_.sign();
    const double to = random_.chance(0.7) ? -side : side;
    const double in = at(s.near_z, s.far_z);
    const double out = at(s.near_z, s.far_z);
    const Vec3 from{side * off_stage(in, s.reach), 0, in};
    const Vec3 end{to * off_stage(out, s.reach), 0, out};
    const double before_m = length(place - from);
    Path::Timing timing;
    timing.speed_m_s = s.speed;
    timing.start_s = at(-4.0, 12.0);
    // The soft ends lose 0.3 s each.
    timing.pause_at_s = timing.start_s + before_m / s.speed - 0.3;
    timing.pause_s = at(s.least_s, s.most_s) + 0.6;
    return Path({from, place, end}, timing);
  }

  bool person(const std::array<int, 5>& wears, double least_s, double most_s) {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.6, 1.86), 0, 0}, wears);
      a.path = stop({5.2, 8.8, 0.5, at(1.1, 1.4), least_s, most_s});
      return a;
    });
  }
  bool child() {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.12, 1.28), 0, 0}, wear_.child);
      a.path = stop({5.2, 8.0, 0.4, at(1.1, 1.4), 6, 10});
      return a;
    });
  }
  bool cart(const std::array<int, 5>& looks, double least_s, double most_s) {
    return place([&] {
      Actor a = base(ActorKind::kCart, {at(0.34, 0.4), at(0.72, 0.85), at(0.55, 0.65)}, looks);
      a.path = stop({5.6, 8.6, 0.8, at(0.95, 1.25), least_s, most_s});
      return a;
    });
  }
  bool robot() {
    return place([&] {
      Actor a = base(ActorKind::kRobot, {at(0.95, 1.1), 0, 0}, wear_.robot);
      a.path = stop({5.6, 8.8, 0.4, at(0.75, 0.95), 8, 12});
      return a;
    });
  }
  bool passer_by() {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.62, 1.8), 0, 0}, second_.bystander);
      a.path = enter(
          {across({random_.sign(), {at(5.2, 8.8), at(5.2, 8.8), at(5.2, 8.8)}, 0.5}), at(2.0, 20.0), at(1.15, 1.4)});
      return a;
    });
  }

  const Wardrobe& second_;
};

bool keeps_promises(const Scene& yard, const std::vector<Actor>& cast_list) {
  const Survey s = survey(yard, cast_list, -kPrelude_s, kLastExit_s);
  return std::all_of(s.actors.begin(), s.actors.end(),
                     [](const Survey::PerActor& a) { return a.longest_hidden_s < kLongestHidden_s; });
}

}  // namespace

Scene make_stop_and_go(std::uint64_t seed) {
  Scene scene;
  scene.name = "stop-and-go";
  scene.seed = seed;
  Random random(seed * 1000003ULL + 701);
  build_yard(scene, random);
  const Wardrobe wardrobe = make_wardrobe(scene, random);
  const Wardrobe second = make_wardrobe(scene, random);
  hold_acts(scene, {kLastExit_s + kPrelude_s, kPrelude_s, 701, 8},
            [wardrobe, second](const Scene& yard, std::uint64_t key) -> std::optional<std::vector<Actor>> {
              std::optional<std::vector<Actor>> drawn = Casting(yard, wardrobe, second, key).draw();
              if (!drawn || !keeps_promises(yard, *drawn)) return std::nullopt;
              return drawn;
            });
  return scene;
}

}  // namespace stereotrack::capture::synthetic
