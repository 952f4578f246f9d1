#include "firmware-app/stereotrackd/publisher_rt.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "drivers/record/output_note.hpp"
#include "drivers/telemetry/frame_flags.hpp"
#include "firmware-app/runtime/allocation_count.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack::daemon {

namespace {

using runtime::OutputSchedule;

constexpr std::chrono::milliseconds kLongestWait{100};  // so that the beat goes on without slots
constexpr std::chrono::seconds kStatusPeriod{1};
constexpr std::chrono::milliseconds kStatusRoom{1};  // a status needs no more, and must not delay a slot
constexpr std::chrono::milliseconds kClockStep{1};   // a map that moves by more than measuring explains
constexpr std::uint64_t kWarmUpOutputs = 10;

std::uint32_t to_us(std::uint64_t ns) noexcept {
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(ns / 1000, std::numeric_limits<std::uint32_t>::max()));
}

std::uint32_t narrow(std::uint64_t count) noexcept {
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(count, std::numeric_limits<std::uint32_t>::max()));
}

/// Where the notice of a pair is kept: they are as many as slots may be in flight.
std::size_t place_of(std::uint64_t ordinal) noexcept {
  return static_cast<std::size_t>(ordinal % OutputSchedule::kMaxInFlight);
}

}  // namespace

Result<std::unique_ptr<Publisher>> Publisher::create(const Config& config, std::unique_ptr<Plan> plan,
                                                     gpio::OutputLines& lines, capture::FramePool& pool,
                                                     capture::PairOutlet::Notices& notices, OutcomeMailbox& mailbox,
                                                     capture::Doorbell& bell, const capture::LiveSource& source,
                                                     Vitals& vitals) {
  const Result<OutputSchedule> schedule = OutputSchedule::create(config.schedule, source.clock_map());
  if (!schedule.has_value()) return fail(schedule.error());
  return std::unique_ptr<Publisher>(
      new Publisher(config, *schedule, std::move(plan), lines, pool, notices, mailbox, bell, source, vitals));
}

Publisher::Publisher(const Config& config, const OutputSchedule& schedule, std::unique_ptr<Plan> plan,
                     gpio::OutputLines& lines, capture::FramePool& pool, capture::PairOutlet::Notices& notices,
                     OutcomeMailbox& mailbox, capture::Doorbell& bell, const capture::LiveSource& source,
                     Vitals& vitals)
    : config_(config),
      schedule_(schedule),
      encoder_(config.encoder),
      plan_(std::move(plan)),
      lines_(lines),
      pool_(pool),
      notices_(notices),
      mailbox_(mailbox),
      bell_(bell),
      source_(source),
      vitals_(vitals),
      map_(source.clock_map()) {}

Publisher::~Publisher() {
  delete incoming_.load();
  delete retired_.load();
}

void Publisher::exchange(std::unique_ptr<Plan> plan) {
  // Acquire and release: the plan's content, in both directions. The new one first: where the publisher takes the one
  // before just now, the place for what is retired is emptied after it.
  delete incoming_.exchange(plan.release(), std::memory_order_acq_rel);
  delete retired_.exchange(nullptr, std::memory_order_acq_rel);
  bell_.ring();
}

void Publisher::take_plan() noexcept {
  // Not before the last one was fetched: there is one place for what is retired.
  if (incoming_.load(std::memory_order_relaxed) == nullptr) return;
  if (retired_.load(std::memory_order_acquire) != nullptr) return;
  Plan* next = incoming_.exchange(nullptr, std::memory_order_acq_rel);
  if (next == nullptr) return;
  const telemetry::SinkCounters& done = plan_->sink->counters();
  before_.sent += done.sent;
  before_.dropped += done.dropped;
  before_.failed += done.failed;
  if (next->rules) {
    rules_are_new_ = true;
  } else {
    next->rules = plan_->rules;
    next->zones = plan_->zones;
  }
  std::unique_ptr<Plan> mine(next);
  plan_.swap(mine);
  retired_.store(mine.release(), std::memory_order_release);  // not freed here
  vitals_.reloads.add();
}

