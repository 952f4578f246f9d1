#include "drivers/trigger/pulse_train.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "drivers/gpio/simulated_chip.hpp"

// In simulated time, on a line of the simulated chip: its level is what a meter at the pin would read.
namespace stereotrack::trigger {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
namespace sim = gpio::simulated_chip;

constexpr milliseconds kPeriod{40};
constexpr milliseconds kWidth{2};
constexpr milliseconds kLate{1};
constexpr MonotonicTime kBegin(std::chrono::seconds(100));

gpio::OutputLines line(const std::string& name, bool active_low = false) {
  const gpio::LineSpec spec{.name = {"sim", name}, .active_low = active_low};
  return gpio::open_lines({&spec, 1}, "test");
}

std::unique_ptr<PulseTrain> train(const std::string& name, bool falls = false) {
  auto made = PulseTrain::create({.period = kPeriod, .width = kWidth, .late = kLate, .falls = falls}, line(name));
  EXPECT_TRUE(made.has_value());
  return std::move(*made);
}

std::vector<Trigger::Pulse> told(Trigger& trigger) {
  std::vector<Trigger::Pulse> pulses;
  Trigger::Pulse pulse;
  while (trigger.take(pulse)) pulses.push_back(pulse);
  return pulses;
}

TEST(PulseTrain, RisesOnTheGridAndFallsAWidthLater) {
  const auto pulses = train("train-grid");
  const auto trigger = pulses->trigger();
  MonotonicTime now = kBegin;
  for (int k = 1; k <= 100; ++k) {
    const MonotonicTime grid = kBegin + k * kPeriod;
    const MonotonicTime rise = pulses->step(now);
    ASSERT_EQ(rise, grid);
    EXPECT_FALSE(pulses->rose());
    EXPECT_EQ(pulses->step(rise - nanoseconds(1)), rise);  // sooner does no harm
    EXPECT_EQ(sim::level("train-grid"), false);
    const MonotonicTime fall = pulses->step(rise);
    EXPECT_EQ(fall, rise + kWidth);
    EXPECT_TRUE(pulses->rose() && pulses->is_active());
    EXPECT_EQ(pulses->due(), grid);
    EXPECT_EQ(sim::level("train-grid"), true);
    EXPECT_EQ(pulses->step(fall - nanoseconds(1)), fall);
    EXPECT_EQ(sim::level("train-grid"), true);
    now = fall;
  }
  (void)pulses->step(now);
  EXPECT_EQ(sim::level("train-grid"), false);
  EXPECT_EQ(sim::edges("train-grid"), 200U);
  EXPECT_EQ(pulses->counters().given.get(), 100U);
  EXPECT_EQ(pulses->counters().skipped.get(), 0U);
  // The last 64 at most wait to be told, the first of them first.
  const std::vector<Trigger::Pulse> pulse = told(*trigger);
  ASSERT_EQ(pulse.size(), PulseTrain::kUntold);
  for (std::size_t i = 0; i < pulse.size(); ++i) {
    EXPECT_EQ(pulse[i].number, i + 1);
    EXPECT_EQ(pulse[i].time, kBegin + (static_cast<int>(i) + 1) * kPeriod);
  }
  EXPECT_EQ(trigger->lost(), 36U);
}

TEST(PulseTrain, TheFallingEdgeIsToldWhereItBeginsTheExposure) {
  const auto pulses = train("train-falls", true);
  const auto trigger = pulses->trigger();
  const MonotonicTime rise = pulses->step(kBegin);
  const MonotonicTime fall = pulses->step(rise + microseconds(100));
  EXPECT_TRUE(told(*trigger).empty());
  (void)pulses->step(fall + microseconds(30));
  const std::vector<Trigger::Pulse> pulse = told(*trigger);
  ASSERT_EQ(pulse.size(), 1U);
  EXPECT_EQ(pulse[0].time, rise + microseconds(100) + kWidth + microseconds(30));
}

TEST(PulseTrain, ALineThatIsActiveLowRestsHigh) {
  auto made = PulseTrain::create({.period = kPeriod, .width = kWidth, .late = kLate}, line("train-low", true));
  ASSERT_TRUE(made.has_value());
  EXPECT_EQ(sim::level("train-low"), true);
  const MonotonicTime rise = (*made)->step(kBegin);
  (void)(*made)->step(rise);
  EXPECT_EQ(sim::level("train-low"), false);
  (*made)->end(rise + microseconds(1));
  EXPECT_EQ(sim::level("train-low"), true);
}

TEST(PulseTrain, APulseUpToItsLimitLateIsGivenOneThatIsLaterSkippedAndNeverMadeUpFor) {
  const auto pulses = train("train-late");
  const auto trigger = pulses->trigger();
  MonotonicTime next = pulses->step(kBegin);
  next = pulses->step(next + kLate);
  EXPECT_TRUE(pulses->rose());
  next = pulses->step(next);
  EXPECT_EQ(next, kBegin + 2 * kPeriod);
  EXPECT_EQ(pulses->step(next + kLate + nanoseconds(1)), kBegin + 3 * kPeriod);
  EXPECT_FALSE(pulses->rose());
  EXPECT_EQ(pulses->counters().skipped.get(), 1U);
  // Ten periods slept over, and awake in time for the eleventh.
  next = pulses->step(kBegin + 13 * kPeriod + microseconds(200));
  EXPECT_TRUE(pulses->rose());
  EXPECT_EQ(pulses->due(), kBegin + 13 * kPeriod);
  EXPECT_EQ(pulses->counters().skipped.get(), 11U);
  EXPECT_EQ(pulses->step(next), kBegin + 14 * kPeriod);
  const std::vector<Trigger::Pulse> pulse = told(*trigger);
  ASSERT_EQ(pulse.size(), 2U);
  EXPECT_EQ(pulse[1].number, 2U);
  EXPECT_EQ(pulse[1].time, kBegin + 13 * kPeriod + microseconds(200));
}

TEST(PulseTrain, AWidthThatIsSleptOverDoesNotMeltTwoPulsesIntoOne) {
  const auto pulses = train("train-melt");
  MonotonicTime next = pulses->step(kBegin);
  (void)pulses->step(next);
  // Awake right when the second one is due: the line has to rest first.
  next = pulses->step(kBegin + 2 * kPeriod);
  EXPECT_EQ(sim::level("train-melt"), false);
  EXPECT_EQ(next, kBegin + 2 * kPeriod + kWidth);
  // Which takes longer than a pulse may be late.
  EXPECT_EQ(pulses->step(next), kBegin + 3 * kPeriod);
  EXPECT_EQ(pulses->counters().skipped.get(), 1U);
}

TEST(PulseTrain, ALineThatRefusesGivesNoPulseAndWorksOnceItsChipIsBack) {
  const auto pulses = train("train-gone");
  const auto trigger = pulses->trigger();
  MonotonicTime now = kBegin;
  const auto play = [&](int rounds) {
    for (int i = 0; i < rounds; ++i) now = pulses->step(now);
  };
  play(9);
  const std::uint64_t given = pulses->counters().given.get();
  sim::set_gone("train-gone", true);
  play(40);
  EXPECT_EQ(pulses->counters().given.get(), given);
  EXPECT_GT(pulses->counters().failed.get(), 0U);
  EXPECT_GT(pulses->counters().skipped.get(), 0U);
  EXPECT_EQ(pulses->lines().gone(), 1U);
  const std::size_t before = told(*trigger).size();
  EXPECT_EQ(before, given);
  sim::set_gone("train-gone", false);
  EXPECT_EQ(pulses->lines().reopen(), 1U);
  play(21);
  EXPECT_GE(pulses->counters().given.get(), given + 8);
  EXPECT_EQ(pulses->lines().gone(), 0U);
  const std::vector<Trigger::Pulse> pulse = told(*trigger);
  ASSERT_FALSE(pulse.empty());
  EXPECT_EQ(pulse[0].number, given + 1);  // numbers count what was given
}

TEST(PulseTrain, AfterItsEndTheLineIsInactiveAndAnotherGridBegins) {
  {
    const auto pulses = train("train-end");
    const MonotonicTime rise = pulses->step(kBegin);
    (void)pulses->step(rise);
    EXPECT_EQ(sim::level("train-end"), true);
    pulses->end(rise + microseconds(10));
    EXPECT_EQ(sim::level("train-end"), false);
    const MonotonicTime again = rise + std::chrono::hours(1);
    EXPECT_EQ(pulses->step(again), again + kPeriod);
    EXPECT_EQ(pulses->counters().skipped.get(), 0U);
    (void)pulses->step(again + kPeriod);
    EXPECT_EQ(sim::level("train-end"), true);
    // In the handler of a fault: whatever the thread does from then on.
    EXPECT_TRUE(pulses->lines().hold_safe());
    EXPECT_EQ(sim::level("train-end"), false);
    MonotonicTime now = again + kPeriod;
    for (int i = 0; i < 5; ++i) now = pulses->step(now);
    EXPECT_EQ(sim::level("train-end"), false);
  }
  EXPECT_EQ(sim::level("train-end"), false);
}

TEST(PulseTrain, WhateverTheSleepRisesAreNeverNearerThanAPeriodLessItsLimit) {
  std::mt19937 random(7);
  const auto between = [&](std::int64_t low, std::int64_t high) {
    return std::uniform_int_distribution<std::int64_t>(low, high)(random);
  };
  for (int round = 0; round < 300; ++round) {
    const nanoseconds period(between(1'000'000, 50'000'000));
    const nanoseconds width(between(1'000, period.count() * 2 / 3));
    const nanoseconds late(between(0, period.count() - width.count() - 1));
    auto made = PulseTrain::create({.period = period, .width = width, .late = late}, line("train-random"));
    ASSERT_TRUE(made.has_value());
    PulseTrain& pulses = **made;
    const auto trigger = pulses.trigger();
    std::uint64_t edges = sim::edges("train-random");
    MonotonicTime now = kBegin;
    MonotonicTime next = pulses.step(now);
    MonotonicTime last_rise{};
    MonotonicTime last_fall{};
    std::uint64_t grid_seen = 0;
    for (int i = 0; i < 300; ++i) {
      const bool sleeps_long = between(0, 9) == 0;
      now = next + nanoseconds(between(0, sleeps_long ? 5 * period.count() : late.count()));
      next = pulses.step(now);
      const std::uint64_t changes = sim::edges("train-random") - edges;
      edges += changes;
      ASSERT_LE(changes, 1U);
      ASSERT_GT(next, now);
      if (pulses.rose()) {
        ASSERT_EQ(sim::level("train-random"), true);
        ASSERT_EQ((pulses.due() - kBegin) % period, nanoseconds(0));
        ASSERT_GE(now, pulses.due());
        ASSERT_LE(now - pulses.due(), late);
        if (last_rise != MonotonicTime()) {
          ASSERT_GE(now - last_rise, period - late);
          ASSERT_GE(now - last_fall, std::min(width, (period - width) / 2));
        }
        last_rise = now;
        grid_seen = static_cast<std::uint64_t>((pulses.due() - kBegin) / period);
        // Each of the grid was given or skipped, once.
        ASSERT_EQ(pulses.counters().given.get() + pulses.counters().skipped.get(), grid_seen);
        const std::vector<Trigger::Pulse> pulse = told(*trigger);
        ASSERT_EQ(pulse.size(), 1U);
        ASSERT_EQ(pulse[0].time, now);
      } else if (changes == 1) {
        ASSERT_GE(now - last_rise, width);
        last_fall = now;
      }
    }
    EXPECT_GT(grid_seen, 10U);
  }
}

TEST(PulseTrain, WhatDoesNotFitIsRefused) {
  const auto refused = [](const PulseTrain::Config& config, gpio::OutputLines lines) {
    const auto made = PulseTrain::create(config, std::move(lines));
    return !made.has_value() && made.error() == Fault::kBadConfig;
  };
  EXPECT_TRUE(refused({.period = {}, .width = kWidth, .late = kLate}, line("train-bad")));
  EXPECT_TRUE(refused({.period = kPeriod, .width = {}, .late = kLate}, line("train-bad")));
  EXPECT_TRUE(refused({.period = kPeriod, .width = kWidth, .late = nanoseconds(-1)}, line("train-bad")));
  EXPECT_TRUE(refused({.period = kPeriod, .width = kPeriod - kLate, .late = kLate}, line("train-bad")));
  EXPECT_TRUE(refused({.period = kPeriod, .width = kWidth, .late = kLate}, gpio::OutputLines()));
  EXPECT_FALSE(
      refused({.period = kPeriod, .width = kPeriod - kLate - nanoseconds(1), .late = kLate}, line("train-bad")));
}

}  // namespace
}  // namespace stereotrack::trigger
