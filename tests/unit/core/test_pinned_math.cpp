#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "pipeline/core/pinned_math.hpp"

namespace stereotrack {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(PinnedMath, SineAndCosineAgreeWithTheLibraryOverTheirDomain) {
  for (double x = -100.0; x <= 100.0; x += 0.000977) {
    ASSERT_NEAR(pinned_sin(x), std::sin(x), 1e-15) << x;
    ASSERT_NEAR(pinned_cos(x), std::cos(x), 1e-15) << x;
  }
  for (double x = -1e6; x <= 1e6; x += 13.37) {
    ASSERT_NEAR(pinned_sin(x), std::sin(x), 1e-12) << x;
    ASSERT_NEAR(pinned_cos(x), std::cos(x), 1e-12) << x;
  }
}

TEST(PinnedMath, SineOfKnownAnglesIsWhatSchoolSays) {
  EXPECT_EQ(pinned_sin(0.0), 0.0);
  EXPECT_EQ(pinned_cos(0.0), 1.0);
  EXPECT_NEAR(pinned_sin(std::numbers::pi / 6), 0.5, 1e-15);
  EXPECT_NEAR(pinned_cos(std::numbers::pi / 3), 0.5, 1e-15);
  EXPECT_NEAR(pinned_tan(std::numbers::pi / 4), 1.0, 1e-15);
}

TEST(PinnedMath, SineOutsideItsDomainIsNotANumber) {
  for (double x : {1.1e6, -1.1e6, kInfinity, -kInfinity, std::nan("")}) {
    EXPECT_TRUE(std::isnan(pinned_sin(x)));
    EXPECT_TRUE(std::isnan(pinned_cos(x)));
    EXPECT_TRUE(std::isnan(pinned_tan(x)));
  }
}

TEST(PinnedMath, TangentAgreesWithTheLibrary) {
  for (double x = -20.0; x <= 20.0; x += 0.00137) {
    if (std::fabs(std::cos(x)) < 1e-3) continue;
    ASSERT_NEAR(pinned_tan(x) / std::tan(x), 1.0, 1e-12) << x;
  }
}

TEST(PinnedMath, ArcTangentAgreesWithTheLibrary) {
  for (double x = -10.0; x <= 10.0; x += 0.000977) ASSERT_NEAR(pinned_atan(x), std::atan(x), 1e-15) << x;
  for (double x : {1e-300, 1e-9, 0.4375, 0.6875, 1.1875, 2.4375, 1e3, 1e9, 1e18, 1e20, 1e300, kInfinity}) {
    EXPECT_NEAR(pinned_atan(x), std::atan(x), 1e-15) << x;
    EXPECT_EQ(pinned_atan(-x), -pinned_atan(x)) << x;
  }
  EXPECT_TRUE(std::isnan(pinned_atan(std::nan(""))));
}

TEST(PinnedMath, ArcTangentOfTwoKnowsItsQuadrant) {
  for (double y : {-3.0, -1e-9, 0.0, 1e-9, 2.0}) {
    for (double x : {-4.0, -1e-9, 0.0, 1e-9, 5.0}) {
      EXPECT_NEAR(pinned_atan2(y, x), std::atan2(y, x), 1e-15) << y << " " << x;
    }
  }
  EXPECT_TRUE(std::isnan(pinned_atan2(1.0, std::nan(""))));
  EXPECT_TRUE(std::isnan(pinned_atan2(std::nan(""), 0.0)));
}

TEST(PinnedMath, ExponentialAgreesWithTheLibrary) {
  for (double x = -708.0; x <= 709.0; x += 0.0137) ASSERT_NEAR(pinned_exp(x) / std::exp(x), 1.0, 1e-15) << x;
  EXPECT_EQ(pinned_exp(0.0), 1.0);
  EXPECT_NEAR(pinned_exp(709.78) / std::exp(709.78), 1.0, 1e-15);
  EXPECT_EQ(pinned_exp(709.79), kInfinity);
  EXPECT_EQ(pinned_exp(kInfinity), kInfinity);
  EXPECT_EQ(pinned_exp(-709.0), 0.0);
  EXPECT_EQ(pinned_exp(-kInfinity), 0.0);
  EXPECT_TRUE(std::isnan(pinned_exp(std::nan(""))));
}

TEST(PinnedMath, LogarithmAgreesWithTheLibrary) {
  for (double x = 1e-3; x < 20.0; x += 0.00137) ASSERT_NEAR(pinned_log(x), std::log(x), 2e-15) << x;
  for (double x : {5e-324, 1e-310, 1e-300, 1e-9, 1.0 - 1e-15, 1.0 + 1e-15, 1e9, 1e300}) {
    EXPECT_NEAR(pinned_log(x), std::log(x), 1e-15 * std::fabs(std::log(x))) << x;
  }
  EXPECT_EQ(pinned_log(1.0), 0.0);
  EXPECT_EQ(pinned_log(0.0), -kInfinity);
  EXPECT_EQ(pinned_log(kInfinity), kInfinity);
  EXPECT_TRUE(std::isnan(pinned_log(-1.0)));
  EXPECT_TRUE(std::isnan(pinned_log(std::nan(""))));
}

TEST(PinnedMath, BitsAreTheOnesWrittenDownHere) {
  std::uint64_t hash = 1469598103934665603ULL;
  const auto mix = [&hash](double value) { hash = (hash ^ std::bit_cast<std::uint64_t>(value)) * 1099511628211ULL; };
  for (int i = -5000; i <= 5000; ++i) {
    const double x = i * 0.0078125;
    mix(pinned_sin(x));
    mix(pinned_cos(x));
    mix(pinned_tan(x));
    mix(pinned_atan(x));
    mix(pinned_exp(x));
    mix(pinned_log(x * x + 0.25));
  }
  EXPECT_EQ(hash, 5345565625775626859ULL);
}

}  // namespace
}  // namespace stereotrack
