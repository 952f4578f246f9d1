#include "pipeline/track/extrapolate.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "pipeline/track/kalman.hpp"

namespace stereotrack {
namespace {

constexpr Extrapolation kModel{.width = 640, .height = 480};

TrackReport walker() {
  TrackReport report;
  report.id = 7;
  report.has_depth = true;
  report.box = {100, 50, 40, 80};
  report.image_x = 119.5;
  report.image_y = 89.5;
  report.image_vx = 100;
  report.image_vy = -20;
  report.position = {0.5, 0.25, 4};
  report.velocity = {1, 0, -2};
  report.covariance.diagonal() << 0.01, 0.01, 0.04, 0.09, 0.09, 0.16;
  report.acceleration_sd = 6;
  report.age_s = 1;
  return report;
}

// Worked by hand: s = 0.1; q = 6^2 = 36; P_zz' = 0.04 + 0.01 x 0.16 + 36 x 1e-4 / 4 = 0.0425;
// P_z,vz' = 0.1 x 0.16 + 36 x 1e-3 / 2 = 0.034; P_vz,vz' = 0.16 + 36 x 0.01 = 0.52.
TEST(Extrapolate, AgreesWithAnExampleByHand) {
  TrackReport report = walker();
  extrapolate(kModel, 0.1, report);
  EXPECT_DOUBLE_EQ(report.position.x(), 0.6);
  EXPECT_DOUBLE_EQ(report.position.y(), 0.25);
  EXPECT_DOUBLE_EQ(report.position.z(), 3.8);
  EXPECT_DOUBLE_EQ(report.velocity.z(), -2);
  EXPECT_NEAR(report.covariance(2, 2), 0.0425, 1e-12);
  EXPECT_NEAR(report.covariance(2, 5), 0.034, 1e-12);
  EXPECT_NEAR(report.covariance(5, 2), 0.034, 1e-12);
  EXPECT_NEAR(report.covariance(5, 5), 0.52, 1e-12);
  EXPECT_EQ(report.box, (Rect{110, 48, 40, 80}));
  EXPECT_DOUBLE_EQ(report.image_x, 129.5);
  EXPECT_DOUBLE_EQ(report.age_s, 1.1);
}

TEST(Extrapolate, NoTimeChangesNothing) {
  TrackReport report = walker();
  extrapolate(kModel, 0, report);
  EXPECT_EQ(report.position, walker().position);
  EXPECT_EQ(report.covariance, walker().covariance);
  EXPECT_EQ(report.box, walker().box);
}

TEST(Extrapolate, WhatWouldBeBehindTheCameraHasNoDepth) {
  TrackReport report = walker();
  extrapolate(kModel, 2.0, report);  // 4 m at 2 m/s: there
  EXPECT_FALSE(report.has_depth);
}

TEST(Extrapolate, ABoxIsClippedToThePictureAndEmptyOutsideOfIt) {
  TrackReport report = walker();
  report.image_vx = -1200;
  extrapolate(kModel, 0.1, report);  // 120 px to the left: from -20 on
  EXPECT_EQ(report.box, (Rect{0, 48, 20, 80}));
  report = walker();
  report.image_vx = -1e300;
  extrapolate(kModel, 0.1, report);
  EXPECT_TRUE(report.box.empty());
}

TEST(Extrapolate, WithoutDepthThePictureAloneMoves) {
  TrackReport report = walker();
  report.has_depth = false;
  report.position.setZero();
  report.covariance.setZero();
  extrapolate(kModel, 0.1, report);
  EXPECT_EQ(report.box.left, 110);
  EXPECT_TRUE(report.position.isZero());
  EXPECT_TRUE(report.covariance.isZero());
}

TEST(Extrapolate, ANumberThatIsNoneStaysForTheEncoderToRefuse) {
  TrackReport report = walker();
  report.velocity.x() = std::numeric_limits<double>::quiet_NaN();
  extrapolate(kModel, 0.1, report);
  EXPECT_TRUE(std::isnan(report.position.x()));
}

}  // namespace
}  // namespace stereotrack
