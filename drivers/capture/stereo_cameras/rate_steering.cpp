#include "drivers/capture/stereo_cameras/rate_steering.hpp"

#include <algorithm>
#include <cmath>

namespace stereotrack::capture {

namespace {

constexpr double kPhaseGain = 0.3;     ///< of a second's phase
constexpr double kNaturalGain = 0.02;  ///< likewise, for the drift
constexpr double kCalmS = 0.5e-3;      ///< moved in one second: under this, an error tells of the drift
constexpr double kFarS = 0.5e-3;       ///< off what was foreseen: one such second says nothing
constexpr double kStaleS = 3;          ///< without a measurement
constexpr double kMostNatural = 0.7 * RateSteering::kMostRatio;
constexpr double kForget = 0.9;
constexpr double kAskedLeastS = 50e-6;  ///< in one second: less is noise
constexpr int kAnswers = 4;             ///< seconds after which it is judged
constexpr double kPatienceS = 60;

}  // namespace

void RateSteering::begin(std::chrono::nanoseconds nominal, const std::optional<PeriodRange>& range) noexcept {
  *this = RateSteering();
  nominal_ = period_ = nominal;
  state_ = State::kCannot;
  obstacle_ = Obstacle::kNoControl;
  if (!range || range->quantum.count() <= 0 || nominal.count() <= 0) return;
  range_ = *range;
  period_s_ = to_seconds(nominal);
  quantum_ = to_seconds(range->quantum) / period_s_;
  delay_s_ = kDelayPeriods * period_s_;
  const double shorter = 1 - to_seconds(range->least) / period_s_;
  const double longer = to_seconds(range->most) / period_s_ - 1;
  obstacle_ = Obstacle::kNoRoom;
  if (std::min(shorter, longer) < std::max(kLeastRoom, quantum_)) return;
  obstacle_ = Obstacle::kCoarse;
  if (quantum_ > kMostRatio) return;
  obstacle_ = Obstacle::kNone;
  state_ = State::kMeasuring;
}

void RateSteering::stop() noexcept { *this = RateSteering(); }

double RateSteering::folded(double phase_s) const noexcept {
  return phase_s - period_s_ * std::floor(phase_s / period_s_ + 0.5);
}

/// By what was set, between the two times.
double RateSteering::moved(double from_s, double to_s) const noexcept {
  double sum = 0;
  for (std::size_t i = 0; i < sets_count_; ++i) {
    const double begin = std::max(from_s, sets_[i].from_s);
    const double end = i + 1 < sets_count_ ? std::min(to_s, sets_[i + 1].from_s) : to_s;
    if (end > begin) sum += sets_[i].ratio * (end - begin);
  }
  return sum;
}

double RateSteering::band() const noexcept { return std::max(kBandLeastS, 0.6 * quantum_ * kLookS); }

/// False: for seconds now the phase has not done what was asked of it.
bool RateSteering::follows(double change_s, double asked_s) noexcept {
  if (std::abs(asked_s) < kAskedLeastS) return true;
  // A jump that has nothing to do with it must not count for more than it asked.
  const double most = 1.5 * std::abs(asked_s);
  asked_squared_ = kForget * asked_squared_ + asked_s * asked_s;
  came_of_it_ = kForget * came_of_it_ + std::clamp(change_s, -most, most) * asked_s;
  answers_ = std::min(answers_ + 1, kAnswers);
  if (answers_ < kAnswers || came_of_it_ > 0.5 * asked_squared_) {
    bad_answers_ = 0;
    return true;
  }
  return ++bad_answers_ < 3;
}

void RateSteering::judge(double time_s, double phase_s) noexcept {
  const double near = std::max(kLockedS, 2 * band());
  const bool locked = state_ == State::kLocked;
  const bool against = locked ? std::abs(phase_s) > 5 * near : std::abs(phase_s) < near;
  in_row_ = against ? in_row_ + 1 : 0;
  if (in_row_ >= kInRow) {
    state_ = locked ? State::kApproaching : State::kLocked;
    since_s_ = time_s;
    in_row_ = 0;
  } else if (!locked && time_s - since_s_ > kPatienceS + period_s_ / kMostRatio) {
    state_ = State::kGivenUp;
  }
}

void RateSteering::measured(CaptureTime time, std::chrono::nanoseconds phase, std::optional<double> drift) noexcept {
  const double now_s = to_seconds(time.time_since_epoch());
  const double measured_s = to_seconds(phase);
  if (state_ == State::kMeasuring) {
    if (!drift) return;
    natural_ = std::clamp(*drift, -kMostNatural, kMostNatural);
    phase_s_ = measured_s;
    last_s_ = measured_s;
    time_s_ = since_s_ = now_s;
    state_ = State::kApproaching;
    return;
  }
  if ((state_ != State::kApproaching && state_ != State::kLocked) || now_s <= time_s_) return;
  const double span = now_s - time_s_;
  const double asked = moved(time_s_, now_s);
  const double foreseen = phase_s_ + natural_ * span + asked;
  const double error = folded(measured_s - foreseen);
  const bool stale = span > kStaleS || !last_s_;
  if (!stale && !follows(folded(measured_s - *last_s_) - natural_ * span, asked)) {
    state_ = State::kGivenUp;
    return;
  }
  const bool far = std::abs(error) > kFarS;
  if (stale || (far && outlier_)) {
    phase_s_ = measured_s;  // somebody's clock has stepped, or nothing was known
  } else {
    phase_s_ = folded(foreseen + (far ? 0 : kPhaseGain * error));
    if (!far && std::abs(asked) < kCalmS)
      natural_ = std::clamp(natural_ + kNaturalGain * error / span, -kMostNatural, kMostNatural);
  }
  outlier_ = far && !outlier_ && !stale;
  last_s_ = measured_s;
  time_s_ = now_s;
  judge(now_s, measured_s);
}

std::int64_t RateSteering::quanta(double phase_s) noexcept {
  const double most = std::floor(kMostRatio / quantum_);
  const double base = std::clamp(std::round(-natural_ / quantum_), -most, most);
  const double size = std::abs(phase_s);
  // What drifts outwards is turned half of what the turn will make, so that it swings about 0.
  const double rest = natural_ + base * quantum_;
  const double turn = rest * phase_s > 0 ? 0.5 * (quantum_ - std::abs(rest)) * kLookS : band();
  const double begin = std::clamp(turn, kBandLeastS, band());
  moving_ = size > begin || (moving_ && size > band() / 3);
  if (!moving_) return static_cast<std::int64_t>(base);
  double n = std::clamp(std::round((-natural_ - phase_s / kApproachS) / quantum_), -most, most);
  n = phase_s > 0 ? std::min(n, base - 1) : std::max(n, base + 1);
  n = std::clamp(n, -most, most);
  // The last step is not taken where it leads further away.
  const double then = phase_s + (natural_ + n * quantum_) * kLookS;
  const double else_then = phase_s + (natural_ + base * quantum_) * kLookS;
  if (std::abs(then) >= std::abs(else_then)) n = base;
  return static_cast<std::int64_t>(n);
}

std::optional<std::chrono::nanoseconds> RateSteering::next(MonotonicTime now) noexcept {
  std::int64_t n = 0;
  if (state_ == State::kApproaching || state_ == State::kLocked) {
    const double acts_s = to_seconds(now.time_since_epoch()) + delay_s_;
    if (acts_s - delay_s_ - time_s_ > kStaleS) {
      n = std::llround(std::clamp(-natural_, -kMostRatio, kMostRatio) / quantum_);
    } else {
      n = quanta(folded(phase_s_ + natural_ * (acts_s - time_s_) + moved(time_s_, acts_s)));
    }
  } else if (state_ != State::kGivenUp) {
    return std::nullopt;
  }
  const auto wanted = std::clamp(nominal_ + n * range_.quantum, range_.least, range_.most);
  if (std::chrono::abs(wanted - period_) * 2 < range_.quantum) return std::nullopt;
  return wanted;
}

void RateSteering::made(MonotonicTime now, std::chrono::nanoseconds period) noexcept {
  period_ = period;
  refusals_ = 0;
  if (sets_count_ == kSets) {
    std::copy(sets_.begin() + 1, sets_.end(), sets_.begin());
    --sets_count_;
  }
  sets_[sets_count_++] = {to_seconds(now.time_since_epoch()) + delay_s_, to_seconds(period) / period_s_ - 1};
}

void RateSteering::refused() noexcept {
  if (++refusals_ < kMostRefusals) return;
  if (state_ == State::kGivenUp) period_ = nominal_;  // not asked for without end
  state_ = State::kGivenUp;
}

}  // namespace stereotrack::capture
