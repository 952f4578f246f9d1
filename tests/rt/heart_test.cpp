#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>

#include "drivers/capture/frame_pool.hpp"
#include "drivers/trigger/pairer.hpp"
#include "firmware-app/runtime/effort.hpp"
#include "firmware-app/runtime/output_schedule.hpp"
#include "pipeline/core/mailbox.hpp"
#include "pipeline/core/queue.hpp"
#include "tests/rt/heap_watch.hpp"

namespace stereotrack::runtime {
namespace {

using std::chrono::milliseconds;
using trigger::Pairer;
using trigger::Side;
using trigger::Verdict;

struct Notice {
  std::uint64_t ordinal = 0;
  CaptureTime capture_time{};
};
struct Outcome {
  std::uint64_t ordinal = 0;
  CaptureTime capture_time{};
  std::array<double, 64> targets{};
};

TEST(Heart, TenThousandFramesFromSensorToOutputMakeNoHeapCall) {
  // All parts in one thread and in simulated time: every 7th right frame is lost, every 5th pair is slow, and for a
  // while the frame loop holds on to its leases.
  capture::FramePool pool(4);
  Pairer pairer = *Pairer::create({.period = milliseconds(10)});
  HandoverQueue<Notice, 32> notices;
  Mailbox<Outcome> mailbox;
  EffortController::Config shedding;
  (void)shedding.order.push(Effort::kCorners);
  EffortController effort = *EffortController::create(shedding);
  OutputSchedule schedule = *OutputSchedule::create({.latency = milliseconds(8),
                                                     .period = milliseconds(10),
                                                     .lead = milliseconds(1),
                                                     .grace = milliseconds(2),
                                                     .oldest_state = milliseconds(100),
                                                     .missing_limit = 5},
                                                    ClockMap());
  std::array<Outcome, OutputSchedule::kKeeps> kept{};
  std::uint64_t sent = 0;
  std::uint64_t without_slot = 0;

  const test::HeapWatch watch;
  std::array<capture::PairLease, 4> held;
  for (std::uint32_t i = 1; i <= 10'000; ++i) {
    const auto exposed = CaptureTime(i * milliseconds(10));
    const auto now = [&](int ms) { return MonotonicTime(exposed.time_since_epoch() + milliseconds(ms)); };

    // Capture thread.
    const auto deliver = [&](Side side) {
      for (const trigger::Settled& settled : pairer.push(side, {exposed, i, i})) {
        if (settled.verdict != Verdict::kPaired) continue;
        const auto claimed = pool.claim();
        if (claimed.pair == nullptr) {
          ++without_slot;
          continue;
        }
        *claimed.pair = FramePair{};
        claimed.pair->ordinal = settled.ordinal;
        claimed.pair->capture_time = exposed;
        pool.publish();
        ASSERT_TRUE(notices.push({settled.ordinal, exposed}));
      }
    };
    deliver(Side::kLeft);
    if (i % 7 != 0) deliver(Side::kRight);
    std::uint32_t slot = 0;
    while (pool.take_back(slot)) {
    }

    // Publisher, first what it is told of.
    Notice notice;
    while (notices.pop(notice)) schedule.notice(notice.ordinal, notice.capture_time, now(1));

    // Frame loop.
    const bool slow = i % 5 == 0;
    if (pool.wait(MonotonicTime()) == capture::FramePool::Wait::kPair) {
      capture::PairLease lease = pool.take_newest();
      Outcome& draft = mailbox.draft();
      draft.ordinal = lease->ordinal;
      draft.capture_time = lease->capture_time;
      draft.targets.fill(static_cast<double>(i));
      if (i % 1000 < 5) held[i % held.size()] = std::move(lease);
      mailbox.publish();
    }
    if (i % 1000 == 8) {
      for (capture::PairLease& lease : held) lease.release();
    }
    (void)effort.next(milliseconds(slow ? 12 : 3), milliseconds(10));

    // Publisher.
    const auto take_result = [&](int ms) {
      const Outcome* outcome = mailbox.take();
      if (outcome == nullptr) return;
      const auto keep = schedule.result(outcome->ordinal, outcome->capture_time, now(ms));
      if (keep) kept[*keep] = *outcome;
    };
    if (!slow) take_result(4);
    while (const std::optional<OutputSchedule::Output> output = schedule.decide(now(7))) {
      if (output->state) {
        ASSERT_EQ(kept[output->state->keep].ordinal, output->state->ordinal);
      }
      ++sent;
    }
    if (slow) take_result(9);
  }
  EXPECT_EQ(watch.calls(), 0U);
  EXPECT_TRUE(allocations_are_counted());

  // It did what it was made to do.
  EXPECT_EQ(sent, 10'000U);
  EXPECT_GT(without_slot, 0U);
  const auto& counters = schedule.counters();
  EXPECT_EQ(counters.on_time + counters.predicted_late + counters.missing, sent);
  EXPECT_GT(counters.predicted_late, 1000U);
  EXPECT_GT(counters.missing, 1000U);
  EXPECT_GT(effort.counters().sheds[static_cast<std::size_t>(Effort::kCorners)], 0U);
  EXPECT_EQ(pool.counters().starved, without_slot);
}

}  // namespace
}  // namespace stereotrack::runtime
