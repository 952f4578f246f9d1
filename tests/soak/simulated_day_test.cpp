#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "drivers/capture/live_source.hpp"
#include "drivers/gpio/simulated_chip.hpp"
#include "drivers/trigger/pairer.hpp"
#include "firmware-app/runtime/effort.hpp"
#include "firmware-app/runtime/output_schedule.hpp"
#include "firmware-app/signals/signal_rules.hpp"
#include "pipeline/core/mailbox.hpp"
#include "tests/rt/heap_watch.hpp"

// A day of the daemon's heart in simulated time: sensors, pairer, pool, frame loop, schedule, rules and lines, as the
// threads of firmware-app/stereotrackd run them, one event after the other. One fault at a time, whose counters must
// move by exactly what it is and no others; and storms, in which all come at once and only the books must balance.
namespace stereotrack::runtime {
namespace {

using capture::FramePool;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using trigger::Pairer;
using trigger::Side;

constexpr nanoseconds kPeriod{16'666'667};  // 60 pairs a second
constexpr int kPerHour = 60 * 3600;
constexpr milliseconds kLatency{40};
constexpr milliseconds kLead{1};
constexpr milliseconds kGrace{4};
constexpr milliseconds kStale{100};   // no output for so long: all lines are safe
constexpr milliseconds kTransfer{2};  // from exposure to arrival
constexpr microseconds kRightAfter{100};
constexpr milliseconds kGiveUpAfter{14};  // after exposure, the driver waits for no partner any more
constexpr milliseconds kCompute{8};
constexpr int kMissingLimit = 5;
constexpr std::size_t kPoolSlots = 4;
constexpr std::uint64_t kWindow = 60;           // slots of one fault, until all is as before
constexpr std::uint64_t kStatusSlot = 40;       // of each window
constexpr std::uint64_t kSettle = 5 * kWindow;  // after a storm
constexpr const char* kLines[] = {"day-seen", "day-unseen", "day-heart", "day-missed"};

/// All that is counted.
enum Count : std::size_t {
  kPaired,
  kMissingLeft,
  kMissingRight,
  kLateFrames,
  kOutOfOrder,
  kDuplicate,
  kPairerSteps,  // Pairer
  kCaptured,
  kEvicted,
  kSkipped,
  kStarved,  // FramePool
  kOnTime,
  kPredictedLate,
  kSuperseded,
  kMissing,
  kOversleptPairs,
  kOversleptMissing,  // OutputSchedule
  kAfterDue,
  kWithoutState,
  kOutages,
  kLateResults,
  kStaleResults,
  kLateNotices,
  kDisordered,
  kFromFuture,
  kFromPast,
  kRefused,
  kOverruns,
  kHelpless,
  kSheds,
  kRestores,     // EffortController
  kLinesFailed,  // OutputLines
  kCounts
};
constexpr std::array<const char*, kCounts> kNames{"paired",
                                                  "missing_left",
                                                  "missing_right",
                                                  "late frames",
                                                  "out_of_order",
                                                  "duplicate",
                                                  "pairer steps",
                                                  "captured",
                                                  "evicted",
                                                  "skipped",
                                                  "starved",
                                                  "on_time",
                                                  "predicted_late",
                                                  "predicted_superseded",
                                                  "missing",
                                                  "overslept_pairs",
                                                  "overslept_missing",
                                                  "after_due",
                                                  "without_state",
                                                  "outages",
                                                  "late_results",
                                                  "stale_results",
                                                  "late_notices",
                                                  "out of order notices",
                                                  "from_future",
                                                  "from_past",
                                                  "refused",
                                                  "overruns",
                                                  "helpless",
                                                  "sheds",
                                                  "restores",
                                                  "lines failed"};
using Tally = std::array<std::int64_t, kCounts>;

struct Outcome {
  std::uint64_t ordinal = 0;
  CaptureTime capture_time{};
};

/// What is wrong with one slot's frames and frame.
struct SlotPlan {
  std::array<bool, 2> lost{};
  std::array<bool, 2> twice{};
  std::array<nanoseconds, 2> late{};  ///< later than kTransfer, by side
  nanoseconds exposed{0};             ///< later than the period says
  nanoseconds compute = kCompute;
  bool holds_lease = false;  ///< to the end of its run
};

struct Event {
  enum class Kind : std::uint8_t { kFrame, kGiveUp, kDone };
  MonotonicTime at{};
  Kind kind = Kind::kFrame;
  Side side = Side::kLeft;
  CaptureTime stamp{};
  std::uint64_t slot = 0;
};

signals::SignalRules day_rules() {
  signals::SignalRules::Config config;
  config.unit_m = 1;
  config.stale_after = kStale;
  signals::Signal seen;
  signals::Signal unseen;
  unseen.safe = true;
  signals::Signal heart;
  heart.when = signals::Condition::kHeartbeat;
  heart.half_period = milliseconds(50);
  signals::Signal missed;
  missed.when = signals::Condition::kDeadlineMissed;
  for (const signals::Signal& signal : {seen, unseen, heart, missed}) (void)config.signals.push(signal);
  return *signals::SignalRules::create(config);
}

OutputSchedule day_schedule() {
  return *OutputSchedule::create({.latency = kLatency,
                                  .period = kPeriod,
                                  .lead = kLead,
                                  .grace = kGrace,
                                  .oldest_state = milliseconds(90),
                                  .missing_limit = kMissingLimit},
                                 ClockMap());
}

EffortController day_effort() {
  EffortController::Config config;
  for (const Effort effort : {Effort::kCorners, Effort::kDenseMap}) (void)config.order.push(effort);
  config.restore_after = 8;
  config.patience_most = 32;
  return *EffortController::create(config);
}

class Day {
 public:
  Day() {
    target_.id = 1;
    target_.state = TrackState::kConfirmed;
    std::vector<gpio::LineSpec> specs;
    for (const char* name : kLines) specs.push_back({{"sim", name}, false, specs.size() == 1});
    lines_ = gpio::open_lines(specs, "test");
  }

