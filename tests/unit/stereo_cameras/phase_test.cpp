#include "drivers/capture/stereo_cameras/phase.hpp"

#include <gtest/gtest.h>

#include <random>

namespace stereotrack::capture {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

constexpr nanoseconds kPeriod = milliseconds(40);

TEST(PhaseEstimator, OneFrameSaysNothing) {
  PhaseEstimator phase(kPeriod);
  phase.add(CaptureTime(seconds(1)), milliseconds(1));
  EXPECT_FALSE(phase.phase().has_value());
  EXPECT_FALSE(phase.drift().has_value());
}

TEST(PhaseEstimator, FindsWhatWasPutInThroughJitterLossAndWrongNeighbours) {
  // 20 s at 25/s: 3 ms at the end, 20e-6 s/s; 0.2 ms of jitter; every fifth frame tells the neighbour's distance, every
  // seventh nonsense.
  std::mt19937 random(1);
  std::normal_distribution<double> jitter(0, 0.2e-3);
  PhaseEstimator phase(kPeriod);
  for (int i = 0; i < 500; ++i) {
    const double t = 0.04 * i;
    double d = 3e-3 + 20e-6 * (t - 20) + jitter(random);
    if (i % 5 == 0) d += 0.04;
    if (i % 7 == 0) d = 0.013;
    phase.add(CaptureTime(kPeriod * i), nanoseconds(static_cast<std::int64_t>(d * 1e9)));
  }
  ASSERT_TRUE(phase.phase().has_value());
  EXPECT_NEAR(static_cast<double>(phase.phase()->count()), 3e6, 0.1e6);
  ASSERT_TRUE(phase.drift().has_value());
  EXPECT_NEAR(*phase.drift(), 20e-6, 15e-6);
}

TEST(PhaseEstimator, DriftGoesOnWhereThePhaseFolds) {
  // 1 ms a second: from 15 to 25 ms, which is -15 ms of 40.
  PhaseEstimator phase(kPeriod);
  for (int i = 0; i < 251; ++i) {
    phase.add(CaptureTime(kPeriod * i), milliseconds(15) + microseconds(40) * i);
  }
  ASSERT_TRUE(phase.drift().has_value());
  EXPECT_NEAR(*phase.drift(), 1e-3, 1e-6);
  // Of the newest second's middle, half a second before the end.
  EXPECT_NEAR(static_cast<double>(phase.phase()->count()), -15.5e6, 0.6e6);
}

TEST(PhaseEstimator, ForgetsWhenItIsToldAndWhenTimeFalls) {
  PhaseEstimator phase(kPeriod);
  const auto feed = [&](nanoseconds distance) {
    for (int i = 0; i < 300; ++i) phase.add(CaptureTime(kPeriod * i), distance);
  };
  feed(milliseconds(5));
  EXPECT_EQ(phase.phase(), nanoseconds(milliseconds(5)));
  phase.restart();
  EXPECT_FALSE(phase.phase().has_value());
  feed(milliseconds(-7));
  EXPECT_EQ(phase.phase(), nanoseconds(milliseconds(-7)));
  feed(milliseconds(2));  // its times begin anew
  EXPECT_EQ(phase.phase(), nanoseconds(milliseconds(2)));
  EXPECT_EQ(phase.drift(), 0.0);
}

TEST(PhaseEstimator, HoldsAMinuteAndGoesOn) {
  PhaseEstimator phase(kPeriod);
  for (int i = 0; i < 25 * 200; ++i) {
    phase.add(CaptureTime(kPeriod * i), i < 25 * 100 ? milliseconds(1) : milliseconds(9));
  }
  EXPECT_EQ(phase.phase(), nanoseconds(milliseconds(9)));
}

}  // namespace
}  // namespace stereotrack::capture
