#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// The yard in the light of lamps on the mains, while others go on and off: light that changes without anybody there.
///
/// Few pass (see let_few_pass): three quarters of the time nobody is in view. Lasts as long as is asked for; what
/// happens comes again every 120 s, so 120 s (3600 frames at 30 a second) see all of it:
///
///      0 -  12 s   steady light
///     12 -  46 s   pictures exposed at once: light pulses at twice the mains' frequency of 50.03 Hz, of which a
///     picture
///                  every 1/30 s catches every third phase and a bit: the whole picture's light goes up and down by 15
///                  % within 3 frames (a beat of 10 Hz that drifts by a turn in 17 s)
///     46 -  58 s   steady light
///     58 - 108 s   a rolling shutter, read out within 24 ms: 2.4 bands, lighter and darker by 15 %, that jump by a
///     third
///                  from frame to frame and crawl
///    108 - 120 s   steady light
///
/// and eight steps of all light, each from one frame to the next, by a factor of 0.75 to 0.85 or back to 1, about at 8,
/// 20, 31, 52, 64, 77, 90, 103 s (the seed moves each by up to 2 s), and a floodlight on a part of the yard that goes
/// on about at 25, 70 and 96 s for 4 to 8 s. Light's changes by k change grey levels by k^(29/64): 15 % are 6 to 7 %.
/// Both cameras see the same phase. At another frame rate the beat is that of 100.06 Hz with it.
///
/// Truth: light is nobody: label 0. For the rate of false tracks count those that never lie on an object.
[[nodiscard]] Scene make_flicker(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
