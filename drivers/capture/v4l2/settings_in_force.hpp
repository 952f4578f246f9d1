#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "drivers/capture/camera.hpp"

namespace stereotrack::capture::v4l2 {

/// What each frame was exposed with, though a control acts some frames after it was set.
///     frame n is the first whose stamp is later than the change  =>  in force from frame n + delay - 1 on
/// `delay` is the sensor's: 1 where the first such frame shows it. 8 changes may be on their way; of more, the newest
/// takes the place of the one before it. One thread; no heap.
class SettingsInForce {
 public:
  SettingsInForce() = default;
  SettingsInForce(const SensorSettings& first, int delay_frames) noexcept
      : current_(first), asked_(first), delay_(delay_frames < 1 ? 1 : static_cast<std::uint64_t>(delay_frames)) {}

  /// Told in the order of their times, on the frames' clock.
  void change(const SensorSettings& settings, std::chrono::nanoseconds when) noexcept {
    if (count_ == changes_.size()) --count_;
    changes_[count_++] = {settings, when, 0, false};
    asked_ = settings;
  }
  /// What was asked for last.
  [[nodiscard]] const SensorSettings& asked() const noexcept { return asked_; }

  /// Asked for each frame in turn.
  [[nodiscard]] const SensorSettings& of_frame(std::uint64_t sequence, std::chrono::nanoseconds stamp) noexcept {
    for (std::size_t i = 0; i < count_; ++i) {
      Change& change = changes_[i];
      if (change.placed || stamp <= change.when) continue;
      change.placed = true;
      change.from = sequence + delay_ - 1;
    }
    std::size_t done = 0;
    while (done < count_ && changes_[done].placed && changes_[done].from <= sequence) {
      current_ = changes_[done++].settings;
    }
    for (std::size_t i = done; done > 0 && i < count_; ++i) changes_[i - done] = changes_[i];
    count_ -= done;
    return current_;
  }

 private:
  struct Change {
    SensorSettings settings;
    std::chrono::nanoseconds when{0};
    std::uint64_t from = 0;
    bool placed = false;
  };

  SensorSettings current_;
  SensorSettings asked_;
  std::uint64_t delay_ = 1;
  std::array<Change, 8> changes_{};
  std::size_t count_ = 0;
};

}  // namespace stereotrack::capture::v4l2
