#include "drivers/capture/libcamera/clock_finder.hpp"

#include <gtest/gtest.h>

#include <cstdint>

namespace stereotrack::capture::libcamera {
namespace {

using namespace std::chrono_literals;
using std::chrono::nanoseconds;
using Clock = ClockFinder::Clock;

constexpr nanoseconds kPeriod = 33ms;
constexpr nanoseconds kReadout = 15ms;
constexpr nanoseconds kExposure = 5ms;

/// Frames of a camera whose clock is `ahead` of the monotonic one; they come when they were read out and `on_its_way`.
struct Sensor {
  ClockFinder finder;
  nanoseconds ahead{0};
  nanoseconds now = 1000s;  ///< start of the next exposure, monotonic
  nanoseconds stamp{0};

  bool expose(nanoseconds on_its_way) {
    stamp = now + ahead;
    const bool changed = finder.frame(stamp, now + kExposure + kReadout + on_its_way, kExposure);
    error = stamp + finder.offset() - now;
    now += kPeriod;
    return changed;
  }
  nanoseconds error{0};  ///< of the last stamp, moved to the monotonic clock
};

Sensor sensor(nanoseconds ahead, nanoseconds slept) {
  return {ClockFinder({.boottime_ahead = slept, .period = kPeriod, .readout = kReadout}), ahead};
}

TEST(ClockFinder, NothingIsKnownBeforeTheFirstFrame) {
  EXPECT_EQ(ClockFinder().clock(), Clock::kUnknown);
  EXPECT_EQ(ClockFinder().offset(), 0ns);
}

TEST(ClockFinder, MonotonicStampsAreFoundWhateverTheBoardHasSlept) {
  for (const nanoseconds slept : {0ns, nanoseconds(10ms), nanoseconds(1s), nanoseconds(100h)}) {
    Sensor camera = sensor(0ns, slept);
    for (int i = 0; i < 20; ++i) EXPECT_FALSE(camera.expose(i % 5 * 10ms));
    EXPECT_EQ(camera.finder.clock(), Clock::kMonotonic) << slept.count();
    EXPECT_EQ(camera.error, 0ns);
  }
}

TEST(ClockFinder, BoottimeIsFoundOnceTheBoardHasSlept) {
  for (const nanoseconds slept : {nanoseconds(1s), nanoseconds(100h)}) {
    Sensor camera = sensor(slept, slept);
    for (int i = 0; i < 20; ++i) EXPECT_FALSE(camera.expose(i % 5 * 10ms));
    EXPECT_EQ(camera.finder.clock(), Clock::kBoottime) << slept.count();
    EXPECT_EQ(camera.error, 0ns);
  }
}

// What its head says of the first two: a sleep that is shorter than a frame's delay.
TEST(ClockFinder, AShortSleepIsTheMostThatTheyAreMistakenBy) {
  Sensor camera = sensor(10ms, 10ms);
  for (int i = 0; i < 20; ++i) (void)camera.expose(0ms);
  EXPECT_LE(camera.error, 10ms);
  EXPECT_GE(camera.error, 0ms);
}

TEST(ClockFinder, AnOffsetOfItsOwnIsFoundByTheQuickestFrame) {
  for (const nanoseconds ahead : {nanoseconds(-900s), nanoseconds(-5s), nanoseconds(3s), nanoseconds(10'000h)}) {
    Sensor camera = sensor(ahead, 20s);
    (void)camera.expose(40ms);
    EXPECT_EQ(camera.error, 40ms);  // late by what it took
    for (int i = 0; i < 50; ++i) EXPECT_FALSE(camera.expose(2ms + i % 7 * 5ms));
    EXPECT_EQ(camera.finder.clock(), Clock::kOther);
    EXPECT_EQ(camera.error, 2ms) << ahead.count();
  }
}

TEST(ClockFinder, ADriftIsFollowedWithinTwoMilliseconds) {
  for (const double drift : {-1e-4, 1e-4}) {
    Sensor camera = sensor(500s, 0s);
    for (int i = 0; i < 20'000; ++i) {
      camera.ahead += nanoseconds(static_cast<std::int64_t>(drift * static_cast<double>(kPeriod.count())));
      EXPECT_FALSE(camera.expose(i % 10 == 0 ? 0ms : 10ms));
      if (i > 100) {
        ASSERT_LE(std::chrono::abs(camera.error), 2ms) << i;
      }
    }
  }
}

TEST(ClockFinder, AFirstFrameThatWasHeldUpDoesNotDecide) {
  Sensor camera = sensor(0ns, 0ns);
  EXPECT_FALSE(camera.expose(2s));
  EXPECT_EQ(camera.finder.clock(), Clock::kOther);
  EXPECT_FALSE(camera.expose(0ms));
  EXPECT_EQ(camera.finder.clock(), Clock::kMonotonic);
  EXPECT_EQ(camera.error, 0ns);
}

TEST(ClockFinder, LaterOnesThatWereHeldUpChangeNothing) {
  Sensor camera = sensor(0ns, 0ns);
  for (int i = 0; i < 10; ++i) (void)camera.expose(0ms);
  for (int i = 0; i < 4; ++i) EXPECT_FALSE(camera.expose(2s));
  EXPECT_EQ(camera.finder.clock(), Clock::kMonotonic);
  EXPECT_FALSE(camera.expose(0ms));
}

TEST(ClockFinder, FiveInARowAreAnotherClock) {
  Sensor camera = sensor(0ns, 0ns);
  for (int i = 0; i < 10; ++i) (void)camera.expose(0ms);
  camera.ahead = 100s;
  for (int i = 0; i < 4; ++i) EXPECT_FALSE(camera.expose(0ms));
  EXPECT_TRUE(camera.expose(0ms));
  EXPECT_EQ(camera.finder.clock(), Clock::kOther);
  EXPECT_EQ(camera.error, 0ns);
}

TEST(ClockFinder, AStampThatGoesBackIsAStepAtOnce) {
  Sensor camera = sensor(50s, 0s);
  for (int i = 0; i < 300; ++i) (void)camera.expose(0ms);
  camera.ahead = 20s;
  EXPECT_TRUE(camera.expose(0ms));
  EXPECT_EQ(camera.error, 0ns);
  camera.ahead = camera.ahead - kPeriod;  // the same stamp again
  EXPECT_TRUE(camera.expose(0ms));
}

}  // namespace
}  // namespace stereotrack::capture::libcamera
