#include "drivers/capture/synthetic/scenes/crossing.hpp"

#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scenes/acts.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kPrelude_s = 6.0;
constexpr double kLastExit_s = 27.0;
constexpr double kPromise_s = 22.0;
constexpr double kLongestHidden_s = 1.5;
constexpr SurveyDetail kDetail{1.0 / 20.0, 0.5};

enum class Meeting { kOpposite, kOvertaking, kStanding };

struct PairPlan {
  Meeting how = Meeting::kOpposite;
  double least_z = 0;  ///< of who is in front [m]
  double most_z = 0;
  bool same_clothes = false;
  double hidden_s = 0;       ///< who is behind, at least
  double most_hidden_s = 0;  ///< at most
};

constexpr std::array<PairPlan, 6> kPairs{{{Meeting::kOpposite, 4.9, 5.3, false, 0.1, 0.6},
                                          {Meeting::kOpposite, 6.2, 6.8, true, 0.1, 0.6},
                                          {Meeting::kOvertaking, 5.4, 6.0, false, 0.6, 1.0},
                                          {Meeting::kStanding, 5.2, 5.8, false, 0.2, 0.9},
                                          {Meeting::kOvertaking, 6.6, 7.2, true, 1.0, 1.5},
                                          {Meeting::kOpposite, 7.6, 8.0, true, 0.1, 0.6}}};

/// Shirt, trousers, skin, hair, shoes.
using Outfit = std::array<int, 5>;
using Outfits = std::array<Outfit, 5>;

/// Depth of the middle of a person who stands at z.
double depth_of(const Rig& rig, double z) { return rig.cos_pitch * z + rig.sin_pitch * (rig.height_m - 0.9); }

class Casting : private Troupe {
 public:
  Casting(const Scene& yard, const Wardrobe& wardrobe, const Outfits& outfits, std::uint64_t key)
      : Troupe(yard, wardrobe, key, {-kPrelude_s, kLastExit_s}), yard_(yard), outfits_(outfits) {
    for (std::size_t i = kPairs.size() - 1; i > 0; --i) {
      std::swap(turns_[i], turns_[static_cast<std::size_t>(random_.below(static_cast<int>(i) + 1))]);
    }
  }

  std::optional<std::vector<Actor>> draw() {
    for (std::size_t i = 0; i < kPairs.size(); ++i) {
      if (!pair(kPairs[i], 3.0 * (turns_[i] + 1))) return std::nullopt;
    }
    return cast_;
  }

 private:
  /// How near those of a pair come [m]: their arms and legs swing along their ways, not towards each other.
  static constexpr double kShoulders = -0.13;

  bool pair(const PairPlan& plan, double meet_s) {
    for (int attempt = 0; attempt < 60; ++attempt) {
      std::array<Actor, 2> two = draw_pair(plan, meet_s + at(-0.3, 0.3));
      bool fits = true;
      for (std::size_t i = 0; i < two.size(); ++i) {
        two[i].id = static_cast<std::uint32_t>(cast_.size() + i) + 1;
        fits = fits && two[i].path.start_s() >= -kPrelude_s && two[i].path.end_s() <= kLastExit_s &&
               !collides(yard_, two[i], cast_, 0.0);
      }
      if (!fits || collides(yard_, two[0], std::span(&two[1], 1), kShoulders)) continue;
      const double around_s = plan.how == Meeting::kOvertaking ? 3.0 : 1.2;
      const Survey s = survey(yard_, two, meet_s - around_s, meet_s + around_s, kDetail);
      const double hidden_s = s.actors[1].longest_hidden_s;
      if (hidden_s < plan.hidden_s || hidden_s > plan.most_hidden_s || s.actors[0].hidden_s > 0) continue;
      cast_.insert(cast_.end(), two.begin(), two.end());
      return true;
    }
    return false;
  }

