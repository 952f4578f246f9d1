#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// The yard with eleven moving things, after the thesis' test with eleven objects.
///
/// Three people (one pauses, one is a child in the colours of the wall), a dog, a trolley, a crate that
/// turns, a robot, a beach ball, a bouncing football, a small ball far away and a drone. Places, colours and
/// paths come from the seed. A cast is drawn anew until, in the first 20 seconds at 640 x 480: nobody runs
/// into anybody or anything, the small ball's whole picture is under 60 px in places and the crate's over
/// 20,000, all eleven are seen, and there are 7 to 18 occlusions among them (see Survey).
[[nodiscard]] Scene make_eleven(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
