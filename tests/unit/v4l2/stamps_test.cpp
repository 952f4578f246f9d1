#include "drivers/capture/v4l2/stamps.hpp"

#include <gtest/gtest.h>

#include <cstdint>

namespace stereotrack::capture::v4l2 {
namespace {

using namespace std::chrono_literals;
using std::chrono::nanoseconds;

TEST(StampLine, StampsOfTheMonotonicClockStayAsTheyAre) {
  StampLine line;
  for (nanoseconds now = 100s; now < 102s; now += 40ms) {
    const auto stamp = line.next(now - 7ms, now);
    EXPECT_EQ(stamp.time, now - 7ms);
    EXPECT_FALSE(stamp.step);
  }
}

TEST(StampLine, AStallOfTheReaderIsNoStep) {
  StampLine line;
  (void)line.next(10s, 10s);
  // Taken 30 s late, one after the other.
  for (int i = 1; i < 5; ++i) {
    const auto stamp = line.next(10s + i * 40ms, 40s + i * 1us);
    EXPECT_EQ(stamp.time, 10s + i * 40ms);
    EXPECT_FALSE(stamp.step);
  }
}

TEST(StampLine, ATriggerThatPausesForHoursIsNoStep) {
  StampLine line;
  (void)line.next(10s, 10s);
  EXPECT_EQ(line.next(10s + 5h, 10s + 5h + 3ms).time, 10s + 5h);
}

TEST(StampLine, SecondsThatComeRoundAt32BitsAreCarriedOn) {
  constexpr nanoseconds kRound = std::chrono::seconds(std::int64_t{1} << 32);
  StampLine line;
  EXPECT_EQ(line.next(kRound - 20ms, kRound - 15ms).time, kRound - 20ms);
  const auto stamp = line.next(20ms, kRound + 25ms);
  EXPECT_EQ(stamp.time, kRound + 20ms);
  EXPECT_FALSE(stamp.step);
  EXPECT_EQ(line.next(60ms, kRound + 65ms).time, kRound + 60ms);
}

TEST(StampLine, NanosecondsThatComeRoundAt64BitsAreCarriedOn) {
  constexpr nanoseconds kLast = nanoseconds::max();
  StampLine line;
  // No clock is there: the first one is placed at its arrival.
  const auto first = line.next(kLast - 10ms, 50s);
  EXPECT_EQ(first.time, 50s);
  EXPECT_TRUE(first.step);
  const auto second = line.next(nanoseconds::min() + 30ms - 1ns, 50s + 42ms);
  EXPECT_EQ(second.time, 50s + 40ms);
  EXPECT_FALSE(second.step);
}

TEST(StampLine, AStepThatNoRoundExplainsGoesOnFromTheArrival) {
  StampLine line;
  (void)line.next(100s, 100s);
  const auto back = line.next(90s, 100s + 40ms);
  EXPECT_EQ(back.time, 100s + 40ms);
  EXPECT_TRUE(back.step);
  const auto next = line.next(90s + 40ms, 100s + 85ms);
  EXPECT_EQ(next.time, 100s + 80ms);
  EXPECT_FALSE(next.step);
}

// Three frames wait while the first is taken: nothing may stay ahead of its arrival for that.
TEST(StampLine, AFirstFrameThatWaitedDoesNotKeepTimesAhead) {
  StampLine line;
  const nanoseconds raw = 1s;  // hours from the monotonic clock
  nanoseconds last = line.next(raw, 20000s).time;
  EXPECT_EQ(last, 20000s);
  for (int i = 1; i < 4; ++i) {
    const nanoseconds taken = 20000s + i * 1ms;
    const auto stamp = line.next(raw + i * 40ms, taken);
    EXPECT_FALSE(stamp.step);
    EXPECT_GT(stamp.time, last);
    EXPECT_EQ(stamp.time, taken) << i;
    last = stamp.time;
  }
  // From then on by the driver's count, however late it is taken.
  EXPECT_EQ(line.next(raw + 160ms, 20000s + 45ms).time, 20000s + 43ms);
}

TEST(StampLine, StampsOfTheMonotonicClockMayBeAheadOfTheirArrival) {
  StampLine line;
  for (nanoseconds now = 100s; now < 101s; now += 40ms) EXPECT_EQ(line.next(now + 36ms, now).time, now + 36ms);
}

TEST(StampLine, TimeNeverStandsStill) {
  StampLine line;
  (void)line.next(100s, 100s);
  EXPECT_GT(line.next(100s, 99s).time, 100s);
}

TEST(MidExposure, OfAStampAtTheStart) {
  EXPECT_EQ(mid_exposure(1s, StampedAt::kStartOfExposure, 10ms, 30ms), 1s + 5ms);
}

// Exposed from 0 to 10 ms, read out from 10 to 40: the stamp is 40 ms, the middle 5 ms.
TEST(MidExposure, OfAStampAtTheEnd) {
  EXPECT_EQ(mid_exposure(1s + 40ms, StampedAt::kEndOfFrame, 10ms, 30ms), 1s + 5ms);
}

}  // namespace
}  // namespace stereotrack::capture::v4l2
