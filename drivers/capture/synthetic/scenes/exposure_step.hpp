#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// The yard while exposure and light jump: what every grey level of the background changes with at once.
///
/// Nine things pass (see Passers). Meanwhile, in both cameras alike, at 30 frames a second about in these frames (the
/// seed moves each by up to 9):
///     85   exposure x 1.5, from one frame to the next
///     140  exposure / 1.4
///     190  a floodlight comes on: more light on a part of the yard, none on the rest
///     240  exposure x 0.7
///     290  exposure x 4/3 within 12 frames, back to that of frame 1
///     345  the floodlight goes out
/// and over again every 14 s. Exposure is a factor on light; grey levels go with its 29/64th power (see Sensor): x 1.5
/// makes them 20 % brighter. Every frame is scored as it is, those of the steps too; what is left out is the learning
/// of the background, frames 1-30.
[[nodiscard]] Scene make_exposure_step(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