  // ---- What goes wrong, from the slot to come on

  SlotPlan& plan(std::uint64_t slots_ahead = 0) { return plans_[(slot_ + slots_ahead) % plans_.size()]; }
  void step_clock(nanoseconds by) { ahead_ += by; }
  /// The process does not run from a millisecond before the slot to come is exposed.
  void suspend(nanoseconds span) { wakes_ = exposure(slot_) - milliseconds(1) + span; }
  static void chip_is_gone(bool gone) {
    for (const char* name : kLines) gpio::simulated_chip::set_gone(name, gone);
  }

  /// Goes on by so many slots.
  void pass(std::uint64_t slots) {
    for (const std::uint64_t last = slot_ + slots; slot_ < last; ++slot_) {
      expose();
      go_until(exposure(slot_ + 1) - milliseconds(1));
    }
  }

  [[nodiscard]] std::uint64_t slot() const { return slot_; }
  [[nodiscard]] std::uint64_t service_heap_calls() const { return service_calls_; }
  [[nodiscard]] gpio::LineBits lines() const { return rules_.lines(); }
  [[nodiscard]] const OutputSchedule& schedule() const { return schedule_; }
  [[nodiscard]] const EffortController& effort() const { return effort_; }

  [[nodiscard]] Tally tally() const {
    const auto i = [](std::uint64_t n) { return static_cast<std::int64_t>(n); };
    const Pairer::Counters& p = pairer_.counters();
    const FramePool::Counters f = pool_.counters();
    const OutputSchedule::Counters& s = schedule_.counters();
    const EffortController::Counters& e = effort_.counters();
    const auto sum = [](const auto& counts) {
      std::int64_t all = 0;
      for (const std::uint64_t n : counts) all += static_cast<std::int64_t>(n);
      return all;
    };
    return {i(p.paired),
            i(p.missing_left),
            i(p.missing_right),
            i(p.late),
            i(p.out_of_order),
            i(p.duplicate),
            i(p.clock_steps),
            i(f.captured),
            i(f.evicted),
            i(f.skipped),
            i(f.starved),
            i(s.on_time),
            i(s.predicted_late),
            i(s.predicted_superseded),
            i(s.missing),
            i(s.overslept_pairs),
            i(s.overslept_missing),
            i(s.after_due),
            i(s.without_state),
            i(s.outages),
            i(s.late_results),
            i(s.stale_results),
            i(s.late_notices),
            i(s.notices_out_of_order),
            i(s.from_future),
            i(s.from_past),
            i(s.refused),
            i(e.overruns),
            i(e.helpless),
            sum(e.sheds),
            sum(e.restores),
            i(lines_failed_)};
  }

