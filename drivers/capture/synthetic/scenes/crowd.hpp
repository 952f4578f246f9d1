#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// Forty and more at once: a yard full of people and things.
///
/// Fifty-two come within the first seconds of an act: 24 people and children in 9 different clothes (three of them stop
/// for 1 to 3 s), 6 dogs, 9 balls, 4 robots, 3 trolleys, 2 crates that turn, 4 drones. All but the drones go along
/// eight lanes, 0.78 m apart, each lane with a direction and a pace of its own (0.6 to 1 m/s), so that in the picture
/// they pass and hide each other all the time. At the peak, between 6 and 13 s, there are 40 or more of which at least
/// a quarter is to be seen (those that are scored), and more than 30 for three seconds. The rig stands higher than in
/// other scenes, 5 m, and looks down more steeply, by 37 degrees (3-4-5), so that people far away are seen over those
/// who are near: a person is about 100 px high. Somebody may be hidden for long by who goes beside him; truth is not
/// scored then. An act is 34 s; all have left after 27.
[[nodiscard]] Scene make_crowd(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
