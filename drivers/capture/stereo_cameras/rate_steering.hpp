#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "drivers/capture/camera.hpp"
#include "drivers/capture/live_source.hpp"
#include "pipeline/core/time.hpp"

namespace stereotrack::capture {

/// Holds the right one of two free-running cameras to the left one by the time between its frames.
///
///     phase(t) = phase_k + natural (t - T_k) + sum of what was set since, each from kDelayPeriods after it was set
///     set      = nominal + n quantum,   n q = - natural - phase / kApproach,   q = quantum / nominal      [s/s]
///
/// phase_k and natural, the drift at nominal periods, are an observer's: it predicts each second's phase from what was
/// set and is corrected by what was measured. So a second's delay of the measurement is none of the loop's.
///
/// Where a quantum is coarse (a row of 30 us moves the phase by 0.9 ms a second) no n stands still: within a band of
/// half of what one quantum moves between two looks, kBandLeast at least, nothing is done but for the whole quanta of
/// `natural`; outside it so many quanta, one at least, as bring the phase nearer by the next look. Quanta that are
/// toggled by phase, with hysteresis, are the dither that mean rates between two quanta take.
///
/// The rate stays within kMostRatio of the nominal one, so the phase goes to the nearer of the two frames it lies
/// between and never beyond it, and pairs keep their tolerance.
/// One thread; no memory but its own; some 1 us a call.
class RateSteering {
 public:
  static constexpr double kMostRatio = 0.005;  ///< of the period
  static constexpr double kLeastRoom = 0.001;  ///< of the period, that there must be to both sides
  static constexpr double kApproachS = 2;      ///< the phase falls to 37 % in it [s]
  static constexpr double kLookS = 0.1;        ///< between two next() [s]
  static constexpr double kBandLeastS = 30e-6;
  static constexpr double kLockedS = 100e-6;  ///< a phase under this, or two bands, is locked; five times it is not
  static constexpr int kInRow = 3;            ///< seconds for either
  static constexpr int kMostRefusals = 10;    ///< in a row; fewer may be those of a camera that is being unplugged
  static constexpr int kDelayPeriods = 2;     ///< from set to the first frame that comes at another time

  using State = Steering;  ///< kCannot: obstacle() says why; kMeasuring: at nominal periods
  enum class Obstacle : std::uint8_t {
    kNone,
    kNoControl,  ///< its driver cannot set the period
    kNoRoom,     ///< the period is at an end of what can be set
    kCoarse,     ///< a quantum is more than kMostRatio
  };

  /// A pair of cameras streams, the right one at its nominal period.
  void begin(std::chrono::nanoseconds nominal, const std::optional<PeriodRange>& range) noexcept;
  /// One of the two is gone, or nobody wants it steered.
  void stop() noexcept;

  /// A second's phase, at its middle, within half a period; and the drift over those since begin(), once it is known.
  void measured(CaptureTime time, std::chrono::nanoseconds phase, std::optional<double> drift) noexcept;

  /// About every kLookS: the period to be set now. Empty: as it is. Then made() or refused().
  [[nodiscard]] std::optional<std::chrono::nanoseconds> next(MonotonicTime now) noexcept;
  void made(MonotonicTime now, std::chrono::nanoseconds period) noexcept;
  void refused() noexcept;

  [[nodiscard]] State state() const noexcept { return state_; }
  [[nodiscard]] Obstacle obstacle() const noexcept { return obstacle_; }
  [[nodiscard]] std::chrono::nanoseconds nominal() const noexcept { return nominal_; }
  [[nodiscard]] std::chrono::nanoseconds period() const noexcept { return period_; }  ///< that is set
  [[nodiscard]] double natural() const noexcept { return natural_; }                  ///< [s/s]

 private:
  struct Set {
    double from_s = 0;  ///< when it acts
    double ratio = 0;   ///< over the nominal period
  };
  [[nodiscard]] double folded(double phase_s) const noexcept;
  [[nodiscard]] double moved(double from_s, double to_s) const noexcept;
  [[nodiscard]] double band() const noexcept;
  [[nodiscard]] std::int64_t quanta(double phase_s) noexcept;
  [[nodiscard]] bool follows(double change_s, double asked_s) noexcept;
  void judge(double time_s, double phase_s) noexcept;

  static constexpr std::size_t kSets = 64;

  State state_ = State::kOff;
  Obstacle obstacle_ = Obstacle::kNone;
  std::chrono::nanoseconds nominal_{0};
  std::chrono::nanoseconds period_{0};
  PeriodRange range_;
  double period_s_ = 1;  ///< nominal
  double quantum_ = 0;   ///< of the period
  double delay_s_ = 0;

  std::array<Set, kSets> sets_{};  ///< oldest first
  std::size_t sets_count_ = 0;

  double natural_ = 0;
  double phase_s_ = 0;  ///< the observer's, at time_s_
  double time_s_ = 0;
  std::optional<double> last_s_;  ///< phase that was measured at time_s_
  bool outlier_ = false;          ///< the last one was far from what was foreseen
  bool moving_ = false;
  int in_row_ = 0;
  double since_s_ = 0;  ///< when it began to approach

  // What came of what was asked for, of the last ten seconds or so.
  double asked_squared_ = 0;
  double came_of_it_ = 0;
  int answers_ = 0;
  int bad_answers_ = 0;
  int refusals_ = 0;  ///< in a row
};

}  // namespace stereotrack::capture