  /// The books, whatever has happened.
  void audit() const {
    const OutputSchedule::Counters& s = schedule_.counters();
    const Pairer::Counters& p = pairer_.counters();
    const FramePool::Counters f = pool_.counters();
    // Each frame that came in went out once, or waits.
    ASSERT_EQ(frames_in_, frames_out_ + pairer_.waiting());
    ASSERT_EQ(p.paired, pairs_);
    ASSERT_EQ(p.paired, f.captured + f.starved);
    // Each pair was told of and has ended in one way, or is in flight.
    ASSERT_EQ(notices_.refused(), 0U);
    ASSERT_EQ(pairs_, s.on_time + s.predicted_late + s.predicted_superseded + s.overslept_pairs + s.late_notices +
                          s.notices_out_of_order + s.from_future - results_from_future_ + s.from_past + s.refused +
                          schedule_.in_flight());
    // What left is what was counted.
    ASSERT_EQ(left_, s.on_time + s.predicted_late + s.predicted_superseded + s.missing);
    // Each captured pair was run, passed over, taken out, or is there still.
    ASSERT_LE(runs_ + f.skipped + f.evicted, f.captured);
    ASSERT_GE(runs_ + f.skipped + f.evicted + kPoolSlots, f.captured);
    const EffortController::Counters& e = effort_.counters();
    std::uint64_t shed_now = 0;
    for (std::size_t i = 0; i < kEfforts; ++i) {
      ASSERT_EQ(e.sheds[i] - e.restores[i], leaves_out(effort_.shed(), static_cast<Effort>(i)) ? 1U : 0U);
      shed_now += e.sheds[i] - e.restores[i];
    }
    ASSERT_LE(shed_now, 2U);
  }

 private:
  [[nodiscard]] static MonotonicTime exposure(std::uint64_t slot) {
    return MonotonicTime(std::chrono::seconds(1) + static_cast<std::int64_t>(slot) * kPeriod);
  }

  void schedule_event(const Event& event) {
    ASSERT_LT(event_count_, events_.size());
    std::size_t at = event_count_++;
    for (; at > 0 && events_[at - 1].at > event.at; --at) events_[at] = events_[at - 1];
    events_[at] = event;
  }
  Event next_event() {
    const Event first = events_[0];
    std::copy(events_.begin() + 1, events_.begin() + static_cast<std::ptrdiff_t>(event_count_), events_.begin());
    --event_count_;
    return first;
  }

  void expose() {
    SlotPlan& plan = plans_[slot_ % plans_.size()];
    const MonotonicTime exposed = exposure(slot_) + plan.exposed;
    const CaptureTime stamp(exposed.time_since_epoch() + ahead_);
    for (const Side side : {Side::kLeft, Side::kRight}) {
      const auto index = static_cast<std::size_t>(side);
      Event frame{exposed + kTransfer + plan.late[index], Event::Kind::kFrame, side, stamp, slot_};
      if (side == Side::kRight) frame.at += kRightAfter;
      for (int times = plan.lost[index] ? 0 : plan.twice[index] ? 2 : 1; times > 0; --times) schedule_event(frame);
    }
    schedule_event({exposed + kGiveUpAfter, Event::Kind::kGiveUp, Side::kLeft, stamp, slot_});
    compute_[slot_ % compute_.size()] = plan.compute;
    holds_[slot_ % holds_.size()] = plan.holds_lease;
    plan = {};
  }

  void go_until(MonotonicTime end) {
    for (;;) {
      MonotonicTime wake = end;
      if (const auto slot = schedule_.next_wake()) wake = std::min(wake, *slot);
      if (const auto change = rules_.next_change()) wake = std::min(wake, *change);
      const bool event = event_count_ > 0 && events_[0].at <= wake;
      const MonotonicTime at = event ? events_[0].at : std::max(wake, now_);
      if (std::max(at, wakes_) > end) break;
      if (at < wakes_) {
        sleep_over();
        continue;
      }
      now_ = std::max(now_, at);
      if (event) take(next_event());
      publisher();
      if (!event && wake == end) break;
    }
  }

  // The process was suspended: what the sensors saw is gone, and what it had to do it does now.
  void sleep_over() {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < event_count_; ++i) {
      if (events_[i].at < wakes_ && events_[i].kind != Event::Kind::kDone) continue;
      events_[kept] = events_[i];
      events_[kept].at = std::max(events_[kept].at, wakes_);
      ++kept;
    }
    event_count_ = kept;
    now_ = wakes_;
    publisher();
  }

