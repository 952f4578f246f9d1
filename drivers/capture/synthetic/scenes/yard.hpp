#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scene.hpp"
#include "drivers/capture/synthetic/survey.hpp"

namespace stereotrack::capture::synthetic {

/// The place where the scenes play: a paved yard before a brick wall with a gate, windows and posters, a
/// container, a shed and small things to look past; houses and trees beyond. Colours, places and which side
/// is which come from `random`. Fills statics, light and sky of `scene`; people may go at z = 4.5 .. 9.4.
struct YardPlan {
  double mirror = 1;  ///< -1: left and right are changed
  Vec3 lamp;          ///< the top of the lamp post
};
YardPlan build_yard(Scene& scene, Random& random);

/// A colour as print and cloth have it.
[[nodiscard]] Vec3 print_colour(Random& random);

/// Materials for everybody who can come by: see pose() for what is which.
struct Wardrobe {
  std::array<int, 5> tall{}, bystander{}, child{}, dog{}, cart{}, crate{}, robot{}, drone{};
  int beach_ball = 0;
  int football = 0;
  int small_ball = 0;
};
[[nodiscard]] Wardrobe make_wardrobe(Scene& scene, Random& random);

/// How far from the middle the left and right picture's edges are at a place on the floor, with room for
/// a thing of `reach` and its shadow [m].
[[nodiscard]] double off_stage(double z, double reach);

/// Draws actors one after the other, each so that it meets nobody drawn before. A scene's casting derives
/// from it.
class Troupe {
 public:
  struct Hours {
    double first_start_s = 0;  ///< nobody sets out before
    double last_exit_s = 0;    ///< everybody has left by then
  };
  Troupe(const Scene& scene, const Wardrobe& wardrobe, std::uint64_t key, const Hours& hours)
      : wear_(wardrobe), random_(key), scene_(scene), hours_(hours) {}

 protected:
  struct Crossing {
    double side = 0;             ///< it comes from: -1 left, 1 right
    std::vector<double> depths;  ///< z of its points, evenly spaced in x
    double reach = 0;            ///< half its width
  };
  [[nodiscard]] std::vector<Vec3> across(const Crossing& c);

  struct Entrance {
    std::vector<Vec3> points;
    double seen_s = 0;  ///< about when it comes into the picture, from the start of the act
    double speed = 1;   ///< [m/s]
    double pause_after_s = 0;
    double pause_s = 0;
  };
  [[nodiscard]] static Path enter(Entrance e);

  /// Tries what `make` draws until it fits; false when nothing does.
  /// `gap_m`: how near it may come to others, beyond the discs that they need.
  template <class Make>
  bool place(Make&& make, double gap_m = 0.12, int attempts = 40) {
    for (int attempt = 0; attempt < attempts; ++attempt) {
      Actor actor = make();
      actor.id = static_cast<std::uint32_t>(cast_.size()) + 1;
      if (actor.path.start_s() < hours_.first_start_s || actor.path.end_s() > hours_.last_exit_s) continue;
      if (collides(scene_, actor, cast_, gap_m)) continue;
      cast_.push_back(std::move(actor));
      return true;
    }
    return false;
  }

  [[nodiscard]] Actor base(ActorKind kind, Vec3 size, std::array<int, 5> materials);
  double at(double low, double high) { return random_.uniform(low, high); }
  double either_way(double low, double high) {
    const double sign = random_.sign();
    return sign * at(low, high);
  }

  const Wardrobe& wear_;
  Random random_;
  std::vector<Actor> cast_;

 private:
  const Scene& scene_;
  Hours hours_;
};

}  // namespace stereotrack::capture::synthetic
