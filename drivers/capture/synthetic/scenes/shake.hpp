#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// The yard seen from a mast that sways in the wind: nothing that stands still does so in the picture.
///
/// Nine things pass (see Passers) while the rig, both cameras as one, turns about the middle between them: yaw and
/// pitch are three waves each (periods of about 2.6, 1.1 and 0.4 s; the seed varies them) and a small jitter, roll is
/// one. A point of the yard moves by up to 3.1 px from its place at rest in the middle of a 640 x 480 picture and by up
/// to 4 near its left and right edge (never more than 4.5), three or four times as far sideways as up and down. Once
/// between 4 and 9 s all waves meet.
///
/// Truth is that of the picture as shaken: masks, boxes, disparity and places in the frame of the left camera as it is
/// turned in that moment. The rig is stiff, so that the calibration holds in every frame. What is left out when scoring
/// is the learning of the background, frames 1-30.
[[nodiscard]] Scene make_shake(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
