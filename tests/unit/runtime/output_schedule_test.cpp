#include "firmware-app/runtime/output_schedule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <vector>

namespace stereotrack::runtime {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using Kind = OutputSchedule::Kind;
using Output = OutputSchedule::Output;

constexpr milliseconds kPeriod{10};

/// Pairs every 10 ms, L = 8 ms, decided 1 ms before, at most 2 ms late, five missing ones in a row.
OutputSchedule::Config config() {
  return {.latency = milliseconds(8),
          .period = kPeriod,
          .lead = milliseconds(1),
          .grace = milliseconds(2),
          .oldest_state = milliseconds(100),
          .missing_limit = 5};
}

/// The capture clock is an hour ahead of the monotonic one. All times of a test are milliseconds after 1000 s of it.
constexpr std::chrono::hours kAhead{1};
MonotonicTime at(double ms) { return MonotonicTime(std::chrono::seconds(1000) + nanoseconds(std::llround(ms * 1e6))); }
CaptureTime captured(double ms) { return CaptureTime(at(ms).time_since_epoch() + kAhead); }
ClockMap right_map() { return {captured(0), at(0)}; }
double ms_of(MonotonicTime time) { return std::chrono::duration<double, std::milli>(time - at(0)).count(); }

struct Sent {
  Output output;
  double at_ms;
};

/// The publisher's loop over simulated time.
class Rig {
 public:
  explicit Rig(const OutputSchedule::Config& of = config()) : schedule(*OutputSchedule::create(of, right_map())) {}

  void notice(double when, std::uint64_t ordinal, double capture) {
    events_.emplace(when, [=, this] { schedule.notice(ordinal, captured(capture), at(now_)); });
  }
  void result(double when, std::uint64_t ordinal, double capture) {
    events_.emplace(when, [=, this] {
      const auto keep = schedule.result(ordinal, captured(capture), at(now_));
      if (keep) kept_[*keep] = ordinal;
    });
  }
  /// Exposed at `capture`, noticed 1 ms later, done `compute` ms after the capture.
  void pair(std::uint64_t ordinal, double capture, double compute = 5) {
    notice(capture + 1, ordinal, capture);
    result(capture + compute, ordinal, capture);
  }
  void call(double when, std::function<void()> what) { events_.emplace(when, std::move(what)); }
  void suspend(double from, double to) {
    from_ = from;
    to_ = to;
  }

  void run_until(double end) {
    for (;;) {
      double next = end;
      const auto wake = schedule.next_wake();
      if (wake) next = std::min(next, std::max(ms_of(*wake), now_));
      if (!events_.empty()) next = std::min(next, std::max(events_.begin()->first, now_));
      if (next >= end) break;
      now_ = next;
      if (now_ >= from_ && now_ < to_) now_ = to_;
      while (!events_.empty() && events_.begin()->first <= now_) {
        const auto what = events_.begin()->second;
        events_.erase(events_.begin());
        what();
      }
      while (const auto output = schedule.decide(at(now_))) {
        if (output->state) {
          EXPECT_EQ(kept_[output->state->keep], output->state->ordinal) << "the payload was overwritten";
        }
        now_ = std::max(now_, ms_of(output->due));  // sleeps, and sends
        sent.push_back({*output, now_});
      }
    }
    now_ = end;
  }

  OutputSchedule schedule;
  std::vector<Sent> sent;