  std::array<Actor, 2> draw_pair(const PairPlan& plan, double meet_s) {
    const int first = random_.below(static_cast<int>(outfits_.size()));
    const int other =
        (first + 1 + random_.below(static_cast<int>(outfits_.size()) - 1)) % static_cast<int>(outfits_.size());
    const Outfit& near_wears = outfits_[static_cast<std::size_t>(first)];
    const Outfit& far_wears = plan.same_clothes ? near_wears : outfits_[static_cast<std::size_t>(other)];
    Actor in_front = base(ActorKind::kWalker, {at(1.8, 1.92), 0, 0}, near_wears);
    Actor behind = base(ActorKind::kWalker, {at(1.5, 1.6), 0, 0}, far_wears);

    const double near_z = at(plan.least_z, plan.most_z);
    const double far_z = near_z + at(0.75, 0.95);
    const double closer = depth_of(yard_.rig, near_z);
    const double farther = depth_of(yard_.rig, far_z);
    const double near_x = at(-1.1, 1.1);
    const double far_x = near_x * farther / closer;
    const double side = random_.sign();
    double near_speed = at(0.85, 1.15);
    double far_speed = at(0.85, 1.15);
    if (plan.how == Meeting::kOvertaking) {
      // A body seen from the side is half hidden while the lines of sight pass within about 0.15 m of each other.
      const double wanted_s = at(plan.hidden_s, plan.most_hidden_s);
      const double slip = 0.3 / farther / wanted_s;
      near_speed = at(0.85, 1.1);
      far_speed = farther * (near_speed / closer + (random_.chance(0.5) ? slip : -slip));
    }
    const double far_side = plan.how == Meeting::kOpposite ? -side : side;
    const double stands_s = plan.how == Meeting::kStanding ? 2.0 : 0.0;
    in_front.path = through(side, near_x, near_z, near_speed, meet_s, stands_s);
    behind.path = through(far_side, far_x, far_z, far_speed, meet_s, 0);
    return {in_front, behind};
  }

  /// Straight across, at x in that moment; who stands does so around it.
  static Path through(double side, double x, double z, double speed, double when_s, double stands_s) {
    const double edge = off_stage(z, 0.5);
    Path::Timing timing;
    timing.speed_m_s = speed;
    timing.start_s = when_s - (edge - side * x) / speed - 0.5 * stands_s;
    if (stands_s > 0) {
      timing.pause_at_s = when_s - 0.5 * stands_s - 0.3;  // slowing down takes 0.6 s
      timing.pause_s = stands_s;
    }
    return Path({{side * edge, 0, z}, {x, 0, z}, {-side * edge, 0, z}}, timing);
  }

  const Scene& yard_;
  const Outfits& outfits_;
  std::array<int, kPairs.size()> turns_{0, 1, 2, 3, 4, 5};
};

bool keeps_promises(const Scene& yard, const std::vector<Actor>& cast_list) {
  const Survey s = survey(yard, cast_list, 0.0, kPromise_s, kDetail);
  if (s.occlusions < 15) return false;
  for (const Survey::PerActor& a : s.actors) {
    if (a.longest_hidden_s > kLongestHidden_s || a.seconds_seen < 3.0) return false;
  }
  return true;
}

}  // namespace

Scene make_crossing(std::uint64_t seed) {
  Scene scene;
  scene.name = "crossing";
  scene.seed = seed;
  Random random(seed * 1000003ULL + 601);
  build_yard(scene, random);
  const Wardrobe wardrobe = make_wardrobe(scene, random);
  const Wardrobe second = make_wardrobe(scene, random);
  const Outfits outfits{wardrobe.tall, wardrobe.bystander, wardrobe.child, second.tall, second.bystander};
  hold_acts(scene, {kLastExit_s + kPrelude_s, kPrelude_s, 601, 12},
            [wardrobe, outfits](const Scene& yard, std::uint64_t key) -> std::optional<std::vector<Actor>> {
              std::optional<std::vector<Actor>> drawn = Casting(yard, wardrobe, outfits, key).draw();
              if (!drawn || !keeps_promises(yard, *drawn)) return std::nullopt;
              return drawn;
            });
  return scene;
}

}  // namespace stereotrack::capture::synthetic
