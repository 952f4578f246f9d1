#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// The yard with trees, bushes and a flag in gusts of wind: background that moves and changes its colours.
///
/// Two trees and two bushes before the wall, a bush near the camera, some 6500 leaves, and a flag on a pole (see
/// Foliage). Clumps of leaves swing by 3 to 7 px (at 640 x 480) and come back in 1 to 2 s, stronger and weaker with the
/// gusts; leaves turn and flicker between their dark upper and pale under side; shadows of the plants dance on the
/// floor. Nine things pass (see Passers) before the trees and bushes and behind the one that is near.
///
/// Truth: leaves, flag and their shadows stand still (0), with the disparity that they have; an object is 255 where it
/// is seen before or between leaves. What is left out when scoring is the learning of the background, frames 1-30.
[[nodiscard]] Scene make_foliage(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