void Publisher::take_news() noexcept {
  capture::PairNotice notice;
  while (notices_.pop(notice)) {
    // Read after it came: a pair that was put in a moment ago must not look as if it were to come.
    schedule_.notice(notice.ordinal, notice.capture_time, runtime::monotonic_now());
    noticed_[place_of(notice.ordinal)] = notice;
    judge_exposure(notice);
  }
  if (const Outcome* outcome = mailbox_.take()) {
    const auto keep = schedule_.result(outcome->ordinal, outcome->capture_time, runtime::monotonic_now());
    if (keep) kept_[*keep] = *outcome;
  }
}

/// What two cameras that were to expose alike did.
void Publisher::judge_exposure(const capture::PairNotice& notice) noexcept {
  if (notice.skew) {
    const std::chrono::nanoseconds skew = std::chrono::abs(*notice.skew);
    vitals_.skew_max_us.set(std::max<std::uint64_t>(vitals_.skew_max_us.get(), skew.count() / 1000));
    if (config_.skew_limit.count() > 0 && skew > config_.skew_limit) vitals_.skew_over.add();
  }
  if (config_.exposure_limit > 0 && notice.left.exposure && notice.right.exposure) {
    const auto [shorter, longer] = std::minmax(*notice.left.exposure, *notice.right.exposure);
    if (to_seconds(longer - shorter) > config_.exposure_limit * to_seconds(longer)) vitals_.exposures_differ.add();
  }
}

/// Null: no pair, or one from long ago.
const capture::PairNotice* Publisher::notice_of(const Output& output) const noexcept {
  if (output.ordinal == 0) return nullptr;
  const std::optional<capture::PairNotice>& notice = noticed_[place_of(output.ordinal)];
  return notice && notice->ordinal == output.ordinal ? &*notice : nullptr;
}

void Publisher::look_at_clocks(MonotonicTime now) noexcept {
  const ClockMap map = source_.clock_map();
  if (std::chrono::abs(map.offset() - map_.offset()) > kClockStep) {
    clock_stepped_ = true;
    vitals_.clock_steps.add();
  }
  map_ = map;
  schedule_.set_map(map);
  if (now >= next_status_) tai_ = runtime::read_tai();
}

telemetry::Live Publisher::live_of(const Output* output) const noexcept {
  telemetry::Live live;
  // Times leave on the capture clock.
  live.tai_offset = tai_.offset + map_.offset();
  live.tai_error = tai_.error;
  live.send_error = send_error_;
  live.efforts_shed = output != nullptr && output->kind == OutputSchedule::Kind::kOnTime
                          ? leaving_.left_out
                          : static_cast<EffortBits>(vitals_.efforts_left_out.get());
  live.health = health_;
  const auto in_us = [](const std::optional<std::chrono::nanoseconds>& exposure) {
    return exposure ? to_us(static_cast<std::uint64_t>(std::max<std::int64_t>(exposure->count(), 0))) : 0U;
  };
  if (const capture::PairNotice* notice = output == nullptr ? nullptr : notice_of(*output)) {
    live.pair_skew = notice->skew;
    live.exposure_left_us = in_us(notice->left.exposure);
    live.exposure_right_us = in_us(notice->right.exposure);
  }
  return live;
}

/// The targets as they are expected at the moment at which the slot leaves, in leaving_.
void Publisher::predict(const Output& output) noexcept {
  leaving_.tracks.clear();
  leaving_.flags = 0;
  leaving_.left_out = 0;
  if (!output.state) return;
  const Outcome& from = kept_[output.state->keep];
  leaving_.flags = from.flags;
  leaving_.left_out = from.left_out;
  const double seconds = to_seconds(output.state->ahead);
  for (const TrackReport& track : from.tracks) {
    TrackReport expected = track;
    extrapolate(config_.extrapolation, seconds, expected);
    if (output.kind != OutputSchedule::Kind::kOnTime) coast(expected);
    (void)leaving_.tracks.push(expected);
  }
}

