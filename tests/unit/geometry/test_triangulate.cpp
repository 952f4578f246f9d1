#include <gtest/gtest.h>

#include <limits>

#include "pipeline/geometry/triangulate.hpp"

namespace stereotrack {
namespace {

constexpr RectifiedGeometry kRig{.width_left = 640,
                                 .width_right = 640,
                                 .height = 480,
                                 .f = 500,
                                 .cx_left = 320,
                                 .cx_right = 300,
                                 .cy = 240,
                                 .baseline = 0.2,
                                 .offset = 20};

TEST(Triangulate, PointByHand) {
  // Z = 500 * 0.2 / 20 = 5, X = 100 * 5 / 500 = 1, Y = -50 * 5 / 500 = -0.5; s_Z = 25 / 100 * 0.4 = 0.1
  const std::optional<Estimate3> point = triangulate(kRig, {420, 190, 20}, {0, 0, 0.4});
  ASSERT_TRUE(point.has_value());
  EXPECT_NEAR((point->mean - Eigen::Vector3d(1, -0.5, 5)).norm(), 0, 1e-12);
  EXPECT_NEAR(std::sqrt(point->covariance(2, 2)), 0.1, 1e-12);
  EXPECT_NEAR(std::sqrt(point->covariance(0, 0)), 0.02, 1e-12);
  EXPECT_NEAR(point->covariance(0, 2), 0.002, 1e-12);
}

TEST(Triangulate, DisparityUnderGateYieldsNoTarget) {
  EXPECT_FALSE(triangulate(kRig, {320, 240, 0.249}, {1, 1, 1}).has_value());
  EXPECT_TRUE(triangulate(kRig, {320, 240, 0.25}, {1, 1, 1}).has_value());
  EXPECT_FALSE(triangulate(kRig, {320, 240, 3.9}, {1, 1, 1}, 4.0).has_value());
  EXPECT_FALSE(triangulate(kRig, {320, 240, 0}, {1, 1, 1}, 0.0).has_value());
  EXPECT_FALSE(triangulate(kRig, {320, 240, -1}, {1, 1, 1}, -2.0).has_value());
}

TEST(Triangulate, NotANumberYieldsNothing) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(triangulate(kRig, {nan, 240, 20}, {1, 1, 1}).has_value());
  EXPECT_FALSE(triangulate(kRig, {320, 240, nan}, {1, 1, 1}).has_value());
  EXPECT_FALSE(triangulate(kRig, {320, 240, 20}, {1, nan, 1}).has_value());
}

TEST(Triangulate, CovarianceIsThatOfFiniteDifferences) {
  const Eigen::Vector3d sigma(0.5, 0.7, 0.3);
  for (double d : {2.0, 20.0, 200.0}) {
    const Eigen::Vector3d at(400, 150, d);
    Eigen::Matrix3d jacobian;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d step = 1e-4 * Eigen::Vector3d::Unit(i);
      jacobian.col(i) = (triangulate(kRig, at + step, sigma)->mean - triangulate(kRig, at - step, sigma)->mean) / 2e-4;
    }
    const Eigen::Matrix3d expected = jacobian * sigma.cwiseAbs2().asDiagonal() * jacobian.transpose();
    const Eigen::Matrix3d covariance = triangulate(kRig, at, sigma)->covariance;
    EXPECT_NEAR((covariance - expected).norm() / expected.norm(), 0, 1e-7) << d;
    EXPECT_EQ(covariance, Eigen::Matrix3d(covariance.transpose()));
  }
}

TEST(Project, CovarianceIsThatOfFiniteDifferences) {
  const Eigen::Vector3d at(0.8, -0.4, 4);
  Eigen::Matrix3d covariance;
  covariance << 0.04, 0.01, 0.02, 0.01, 0.05, -0.01, 0.02, -0.01, 0.3;
  Eigen::Matrix3d jacobian;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d step = 1e-5 * Eigen::Vector3d::Unit(i);
    jacobian.col(i) = (project(kRig, at + step, covariance)->mean - project(kRig, at - step, covariance)->mean) / 2e-5;
  }
  const Eigen::Matrix3d expected = jacobian * covariance * jacobian.transpose();
  EXPECT_NEAR((project(kRig, at, covariance)->covariance - expected).norm() / expected.norm(), 0, 1e-7);
}

TEST(Project, UndoesTriangulateWithItsCovariance) {
  const Eigen::Vector3d uvd(400, 150, 25);
  const Eigen::Vector3d sigma(0.5, 0.7, 0.3);
  const std::optional<Estimate3> point = triangulate(kRig, uvd, sigma);
  ASSERT_TRUE(point.has_value());
  const std::optional<Estimate3> image = project(kRig, point->mean, point->covariance);
  ASSERT_TRUE(image.has_value());
  EXPECT_NEAR((image->mean - uvd).norm(), 0, 1e-10);
  EXPECT_NEAR((image->covariance - Eigen::Matrix3d(sigma.cwiseAbs2().asDiagonal())).norm(), 0, 1e-12);
}

TEST(Project, BehindTheCamerasThereIsNoPicture) {
  const Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  EXPECT_FALSE(project(kRig, {0, 0, 0}, covariance).has_value());
  EXPECT_FALSE(project(kRig, {0, 0, -1}, covariance).has_value());
  EXPECT_FALSE(project(kRig, {0, 0, 1e-300}, covariance).has_value());
  EXPECT_FALSE(project(kRig, {0, std::numeric_limits<double>::infinity(), 1}, covariance).has_value());
  EXPECT_FALSE(project(kRig, {0, 0, 1}, covariance * std::numeric_limits<double>::quiet_NaN()).has_value());
}

}  // namespace
}  // namespace stereotrack
