#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "drivers/trigger/pulse_matcher.hpp"
#include "pipeline/core/time.hpp"

namespace stereotrack::trigger {

/// Whether one sensor follows the trigger, by which of its frames answer a pulse (PulseMatcher). One whose wire is off
/// and that runs free goes astray: its frames answer none or, where chance puts some near a pulse, a part of them.
///
///     astray   none of kFewest frames or more answered, for as long as the caller waits (unanswered_in_row(),
///              last_answer()); or
///              more than a third of many:  score = max(0, score + (answer ? -1 : 2)) >= kWorst,
///              after 24 frames that answer none, after 96 of which each second one does; of frames between pulses
///              alone: where nobody looked for so long that pulses are forgotten, it is no fault of the sensor
///     believed anew after convincing() answers in a row: kConvincing; twice as many each time that it went astray
///              before kMostConvincing were answered since it was believed. So one that drifts past the pulses is told
///              less and less often.
///
/// The caller decides, by both sides, and says so by go_astray() and believe(). Pure logic, one thread, O(1).
class AnswerWatch {
 public:
  static constexpr std::uint32_t kFewest = 4;
  static constexpr std::uint32_t kWorst = 48;
  static constexpr std::uint32_t kConvincing = 8;
  static constexpr std::uint32_t kMostConvincing = 1024;

  /// It is believed, and nothing is held against it from now on: its first frame comes, it is one that convinces, or
  /// pulses are told anew. How often it was astray is kept.
  void begin(MonotonicTime now) noexcept {
    is_astray_ = false;
    last_answer_ = now;
    frames_ = unanswered_ = unanswered_in_row_ = answers_in_row_ = score_ = proven_ = 0;
  }

  /// A frame came at `now`.
  void frame(const PulseMatcher::Found& found, MonotonicTime now) noexcept {
    ++frames_;
    if (found.kind != PulseMatcher::Kind::kAnswer) {
      off_ = found.off;
      ++unanswered_;
      ++unanswered_in_row_;
      if (found.between) {
        answers_in_row_ = 0;
        score_ = std::min(score_ + 2, kWorst);
      }
      return;
    }
    ++answers_in_row_;
    unanswered_in_row_ = 0;
    if (is_astray_) return;
    last_answer_ = now;
    if (proven_ < kMostConvincing) ++proven_;
    if (score_ > 0) --score_;
    if (score_ == 0) frames_ = unanswered_ = 0;
  }

  void go_astray() noexcept {
    if (is_astray_) return;
    is_astray_ = true;
    convincing_ =
        convincing_ == 0 || proven_ >= kMostConvincing ? kConvincing : std::min(2 * convincing_, kMostConvincing);
    answers_in_row_ = 0;
  }

  [[nodiscard]] bool is_astray() const noexcept { return is_astray_; }
  /// Astray, and has answered so often that it is to be believed.
  [[nodiscard]] bool convinces() const noexcept { return is_astray_ && answers_in_row_ >= convincing_; }
  /// Half as often, and goes on: for who looks at both sides.
  [[nodiscard]] bool half_convinces() const noexcept { return is_astray_ && 2 * answers_in_row_ >= convincing_; }
  [[nodiscard]] bool mostly_strays() const noexcept { return score_ >= kWorst; }
  [[nodiscard]] std::uint32_t convincing() const noexcept { return convincing_; }

  /// When it last answered a pulse while it was believed, or began.
  [[nodiscard]] MonotonicTime last_answer() const noexcept { return last_answer_; }
  [[nodiscard]] std::uint32_t unanswered_in_row() const noexcept { return unanswered_in_row_; }
  /// Since all was well: frames, and those of them that answered no pulse; by how much the last of these was off.
  [[nodiscard]] std::uint32_t frames() const noexcept { return frames_; }
  [[nodiscard]] std::uint32_t unanswered() const noexcept { return unanswered_; }
  [[nodiscard]] std::chrono::nanoseconds off() const noexcept { return off_; }

 private:
  bool is_astray_ = false;
  MonotonicTime last_answer_{};
  std::uint32_t frames_ = 0;
  std::uint32_t unanswered_ = 0;
  std::uint32_t unanswered_in_row_ = 0;
  std::uint32_t answers_in_row_ = 0;
  std::uint32_t score_ = 0;
  std::uint32_t proven_ = 0;      ///< answers since it was believed
  std::uint32_t convincing_ = 0;  ///< 0: it never was astray
  std::chrono::nanoseconds off_{0};
};

}  // namespace stereotrack::trigger
