#include "drivers/capture/synthetic/scenes/far.hpp"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scenes/acts.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kPrelude_s = 8.0;
constexpr double kLastExit_s = 30.0;
constexpr double kPromise_s = 20.0;
constexpr double kLeastSeen_s = 3.0;
constexpr double kHalf_px = 3.0;  ///< radius in the picture

class Casting : private Troupe {
 public:
  Casting(const Scene& yard, const Wardrobe& wardrobe, const std::vector<int>& prints, std::uint64_t key)
      : Troupe(yard, wardrobe, key, {-kPrelude_s, kLastExit_s}), rig_(yard.rig), prints_(prints) {}

  std::optional<std::vector<Actor>> draw() {
    const bool all =
        roller() && roller() && roller() && roller() && bouncer() && bouncer() && balloon() && balloon() && balloon();
    if (!all) return std::nullopt;
    return cast_;
  }

 private:
  /// What is kHalf_px there.
  [[nodiscard]] double radius(double y, double z) const {
    const double depth = rig_.cos_pitch * z + rig_.sin_pitch * (rig_.height_m - y);
    return kHalf_px * depth / (rig_.focal_widths * 640.0);
  }
  [[nodiscard]] std::array<int, 5> print() const { return {prints_[cast_.size() % prints_.size()], 0, 0, 0, 0}; }

  bool roller() {
    return place([&] {
      const double z = at(12.1, 12.6);
      Actor a = base(ActorKind::kBall, {radius(0, z), 0, 0}, print());
      a.path = enter({across({random_.sign(), {z, z + at(-0.1, 0.1), z}, 0.1}), at(-4.0, 8.0), at(0.5, 1.5)});
      return a;
    });
  }
  bool bouncer() {
    return place([&] {
      const double z = at(12.1, 12.6);
      Actor a = base(ActorKind::kBouncingBall, {radius(0.4, z), 0, 0}, print());
      a.throw_height = at(0.8, 1.6);
      a.path = enter({across({random_.sign(), {z, z + at(-0.1, 0.1), z}, 0.1}), at(1.0, 12.0), at(1.4, 2.2)});
      return a;
    });
  }
  bool balloon() {
    return place([&] {
      const double z = at(23.0, 27.5);
      const double y = at(4.1, 5.0);
      Actor a = base(ActorKind::kBall, {radius(y, z), 0, 0}, print());
      std::vector<Vec3> points = across({random_.sign(), {z, z, z, z}, 0.3});
      for (Vec3& p : points) p.y = y + at(-0.25, 0.25);
      a.path = enter({std::move(points), at(-3.0, 5.0), at(1.2, 2.4)});
      return a;
    });
  }

  const Rig& rig_;
  const std::vector<int>& prints_;
};

bool keeps_promises(const Scene& yard, const std::vector<Actor>& cast_list) {
  const Survey s = survey(yard, cast_list, 0.0, kPromise_s, {0.1});
  return std::all_of(s.actors.begin(), s.actors.end(),
                     [](const Survey::PerActor& a) { return a.seconds_seen > 1.3 * kLeastSeen_s; });
}

}  // namespace

Scene make_far(std::uint64_t seed) {
  Scene scene;
  scene.name = "far";
  scene.seed = seed;
  Random random(seed * 1000003ULL + 907);
  build_yard(scene, random);
  const Wardrobe wardrobe = make_wardrobe(scene, random);
  std::vector<int> prints{wardrobe.small_ball, wardrobe.football};
  for (int i = 0; i < 4; ++i) {
    Material print{Pattern::kPlain, print_colour(random), {}, {}, 1};
    print.seed = static_cast<std::uint32_t>(random.bits());
    scene.materials.push_back(print);
    prints.push_back(static_cast<int>(scene.materials.size()) - 1);
  }
  hold_acts(scene, {kLastExit_s + kPrelude_s, kPrelude_s, 907, 9},
            [wardrobe, prints](const Scene& yard, std::uint64_t key) -> std::optional<std::vector<Actor>> {
              std::optional<std::vector<Actor>> drawn = Casting(yard, wardrobe, prints, key).draw();
              if (!drawn || !keeps_promises(yard, *drawn)) return std::nullopt;
              return drawn;
            });
  return scene;
}

}  // namespace stereotrack::capture::synthetic