 private:
  std::multimap<double, std::function<void()>> events_;
  std::map<std::size_t, std::uint64_t> kept_;
  double now_ = 0;
  double from_ = 0, to_ = 0;
};

void expect_sent(const Sent& sent, Kind kind, std::uint64_t ordinal, double due, std::uint64_t state_ordinal,
                 double ahead) {
  EXPECT_EQ(sent.output.kind, kind) << "due " << due;
  EXPECT_EQ(sent.output.ordinal, ordinal) << "due " << due;
  EXPECT_EQ(ms_of(sent.output.due), due);
  EXPECT_EQ(sent.at_ms, due);
  EXPECT_FALSE(sent.output.after_due);
  if (state_ordinal == 0) {
    EXPECT_FALSE(sent.output.state) << "due " << due;
    return;
  }
  ASSERT_TRUE(sent.output.state) << "due " << due;
  EXPECT_EQ(sent.output.state->ordinal, state_ordinal) << "due " << due;
  EXPECT_EQ(sent.output.state->ahead, nanoseconds(std::llround(ahead * 1e6))) << "due " << due;
}

TEST(OutputSchedule, RefusesWhatContradictsItself) {
  const auto fault = [](auto change) {
    OutputSchedule::Config bad = config();
    change(bad);
    return !OutputSchedule::create(bad, right_map()).has_value();
  };
  EXPECT_FALSE(fault([](auto&) {}));
  EXPECT_TRUE(fault([](auto& c) { c.latency = nanoseconds(0); }));
  EXPECT_TRUE(fault([](auto& c) { c.period = nanoseconds(0); }));
  EXPECT_TRUE(fault([](auto& c) { c.period = -kPeriod; }));
  EXPECT_TRUE(fault([](auto& c) { c.lead = c.latency; }));
  EXPECT_TRUE(fault([](auto& c) { c.lead = nanoseconds(-1); }));
  EXPECT_TRUE(fault([](auto& c) { c.grace = c.period; }));
  EXPECT_TRUE(fault([](auto& c) { c.grace = nanoseconds(-1); }));
  EXPECT_TRUE(fault([](auto& c) { c.oldest_state = c.latency - nanoseconds(1); }));
  EXPECT_TRUE(fault([](auto& c) { c.missing_limit = 0; }));
  EXPECT_TRUE(fault([](auto& c) {
    c.latency = 17 * kPeriod;
    c.oldest_state = c.latency;
  }));
}

TEST(OutputSchedule, SaysNothingBeforeTheFirstPair) {
  Rig rig;
  EXPECT_TRUE(rig.schedule.status_only());
  EXPECT_FALSE(rig.schedule.next_wake());
  EXPECT_FALSE(rig.schedule.decide(at(1e6)));
  EXPECT_EQ(rig.schedule.counters().missing, 0U);
}

TEST(OutputSchedule, OnTimeLeavesAtCapturePlusLatencyExactly) {
  Rig rig;
  for (std::uint64_t i = 1; i <= 4; ++i) rig.pair(i, 10.0 * static_cast<double>(i));
  rig.run_until(50);
  ASSERT_EQ(rig.sent.size(), 4U);
  for (std::size_t i = 1; i <= 4; ++i) {
    expect_sent(rig.sent[i - 1], Kind::kOnTime, i, 10.0 * static_cast<double>(i) + 8, i, 8);
  }
  EXPECT_EQ(rig.schedule.counters().on_time, 4U);
  EXPECT_FALSE(rig.schedule.status_only());
}

TEST(OutputSchedule, WakesALeadTimeBeforeAndNotEarlier) {
  Rig rig;
  rig.schedule.notice(1, captured(10), at(11));
  ASSERT_TRUE(rig.schedule.next_wake());
  EXPECT_EQ(ms_of(*rig.schedule.next_wake()), 17);
  EXPECT_FALSE(rig.schedule.decide(at(17) - nanoseconds(1)));
  EXPECT_TRUE(rig.schedule.decide(at(17)));
  EXPECT_FALSE(rig.schedule.decide(at(17))) << "once";
}

TEST(OutputSchedule, AResultBeforeItsNoticeIsOnTime) {
  Rig rig;
  rig.result(14, 1, 10);
  rig.notice(15, 1, 10);
  rig.run_until(20);
  ASSERT_EQ(rig.sent.size(), 1U);
  expect_sent(rig.sent[0], Kind::kOnTime, 1, 18, 1, 8);
}

TEST(OutputSchedule, ALateResultOnlyUpdatesTheState) {
  Rig rig;
  rig.pair(1, 10);
  rig.pair(2, 20, 9);  // at 29: its slot leaves at 28
  rig.pair(3, 30, 9.5);
  rig.pair(4, 40);
  rig.run_until(50);
  ASSERT_EQ(rig.sent.size(), 4U);
  expect_sent(rig.sent[0], Kind::kOnTime, 1, 18, 1, 8);
  expect_sent(rig.sent[1], Kind::kPredicted, 2, 28, 1, 18);
  expect_sent(rig.sent[2], Kind::kPredicted, 3, 38, 2, 18);
  expect_sent(rig.sent[3], Kind::kOnTime, 4, 48, 4, 8);
  const auto& counters = rig.schedule.counters();
  EXPECT_EQ(counters.predicted_late, 2U);
  EXPECT_EQ(counters.late_results, 2U);
  EXPECT_EQ(counters.on_time, 2U);
  EXPECT_FALSE(rig.sent[1].output.superseded);
}

TEST(OutputSchedule, AResultWithinTheLeadTimeIsLate) {
  Rig rig;
  rig.pair(1, 10, 7);    // at 17, the moment of deciding: in
  rig.pair(2, 20, 7.5);  // out
  rig.run_until(40);
  ASSERT_GE(rig.sent.size(), 2U);
  expect_sent(rig.sent[0], Kind::kOnTime, 1, 18, 1, 8);
  expect_sent(rig.sent[1], Kind::kPredicted, 2, 28, 1, 18);
}

TEST(OutputSchedule, AResultThatIsPassedOverIsPredictedFromTheNewerState) {
  OutputSchedule::Config long_latency = config();
  long_latency.latency = milliseconds(18);
  Rig rig(long_latency);
  rig.pair(1, 10);
  rig.notice(21, 2, 20);  // the frame loop passes over 2
  rig.pair(3, 30);
  rig.run_until(49);
  ASSERT_EQ(rig.sent.size(), 3U);
  expect_sent(rig.sent[1], Kind::kPredicted, 2, 38, 3, 8);
  EXPECT_TRUE(rig.sent[1].output.superseded);
  expect_sent(rig.sent[2], Kind::kOnTime, 3, 48, 3, 18);
  EXPECT_EQ(rig.schedule.counters().predicted_superseded, 1U);
  EXPECT_EQ(rig.schedule.counters().predicted_late, 0U);
}

TEST(OutputSchedule, WithoutAnyStateASlotStillLeaves) {
  Rig rig;
  rig.notice(11, 1, 10);
  rig.run_until(20);
  ASSERT_EQ(rig.sent.size(), 1U);
  expect_sent(rig.sent[0], Kind::kPredicted, 1, 18, 0, 0);
  EXPECT_EQ(rig.schedule.counters().without_state, 1U);
}

TEST(OutputSchedule, AStateThatIsTooOldIsNotPredicted) {
  Rig rig;
  rig.pair(1, 10);
  for (std::uint64_t i = 2; i <= 12; ++i)
    rig.notice(10.0 * static_cast<double>(i) + 1, i, 10.0 * static_cast<double>(i));
  rig.run_until(130);
  ASSERT_EQ(rig.sent.size(), 12U);
  expect_sent(rig.sent[9], Kind::kPredicted, 10, 108, 1, 98);
  expect_sent(rig.sent[10], Kind::kPredicted, 11, 118, 0, 0);  // 108 ms ahead, of 100 allowed
  EXPECT_EQ(rig.schedule.counters().without_state, 2U);
}

TEST(OutputSchedule, AMissingPairLeavesWhereThePeriodPutsIt) {
  Rig rig;
  rig.pair(1, 10);
  rig.pair(3, 30.5);
  rig.run_until(39);
  ASSERT_EQ(rig.sent.size(), 3U);
  expect_sent(rig.sent[0], Kind::kOnTime, 1, 18, 1, 8);
  expect_sent(rig.sent[1], Kind::kMissing, 0, 28, 1, 18);
  EXPECT_EQ(ms_of(rig.sent[1].output.captured), 20);
  expect_sent(rig.sent[2], Kind::kOnTime, 3, 38.5, 3, 8);
  EXPECT_EQ(rig.schedule.counters().missing, 1U);
}

TEST(OutputSchedule, AfterTheLimitOfMissingPairsOnlyStatusLeavesUntilOneComes) {
  Rig rig;
  rig.pair(1, 10);
  rig.pair(2, 203);
  rig.run_until(200);
  ASSERT_EQ(rig.sent.size(), 6U);
  for (std::size_t i = 1; i <= 5; ++i) {
    expect_sent(rig.sent[i], Kind::kMissing, 0, 18 + 10.0 * static_cast<double>(i), 1,
                8 + 10.0 * static_cast<double>(i));
  }
  EXPECT_TRUE(rig.schedule.status_only());
  EXPECT_FALSE(rig.schedule.next_wake());
  EXPECT_EQ(rig.schedule.counters().outages, 1U);
  rig.run_until(212);
  ASSERT_EQ(rig.sent.size(), 7U);
  expect_sent(rig.sent[6], Kind::kOnTime, 2, 211, 2, 8);
  EXPECT_FALSE(rig.schedule.status_only());
  EXPECT_EQ(rig.schedule.counters().missing, 5U);
  EXPECT_EQ(rig.schedule.counters().overslept_missing, 0U);
}

TEST(OutputSchedule, ALateNoticeIsNotToldTwice) {
  Rig rig;
  rig.pair(1, 10);
  rig.notice(27.5, 2, 20.25);  // its slot was decided at 27, as missing
  rig.result(27.6, 2, 20.25);
  rig.pair(3, 30.25);
  rig.run_until(40);
  ASSERT_EQ(rig.sent.size(), 3U);
  expect_sent(rig.sent[1], Kind::kMissing, 0, 28, 1, 18);
  expect_sent(rig.sent[2], Kind::kOnTime, 3, 38.25, 3, 8);
  EXPECT_EQ(rig.schedule.counters().late_notices, 1U);
  EXPECT_EQ(rig.schedule.counters().late_results, 1U);
}

TEST(OutputSchedule, APairThatWasTooOldIsLateWhateverWasInFlightBeforeIt) {
  OutputSchedule::Config longer = config();
  longer.latency = milliseconds(25);
  Rig rig(longer);
  rig.notice(1, 1, 0);
  rig.notice(11, 2, -40);  // its stamp is of another clock: its slot ends here, before the first one's
  rig.result(15, 1, 0);    // in flight: on time
  rig.result(26, 2, -40);
  rig.run_until(30);
  EXPECT_EQ(rig.schedule.counters().from_past, 1U);
  EXPECT_EQ(rig.schedule.counters().on_time, 1U);
  EXPECT_EQ(rig.schedule.counters().late_results, 1U);
}

TEST(OutputSchedule, ALateNoticeGivesTheCadenceItsPhaseAndItsResultTheState) {
  Rig rig;
  rig.pair(1, 10);
  rig.notice(35, 2, 21);  // 29 has passed
  rig.result(36, 2, 21);
  rig.run_until(40);
  ASSERT_EQ(rig.sent.size(), 3U);
  expect_sent(rig.sent[1], Kind::kMissing, 0, 28, 1, 18);
  expect_sent(rig.sent[2], Kind::kMissing, 0, 39, 2, 18);  // 21 + 10 + 8
  EXPECT_EQ(rig.schedule.counters().late_notices, 1U);
}

TEST(OutputSchedule, WhereAllNoticesAreLateTheCadenceGoesOn) {
  Rig rig;
  // L is 8 ms, the notice takes 11: more than L and its grace.
  for (std::uint64_t i = 1; i <= 30; ++i) {
    rig.notice(10.0 * static_cast<double>(i) + 11, i, 10.0 * static_cast<double>(i));
    rig.result(10.0 * static_cast<double>(i) + 12, i, 10.0 * static_cast<double>(i));
  }
  rig.run_until(310);
  ASSERT_EQ(rig.sent.size(), 29U);
  for (std::size_t i = 0; i < rig.sent.size(); ++i) {
    const double due = 28 + 10.0 * static_cast<double>(i);
    expect_sent(rig.sent[i], Kind::kMissing, 0, due, i + 1, 18);
  }
  EXPECT_EQ(rig.schedule.counters().late_notices, 29U);  // the last is still to come
  EXPECT_EQ(rig.schedule.counters().outages, 0U);
}

TEST(OutputSchedule, APairOutOfOrderIsRefusedAndItsSlotIsMissing) {
  OutputSchedule::Config long_latency = config();
  long_latency.latency = milliseconds(28);
  Rig rig(long_latency);
  rig.notice(11, 1, 10);
  rig.notice(31, 3, 30);
  rig.notice(32, 2, 20);
  rig.notice(33, 3, 30);  // twice
  rig.notice(41, 4, 40);
  rig.notice(42, 5, 35);  // rises by number, not by time
  rig.run_until(70);
  ASSERT_EQ(rig.sent.size(), 4U);
  expect_sent(rig.sent[0], Kind::kPredicted, 1, 38, 0, 0);
  expect_sent(rig.sent[1], Kind::kMissing, 0, 48, 0, 0);
  expect_sent(rig.sent[2], Kind::kPredicted, 3, 58, 0, 0);
  expect_sent(rig.sent[3], Kind::kPredicted, 4, 68, 0, 0);
  EXPECT_EQ(rig.schedule.counters().notices_out_of_order, 3U);
  EXPECT_TRUE(rig.schedule.map_is_suspect());
}

TEST(OutputSchedule, ResultsOutOfOrderServeTheirSlotsAndNotTheState) {
  OutputSchedule::Config long_latency = config();
  long_latency.latency = milliseconds(28);
  Rig rig(long_latency);
  for (std::uint64_t i = 1; i <= 4; ++i)
    rig.notice(10.0 * static_cast<double>(i) + 1, i, 10.0 * static_cast<double>(i));
  rig.result(33, 2, 20);
  rig.result(34, 1, 10);
  rig.result(35, 2, 20);  // twice
  rig.run_until(60);
  ASSERT_EQ(rig.sent.size(), 3U);
  expect_sent(rig.sent[0], Kind::kOnTime, 1, 38, 1, 28);
  expect_sent(rig.sent[1], Kind::kOnTime, 2, 48, 2, 28);
  expect_sent(rig.sent[2], Kind::kPredicted, 3, 58, 2, 38);
  EXPECT_EQ(rig.schedule.counters().stale_results, 1U);
  EXPECT_FALSE(rig.schedule.result(1, captured(10), at(61))) << "older than the state, and no slot waits for it";
  EXPECT_EQ(rig.schedule.counters().stale_results, 2U);
}

TEST(OutputSchedule, CaptureClockStepsForward) {
  Rig rig;
  for (std::uint64_t i = 1; i <= 3; ++i) rig.pair(i, 10.0 * static_cast<double>(i));
  // From here on stamps are a second ahead; at 72 the owner has measured anew.
  for (std::uint64_t i = 4; i <= 9; ++i) {
    const double true_ms = 10.0 * static_cast<double>(i);
    rig.notice(true_ms + 1, i, true_ms + 1000);
    rig.result(true_ms + 5, i, true_ms + 1000);
  }
  bool asked = false;
  rig.call(72, [&] {
    asked = rig.schedule.map_is_suspect();
    rig.schedule.set_map({captured(1072), at(72)});
  });
  rig.run_until(100);
  EXPECT_TRUE(asked);
  ASSERT_EQ(rig.sent.size(), 9U);
  expect_sent(rig.sent[2], Kind::kOnTime, 3, 38, 3, 8);
  for (std::size_t i = 3; i < 7; ++i) {
    const double due = 48 + 10.0 * static_cast<double>(i - 3);
    // Pair 7 was noticed at 71, under the old map; its result came under the new one.
    if (i < 6) {
      expect_sent(rig.sent[i], Kind::kMissing, 0, due, 3, due - 30);
    } else {
      expect_sent(rig.sent[i], Kind::kMissing, 0, due, 7, 8);
    }
  }
  expect_sent(rig.sent[7], Kind::kOnTime, 8, 88, 8, 8);
  expect_sent(rig.sent[8], Kind::kOnTime, 9, 98, 9, 8);
  EXPECT_EQ(rig.schedule.counters().from_future, 4U + 3U) << "notices and results";
  EXPECT_FALSE(rig.schedule.map_is_suspect());
  EXPECT_EQ(rig.schedule.counters().outages, 0U);
}

TEST(OutputSchedule, ALongClockStepForwardDoesNotEndTheCadence) {
  Rig rig;
  rig.pair(1, 10);
  for (std::uint64_t i = 2; i <= 40; ++i) {
    rig.notice(10.0 * static_cast<double>(i) + 1, i, 10.0 * static_cast<double>(i) + 1000);
  }
  rig.run_until(410);
  EXPECT_EQ(rig.sent.size(), 40U);
  EXPECT_EQ(rig.schedule.counters().missing, 39U);
  EXPECT_EQ(rig.schedule.counters().outages, 0U) << "pairs do come";
}

TEST(OutputSchedule, CaptureClockStepsBack) {
  Rig rig;
  for (std::uint64_t i = 1; i <= 3; ++i) rig.pair(i, 10.0 * static_cast<double>(i));
  for (std::uint64_t i = 4; i <= 9; ++i) {
    const double true_ms = 10.0 * static_cast<double>(i);
    rig.notice(true_ms + 1, i, true_ms - 1000);
    rig.result(true_ms + 5, i, true_ms - 1000);
  }
  bool asked = false;
  rig.call(72, [&] {
    asked = rig.schedule.map_is_suspect();
    rig.schedule.set_map({captured(-928), at(72)});
  });
  rig.run_until(100);
  EXPECT_TRUE(asked);
  ASSERT_EQ(rig.sent.size(), 9U);
  for (std::size_t i = 3; i < 6; ++i) {
    EXPECT_EQ(rig.sent[i].output.kind, Kind::kMissing);
    EXPECT_EQ(rig.sent[i].at_ms, 48 + 10.0 * static_cast<double>(i - 3)) << "the cadence holds";
    EXPECT_FALSE(rig.sent[i].output.state) << "a state from a second ago, by its stamp";
  }
  expect_sent(rig.sent[7], Kind::kOnTime, 8, 88, 8, 8);
  expect_sent(rig.sent[8], Kind::kOnTime, 9, 98, 9, 8);
  EXPECT_EQ(rig.schedule.counters().from_past, 4U);
  EXPECT_EQ(rig.schedule.counters().outages, 0U);
}

TEST(OutputSchedule, ASmallClockStepMovesTheOutputsByAsMuch) {
  Rig rig;
  for (std::uint64_t i = 1; i <= 3; ++i) rig.pair(i, 10.0 * static_cast<double>(i));
  for (std::uint64_t i = 4; i <= 6; ++i) {
    const double true_ms = 10.0 * static_cast<double>(i);
    rig.notice(true_ms + 1, i, true_ms - 0.5);
    rig.result(true_ms + 5, i, true_ms - 0.5);
  }
  rig.run_until(68);
  ASSERT_EQ(rig.sent.size(), 6U);
  expect_sent(rig.sent[3], Kind::kOnTime, 4, 47.5, 4, 8);
  expect_sent(rig.sent[5], Kind::kOnTime, 6, 67.5, 6, 8);
}

TEST(OutputSchedule, ASuspendedProcessSendsNoBurst) {
  OutputSchedule::Config long_latency = config();
  long_latency.latency = milliseconds(28);
  Rig rig(long_latency);
  for (std::uint64_t i = 1; i <= 20; ++i) rig.pair(i, 10.0 * static_cast<double>(i));
  // Asleep from 45 to 95: pairs 2 and 3 are in flight (due 48, 58), 1 has left at 38. What came meanwhile is all there.
  rig.suspend(45, 95);
  rig.run_until(140);
  ASSERT_GE(rig.sent.size(), 2U);
  expect_sent(rig.sent[0], Kind::kOnTime, 1, 38, 1, 28);
  // 2 and 3 in flight (48, 58); nothing was known of 4 to 6 (68 to 88): overslept. 7 (98) is next.
  expect_sent(rig.sent[1], Kind::kOnTime, 7, 98, 7, 28);
  for (std::size_t i = 2; i < rig.sent.size(); ++i) {
    expect_sent(rig.sent[i], Kind::kOnTime, i + 6, 88 + 10.0 * static_cast<double>(i), i + 6, 28);
  }
  EXPECT_EQ(rig.sent.size(), 1U + 5U);
  const auto& counters = rig.schedule.counters();
  EXPECT_EQ(counters.overslept_pairs + counters.overslept_missing, 5U) << "each of 48, 58, 68, 78, 88, once";
  EXPECT_EQ(counters.on_time, 6U);
  EXPECT_EQ(counters.missing, 0U);
}

TEST(OutputSchedule, ALongSuspensionIsAnOutageAndNotAMillionMisses) {
  Rig rig;
  for (std::uint64_t i = 1; i <= 3; ++i) rig.pair(i, 10.0 * static_cast<double>(i));
  rig.suspend(40, 3'600'005);
  rig.pair(4, 3'600'010);
  rig.call(41, [] {});  // what wakes it
  rig.run_until(3'600'019);
  ASSERT_EQ(rig.sent.size(), 4U);
  expect_sent(rig.sent[3], Kind::kOnTime, 4, 3'600'018, 4, 8);
  EXPECT_EQ(rig.schedule.counters().overslept_missing, 5U) << "up to the limit";
  EXPECT_EQ(rig.schedule.counters().outages, 1U);
}

TEST(OutputSchedule, ALittleOversleepingSendsAtOnceAndFlagsIt) {
  Rig rig;
  rig.schedule.notice(1, captured(10), at(11));
  const auto output = rig.schedule.decide(at(20));  // 2 ms over: the last moment
  ASSERT_TRUE(output);
  EXPECT_TRUE(output->after_due);
  EXPECT_EQ(rig.schedule.counters().after_due, 1U);
  Rig later;
  later.schedule.notice(1, captured(10), at(11));
  EXPECT_FALSE(later.schedule.decide(at(20) + nanoseconds(1)));
  EXPECT_EQ(later.schedule.counters().overslept_pairs, 1U);
}

TEST(OutputSchedule, LatencyShorterThanThePipelinePredictsAlways) {
  Rig rig;
  for (std::uint64_t i = 1; i <= 20; ++i) rig.pair(i, 10.0 * static_cast<double>(i), 14);
  rig.run_until(210);
  ASSERT_EQ(rig.sent.size(), 20U);
  expect_sent(rig.sent[0], Kind::kPredicted, 1, 18, 0, 0);
  for (std::size_t i = 2; i <= 20; ++i) {
    // Decided at 10 i + 7; result i - 1 came at 10 i + 4.
    expect_sent(rig.sent[i - 1], Kind::kPredicted, i, 10.0 * static_cast<double>(i) + 8, i - 1, 18);
  }
  EXPECT_EQ(rig.schedule.counters().predicted_late, 20U);
  EXPECT_EQ(rig.schedule.counters().late_results, 19U);  // the last has not come yet
}

TEST(OutputSchedule, LatencyOfSeveralPeriodsKeepsSlotsInFlightEachWithItsOwnResult) {
  OutputSchedule::Config long_latency = config();
  long_latency.latency = milliseconds(93);
  Rig rig(long_latency);
  std::size_t most = 0;
  for (std::uint64_t i = 1; i <= 100; ++i) {
    rig.pair(i, 10.0 * static_cast<double>(i));
    rig.call(10.0 * static_cast<double>(i) + 6, [&] { most = std::max(most, rig.schedule.in_flight()); });
  }
  rig.run_until(1094);
  ASSERT_EQ(rig.sent.size(), 100U);
  for (std::size_t i = 1; i <= 100; ++i) {
    expect_sent(rig.sent[i - 1], Kind::kOnTime, i, 10.0 * static_cast<double>(i) + 93, i, 93);
  }
  EXPECT_EQ(most, 9U);  // at 10 i + 6: those exposed from 10 i - 80 on
}

TEST(OutputSchedule, TheLongestLatencyAndTheHighestRateFitIn) {
  OutputSchedule::Config longest = config();
  longest.latency = 16 * kPeriod;
  longest.oldest_state = milliseconds(200);
  Rig rig(longest);
  // Twice the nominal rate: 32 slots in flight.
  for (std::uint64_t i = 1; i <= 100; ++i) rig.pair(i, 5.0 * static_cast<double>(i), 3);
  rig.run_until(661);
  EXPECT_EQ(rig.sent.size(), 100U);
  EXPECT_EQ(rig.schedule.counters().on_time, 100U);
  EXPECT_EQ(rig.schedule.counters().refused, 0U);
  // A third more is refused, not misplaced.
  Rig full(longest);
  for (std::uint64_t i = 1; i <= 45; ++i) full.schedule.notice(i, captured(3.0 * static_cast<double>(i)), at(140));
  EXPECT_EQ(full.schedule.in_flight(), OutputSchedule::kMaxInFlight);
  EXPECT_EQ(full.schedule.counters().refused, 45U - OutputSchedule::kMaxInFlight);
}

TEST(OutputSchedule, JitterOfCaptureTimesMovesEachOutputWithItsPair) {
  std::mt19937 random(3);
  Rig rig;
  std::vector<double> captures;
  for (std::uint64_t i = 1; i <= 500; ++i) {
    const double jitter = 0.25 * (static_cast<double>(random() % 17) - 8);  // +- 2 ms, so +- 4 ms between neighbours
    captures.push_back(10.0 * static_cast<double>(i) + jitter);
    rig.pair(i, captures.back());
  }
  rig.run_until(5011);
  ASSERT_EQ(rig.sent.size(), 500U);
  for (std::size_t i = 0; i < 500; ++i) expect_sent(rig.sent[i], Kind::kOnTime, i + 1, captures[i] + 8, i + 1, 8);
}

TEST(OutputSchedule, ARateThatFallsIsMissingEverySecondPairUntilItIsTold) {
  Rig rig;
  for (std::uint64_t i = 1; i <= 4; ++i) rig.pair(i, 10.0 * static_cast<double>(i));
  for (std::uint64_t i = 5; i <= 10; ++i) rig.pair(i, 40 + 20.0 * static_cast<double>(i - 4));
  rig.call(90, [&] { ASSERT_TRUE(rig.schedule.set_period(2 * kPeriod).has_value()); });
  rig.run_until(170);
  ASSERT_EQ(rig.sent.size(), 12U);
  expect_sent(rig.sent[4], Kind::kMissing, 0, 58, 4, 18);
  expect_sent(rig.sent[5], Kind::kOnTime, 5, 68, 5, 8);
  expect_sent(rig.sent[6], Kind::kMissing, 0, 78, 5, 18);
  expect_sent(rig.sent[7], Kind::kOnTime, 6, 88, 6, 8);
  for (std::size_t i = 8; i < 12; ++i) {
    expect_sent(rig.sent[i], Kind::kOnTime, i - 1, 108 + 20.0 * static_cast<double>(i - 8), i - 1, 8);
  }
  EXPECT_EQ(rig.schedule.set_period(nanoseconds(0)).error(), Fault::kBadConfig);
}

TEST(OutputSchedule, ARateThatRisesIsFollowedAtOnce) {
  Rig rig;
  for (std::uint64_t i = 1; i <= 4; ++i) rig.pair(i, 10.0 * static_cast<double>(i));
  for (std::uint64_t i = 5; i <= 12; ++i) rig.pair(i, 40 + 5.0 * static_cast<double>(i - 4));
  rig.run_until(89);
  ASSERT_EQ(rig.sent.size(), 12U);
  for (std::size_t i = 4; i < 12; ++i) {
    expect_sent(rig.sent[i], Kind::kOnTime, i + 1, 48 + 5.0 * static_cast<double>(i - 3), i + 1, 8);
  }
  EXPECT_EQ(rig.schedule.counters().missing, 0U);
}

TEST(OutputSchedule, RestartForgetsOrdinalsAndStateAndKeepsTheAccount) {
  Rig rig;
  for (std::uint64_t i = 1; i <= 3; ++i) rig.pair(i, 10.0 * static_cast<double>(i));
  rig.call(40, [&] { rig.schedule.restart(); });
  rig.notice(61, 1, 60);
  rig.run_until(70);
  ASSERT_EQ(rig.sent.size(), 4U);
  expect_sent(rig.sent[3], Kind::kPredicted, 1, 68, 0, 0);
  EXPECT_EQ(rig.schedule.counters().on_time, 3U);
}

TEST(OutputSchedule, WhateverHappensEachSlotEndsOnceAndInOrder) {
  // Pairs that are lost, late, jittered, slow, noticed twice; three suspensions; random seeds.
  for (unsigned seed = 1; seed <= 200; ++seed) {
    std::mt19937 random(seed);
    OutputSchedule::Config any = config();
    any.latency = milliseconds(4 + static_cast<int>(random() % 60));
    Rig rig(any);
    const auto in = [&](double low, double high) {
      return low + (high - low) * 0.001 * static_cast<double>(random() % 1001);
    };
    std::map<std::uint64_t, MonotonicTime> result_at;
    std::set<std::uint64_t> noticed;
    std::size_t twice = 0;
    for (std::uint64_t i = 1; i <= 300; ++i) {
      if (random() % 12 == 0) continue;
      const double capture = 10.0 * static_cast<double>(i) + in(-2, 2);
      const double delay = random() % 20 == 0 ? in(1, 80) : 1;
      rig.notice(capture + delay, i, capture);
      noticed.insert(i);
      if (random() % 30 == 0) {
        rig.notice(capture + delay + in(0, 20), i, capture);
        ++twice;
      }
      if (random() % 15 != 0) {
        result_at[i] = at(capture + in(2, 40));
        rig.result(ms_of(result_at[i]), i, capture);
      }
    }
    rig.suspend(in(500, 1000), in(1000, 1400));
    rig.run_until(4000);
    MonotonicTime last{};
    std::set<std::uint64_t> told;
    for (const Sent& sent : rig.sent) {
      ASSERT_GT(sent.output.captured, last) << "seed " << seed;
      last = sent.output.captured;
      ASSERT_EQ(sent.output.due, sent.output.captured + any.latency);
      ASSERT_LE(sent.at_ms, ms_of(sent.output.due + any.grace)) << "seed " << seed;
      if (sent.output.ordinal != 0) {
        ASSERT_TRUE(told.insert(sent.output.ordinal).second) << "seed " << seed;
        ASSERT_TRUE(noticed.count(sent.output.ordinal));
        const auto result = result_at.find(sent.output.ordinal);
        const bool early = result != result_at.end() && result->second <= sent.output.due - any.lead;
        const bool late = result == result_at.end() || result->second > at(sent.at_ms);
        // Between the two, it depends on when the loop looked.
        ASSERT_FALSE(early && sent.output.kind != Kind::kOnTime && !sent.output.superseded)
            << "seed " << seed << " pair " << sent.output.ordinal;
        ASSERT_FALSE(late && sent.output.kind == Kind::kOnTime) << "seed " << seed;
      }
    }
    const auto& counters = rig.schedule.counters();
    ASSERT_EQ(counters.on_time + counters.predicted_late + counters.predicted_superseded + counters.missing,
              rig.sent.size());
    // Each pair: its slot left, was overslept, or its notice was refused for a counted cause; the second notices are
    // refused as out of order.
    ASSERT_EQ(told.size() + counters.overslept_pairs + counters.late_notices + counters.from_past +
                  counters.notices_out_of_order + counters.refused,
              noticed.size() + twice)
        << "seed " << seed;
  }
}

}  // namespace
}  // namespace stereotrack::runtime
