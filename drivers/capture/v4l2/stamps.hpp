#pragma once

#include <chrono>
#include <cstdint>

#include "pipeline/core/time.hpp"

namespace stereotrack::capture::v4l2 {

/// A driver's stamps as times of one clock that never goes back: CLOCK_MONOTONIC, which is what they promise to be.
///
/// What a stamp is expected to be: later than the last, and from an hour before it was taken to a second after. Where
/// it is not, the count may have come round: of seconds in 32 bits, microseconds in 32 bits or nanoseconds in 64 (which
/// the arithmetic undoes by itself). What no such count explains is a step: the time then goes on from when the frame
/// was taken, and stamps are measured from there. A first stamp that is not near the monotonic clock is a step, too.
///
/// A frame that waited was taken late, and so is all that is measured from there: in front of the frames' own arrivals,
/// which cannot be. Each later frame that is ahead of its arrival then moves the times back to it, which is no step.
/// One thread.
class StampLine {
 public:
  struct Stamp {
    std::chrono::nanoseconds time{0};  ///< on CLOCK_MONOTONIC
    bool step = false;
  };
  /// `raw` as the driver has it, `taken` by CLOCK_MONOTONIC.
  [[nodiscard]] Stamp next(std::chrono::nanoseconds raw, std::chrono::nanoseconds taken) noexcept {
    const Stamp stamp = place(count(raw), count(taken));
    last_raw_ = count(raw);
    last_time_ = count(stamp.time);
    started_ = true;
    placed_ = placed_ || stamp.step;
    return stamp;
  }

 private:
  // Nanoseconds modulo 2^64: differences are right across any wrap-around.
  using Count = std::uint64_t;
  static constexpr Count kSecond = 1'000'000'000;
  static constexpr Count kHour = 3600 * kSecond;
  static constexpr Count kHalf = ~Count{0} / 2;
  static constexpr Count kSlack = kSecond;  // some drivers stamp the end of a frame before it has come

  static Count count(std::chrono::nanoseconds time) noexcept { return static_cast<Count>(time.count()); }
  static std::chrono::nanoseconds time(Count count) noexcept {
    return std::chrono::nanoseconds(static_cast<std::int64_t>(count));
  }

  [[nodiscard]] Stamp place(Count raw, Count taken) const noexcept {
    if (!started_) {
      const Count age = taken + kSlack - raw;
      return age <= kHour + kSlack ? Stamp{time(raw), false} : Stamp{time(taken), true};
    }
    constexpr Count kRounds[] = {0, kSecond << 32, 1000ULL << 32};
    for (const Count round : kRounds) {
      const Count later = raw + round - last_raw_;
      if (later == 0 || later > kHalf) continue;
      const Count at = last_time_ + later;
      if (taken + kSlack - at > kHour + kSlack) continue;
      const bool ahead = placed_ && at > taken;
      return {time(ahead ? after_last(taken) : at), false};
    }
    return {time(after_last(taken)), true};
  }
  [[nodiscard]] Count after_last(Count taken) const noexcept { return taken > last_time_ ? taken : last_time_ + 1; }

  bool started_ = false;
  bool placed_ = false;  ///< by an arrival, not by a stamp of the monotonic clock
  Count last_raw_ = 0;
  Count last_time_ = 0;
};

/// Which moment of a frame its stamp names.
enum class StampedAt : std::uint8_t { kStartOfExposure, kEndOfFrame };

/// The middle of the exposure of a sensor that exposes all rows at once; of a rolling shutter, of its first row.
///     start of exposure:  stamp + exposure / 2
///     end of frame:       stamp - readout - exposure / 2
[[nodiscard]] constexpr std::chrono::nanoseconds mid_exposure(std::chrono::nanoseconds stamp, StampedAt at,
                                                              std::chrono::nanoseconds exposure,
                                                              std::chrono::nanoseconds readout) noexcept {
  return at == StampedAt::kStartOfExposure ? stamp + exposure / 2 : stamp - readout - exposure / 2;
}

}  // namespace stereotrack::capture::v4l2
