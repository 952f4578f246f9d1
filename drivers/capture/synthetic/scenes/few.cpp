#include "drivers/capture/synthetic/scenes/few.hpp"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "drivers/capture/synthetic/scenes/acts.hpp"

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kAct_s = 40.0;
constexpr double kPrelude_s = 2.0;
constexpr double kGone_s = 26.0;

class Casting : private Troupe {
 public:
  Casting(const Scene& yard, const Wardrobe& wardrobe, std::uint64_t key)
      : Troupe(yard, wardrobe, key, {-kPrelude_s, kGone_s}) {}

  std::optional<std::vector<Actor>> draw() {
    const bool all = person(wear_.tall, 3.0, 8.0) && (random_.chance(0.5) || person(wear_.bystander, 3.0, 14.0)) &&
                     (random_.chance(0.5) ? dog() : cart());
    if (!all) return std::nullopt;
    return cast_;
  }

 private:
  bool person(const std::array<int, 5>& wears, double from_s, double to_s) {
    return place([&] {
      Actor a = base(ActorKind::kWalker, {at(1.6, 1.86), 0, 0}, wears);
      a.path = enter(
          {across({random_.sign(), {at(5.2, 8.8), at(5.2, 8.8), at(5.2, 8.8)}, 0.5}), at(from_s, to_s), at(1.1, 1.4)});
      return a;
    });
  }
  bool dog() {
    return place([&] {
      Actor a = base(ActorKind::kDog, {at(0.58, 0.68), 0, 0}, wear_.dog);
      a.path = enter(
          {across({random_.sign(), {at(5.4, 8.4), at(5.4, 8.4), at(5.4, 8.4)}, 0.6}), at(4.0, 14.0), at(1.4, 2.0)});
      return a;
    });
  }
  bool cart() {
    return place([&] {
      Actor a = base(ActorKind::kCart, {at(0.34, 0.4), at(0.72, 0.85), at(0.55, 0.65)}, wear_.cart);
      a.path = enter({across({random_.sign(), {at(6, 8), at(6, 8), at(6, 8)}, 0.8}), at(4.0, 14.0), at(1.0, 1.3)});
      return a;
    });
  }
};

}  // namespace

void let_few_pass(Scene& scene, const Wardrobe& wardrobe, std::uint64_t salt) {
  hold_acts(scene, {kAct_s, kPrelude_s, salt, 3},
            [wardrobe](const Scene& yard, std::uint64_t key) -> std::optional<std::vector<Actor>> {
              std::optional<std::vector<Actor>> drawn = Casting(yard, wardrobe, key).draw();
              if (!drawn) return std::nullopt;
              const Survey s = survey(yard, *drawn, 0.0, kGone_s);
              const bool seen = std::all_of(s.actors.begin(), s.actors.end(),
                                            [](const Survey::PerActor& a) { return a.seconds_seen > 3.0; });
              return seen ? drawn : std::nullopt;
            });
}

}  // namespace stereotrack::capture::synthetic
