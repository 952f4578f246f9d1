#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// The yard in the last light of the day, with all the gain that the cameras have: noise, and little else.
///
/// Light is 1/14 of the other scenes', nearly all of it from the sky, so that shadows are faint; the gain that makes up
/// for a part of it makes the noise 1.8 times as strong (standard deviation 6 to 7 grey levels). Grey levels lie
/// between 10 and 60, most of the floor's near 35; a person differs from what is behind him by some 5 to 15. Few pass
/// (see let_few_pass): three quarters of the time nobody is in view. Lasts as long as is asked for: two minutes are
/// 3600 frames at 30 a second. Truth is that of a picture by day.
[[nodiscard]] Scene make_dark(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
