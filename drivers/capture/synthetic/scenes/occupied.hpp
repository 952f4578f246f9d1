#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// The yard, occupied from the first frame on: what a background that is learnt at once gets wrong.
///
/// Six things stand there in frame 1 and leave one after the other, at 30 frames a second about in these frames:
/// a person (12-20), a crate (30-48), a dog (75-105), a ball that somebody else has left (70-110), a trolley
/// (120-160), a robot (220-255); all six have gone by frame 397. Meanwhile a person comes, stops for four seconds and
/// goes on, a child comes and turns back, a football bounces through. Whoever stands touches nobody and is seen in
/// frame 1.
///
/// Truth, in the spirit of changedetection.net: what has stood since frame 1 is undecidable (label 170, in gt.csv
/// with confidence 0) until the first frame in which it moves, an object (255) from then on; who has come and stops
/// stays 255. Where something stood that has left is background: a ghost is an error, and so is what its shadow
/// leaves behind. Shadows are 50 whoever casts them. Nothing is left out when scoring: the early frames are the point.
///
/// From 29.5 s on new casts come by, all from outside.
[[nodiscard]] Scene make_occupied(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