void Publisher::send(std::span<const std::byte> datagram) noexcept {
  plan_->sink->send(datagram);
  const telemetry::SinkCounters& counters = plan_->sink->counters();
  vitals_.telemetry_sent.set(before_.sent + counters.sent);
  vitals_.telemetry_dropped.set(before_.dropped + counters.dropped);
  vitals_.telemetry_failed.set(before_.failed + counters.failed);
}

void Publisher::trigger(record::Cause cause) noexcept {
  if (box_ != nullptr && (causes_ & cause) != 0) box_->trigger(cause);
}

void Publisher::keep(const Output& output, const telemetry::Message& message) noexcept {
  if (box_ == nullptr) return;
  record::OutputNote note = record::note_of(message, encoder_.sequence());
  note.kind = static_cast<std::uint32_t>(output.kind);
  if (output.state) {
    note.state_ordinal = output.state->ordinal;
    note.ahead_ns = output.state->ahead.count();
  }
  box_->note(note);
}

void Publisher::drive(gpio::LineBits lines, MonotonicTime now) noexcept {
  if ((lines & ~lines_told_ & plan_->zones) != 0) trigger(record::kTargetInZone);
  lines_told_ = lines;
  if (lines_.set(lines, now).failed != 0) vitals_.lines_failed.add();
}

void Publisher::publish(const Output& output) noexcept {
  predict(output);
  const bool own = output.kind == OutputSchedule::Kind::kOnTime;
  if (own) last_on_time_ = output.due;
  const signals::SignalRules::Inputs inputs{.tracks = leaving_.tracks.view(),
                                            .tracks_known = output.state.has_value(),
                                            .depth_known = (leaving_.flags & kFlagMono) == 0,
                                            .deadline_missed = !own,
                                            .healthy = output.due - last_on_time_ <= config_.heart_after};
  const gpio::LineBits lines = plan_->rules->decide(inputs, output.due);
  rules_are_new_ = false;

  telemetry::Message message;
  message.tracks = leaving_.tracks.view();
  message.ordinal = output.ordinal;
  message.capture_time = map_.to_capture(output.captured);
  if (const capture::PairNotice* notice = notice_of(output)) message.capture_time = notice->capture_time;
  message.send_time = message.capture_time + (output.due - output.captured);
  message.latency = output.due - output.captured;
  message.flags = telemetry::flags_of_frame(leaving_.flags) | telemetry::kStateAtOutput;
  if (output.kind == OutputSchedule::Kind::kMissing) message.flags |= telemetry::kPairMissing;
  if (output.kind == OutputSchedule::Kind::kPredicted) message.flags |= telemetry::kPredicted;
  if (output.after_due) message.flags |= telemetry::kLate;
  if (leaving_.left_out != 0) message.flags |= telemetry::kEffortShed;
  if (std::exchange(clock_stepped_, false)) message.flags |= telemetry::kClockStepped;
  const std::uint64_t unused = unused_pairs();
  if (unused != unused_told_) message.flags |= telemetry::kFramesSkippedBefore;
  unused_told_ = unused;
  message.frames_skipped = narrow(unused);
  message.unit_m = config_.unit_m;
  message.focal_x_px = config_.focal_x_px;
  message.focal_y_px = config_.focal_y_px;
  message.live = live_of(&output);
  const telemetry::Encoder::Parts parts = encoder_.encode(message, buffer_);

  runtime::sleep_until(output.due, config_.awake);
  drive(lines, output.due);
  const MonotonicTime set = runtime::monotonic_now();
  for (const std::span<const std::byte> part : parts) send(part);
  const MonotonicTime sent = runtime::monotonic_now();
  send_error_ = sent - output.due;
  vitals_.line_set.record((set - output.due).count());
  vitals_.send_error.record(std::chrono::abs(sent - output.due).count());
  vitals_.capture_to_send.record((sent - output.captured).count());
  vitals_.outputs.add();
  keep(output, message);
  judge(output, sent - output.due);
  vitals_.targets.set(leaving_.tracks.size());
  last_states_.add({.ordinal = output.ordinal,
                    .due_ns = output.due.time_since_epoch().count(),
                    .send_error_ns = send_error_->count(),
                    .compute_max_ns = vitals_.compute.max_ns(),
                    .kind = static_cast<std::uint32_t>(output.kind),
                    .flags = message.flags,
                    .targets = static_cast<std::uint32_t>(leaving_.tracks.size()),
                    .health = health_});
}

