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

/// The clock by which the program sleeps and sends: CLOCK_MONOTONIC. Reading it is the program's business
/// (firmware-app/runtime/clock.hpp); whoever else needs the time is told it.
struct MonotonicClock {
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<MonotonicClock, duration>;
  static constexpr bool is_steady = true;
};
using MonotonicTime = MonotonicClock::time_point;

/// The one bridge between the two: where a moment of the capture clock lies on the monotonic one.
///     monotonic = capture + offset
/// The offset is measured at start, and anew when the capture clock has stepped.
class ClockMap {
 public:
  constexpr ClockMap() noexcept = default;
  /// Both read at the same moment, as well as that can be done.
  constexpr ClockMap(CaptureTime capture, MonotonicTime monotonic) noexcept
      : offset_(monotonic.time_since_epoch() - capture.time_since_epoch()) {}

  [[nodiscard]] constexpr MonotonicTime to_monotonic(CaptureTime time) const noexcept {
    return MonotonicTime(time.time_since_epoch() + offset_);
  }
  [[nodiscard]] constexpr CaptureTime to_capture(MonotonicTime time) const noexcept {
    return CaptureTime(time.time_since_epoch() - offset_);
  }
  [[nodiscard]] constexpr std::chrono::nanoseconds offset() const noexcept { return offset_; }

 private:
  std::chrono::nanoseconds offset_{0};
};

/// In seconds, exact to a nanosecond for spans under 100 days. Always by this product: a division by 1e9 gives other
/// bits.
[[nodiscard]] inline double to_seconds(std::chrono::nanoseconds span) noexcept {
  return static_cast<double>(span.count()) * 1e-9;
}

/// a - b in seconds, exact to a nanosecond for spans under 100 days.
[[nodiscard]] inline double seconds_between(CaptureTime b, CaptureTime a) noexcept { return to_seconds(a - b); }

}  // namespace stereotrack
