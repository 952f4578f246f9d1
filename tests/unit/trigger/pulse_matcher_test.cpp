#include "drivers/trigger/pulse_matcher.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>

namespace stereotrack::trigger {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using Kind = PulseMatcher::Kind;

constexpr milliseconds kPeriod{20};
constexpr milliseconds kDelay{3};

CaptureTime at(std::uint64_t pulse) {
  return CaptureTime(std::chrono::seconds(1) + kPeriod * static_cast<std::int64_t>(pulse));
}
PulseMatcher make() { return *PulseMatcher::create({.period = kPeriod, .delay = kDelay}); }

TEST(PulseMatcher, AFrameHasTheNumberOfThePulseThatAskedForIt) {
  PulseMatcher matcher = make();
  for (std::uint64_t n = 1; n <= 100; ++n) {
    matcher.pulse(n, at(n));
    for (const Side side : {Side::kLeft, Side::kRight}) {
      const PulseMatcher::Found found = matcher.frame(side, at(n) + kDelay + microseconds(800));
      EXPECT_EQ(found.kind, Kind::kAnswer);
      EXPECT_EQ(found.number, n);
    }
  }
  EXPECT_EQ(matcher.counters(Side::kLeft).answered, 100U);
  EXPECT_EQ(matcher.counters(Side::kLeft).missed + matcher.counters(Side::kRight).missed, 0U);
}

TEST(PulseMatcher, AMissedExposureIsFoundWithTheNextFrameOfItsSide) {
  PulseMatcher matcher = make();
  for (std::uint64_t n = 1; n <= 3; ++n) {
    matcher.pulse(n, at(n));
    (void)matcher.frame(Side::kLeft, at(n) + kDelay);
    if (n != 2) {
      EXPECT_EQ(matcher.frame(Side::kRight, at(n) + kDelay).number, n);
    }
  }
  EXPECT_EQ(matcher.counters(Side::kRight).missed, 1U);
  EXPECT_EQ(matcher.counters(Side::kLeft).missed, 0U);
}

TEST(PulseMatcher, AStrayIsBetweenPulsesOrOfATimeWhosePulsesAreForgotten) {
  PulseMatcher matcher = make();
  EXPECT_FALSE(matcher.frame(Side::kLeft, at(1)).between);
  for (std::uint64_t n = 1; n <= 20; ++n) matcher.pulse(n, at(n));
  EXPECT_TRUE(matcher.frame(Side::kLeft, at(10) + kDelay + milliseconds(8)).between);
  EXPECT_TRUE(matcher.frame(Side::kLeft, at(20) + kDelay + milliseconds(8)).between);
  EXPECT_TRUE(matcher.frame(Side::kLeft, at(20) + kDelay + kPeriod).between);
  EXPECT_FALSE(matcher.frame(Side::kLeft, at(20) + kDelay + kPeriod + microseconds(1)).between);
  EXPECT_FALSE(matcher.frame(Side::kLeft, at(3)).between);  // 1 to 4 are forgotten
  EXPECT_EQ(matcher.counters(Side::kLeft).stray, 6U);
}

TEST(PulseMatcher, ASideThatAnswersNoMoreIsFoundTwoPulsesLater) {
  PulseMatcher matcher = make();
  for (std::uint64_t n = 1; n <= 5; ++n) {
    matcher.pulse(n, at(n));
    if (n <= 2) (void)matcher.frame(Side::kRight, at(n) + kDelay);
    EXPECT_EQ(matcher.counters(Side::kRight).missed, 0U) << n;
  }
  matcher.pulse(6, at(6));
  EXPECT_EQ(matcher.counters(Side::kRight).missed, 1U);  // 3: of 4 and 5 a frame may still come
}

TEST(PulseMatcher, ASecondFrameForOnePulseIsRefused) {
  PulseMatcher matcher = make();
  matcher.pulse(1, at(1));
  EXPECT_EQ(matcher.frame(Side::kLeft, at(1) + kDelay).kind, Kind::kAnswer);
  EXPECT_EQ(matcher.frame(Side::kLeft, at(1) + kDelay + milliseconds(4)).kind, Kind::kDoubled);
  EXPECT_EQ(matcher.counters(Side::kLeft).doubled, 1U);
}

TEST(PulseMatcher, AFrameThatNoPulseAskedForIsStray) {
  PulseMatcher matcher = make();
  EXPECT_EQ(matcher.frame(Side::kLeft, at(1)).kind, Kind::kStray);
  matcher.pulse(1, at(1));
  EXPECT_EQ(matcher.frame(Side::kLeft, at(1) + kDelay + milliseconds(5)).kind, Kind::kAnswer);
  EXPECT_EQ(matcher.frame(Side::kRight, at(1) + kDelay + milliseconds(5) + nanoseconds(1)).kind, Kind::kStray);
  // A pulse whose edge was lost: its number is skipped.
  matcher.pulse(3, at(3));
  EXPECT_EQ(matcher.frame(Side::kLeft, at(2) + kDelay).kind, Kind::kStray);
  EXPECT_EQ(matcher.frame(Side::kLeft, at(3) + kDelay).number, 3U);
}

TEST(PulseMatcher, ASensorThatStartsAnewOwesNothingForPulsesOfBefore) {
  PulseMatcher matcher = make();
  for (std::uint64_t n = 1; n <= 2; ++n) matcher.pulse(n, at(n));
  matcher.restart(Side::kRight);
  for (std::uint64_t n = 3; n <= 6; ++n) {
    matcher.pulse(n, at(n));
    (void)matcher.frame(Side::kRight, at(n) + kDelay);
  }
  EXPECT_EQ(matcher.counters(Side::kRight).missed, 0U);
  EXPECT_EQ(matcher.counters(Side::kLeft).missed, 3U);  // 1 to 3; those of the last two pulses before may come
}

TEST(PulseMatcher, RefusesWhatCannotBe) {
  EXPECT_FALSE(PulseMatcher::create({.period = nanoseconds(0)}).has_value());
  EXPECT_FALSE(PulseMatcher::create({.period = kPeriod, .delay = nanoseconds(-1)}).has_value());
  EXPECT_FALSE(PulseMatcher::create({.period = kPeriod, .tolerance = 0.5}).has_value());
  EXPECT_FALSE(PulseMatcher::create({.period = kPeriod, .tolerance = 0}).has_value());
}

TEST(PulseMatcher, WithThePairerMissedDoubledAndStrayExposuresMakeNoWrongPair) {
  for (std::uint32_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto chance = [&](double part) { return std::uniform_real_distribution<double>(0, 1)(random) < part; };
    const auto jitter = [&] { return microseconds(std::uniform_int_distribution<int>(-1500, 1500)(random)); };
    PulseMatcher matcher = make();
    Pairer pairer = *Pairer::create({.period = kPeriod, .sequenced = true});
    std::uint64_t whole = 0;
    std::array<std::uint64_t, 2> missed{};
    std::array<std::uint64_t, 2> doubled{};
    for (std::uint64_t n = 1; n <= 300; ++n) {
      const bool edge_lost = chance(0.02);
      if (!edge_lost) matcher.pulse(n, at(n));
      bool both = !edge_lost;
      for (const Side side : {Side::kLeft, Side::kRight}) {
        const auto s = static_cast<std::size_t>(side);
        const int times = chance(0.05) ? 0 : chance(0.05) ? 2 : 1;
        both = both && times > 0;
        if (!edge_lost && n < 298) missed[s] += times == 0 ? 1 : 0;
        for (int i = 0; i < times; ++i) {
          const CaptureTime time = at(n) + kDelay + jitter() + milliseconds(8) * i;
          const PulseMatcher::Found found = matcher.frame(side, time);
          if (found.kind != Kind::kAnswer) {
            EXPECT_TRUE(edge_lost || i == 1);
            doubled[s] += edge_lost ? 0 : 1;
            continue;
          }
          EXPECT_EQ(found.number, n);
          for (const Settled& settled : pairer.push(side, {time, found.number, static_cast<std::uint32_t>(n)})) {
            if (settled.verdict == Verdict::kPaired) {
              EXPECT_EQ(settled.left->buffer, settled.right->buffer);
            }
          }
        }
      }
      whole += both ? 1 : 0;
    }
    EXPECT_EQ(pairer.counters().paired + 2, whole);  // two are spent on learning that numbers agree
    for (const Side side : {Side::kLeft, Side::kRight}) {
      const auto s = static_cast<std::size_t>(side);
      const PulseMatcher::Counters& counters = matcher.counters(side);
      EXPECT_GE(counters.missed, missed[s]);
      EXPECT_LE(counters.missed, missed[s] + 2);  // of the last pulses, where more came behind them
      EXPECT_EQ(counters.doubled + counters.stray >= doubled[s], true);
    }
  }
}

}  // namespace
}  // namespace stereotrack::trigger