/// What left and was not as the contract wants it: once a message, whatever the reasons.
void Publisher::judge(const Output& output, std::chrono::nanoseconds late) noexcept {
  // That a pair did not come is not the daemon's deadline; that it left late is.
  const bool sent_late = late > config_.late_after;
  if (sent_late) vitals_.sent_late.add();
  const bool missed = output.kind == OutputSchedule::Kind::kPredicted || sent_late || output.after_due;
  if (missed) vitals_.deadline_misses_left.add();
}

std::uint64_t Publisher::deadline_misses() const noexcept {
  return vitals_.deadline_misses_left.get() + schedule_.counters().overslept_pairs;
}

/// Pairs of which no result of their own could come: lost before, given up for want of a buffer, passed over, refused.
std::uint64_t Publisher::unused_pairs() const noexcept {
  const capture::FramePool::Counters pool = pool_.counters();
  const OutputSchedule::Counters& outputs = schedule_.counters();
  return outputs.missing + outputs.overslept_missing + pool.starved + pool.evicted + pool.skipped +
         vitals_.frames_refused.get();
}

/// What went wrong since the last time, a second ago.
void Publisher::judge_health() noexcept {
  const std::uint64_t misses = deadline_misses();
  const std::uint64_t drops = vitals_.telemetry_dropped.get();
  const std::uint64_t lines_failed = vitals_.lines_failed.get();
  const std::uint64_t recordings =
      box_ == nullptr ? 0 : box_->counters().triggers_dropped.load() + box_->counters().recordings_failed.load();
  std::uint32_t health = standing_health_.load(std::memory_order_relaxed);
  const auto tell_if = [&health](bool wrong, telemetry::Health bit) {
    if (wrong) health |= bit;
  };
  tell_if(schedule_.status_only(), telemetry::kHealthNoPairs);
  tell_if(pairs_are_not_believed(), telemetry::kHealthNoPairs);
  cameras_ = source_.figures();
  tell_if(cameras_.cameras[0].silent, telemetry::kHealthLeftSilent);
  tell_if(cameras_.cameras[1].silent, telemetry::kHealthRightSilent);
  const bool left_astray = cameras_.cameras[0].astray;
  const bool right_astray = cameras_.cameras[1].astray;
  tell_if(cameras_.trigger_silent || left_astray || right_astray || trigger_fails(), telemetry::kHealthTriggerFailed);
  tell_if(left_astray, telemetry::kHealthLeftAstray);
  tell_if(right_astray, telemetry::kHealthRightAstray);
  tell_if(vitals_.skew_over.get() != skew_over_seen_, telemetry::kHealthSkew);
  tell_if(vitals_.exposures_differ.get() != exposures_differ_seen_, telemetry::kHealthExposuresDiffer);
  const std::uint64_t wrong_pairs = vitals_.wrong_pairs.get();
  tell_if(std::exchange(wrong_pairs_seen_, wrong_pairs) != wrong_pairs, telemetry::kHealthWrongPairs);
  skew_over_seen_ = vitals_.skew_over.get();
  exposures_differ_seen_ = vitals_.exposures_differ.get();
  tell_if(misses != misses_seen_, telemetry::kHealthDeadlinesMissed);
  tell_if(vitals_.efforts_left_out.get() != 0, telemetry::kHealthEffortShed);
  tell_if(lines_failed != lines_failed_seen_ || vitals_.inputs_gone.get() != 0, telemetry::kHealthLineFailed);
  tell_if(drops != drops_seen_, telemetry::kHealthTelemetryDrops);
  tell_if(recordings != recordings_seen_, telemetry::kHealthRecordingDrops);
  recordings_seen_ = recordings;
  tell_if(!tai_.error.has_value(), telemetry::kHealthClockUnsynchronised);
  tell_if(vitals_.allocations() > 0, telemetry::kHealthAllocated);
  misses_seen_ = misses;
  drops_seen_ = drops;
  lines_failed_seen_ = lines_failed;
  health_ = health;
  vitals_.health.set(health);
}