  // ---- Capture thread

  void take(const Event& event) {
    if (event.kind == Event::Kind::kDone) {
      end_run();
    } else if (event.kind == Event::Kind::kGiveUp) {
      settle(pairer_.give_up_before(event.stamp + nanoseconds(1)));
    } else {
      ++frames_in_;
      settle(pairer_.push(event.side, {event.stamp, event.slot, static_cast<std::uint32_t>(event.slot)}));
    }
    begin_run();
  }

  void settle(const Pairer::Outcome& outcome) {
    for (const trigger::Settled& settled : outcome) {
      frames_out_ += (settled.left ? 1U : 0U) + (settled.right ? 1U : 0U);
      if (settled.ordinal != 0) {
        ASSERT_EQ(settled.ordinal, ++settled_) << "ordinals count what is settled";
      }
      if (settled.verdict != trigger::Verdict::kPaired) continue;
      ++pairs_;
      FramePair pair;
      pair.ordinal = settled.ordinal;
      pair.capture_time = settled.left->mid_exposure;
      compute_of_[settled.ordinal % compute_of_.size()] = settled.left->sequence;
      (void)outlet_.put(pair);
    }
    std::uint32_t slot = 0;
    while (outlet_.take_back(slot)) {
    }
  }

  // ---- Frame loop

  void begin_run() {
    if (running_) return;
    capture::PairLease lease = pool_.take_newest();
    if (!lease) return;
    running_ = true;
    run_ = {lease->ordinal, lease->capture_time};
    began_ = now_;
    const std::uint64_t slot = compute_of_[run_.ordinal % compute_of_.size()];
    const nanoseconds compute = compute_[slot % compute_.size()];
    if (holds_[slot % holds_.size()]) lease_ = std::move(lease);
    ++runs_;
    schedule_event({now_ + compute, Event::Kind::kDone, Side::kLeft, {}, slot});
  }

  void end_run() {
    lease_.release();
    running_ = false;
    mailbox_.draft() = run_;
    mailbox_.publish();
    const MonotonicTime captured = map().to_monotonic(run_.capture_time);
    (void)effort_.next(now_ - began_, std::min<nanoseconds>(kPeriod, captured + kLatency - kLead - began_));
  }

  // ---- Publisher, as Publisher::run

  [[nodiscard]] ClockMap map() const { return {CaptureTime(ahead_), MonotonicTime()}; }

  void publisher() {
    capture::PairNotice notice;
    while (notices_.pop(notice)) schedule_.notice(notice.ordinal, notice.capture_time, now_);
    if (const Outcome* outcome = mailbox_.take()) {
      const std::uint64_t from_future = schedule_.counters().from_future;
      const auto keep = schedule_.result(outcome->ordinal, outcome->capture_time, now_);
      results_from_future_ += schedule_.counters().from_future - from_future;
      if (keep) kept_[*keep] = *outcome;
    }
    const bool second = slot_ % kWindow == kStatusSlot && slot_ != status_;  // clocks are looked at anew
    if (second) status_ = slot_;
    if (second || schedule_.map_is_suspect()) schedule_.set_map(map());
    bool any = false;
    while (const std::optional<OutputSchedule::Output> output = schedule_.decide(now_)) {
      leave(*output);
      any = true;
    }
    if (!any) drive(rules_.advance(now_), now_);
    if (now_ - last_decided_ >= kStale) {
      ASSERT_EQ(rules_.lines(), rules_.safe_lines()) << "nothing has left for long";
    }
  }

