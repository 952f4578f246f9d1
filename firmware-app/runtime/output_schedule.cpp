#include "firmware-app/runtime/output_schedule.hpp"

#include <algorithm>

namespace stereotrack::runtime {

namespace {

bool fits(const OutputSchedule::Config& config) noexcept {
  return config.period.count() > 0 && config.latency.count() > 0 &&
         config.latency / config.period <= static_cast<int>(OutputSchedule::kMaxInFlight / 2) &&
         config.lead.count() >= 0 && config.lead < config.latency && config.grace.count() >= 0 &&
         config.grace < config.period && config.oldest_state >= config.latency && config.missing_limit >= 1;
}

}  // namespace

Result<OutputSchedule> OutputSchedule::create(const Config& config, const ClockMap& map) noexcept {
  if (!fits(config)) return fail(Fault::kBadConfig);
  return OutputSchedule(config, map);
}

Result<void> OutputSchedule::set_period(std::chrono::nanoseconds period) noexcept {
  Config changed = config_;
  changed.period = period;
  if (!fits(changed)) return fail(Fault::kBadConfig);
  config_ = changed;
  return {};
}

void OutputSchedule::set_map(const ClockMap& map) noexcept {
  map_ = map;
  map_is_suspect_ = false;
}

void OutputSchedule::restart() noexcept {
  pending_count_ = 0;
  noticed_ = 0;
  decided_ = 0;
  anchored_ = false;
  last_was_missing_ = false;
  missing_run_ = 0;
  kept_ = {};
  newest_ = kKeeps;
}

/// The last slot left, as missing, in this one's place.
bool OutputSchedule::is_told(const Slot& slot) const noexcept {
  return anchored_ && last_was_missing_ && pending_count_ == 0 &&
         std::chrono::abs(slot.captured - last_) <= config_.period / 2;
}

/// The slots from the period get this one's phase, from the first on that is still to leave.
void OutputSchedule::take_phase(MonotonicTime captured, MonotonicTime now) noexcept {
  missing_run_ = 0;
  if (pending_count_ > 0) return;  // pairs in flight know better
  const std::chrono::nanoseconds over = now - config_.latency - captured;
  if (over.count() > 0) captured += over / config_.period * config_.period;
  // Back by less than half a period: the same slot. By more: the last slot was already a later one.
  if (anchored_ && captured <= last_ - config_.period / 2) return;
  last_ = captured;
  anchored_ = true;
}

void OutputSchedule::notice(std::uint64_t ordinal, CaptureTime capture_time, MonotonicTime now) noexcept {
  if (ordinal <= noticed_) {
    ++counters_.notices_out_of_order;
    return;
  }
  noticed_ = ordinal;
  drop_overslept(now);
  const Slot slot{ordinal, map_.to_monotonic(capture_time)};
  if (slot.captured > now) {
    ++counters_.from_future;
    map_is_suspect_ = true;
    if (!status_only()) missing_run_ = 0;  // pairs do come
    return;
  }
  const MonotonicTime due = slot.captured + config_.latency;
  if (due + config_.period < now) {
    ++counters_.from_past;
    map_is_suspect_ = true;
    decided_ = ordinal;
    take_phase(slot.captured, now);
    return;
  }
  if (due + config_.grace < now || is_told(slot)) {
    ++counters_.late_notices;
    decided_ = ordinal;
    take_phase(slot.captured, now);
    return;
  }
  const bool rises =
      pending_count_ > 0 ? slot.captured > pending_[pending_count_ - 1].captured : !anchored_ || slot.captured > last_;
  if (!rises) {
    ++counters_.notices_out_of_order;
    map_is_suspect_ = true;  // the ordinal rose, the time did not
    return;
  }
  if (status_only()) anchored_ = false;  // the cadence begins anew with this pair
  missing_run_ = 0;
  if (pending_count_ == kMaxInFlight) {
    ++counters_.refused;
    return;
  }
  pending_[pending_count_++] = slot;
}

bool OutputSchedule::is_pending(std::uint64_t ordinal) const noexcept {
  return std::any_of(pending_.begin(), pending_.begin() + static_cast<std::ptrdiff_t>(pending_count_),
                     [ordinal](const Slot& slot) { return slot.ordinal == ordinal; });
}

MonotonicTime OutputSchedule::captured_of(std::uint64_t ordinal) const noexcept {
  const auto* found =
      std::find_if(pending_.begin(), pending_.end(), [ordinal](const Slot& slot) { return slot.ordinal == ordinal; });
  return found->captured;
}

std::size_t OutputSchedule::find_kept(std::uint64_t ordinal) const noexcept {
  const auto* found =
      std::find_if(kept_.begin(), kept_.end(), [ordinal](const Kept& kept) { return kept.ordinal == ordinal; });
  return static_cast<std::size_t>(found - kept_.begin());
}

/// Any result may go that is neither the state nor a pending slot's; those whose notice is still to come go last. There
/// are two more places than slots, so there is always one.
std::size_t OutputSchedule::room_for_result() const noexcept {
  std::size_t oldest = kKeeps;
  for (std::size_t i = 0; i < kKeeps; ++i) {
    if (i == newest_ || is_pending(kept_[i].ordinal)) continue;
    if (oldest == kKeeps || kept_[i].ordinal < kept_[oldest].ordinal) oldest = i;
  }
  return oldest;
}

std::optional<std::size_t> OutputSchedule::result(std::uint64_t ordinal, CaptureTime capture_time,
                                                  MonotonicTime arrival) noexcept {
  MonotonicTime captured = map_.to_monotonic(capture_time);
  if (captured > arrival) {
    ++counters_.from_future;
    map_is_suspect_ = true;
    return std::nullopt;
  }
  const bool newer = newest_ == kKeeps || ordinal > kept_[newest_].ordinal;
  const bool pending = is_pending(ordinal);
  if (find_kept(ordinal) != kKeeps || (!newer && !pending)) {
    ++counters_.stale_results;
    return std::nullopt;
  }
  if (!pending && ordinal <= decided_) ++counters_.late_results;
  if (pending) captured = captured_of(ordinal);  // the map may have changed since the notice
  const std::size_t keep = room_for_result();
  kept_[keep] = {ordinal, capture_time, captured};
  if (newer) newest_ = keep;
  return keep;
}

std::optional<OutputSchedule::Slot> OutputSchedule::next_slot() const noexcept {
  const bool periodic = !status_only();
  const MonotonicTime expected = last_ + config_.period;
  if (pending_count_ > 0) {
    const Slot& pair = pending_[0];
    // Within half a period of where the period puts it, or nothing is expected: this is the next one.
    if (!periodic || pair.captured - expected <= config_.period / 2) return pair;
  }
  if (periodic) return Slot{0, expected};
  return std::nullopt;
}

std::optional<MonotonicTime> OutputSchedule::next_wake() const noexcept {
  const std::optional<Slot> slot = next_slot();
  if (!slot) return std::nullopt;
  return slot->captured + config_.latency - config_.lead;
}

void OutputSchedule::consume(const Slot& slot) noexcept {
  last_ = slot.captured;
  anchored_ = true;
  last_was_missing_ = slot.ordinal == 0;
  if (last_was_missing_) {
    if (++missing_run_ == config_.missing_limit) ++counters_.outages;
    return;
  }
  decided_ = std::max(decided_, slot.ordinal);  // a later one may have ended before it: a late notice
  std::copy(pending_.begin() + 1, pending_.begin() + static_cast<std::ptrdiff_t>(pending_count_), pending_.begin());
  --pending_count_;
}

std::optional<OutputSchedule::State> OutputSchedule::state_of(std::size_t keep, MonotonicTime due) const noexcept {
  if (keep == kKeeps) return std::nullopt;
  const Kept& kept = kept_[keep];
  const std::chrono::nanoseconds ahead = due - kept.captured;
  if (ahead > config_.oldest_state) return std::nullopt;
  return State{kept.ordinal, kept.capture_time, ahead, keep};
}

OutputSchedule::Output OutputSchedule::compose(const Slot& slot, MonotonicTime now) noexcept {
  Output out;
  out.ordinal = slot.ordinal;
  out.captured = slot.captured;
  out.due = slot.captured + config_.latency;
  out.after_due = now > out.due;
  const std::size_t own = slot.ordinal == 0 ? kKeeps : find_kept(slot.ordinal);
  if (own != kKeeps) {
    out.kind = Kind::kOnTime;
    out.state = state_of(own, out.due);
    ++counters_.on_time;
  } else {
    out.state = state_of(newest_, out.due);
    if (slot.ordinal == 0) {
      out.kind = Kind::kMissing;
      ++counters_.missing;
    } else {
      out.kind = Kind::kPredicted;
      out.superseded = newest_ != kKeeps && kept_[newest_].ordinal > slot.ordinal;
      ++(out.superseded ? counters_.predicted_superseded : counters_.predicted_late);
    }
  }
  if (out.after_due) ++counters_.after_due;
  if (!out.state) ++counters_.without_state;
  return out;
}

void OutputSchedule::drop_overslept(MonotonicTime now) noexcept {
  // Ends: each round uses up a slot, of which there are at most kMaxInFlight and, in a row, missing_limit.
  while (const std::optional<Slot> slot = next_slot()) {
    if (slot->captured + config_.latency + config_.grace >= now) return;
    ++(slot->ordinal == 0 ? counters_.overslept_missing : counters_.overslept_pairs);
    consume(*slot);
  }
}

std::optional<OutputSchedule::Output> OutputSchedule::decide(MonotonicTime now) noexcept {
  drop_overslept(now);
  const std::optional<Slot> slot = next_slot();
  if (!slot || slot->captured + config_.latency - config_.lead > now) return std::nullopt;
  const Output out = compose(*slot, now);
  consume(*slot);
  return out;
}

}  // namespace stereotrack::runtime