/// Pairs came since the last time, and none with a time that can be: each slot left as missing.
bool Publisher::pairs_are_not_believed() noexcept {
  const OutputSchedule::Counters& outputs = schedule_.counters();
  const std::uint64_t refused = outputs.from_future + outputs.from_past;
  const std::uint64_t had_a_slot = outputs.on_time + outputs.predicted_late + outputs.predicted_superseded;
  const bool some_were_refused = std::exchange(refused_seen_, refused) != refused;
  const bool none_had_a_slot = std::exchange(had_a_slot_seen_, had_a_slot) == had_a_slot;
  return some_were_refused && none_had_a_slot;
}

/// Pulses of ours that were not given since the last time.
bool Publisher::trigger_fails() noexcept {
  if (config_.train == nullptr) return false;
  const std::uint64_t now = config_.train->skipped.get() + config_.train->failed.get();
  return std::exchange(trigger_failures_seen_, now) != now;
}

void Publisher::send_status(MonotonicTime now) noexcept {
  judge_health();
  const capture::FramePool::Counters pool = pool_.counters();
  const OutputSchedule::Counters& outputs = schedule_.counters();
  telemetry::Status status;
  status.uptime_ms =
      static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::milliseconds>(now - started_).count());
  status.health = health_;
  status.efforts_shed = static_cast<EffortBits>(vitals_.efforts_left_out.get());
  status.latency_us = to_us(static_cast<std::uint64_t>(config_.schedule.latency.count()));
  status.period_us = to_us(static_cast<std::uint64_t>(config_.schedule.period.count()));
  status.pairs_captured = pool.captured;
  status.pairs_evicted = pool.evicted;
  status.pairs_skipped = pool.skipped;
  status.pairs_starved = pool.starved;
  status.unpaired_left = cameras_.missing_right;
  status.unpaired_right = cameras_.missing_left;
  status.trigger_pulses = cameras_.pulses;
  if (config_.train != nullptr) {
    status.trigger_pulses = config_.train->given.get();
    status.trigger_skipped = config_.train->skipped.get();
    status.trigger_failed = config_.train->failed.get();
  }
  status.exposures_missed_left = cameras_.cameras[0].missed;
  status.exposures_missed_right = cameras_.cameras[1].missed;
  status.exposures_doubled_left = cameras_.cameras[0].doubled;
  status.exposures_doubled_right = cameras_.cameras[1].doubled;
  status.exposures_stray_left = cameras_.cameras[0].stray;
  status.exposures_stray_right = cameras_.cameras[1].stray;
  status.skew_max_us = narrow(vitals_.skew_max_us.get());
  status.outputs_on_time = outputs.on_time;
  status.outputs_predicted = outputs.predicted_late + outputs.predicted_superseded;
  status.outputs_missing = outputs.missing;
  status.outputs_overslept = outputs.overslept_pairs + outputs.overslept_missing;
  status.late_results = outputs.late_results;
  status.deadline_misses = misses_seen_;
  status.allocations = vitals_.allocations();
  status.telemetry_sent = vitals_.telemetry_sent.get();
  status.telemetry_dropped = vitals_.telemetry_dropped.get();
  status.telemetry_failed = vitals_.telemetry_failed.get();
  status.lines_failed = vitals_.lines_failed.get();
  status.clock_steps = vitals_.clock_steps.get();
  status.efforts_shed_count = vitals_.efforts_shed.get();
  if (box_ != nullptr) {
    const record::BlackBox::Counters& box = box_->counters();
    status.recordings_dropped = box.triggers_dropped.load() + box.recordings_failed.load();
    status.recorder_slots = narrow(box_->slots());
    status.recorder_slots_free_low = narrow(box.slots_free_low.load());
  }
  status.pair_buffers = narrow(config_.pool_slots);
  status.pair_buffers_free_low = narrow(pool.free_low);
  status.pairs_waiting_high = narrow(pool.waiting_high);
  status.compute_p50_us = to_us(vitals_.compute.percentile_ns(0.5));
  status.compute_p99_us = to_us(vitals_.compute.percentile_ns(0.99));
  status.compute_max_us = to_us(vitals_.compute.max_ns());
  status.send_error_p50_us = to_us(vitals_.send_error.percentile_ns(0.5));
  status.send_error_p99_us = to_us(vitals_.send_error.percentile_ns(0.99));
  status.send_error_max_us = to_us(vitals_.send_error.max_ns());
  send(encoder_.encode_status(status, live_of(nullptr), map_.to_capture(now),
                              std::span(buffer_).first<telemetry::kMaxDatagramBytes>()));
}