  void leave(const OutputSchedule::Output& output) {
    ++left_;
    ASSERT_EQ(output.due, output.captured + kLatency);
    ASSERT_GE(now_, output.due - kLead) << "before its time";
    ASSERT_LE(now_, output.due + kGrace) << "after its time";
    ASSERT_GT(output.due, last_due_) << "times rise";
    last_due_ = output.due;
    ASSERT_EQ(output.ordinal == 0, output.kind == OutputSchedule::Kind::kMissing);
    if (output.ordinal != 0) {
      ASSERT_GT(output.ordinal, last_ordinal_) << "a pair left twice, or after a later one";
      last_ordinal_ = output.ordinal;
    }
    if (output.state) {
      ASSERT_EQ(kept_[output.state->keep].ordinal, output.state->ordinal) << "another one's payload";
      ASSERT_LE(output.state->ahead, milliseconds(90)) << "too old";
      ASSERT_EQ(output.state->ordinal == output.ordinal, output.kind == OutputSchedule::Kind::kOnTime);
    }
    const bool own = output.kind == OutputSchedule::Kind::kOnTime;
    if (own) last_own_ = output.due;
    const bool healthy = output.due - last_own_ <= kStale;
    const signals::SignalRules::Inputs inputs{.tracks = std::span(&target_, output.state ? 1 : 0),
                                              .tracks_known = output.state.has_value(),
                                              .depth_known = true,
                                              .deadline_missed = !own,
                                              .healthy = healthy};
    const gpio::LineBits lines = rules_.decide(inputs, output.due);
    last_decided_ = std::max(last_decided_, output.due);
    // Unknown: safe, which is off for the first and on for the second. Known: there is a target, both are on.
    ASSERT_EQ(lines & 3U, output.state ? 3U : 2U);
    ASSERT_EQ((lines & 8U) != 0, !own);
    if (!healthy) {
      ASSERT_EQ(lines & 4U, 0U) << "a heart that beats without a result";
    }
    drive(lines, output.due);
  }

  void drive(gpio::LineBits lines, MonotonicTime now) {
    if (lines_.set(lines, now).failed == 0) return;
    ++lines_failed_;
    // The service's business, which may take memory.
    const test::HeapWatch watch;
    static_cast<void>(lines_.reopen());
    service_calls_ += watch.calls();
  }

  static constexpr std::size_t kPlans = 64;

  // The world.
  std::uint64_t slot_ = 0;  // to be exposed next
  MonotonicTime now_{};
  MonotonicTime wakes_{};  // suspended until then
  nanoseconds ahead_{0};   // of the sensors' clock over the monotonic one
  std::array<SlotPlan, kPlans> plans_{};
  std::array<nanoseconds, kPlans> compute_{};
  std::array<bool, kPlans> holds_{};
  std::array<std::uint64_t, kPlans> compute_of_{};  // ordinal -> slot
  std::array<Event, 256> events_{};
  std::size_t event_count_ = 0;

  // Parts.
  Pairer pairer_ = *Pairer::create({.period = kPeriod});
  FramePool pool_{kPoolSlots};
  capture::PairOutlet::Notices notices_;
  capture::Doorbell bell_;
  capture::PairOutlet outlet_{pool_, notices_, bell_};
  Mailbox<Outcome> mailbox_;
  EffortController effort_ = day_effort();
  OutputSchedule schedule_ = day_schedule();
  signals::SignalRules rules_ = day_rules();
  gpio::OutputLines lines_;
  TrackReport target_;

  // Frame loop.
  bool running_ = false;
  Outcome run_;
  MonotonicTime began_{};
  capture::PairLease lease_;

  // Publisher.
  std::array<Outcome, OutputSchedule::kKeeps> kept_{};
  MonotonicTime last_due_{};
  MonotonicTime last_own_{};
  MonotonicTime last_decided_{};
  std::uint64_t last_ordinal_ = 0;
  std::uint64_t status_ = 0;  // slot of the last look at the clocks

