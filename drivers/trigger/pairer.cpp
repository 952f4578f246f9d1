#include "drivers/trigger/pairer.hpp"

#include <algorithm>

namespace stereotrack::trigger {

namespace {

constexpr Side other(Side side) noexcept { return side == Side::kLeft ? Side::kRight : Side::kLeft; }
constexpr std::size_t index(Side side) noexcept { return static_cast<std::size_t>(side); }

std::chrono::nanoseconds part_of(std::chrono::nanoseconds period, double part) noexcept {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(static_cast<double>(period.count()) * part));
}

bool has_place(Verdict verdict) noexcept {
  return verdict == Verdict::kPaired || verdict == Verdict::kNoPartner || verdict == Verdict::kDisagreed;
}

}  // namespace

Pairer::Pairer(const Config& config) noexcept : config_(config), tolerance_(part_of(config.period, config.tolerance)) {}

Result<Pairer> Pairer::create(const Config& config) noexcept {
  const bool good = config.period.count() > 0 && config.tolerance > 0 && config.tolerance <= 0.5;
  if (!good) return fail(Fault::kBadConfig);
  return Pairer(config);
}

Result<void> Pairer::set_period(std::chrono::nanoseconds period) noexcept {
  if (period.count() <= 0) return fail(Fault::kBadConfig);
  config_.period = period;
  tolerance_ = part_of(period, config_.tolerance);
  return {};
}

void Pairer::settle(Verdict verdict, Side side, const SideFrame& frame) noexcept {
  Settled settled;
  settled.verdict = verdict;
  if (has_place(verdict)) settled.ordinal = ++ordinal_;
  (side == Side::kLeft ? settled.left : settled.right) = frame;
  (void)outcome_.push(settled);
  switch (verdict) {
    case Verdict::kNoPartner: ++(side == Side::kLeft ? counters_.missing_right : counters_.missing_left); break;
    case Verdict::kLate: ++counters_.late; break;
    case Verdict::kOutOfOrder: ++counters_.out_of_order; break;
    case Verdict::kDuplicate: ++counters_.duplicate; break;
    case Verdict::kClockStep:  // counted as one step, with all that waited
    case Verdict::kDisagreed:  // counted as one fit
    case Verdict::kPaired: break;
  }
}

void Pairer::settle_oldest(Verdict verdict) noexcept {
  settle(verdict, waiting_side_, waiting_[0]);
  std::copy(waiting_.begin() + 1, waiting_.begin() + static_cast<std::ptrdiff_t>(waiting_count_), waiting_.begin());
  --waiting_count_;
}

void Pairer::hand_back_waiting(Verdict verdict) noexcept {
  while (waiting_count_ > 0) settle_oldest(verdict);
}

bool Pairer::sequences_agree(const SideFrame& left, const SideFrame& right) noexcept {
  if (!config_.sequenced) return true;
  const auto difference = static_cast<std::int64_t>(left.sequence - right.sequence);
  if (difference_ == difference) {
    agreed_ = 0;
    return true;
  }
  agreed_ = agreed_ > 0 && candidate_ == difference ? agreed_ + 1 : 1;
  candidate_ = difference;
  if (agreed_ < (difference_ ? kRelearn : kLearn)) return false;
  difference_ = difference;
  agreed_ = 0;
  return true;
}

void Pairer::settle_fit(const SideFrame& left, const SideFrame& right) noexcept {
  const bool agree = sequences_agree(left, right);
  Settled settled;
  settled.verdict = agree ? Verdict::kPaired : Verdict::kDisagreed;
  settled.ordinal = ++ordinal_;
  settled.left = left;
  settled.right = right;
  (void)outcome_.push(settled);
  ++(agree ? counters_.paired : counters_.disagreed);
  // What still waits may bear stamps of the same other clock.
  if (!agree) hand_back_waiting(Verdict::kClockStep);
}

/// False: settled.
bool Pairer::is_in_order(Side side, const SideFrame& frame) noexcept {
  const std::optional<Last>& last = last_[index(side)];
  if (!last) return true;
  if (frame.mid_exposure == last->time || (config_.sequenced && frame.sequence == last->sequence)) {
    settle(Verdict::kDuplicate, side, frame);
    return false;
  }
  const std::chrono::nanoseconds back = last->time - frame.mid_exposure;
  if (back.count() < 0) return true;
  if (back <= kStepPeriods * config_.period) {
    settle(Verdict::kOutOfOrder, side, frame);
    return false;
  }
  ++counters_.clock_steps;
  hand_back_waiting(Verdict::kClockStep);
  last_ = {};
  closed_ = {};
  return true;
}

void Pairer::wait(Side side, const SideFrame& frame) noexcept {
  if (waiting_count_ == kMaxWaiting) {
    closed_[index(other(side))] = waiting_[0].mid_exposure;
    settle_oldest(Verdict::kNoPartner);
  }
  waiting_side_ = side;
  waiting_[waiting_count_++] = frame;
  counters_.waiting_high = std::max<std::uint64_t>(counters_.waiting_high, waiting_count_);
}

const Pairer::Outcome& Pairer::push(Side side, const SideFrame& frame) noexcept {
  outcome_.clear();
  if (!is_in_order(side, frame)) return outcome_;
  last_[index(side)] = Last{frame.mid_exposure, frame.sequence};

  while (waiting_count_ > 0 && waiting_side_ != side) {
    const std::chrono::nanoseconds ahead = frame.mid_exposure - waiting_[0].mid_exposure;
    if (ahead < -tolerance_) break;  // all that waits is later
    const bool next_is_closer =
        waiting_count_ > 1 && std::chrono::abs(frame.mid_exposure - waiting_[1].mid_exposure) < std::chrono::abs(ahead);
    if (ahead > tolerance_ || next_is_closer) {
      settle_oldest(Verdict::kNoPartner);
      continue;
    }
    const SideFrame partner = waiting_[0];
    std::copy(waiting_.begin() + 1, waiting_.begin() + static_cast<std::ptrdiff_t>(waiting_count_), waiting_.begin());
    --waiting_count_;
    if (side == Side::kLeft) {
      settle_fit(frame, partner);
    } else {
      settle_fit(partner, frame);
    }
    return outcome_;
  }

  const std::optional<CaptureTime>& closed = closed_[index(side)];
  if (closed && frame.mid_exposure <= *closed + tolerance_) {
    settle(Verdict::kLate, side, frame);
  } else if (waiting_count_ > 0 && waiting_side_ != side) {
    settle(Verdict::kNoPartner, side, frame);  // the other side is beyond it
  } else if (const std::optional<Last>& beyond = last_[index(other(side))];
             beyond && beyond->time > frame.mid_exposure + tolerance_) {
    settle(Verdict::kNoPartner, side, frame);  // and what was beyond is settled, too
  } else {
    wait(side, frame);
  }
  return outcome_;
}

const Pairer::Outcome& Pairer::give_up_before(CaptureTime time) noexcept {
  outcome_.clear();
  while (waiting_count_ > 0 && waiting_[0].mid_exposure < time) {
    closed_[index(other(waiting_side_))] = waiting_[0].mid_exposure;
    settle_oldest(Verdict::kNoPartner);
  }
  return outcome_;
}

const Pairer::Outcome& Pairer::restart() noexcept {
  outcome_.clear();
  hand_back_waiting(Verdict::kNoPartner);
  last_ = {};
  closed_ = {};
  difference_.reset();
  agreed_ = 0;
  return outcome_;
}

}  // namespace stereotrack::trigger
