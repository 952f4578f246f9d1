#include "firmware-app/signals/signal_rules.hpp"

#include <algorithm>
#include <cmath>

namespace stereotrack::signals {
namespace {

[[nodiscard]] bool is_about_targets(Condition when) noexcept {
  return when != Condition::kHeartbeat && when != Condition::kDeadlineMissed;
}

/// The line is the condition, held.
[[nodiscard]] bool is_level(const Signal& signal) noexcept {
  return signal.mode == Signal::Mode::kLevel && signal.when != Condition::kHeartbeat;
}

[[nodiscard]] Result<void> check(const Signal& signal, const SignalRules::Config& config) noexcept {
  if (!std::isfinite(signal.limit_m) || !std::isfinite(signal.limit_s)) return fail(Fault::kNotFinite);
  const bool has_unit = config.unit_m > 0;
  const bool pulsed = signal.mode == Signal::Mode::kPulse;
  const bool in_space =
      signal.zone && *signal.zone < config.zones.size() && config.zones[*signal.zone].kind == Zone::Kind::kSpace;
  const bool good = (!signal.zone || (*signal.zone < config.zones.size() && is_about_targets(signal.when))) &&
                    (signal.when != Condition::kInZone || signal.zone) &&
                    (signal.when != Condition::kDistanceBelow || (signal.limit_m > 0 && has_unit)) &&
                    (signal.when != Condition::kTimeToReachBelow || signal.limit_s > 0) &&
                    (signal.when != Condition::kHeartbeat || (signal.half_period.count() > 0 && !pulsed)) &&
                    (!in_space || has_unit) && (!pulsed || signal.pulse.count() > 0) && signal.hold.count() >= 0;
  if (!good) return fail(Fault::kBadConfig);
  return {};
}

}  // namespace

SignalRules::SignalRules(const Config& config) noexcept : config_(config) {
  for (std::size_t i = 0; i < size(); ++i) {
    if (config_.signals[i].safe) safe_ |= gpio::LineBits{1} << i;
  }
  lines_ = safe_;
}

Result<SignalRules> SignalRules::create(const Config& config) noexcept {
  if (!std::isfinite(config.unit_m)) return fail(Fault::kNotFinite);
  if (config.unit_m < 0 || config.stale_after.count() <= 0) return fail(Fault::kBadConfig);
  for (const Zone& zone : config.zones) {
    if (const auto good = stereotrack::check(zone); !good.has_value()) return fail(good.error());
  }
  for (const Signal& signal : config.signals) {
    if (const auto good = check(signal, config); !good.has_value()) return fail(good.error());
  }
  return SignalRules(config);
}

/// Distance, time to reach and zones in space are not there without depth.
bool SignalRules::needs_depth(const Signal& signal) const noexcept {
  return signal.when == Condition::kDistanceBelow || signal.when == Condition::kTimeToReachBelow ||
         (signal.zone && config_.zones[*signal.zone].kind == Zone::Kind::kSpace);
}

bool SignalRules::is_known(const Signal& signal, const Inputs& inputs) const noexcept {
  if (signal.when == Condition::kHeartbeat) return inputs.healthy;
  if (signal.when == Condition::kDeadlineMissed) return true;
  return inputs.tracks_known && (inputs.depth_known || !needs_depth(signal));
}

bool SignalRules::fulfils(const Signal& signal, const TrackReport& target) const noexcept {
  if (target.state == TrackState::kTentative) return false;
  if (signal.zone && !contains(config_.zones[*signal.zone], target, config_.unit_m)) return false;
  const double squared = target.position.squaredNorm();
  switch (signal.when) {
    case Condition::kConfirmed:
    case Condition::kInZone: return true;
    case Condition::kDistanceBelow: {
      const double limit = signal.limit_m / config_.unit_m;
      return target.has_depth && squared < limit * limit;
    }
    case Condition::kTimeToReachBelow:
      // |p| / s < limit with the closing speed s = -p v / |p|. Not closing in: s <= 0, and nothing is less than that.
      return target.has_depth && squared < -target.position.dot(target.velocity) * signal.limit_s;
    case Condition::kHeartbeat:
    case Condition::kDeadlineMissed: break;
  }
  return false;
}

bool SignalRules::holds(const Signal& signal, const Inputs& inputs) const noexcept {
  if (signal.when == Condition::kHeartbeat) return inputs.healthy;
  if (signal.when == Condition::kDeadlineMissed) return inputs.deadline_missed;
  return std::any_of(inputs.tracks.begin(), inputs.tracks.end(),
                     [&](const TrackReport& target) { return fulfils(signal, target); });
}

gpio::LineBits SignalRules::decide(const Inputs& inputs, MonotonicTime now) noexcept {
  static_cast<void>(advance(now));  // what ended since the last call has ended
  fresh_ = true;
  decided_ = now_;
  for (std::size_t i = 0; i < size(); ++i) {
    const Signal& signal = config_.signals[i];
    if (is_known(signal, inputs)) {
      courses_[i].follow(signal, holds(signal, inputs), now_);
    } else {
      courses_[i] = {};
    }
  }
  return compose();
}

gpio::LineBits SignalRules::advance(MonotonicTime now) noexcept {
  now_ = std::max(now_, now);
  if (fresh_ && now_ - decided_ >= config_.stale_after) {
    fresh_ = false;
    courses_ = {};
  }
  for (std::size_t i = 0; i < size(); ++i) courses_[i].pass(config_.signals[i], now_);
  return compose();
}

std::optional<MonotonicTime> SignalRules::next_change() const noexcept {
  if (!fresh_) return std::nullopt;
  MonotonicTime first = decided_ + config_.stale_after;
  for (std::size_t i = 0; i < size(); ++i) {
    const Course& course = courses_[i];
    if (!course.known) continue;
    if (course.is_timed(config_.signals[i])) first = std::min(first, course.next);
    if (is_level(config_.signals[i]) && !course.holds && course.held_until > now_) {
      first = std::min(first, course.held_until);
    }
  }
  return first;
}

gpio::LineBits SignalRules::compose() noexcept {
  lines_ = 0;
  for (std::size_t i = 0; i < size(); ++i) {
    const Signal& signal = config_.signals[i];
    const Course& course = courses_[i];
    const bool active = !course.known ? signal.safe : (is_level(signal) ? course.is_held(now_) : course.active);
    if (active) lines_ |= gpio::LineBits{1} << i;
  }
  return lines_;
}

/// The condition was looked at.
void SignalRules::Course::follow(const Signal& signal, bool condition, MonotonicTime now) noexcept {
  const bool begins = condition && !is_held(now);
  known = true;
  holds = condition;
  if (!begins) return;
  held_until = now + signal.hold;
  if (is_level(signal) || active) return;
  active = true;
  next = now + (signal.when == Condition::kHeartbeat ? signal.half_period : signal.pulse);
}

/// Time went by: a pulse ends, the heart beats.
void SignalRules::Course::pass(const Signal& signal, MonotonicTime now) noexcept {
  if (!known || !is_timed(signal) || now < next) return;
  active = !active;
  if (signal.when != Condition::kHeartbeat) return;
  next += signal.half_period;
  if (next <= now) next = now + signal.half_period;
}

bool SignalRules::Course::is_held(MonotonicTime now) const noexcept { return known && (holds || now < held_until); }

/// `next` means something.
bool SignalRules::Course::is_timed(const Signal& signal) const noexcept {
  return signal.when == Condition::kHeartbeat || (signal.mode == Signal::Mode::kPulse && active);
}

}  // namespace stereotrack::signals
