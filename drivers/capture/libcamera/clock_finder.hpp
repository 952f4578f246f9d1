#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>

namespace stereotrack::capture::libcamera {

/// On which clock a camera's stamps are, found by when its frames come: libcamera says CLOCK_BOOTTIME, its pipelines
/// pass on what their kernel drivers give, CLOCK_MONOTONIC mostly, and some count on their own.
///
///     delay = came - stamp - exposure      stamp: start of the exposure; came: by CLOCK_MONOTONIC
///
/// What a delay can be: from -2 ms (stamps are rounded, some are late) to a quarter of a second and four periods
/// (reading out, what processes pictures, a busy board). The first clock that makes it so is the camera's:
///     monotonic     as it is
///     boot time     the stamp moved by what this board has slept, boottime - monotonic, as told at start
///     other         neither: the offset that makes the shortest delay of the last frames equal to `readout`, below
///                   which none can be. It follows a drift: 256 to 512 frames are looked at, so 100 in a million are
///                   off by 2 ms at 30 frames a second. That no frame came quicker than its readout is all that is
///                   known: times are late by what every frame takes beyond that.
/// After a sleep of less than a frame's delay the first two cannot be told apart: the error is less than the sleep.
///
/// A frame that says something else than those before is held up on its way, most likely: five in a row, or a stamp
/// that does not advance, are another clock. Of the first five each may choose anew. One thread; no heap.
class ClockFinder {
 public:
  enum class Clock : std::uint8_t { kUnknown, kMonotonic, kBoottime, kOther };

  struct Config {
    std::chrono::nanoseconds boottime_ahead{0};  ///< CLOCK_BOOTTIME - CLOCK_MONOTONIC
    std::chrono::nanoseconds period{0};          ///< between frames
    std::chrono::nanoseconds readout{0};         ///< from the end of an exposure to the end of its frame, at least
  };

  ClockFinder() = default;
  explicit ClockFinder(const Config& config) noexcept : config_(config) {}

  /// In the order in which they come. True: from this frame on it is another clock than before, or it has stepped; the
  /// first one is no change.
  bool frame(std::chrono::nanoseconds stamp, std::chrono::nanoseconds came,
             std::chrono::nanoseconds exposure) noexcept {
    const bool first = clock_ == Clock::kUnknown;
    const bool stood = !first && stamp <= last_stamp_;
    last_stamp_ = stamp;
    const std::chrono::nanoseconds delay = came - stamp - exposure;
    const Clock says = judge(delay);
    ++frames_;
    bool changed = stood;
    if (first || stood) {
      settle(says);
    } else if (says == clock_) {
      contrary_ = 0;
    } else if (++contrary_ >= kInARow || frames_ <= kInARow) {
      changed = frames_ > kInARow;
      settle(says);
    }
    if (clock_ == Clock::kOther) look_at(delay);
    return changed;
  }

  [[nodiscard]] Clock clock() const noexcept { return clock_; }

  /// monotonic = stamp + offset
  [[nodiscard]] std::chrono::nanoseconds offset() const noexcept {
    switch (clock_) {
      case Clock::kBoottime: return -config_.boottime_ahead;
      case Clock::kOther: return std::min(shortest_[0], shortest_[1]) - config_.readout;
      default: return std::chrono::nanoseconds(0);
    }
  }

 private:
  static constexpr std::chrono::milliseconds kEarly{2};
  static constexpr std::chrono::milliseconds kLate{250};
  static constexpr int kInARow = 5;
  static constexpr int kLookedAt = 256;
  static constexpr std::chrono::nanoseconds kNone = std::chrono::nanoseconds::max();

  [[nodiscard]] Clock judge(std::chrono::nanoseconds delay) const noexcept {
    const auto can_be = [&](std::chrono::nanoseconds d) { return d >= -kEarly && d <= kLate + 4 * config_.period; };
    if (can_be(delay)) return Clock::kMonotonic;
    if (can_be(delay + config_.boottime_ahead)) return Clock::kBoottime;
    return Clock::kOther;
  }

  void settle(Clock clock) noexcept {
    clock_ = clock;
    contrary_ = 0;
    shortest_ = {kNone, kNone};
    looked_at_ = 0;
  }

  void look_at(std::chrono::nanoseconds delay) noexcept {
    if (looked_at_++ == kLookedAt) {
      shortest_ = {shortest_[1], kNone};
      looked_at_ = 1;
    }
    shortest_[1] = std::min(shortest_[1], delay);
  }

  Config config_;
  Clock clock_ = Clock::kUnknown;
  std::chrono::nanoseconds last_stamp_{0};
  std::array<std::chrono::nanoseconds, 2> shortest_{kNone, kNone};  ///< of the frames before, and of those now
  int looked_at_ = 0;
  int contrary_ = 0;
  int frames_ = 0;
};

}  // namespace stereotrack::capture::libcamera
