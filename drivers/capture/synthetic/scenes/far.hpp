#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// Targets of 6 x 6 pixels: as small as anything that can be told from noise.
///
/// Nine balls whose picture, whole, is 5.4 to 6.6 px wide and high at 640 x 480: four roll along the wall, two bounce
/// there (both 12.4 to 13.0 m from the camera along its axis, disparity 11.5 to 12.1 px, the wall behind 10.5), three
/// balloons drift at 23 to 28 m before houses and sky (disparity 5.4 to 6.5 px). They go by 0.6 to 3.5 px a frame, and
/// bouncing ones by up to 9. Things that stand in the yard hide those on the floor now and then; each is seen for three
/// seconds or more within the first 20 of an act, which lasts 38 s. A ball of 6 px has about 28 pixels.
[[nodiscard]] Scene make_far(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
