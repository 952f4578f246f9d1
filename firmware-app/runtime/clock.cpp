#include "firmware-app/runtime/clock.hpp"

#include <ctime>

namespace stereotrack::runtime {

MonotonicTime monotonic_now() noexcept {
  timespec now{};
  (void)clock_gettime(CLOCK_MONOTONIC, &now);  // cannot fail with this clock and a valid address
  return MonotonicTime(std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec));
}

}  // namespace stereotrack::runtime
