#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "drivers/trigger/pairer.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/time.hpp"

namespace stereotrack::trigger {

/// Which pulse of the trigger a frame answers: counts of pulses against counts of frames, by time.
///
///     pulse k at p_k asks each sensor for one exposure, which begins at  b_k = p_k + delay
///     a frame whose exposure began at t answers the k nearest to it,     |t - b_k| <= tolerance x period,  or none
///
/// The number of its pulse then is a frame's sequence for the Pairer (Config::sequenced): frames of different pulses
/// are no pair, whatever their times. What goes wrong at one side is found there, with its next frame or, where none
/// comes, two pulses later:
/// * missed: a pulse that the side has no frame for;
/// * doubled: a second frame for one pulse, refused;
/// * stray: a frame that no pulse asked for, refused.
///
/// Pulses are told before the frames that they ask for: an edge is there an exposure and a readout earlier. Numbers
/// rise; a gap is pulses whose time is not known: a frame of theirs is a stray.
/// Pure logic, as the Pairer: no clock, no thread, no memory but its own (kKept pulses). O(kKept) a call.
class PulseMatcher {
 public:
  static constexpr std::size_t kKept = 16;       ///< pulses that frames may still come for
  static constexpr std::uint64_t kPatience = 2;  ///< pulses after which a frame that has not come is missed

  struct Config {
    std::chrono::nanoseconds period{0};  ///< nominal time between pulses, > 0
    std::chrono::nanoseconds delay{0};   ///< >= 0
    double tolerance = 0.25;             ///< of the period, above 0 and under 0.5
  };

  enum class Kind : std::uint8_t { kAnswer, kDoubled, kStray };
  struct Found {
    Kind kind = Kind::kStray;
    std::uint64_t number = 0;         ///< of the pulse; 0: kStray
    std::chrono::nanoseconds off{0};  ///< by how much it began later than the nearest pulse asks for; 0: none is known
    bool between = false;             ///< pulses: that is a period at most; else those of its time are forgotten
  };

  /// Of one side, since the start.
  struct Counters {
    std::uint64_t answered = 0;  ///< pulses
    std::uint64_t missed = 0;    ///< pulses; one whose frame came very late after all is counted here and stays
    std::uint64_t doubled = 0;   ///< frames
    std::uint64_t stray = 0;     ///< frames
  };

  /// Faults: kBadConfig.
  [[nodiscard]] static Result<PulseMatcher> create(const Config& config) noexcept;

  /// The trigger has asked, for the `number`th time from 1. One that does not rise is ignored.
  void pulse(std::uint64_t number, CaptureTime time) noexcept;

  /// A frame has come; times of a side rise but for what its driver does wrong.
  [[nodiscard]] Found frame(Side side, CaptureTime begin) noexcept;

  /// A sensor stops or starts anew: pulses so far are none that it owes a frame for.
  void restart(Side side) noexcept;

  [[nodiscard]] const Counters& counters(Side side) const noexcept { return counters_[static_cast<std::size_t>(side)]; }
  [[nodiscard]] std::uint64_t pulses() const noexcept { return last_; }

 private:
  struct Pulse {
    std::uint64_t number = 0;       ///< 0: none
    CaptureTime begin{};            ///< of the exposures that it asks for
    std::array<bool, 2> settled{};  ///< by side: answered, missed, or not owed
    std::array<bool, 2> answered{};
  };

  explicit PulseMatcher(const Config& config) noexcept;
  /// Pulses before `number` that the side has no frame for are missed.
  void miss_before(std::size_t side, std::uint64_t number) noexcept;

  Config config_;
  std::chrono::nanoseconds tolerance_{0};
  std::array<Counters, 2> counters_{};
  std::array<Pulse, kKept> pulses_{};  ///< number n at n mod kKept
  std::uint64_t last_ = 0;
};

}  // namespace stereotrack::trigger
