#include "drivers/trigger/pulse_matcher.hpp"

namespace stereotrack::trigger {

Result<PulseMatcher> PulseMatcher::create(const Config& config) noexcept {
  const bool good =
      config.period.count() > 0 && config.delay.count() >= 0 && config.tolerance > 0 && config.tolerance < 0.5;
  if (!good) return fail(Fault::kBadConfig);
  return PulseMatcher(config);
}

PulseMatcher::PulseMatcher(const Config& config) noexcept
    : config_(config),
      tolerance_(static_cast<std::int64_t>(static_cast<double>(config.period.count()) * config.tolerance)) {}

void PulseMatcher::miss_before(std::size_t side, std::uint64_t number) noexcept {
  for (Pulse& pulse : pulses_) {
    if (pulse.number == 0 || pulse.number >= number || pulse.settled[side]) continue;
    pulse.settled[side] = true;
    ++counters_[side].missed;
  }
}

void PulseMatcher::pulse(std::uint64_t number, CaptureTime time) noexcept {
  if (number <= last_) return;
  last_ = number;
  for (std::size_t side = 0; side < 2; ++side) {
    if (number > kPatience) miss_before(side, number - kPatience);
  }
  // What stood here is kKept pulses old, and settled.
  pulses_[number % kKept] = {number, time + config_.delay, {}, {}};
}

PulseMatcher::Found PulseMatcher::frame(Side side, CaptureTime begin) noexcept {
  const auto s = static_cast<std::size_t>(side);
  Pulse* nearest = nullptr;
  for (Pulse& pulse : pulses_) {
    if (pulse.number == 0) continue;
    if (nearest == nullptr || std::chrono::abs(begin - pulse.begin) < std::chrono::abs(begin - nearest->begin)) {
      nearest = &pulse;
    }
  }
  const std::chrono::nanoseconds off = nearest == nullptr ? std::chrono::nanoseconds(0) : begin - nearest->begin;
  if (nearest == nullptr || std::chrono::abs(off) > tolerance_) {
    ++counters_[s].stray;
    return {Kind::kStray, 0, off, nearest != nullptr && std::chrono::abs(off) <= config_.period};
  }
  if (nearest->answered[s]) {
    ++counters_[s].doubled;
    return {Kind::kDoubled, nearest->number, off, true};
  }
  miss_before(s, nearest->number);
  nearest->answered[s] = nearest->settled[s] = true;
  ++counters_[s].answered;
  return {Kind::kAnswer, nearest->number, off, true};
}

void PulseMatcher::restart(Side side) noexcept {
  for (Pulse& pulse : pulses_) pulse.settled[static_cast<std::size_t>(side)] = true;
}

}  // namespace stereotrack::trigger
