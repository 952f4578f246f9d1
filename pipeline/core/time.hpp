#pragma once

#include <chrono>

namespace stereotrack {

/// The clock that stamps frames: the sensor's or the file's own. One type a clock, so that times of
/// different clocks do not subtract. Its epoch is the source's business; only differences mean something.
struct CaptureClock {
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<CaptureClock, duration>;
  static constexpr bool is_steady = true;
};
using CaptureTime = CaptureClock::time_point;

/// a - b in seconds, exact to a nanosecond for spans under 100 days.
[[nodiscard]] inline double seconds_between(CaptureTime b, CaptureTime a) noexcept {
  return static_cast<double>((a - b).count()) * 1e-9;
}

}  // namespace stereotrack
