#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// Balls that fly by at 40 px a frame and more, smeared by half of that.
///
/// The shutter is open for 1/60 s, half of a frame at 30 a second: a ball leaves a streak of its own width and half of
/// its way. In the first 22 s of an act, one after the other about every 2 s, ten balls (radius 0.11 or 0.075 m, 12 to
/// 20 px wide) cross at z = 5.6 to 8 m from either side: six thrown, with their top inside of the picture or near it,
/// four that bounce once or twice in view. All the way through the picture they go sideways by 38 to 52 px a frame (at
/// 640 x 480), so each is seen in 12 to 18 frames. Two people walk through meanwhile. An act is 31 s.
///
/// Truth: a pixel is the ball's where it shows it for a quarter of the exposure or longer; places are those of the
/// middle of the exposure, which is the pair's capture time; shadows are those of that moment.
[[nodiscard]] Scene make_fast(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
