#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "drivers/capture/synthetic/scene.hpp"
#include "drivers/capture/synthetic/scenes/yard.hpp"

namespace stereotrack::capture::synthetic {

/// Who passes in scenes whose difficulty is not who passes: a robot, three people (one stops for a moment, one is a
/// child in the colours of the wall), a trolley, a dog, a crate that turns, a beach ball and a bouncing football.
/// Each is seen for a while within the first 13 seconds of an act and runs into nobody and nothing.
struct Passers {
  std::uint64_t salt = 0;  ///< of the scene: another scene, other people
  double near_z = 5.2;     ///< they keep between these [m]
  double far_z = 8.8;
};

/// Sets act_s, prelude_s and cast of a scene whose statics and materials are complete.
/// The cast throws std::runtime_error when a seed finds none.
void let_pass(Scene& scene, const Wardrobe& wardrobe, const Passers& passers);

}  // namespace stereotrack::capture::synthetic