  // Books.
  std::uint64_t frames_in_ = 0;
  std::uint64_t frames_out_ = 0;
  std::uint64_t settled_ = 0;
  std::uint64_t pairs_ = 0;
  std::uint64_t runs_ = 0;
  std::uint64_t left_ = 0;
  std::uint64_t results_from_future_ = 0;
  std::uint64_t lines_failed_ = 0;
  std::uint64_t service_calls_ = 0;
};

/// A fault, and what the counters must say of it: by how much they move in its window more than without it.
struct Fault {
  const char* name;
  void (*strike)(Day& day, std::uint64_t dice);
  std::vector<std::pair<Count, std::int64_t>> shows;
};

const std::vector<Fault>& all_faults() {
  static const std::vector<Fault> kAll{
      {"nothing", [](Day&, std::uint64_t) {}, {}},
      {"a left is lost",
       [](Day& day, std::uint64_t) { day.plan().lost[0] = true; },
       {{kMissingLeft, 1}, {kPaired, -1}, {kCaptured, -1}, {kMissing, 1}, {kOnTime, -1}}},
      {"a right is lost",
       [](Day& day, std::uint64_t) { day.plan().lost[1] = true; },
       {{kMissingRight, 1}, {kPaired, -1}, {kCaptured, -1}, {kMissing, 1}, {kOnTime, -1}}},
      {"both are lost",
       [](Day& day, std::uint64_t) {
         day.plan().lost = {true, true};
       },
       {{kPaired, -1}, {kCaptured, -1}, {kMissing, 1}, {kOnTime, -1}}},
      // Of the five that leave as missing, the state is young enough for two: 57 and 73 ms after its exposure.
      {"the sensors stop",
       [](Day& day, std::uint64_t dice) {
         const std::uint64_t slots = 14;
         (void)dice;
         for (std::uint64_t i = 0; i < slots; ++i) day.plan(i).lost = {true, true};
       },
       {{kPaired, -14},
        {kCaptured, -14},
        {kMissing, kMissingLimit},
        {kOutages, 1},
        {kOnTime, -14},
        {kWithoutState, 3}}},
      {"a frame comes twice",
       [](Day& day, std::uint64_t dice) { day.plan().twice[dice % 2] = true; },
       {{kDuplicate, 1}}},
      {"a right comes after the next",
       [](Day& day, std::uint64_t) { day.plan().late[1] = kPeriod + microseconds(500); },
       {{kMissingRight, 1}, {kOutOfOrder, 1}, {kPaired, -1}, {kCaptured, -1}, {kMissing, 1}, {kOnTime, -1}}},
      {"a right comes when its left was given up",
       [](Day& day, std::uint64_t) { day.plan().late[1] = milliseconds(13); },
       {{kMissingRight, 1}, {kLateFrames, 1}, {kPaired, -1}, {kCaptured, -1}, {kMissing, 1}, {kOnTime, -1}}},
      // Done at 42 ms, after its moment; the next but one is run then, and the next leaves from its state.
      {"a stage is slow",
       [](Day& day, std::uint64_t) { day.plan().compute = milliseconds(40); },
       {{kPredictedLate, 1},
        {kSuperseded, 1},
        {kLateResults, 1},
        {kSkipped, 1},
        {kOnTime, -2},
        {kOverruns, 1},
        {kSheds, 1},
        {kRestores, 1}}},
      // 100 ms with a slot of the pool: five pairs come, three slots are free. Its own result is too old then.
      {"a stage hangs with the pixels",
       [](Day& day, std::uint64_t) {
         day.plan().compute = milliseconds(100);
         day.plan().holds_lease = true;
       },
       {{kPredictedLate, 5},
        {kLateResults, 1},
        {kEvicted, 2},
        {kSkipped, 2},
        {kOnTime, -5},
        {kOverruns, 1},
        {kSheds, 1},
        {kRestores, 1},
        {kWithoutState, 3}}},
      {"the clock of the sensors steps on",
       [](Day& day, std::uint64_t dice) { day.step_clock(milliseconds(20 + dice % 10'000)); },
       {{kFromFuture, 1}, {kMissing, 1}, {kOnTime, -1}}},
      {"the clock of the sensors steps back",
       [](Day& day, std::uint64_t dice) { day.step_clock(-milliseconds(200 + dice % 10'000)); },
       {{kPairerSteps, 1}, {kFromPast, 1}, {kMissing, 1}, {kOnTime, -1}, {kLateResults, 1}}},
      // Two pairs in flight; slots 0 to 3 are slept over; 4 and 5, whose frames are gone, still leave in time.
      {"the process is suspended for 100 ms",
       [](Day& day, std::uint64_t) { day.suspend(milliseconds(100)); },
       {{kPaired, -6},
        {kCaptured, -6},
        {kOversleptPairs, 2},
        {kOversleptMissing, 4},
        {kMissing, 2},
        {kOnTime, -8},
        {kWithoutState, 1}}},
      {"the process is suspended for 300 ms",
       [](Day& day, std::uint64_t) { day.suspend(milliseconds(300)); },
       {{kPaired, -18},
        {kCaptured, -18},
        {kOversleptPairs, 2},
        {kOversleptMissing, kMissingLimit},
        {kOutages, 1},
        {kOnTime, -20}}},
      {"an exposure comes late by most of a period",
       [](Day& day, std::uint64_t) { day.plan().exposed = kPeriod * 4 / 5; },
       {{kMissing, 1}}},
      // All three in a burst at 47 ms. The first has missed its moment; the next but two is run after it.
      {"the capture thread is held up",
       [](Day& day, std::uint64_t) {
         for (std::uint64_t i = 0; i < 3; ++i) {
           const nanoseconds burst = milliseconds(45) + static_cast<int>(i) * microseconds(200);
           day.plan(i).late.fill(burst - static_cast<int>(i) * kPeriod);
         }
       },
       {{kMissing, 1},
        {kLateNotices, 1},
        {kPredictedLate, 1},
        {kSuperseded, 1},
        {kLateResults, 1},
        {kSkipped, 2},
        {kOnTime, -3},
        {kOverruns, 1},
        {kSheds, 1},
        {kRestores, 1}}},
      // A burst at 41 ms: in time for the first to leave, but that is told as missing already, at 39 ms.
      {"the capture thread is held up by a little less",
       [](Day& day, std::uint64_t) {
         for (std::uint64_t i = 0; i < 3; ++i) {
           const nanoseconds burst = milliseconds(39) + static_cast<int>(i) * microseconds(200);
           day.plan(i).late.fill(burst - static_cast<int>(i) * kPeriod);
         }
       },
       {{kMissing, 1},
        {kLateNotices, 1},
        {kPredictedLate, 1},
        {kLateResults, 1},
        {kSkipped, 1},
        {kOnTime, -2},
        {kOverruns, 1},
        {kSheds, 1},
        {kRestores, 1}}},
      {"the chip is gone", [](Day&, std::uint64_t) { Day::chip_is_gone(true); }, {}},
  };
  return kAll;
}

class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed) {}
  std::uint64_t roll() { return engine_(); }
  std::uint64_t below(std::uint64_t n) { return engine_() % n; }
  bool one_in(std::uint64_t n) { return below(n) == 0; }

 private:
  std::mt19937_64 engine_;
};

/// One fault and its exact account.
void strike(Day& day, const Fault& fault, Dice& dice) {
  const Tally before = day.tally();
  fault.strike(day, dice.roll());
  day.pass(kWindow / 2);
  Day::chip_is_gone(false);
  day.pass(kWindow - kWindow / 2);
  Tally moved = day.tally();
  const bool chip = fault.shows.empty() && std::string_view(fault.name) == "the chip is gone";
  Tally expected{};
  expected[kPaired] = expected[kCaptured] = expected[kOnTime] = kWindow;
  for (const auto& [count, by] : fault.shows) expected[count] += by;
  for (std::size_t i = 0; i < kCounts; ++i) moved[i] -= before[i];
  if (chip) {
    ASSERT_GT(moved[kLinesFailed], 0);
    moved[kLinesFailed] = 0;
  }
  for (std::size_t i = 0; i < kCounts; ++i) {
    EXPECT_EQ(moved[i], expected[i]) << fault.name << ": " << kNames[i] << ", slot " << day.slot();
  }
}

/// All at once, for some seconds; then nothing, until all is as it was.
void storm(Day& day, Dice& dice) {
  for (std::uint64_t slots = kWindow * (1 + dice.below(5)); slots > 0; --slots) {
    SlotPlan& plan = day.plan();
    for (std::size_t side = 0; side < 2; ++side) {
      plan.lost[side] = dice.one_in(6);
      plan.twice[side] = dice.one_in(12);
      if (dice.one_in(8)) plan.late[side] = microseconds(dice.below(60'000));
    }
    if (dice.one_in(10)) plan.exposed = microseconds(dice.below(16'000));
    if (dice.one_in(8)) plan.compute = microseconds(dice.below(150'000));
    plan.holds_lease = dice.one_in(3);
    if (dice.one_in(40)) day.step_clock(microseconds(static_cast<std::int64_t>(dice.below(2'000'000)) - 1'000'000));
    if (dice.one_in(60)) day.suspend(microseconds(dice.below(400'000)));
    if (dice.one_in(30)) Day::chip_is_gone(dice.one_in(2));
    day.pass(1);
  }
  Day::chip_is_gone(false);
  day.pass(kSettle);
}

void live(std::uint64_t slots, std::uint64_t seed) {
  Day day;
  Dice dice(seed);
  const std::vector<Fault>& faults = all_faults();
  std::vector<std::uint64_t> struck(faults.size());
  day.pass(kSettle);
  const test::HeapWatch heap;
  while (day.slot() < slots) {
    const std::uint64_t which = dice.below(faults.size());
    ASSERT_NO_FATAL_FAILURE(strike(day, faults[which], dice));
    ++struck[which];
    if (dice.one_in(40)) storm(day, dice);
    ASSERT_NO_FATAL_FAILURE(day.audit());
    ASSERT_FALSE(testing::Test::HasFailure()) << "in slot " << day.slot();
  }
  EXPECT_EQ(heap.calls() - day.service_heap_calls(), 0U);
  for (std::size_t i = 0; i < faults.size(); ++i) EXPECT_GT(struck[i], 0U) << faults[i].name << " never happened";
  // As on the first day.
  EXPECT_EQ(day.effort().shed(), 0U);
  EXPECT_EQ(day.effort().patience(), day_effort().patience());
  EXPECT_FALSE(day.schedule().status_only());
  EXPECT_FALSE(day.schedule().map_is_suspect());
}

TEST(SimulatedDay, EachFaultShowsInItsCounterAndInNoOther) {
  for (const Fault& fault : all_faults()) {
    Day day;
    Dice dice(1);
    day.pass(kSettle);
    for (int times = 0; times < 3 && !testing::Test::HasFailure(); ++times) strike(day, fault, dice);
    day.audit();
  }
}

TEST(SimulatedDay, AnHourOfEachOfFourOrders) {
  for (const std::uint64_t seed : {2U, 3U, 4U, 5U}) ASSERT_NO_FATAL_FAILURE(live(kPerHour, seed)) << "seed " << seed;
}

// What a schedule says of pairs that come from `start` on, every seventh lost and every fifth slow.
std::vector<OutputSchedule::Output> outputs_of(OutputSchedule& schedule, MonotonicTime start) {
  std::vector<OutputSchedule::Output> outputs;
  for (std::uint64_t i = 1; i <= 200; ++i) {
    const MonotonicTime exposed = start + static_cast<int>(i) * kPeriod;
    const CaptureTime stamp(exposed.time_since_epoch());
    const auto decide_until = [&](MonotonicTime now) {
      while (const auto wake = schedule.next_wake()) {
        if (*wake > now) return;
        if (const auto output = schedule.decide(*wake)) outputs.push_back(*output);
      }
    };
    if (i % 7 != 0) {
      decide_until(exposed + kTransfer);
      schedule.notice(i, stamp, exposed + kTransfer);
      const MonotonicTime done = exposed + (i % 5 == 0 ? kLatency : nanoseconds(kCompute));
      decide_until(done);
      (void)schedule.result(i, stamp, done);
    }
  }
  return outputs;
}

TEST(SimulatedDay, AScheduleThatBeginsAnewAfterAnHourIsANewOne) {
  Day day;
  Dice dice(6);
  day.pass(kSettle);
  while (day.slot() < kPerHour) storm(day, dice);
  OutputSchedule old = day.schedule();
  old.restart();
  old.set_map(ClockMap());
  OutputSchedule fresh = day_schedule();
  const MonotonicTime start(std::chrono::hours(2));
  const std::vector<OutputSchedule::Output> expected = outputs_of(fresh, start);
  const std::vector<OutputSchedule::Output> seen = outputs_of(old, start);
  ASSERT_GT(expected.size(), 150U);
  ASSERT_EQ(seen.size(), expected.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(seen[i].kind, expected[i].kind) << i;
    EXPECT_EQ(seen[i].ordinal, expected[i].ordinal) << i;
    EXPECT_EQ(seen[i].due, expected[i].due) << i;
    EXPECT_EQ(seen[i].superseded, expected[i].superseded) << i;
    ASSERT_EQ(seen[i].state.has_value(), expected[i].state.has_value()) << i;
    if (seen[i].state) {
      EXPECT_EQ(seen[i].state->ordinal, expected[i].state->ordinal) << i;
      EXPECT_EQ(seen[i].state->ahead, expected[i].state->ahead) << i;
    }
  }
}

TEST(SimulatedDay, ADay) {
  // A sanitizer takes ten times as long.
  ASSERT_NO_FATAL_FAILURE(live(allocations_are_counted() ? 24 * kPerHour : 2 * kPerHour, 1));
}

}  // namespace
}  // namespace stereotrack::runtime
