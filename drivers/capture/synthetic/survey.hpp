#pragma once

#include <span>
#include <vector>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// What a cast will look like in the left picture, found with few rays (a 160 x 120 picture, five a
/// second): for scenes that draw their paths and must keep what they promise.
struct Survey {
  struct PerActor {
    double largest_px = 0;    ///< visible area, at 640 x 480
    double seconds_seen = 0;  ///< with anything visible
    double hidden_s = 0;      ///< in the picture, but with more than 3/4 hidden
  };
  std::vector<PerActor> actors;  ///< as in the cast
  int occlusions = 0;            ///< times that an actor hid a quarter or more of another, each once
  int pairs = 0;                 ///< how many different pairs that were
};
[[nodiscard]] Survey survey(const Scene& scene, std::span<const Actor> cast, double from_s, double to_s);

/// True when `actor` on its way comes nearer than `gap_m` to an actor of `others` or to something that
/// stands still (but the floor, which is the scene's first shape).
[[nodiscard]] bool collides(const Scene& scene, const Actor& actor, std::span<const Actor> others, double gap_m);

}  // namespace stereotrack::capture::synthetic
