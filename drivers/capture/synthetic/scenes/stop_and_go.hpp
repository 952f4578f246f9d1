#pragma once

#include <cstdint>

#include "drivers/capture/synthetic/scene.hpp"

namespace stereotrack::capture::synthetic {

/// People and carts that stop and go on: neither gone, nor part of the background.
///
/// Seven things come, stop once in the picture and leave, in the order of their ids: three people stop for 2 to 4 s, 4
/// to 8 s and 12 to 15 s, a child in the colours of the wall for 6 to 10 s, two trolleys for 5 to 8 s and 10 to 15 s, a
/// robot for 8 to 12 s. A person who walks by without stopping is the eighth. Who stops slows down within 0.6 s, stands
/// still to the last pixel (the clouds' light goes on changing), and gets up to speed within 0.6 s again; where one
/// stops, all of it lies in the picture. Nobody is hidden by more than three quarters for longer than 2 s at a time.
/// Truth: 255, also while they stand. An act is 45 s; all have left after 39 s.
[[nodiscard]] Scene make_stop_and_go(std::uint64_t seed);

}  // namespace stereotrack::capture::synthetic