void Publisher::tell() noexcept {
  const std::uint64_t misses = deadline_misses();
  vitals_.deadline_misses.set(misses);
  if (std::exchange(misses_triggered_, misses) != misses) trigger(record::kDeadlineMiss);
  for (std::size_t i = 0; i < kScheduleCounters.size(); ++i) {
    vitals_.schedule[i].set(schedule_.counters().*kScheduleCounters[i].member);
  }
}

MonotonicTime Publisher::next_wake(MonotonicTime now) const noexcept {
  MonotonicTime wake = now + kLongestWait;
  if (next_status_ > now) wake = std::min(wake, next_status_);  // else it waits for the slot before it
  if (const auto slot = schedule_.next_wake()) wake = std::min(wake, *slot);
  if (const auto change = rules_are_new_ ? std::nullopt : plan_->rules->next_change()) wake = std::min(wake, *change);
  return wake;
}

/// A status where it delays no slot, or is overdue itself; what others read.
void Publisher::between_slots(MonotonicTime now) noexcept {
  tell();
  if (now < next_status_) return;
  const std::optional<MonotonicTime> slot = schedule_.next_wake();
  const bool has_room = !slot || *slot - now > kStatusRoom;
  if (!has_room && now < next_status_ + kStatusPeriod) return;
  look_at_clocks(now);
  send_status(now);
  // Here, where it delays no slot: a chip that is gone shows, though none of its lines changes.
  if (lines_.refresh(now).failed != 0) vitals_.lines_failed.add();
  next_status_ = std::max(next_status_ + kStatusPeriod, now);
}

void Publisher::run(const std::atomic<bool>& no_more, const std::atomic<bool>& stop) noexcept {
  started_ = runtime::monotonic_now();
  next_status_ = started_;
  last_on_time_ = started_ - config_.heart_after - std::chrono::nanoseconds(1);
  std::uint64_t heap_before = allocations_of_this_thread();
  while (!stop.load(std::memory_order_relaxed)) {
    vitals_.publisher_beats.add();
    // Before the news are taken: acquire shows all notices of before.
    const bool is_last = no_more.load(std::memory_order_acquire);
    const capture::Doorbell::Count seen = bell_.rings();
    take_plan();
    take_news();
    MonotonicTime now = runtime::monotonic_now();
    if (is_last && schedule_.in_flight() == 0) break;
    if (schedule_.map_is_suspect()) look_at_clocks(now);
    const std::optional<MonotonicTime> slot = schedule_.next_wake();
    if (slot && *slot <= now) vitals_.publisher_wake_up.record((now - *slot).count());
    if (const std::optional<Output> output = schedule_.decide(now)) {
      publish(*output);
      now = runtime::monotonic_now();
    } else {
      if (!rules_are_new_) drive(plan_->rules->advance(now), now);
    }
    between_slots(now);
    const std::uint64_t heap_calls = allocations_of_this_thread() - heap_before;
    if (vitals_.outputs.get() > kWarmUpOutputs) vitals_.publisher_allocations.add(heap_calls);
    heap_before += heap_calls;
    now = runtime::monotonic_now();
    const MonotonicTime wake = next_wake(now);
    if (wake > now) (void)bell_.wait(seen, wake);
  }
  (void)lines_.set_safe(runtime::monotonic_now());
  tell();
  finished_.store(true, std::memory_order_release);
}

}  // namespace stereotrack::daemon
