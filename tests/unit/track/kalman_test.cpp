#include "pipeline/track/kalman.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/core/eigen.hpp>
#include <opencv2/video/tracking.hpp>
#include <random>

#include "tests/unit/track/correlated_error.hpp"

namespace stereotrack {
namespace {

using Filter1 = ConstantVelocityFilter<1>;
using Filter3 = ConstantVelocityFilter<3>;
using Vector1 = Filter1::Vector;
using Vector6 = Filter3::State;
using test::normal3;

double normal(std::mt19937& random) {
  std::normal_distribution<double> standard;
  return standard(random);
}
Eigen::Matrix3d random_covariance(std::mt19937& random) {
  Eigen::Matrix3d root;
  for (int i = 0; i < 9; ++i) root(i) = normal(random);
  return root * root.transpose() + 0.05 * Eigen::Matrix3d::Identity();
}
Vector6 state_of(const Filter3& filter) {
  Vector6 x;
  x << filter.position(), filter.velocity();
  return x;
}

TEST(Kalman, OneDimensionByHand) {
  Filter1 filter;
  filter.start(Vector1(2), Vector1(1), 1.0, Vector1(4));
  // dt = 1, s_a = 1: x' = (6, 4), P' = [2 1; 1 1] + [1/4 1/2; 1/2 1] = [2.25 1.5; 1.5 2]
  filter.predict(1, 1);
  EXPECT_DOUBLE_EQ(filter.position()(0), 6);
  EXPECT_DOUBLE_EQ(filter.velocity()(0), 4);
  EXPECT_DOUBLE_EQ(filter.covariance()(0, 0), 2.25);
  EXPECT_DOUBLE_EQ(filter.covariance()(0, 1), 1.5);
  EXPECT_DOUBLE_EQ(filter.covariance()(1, 1), 2);
  // R = 2.25: S = 4.5, K = (1/2, 1/3); y = 9 - 6 = 3: x = (7.5, 5); P = [1.125 0.75; 0.75 1.5]
  const auto innovation = filter.update(Vector1(9), Vector1(2.25));
  ASSERT_TRUE(innovation.has_value());
  EXPECT_DOUBLE_EQ(innovation->y(0), 3);
  EXPECT_DOUBLE_EQ(innovation->S(0), 4.5);
  EXPECT_DOUBLE_EQ(filter.position()(0), 7.5);
  EXPECT_DOUBLE_EQ(filter.velocity()(0), 5);
  EXPECT_NEAR(filter.covariance()(0, 0), 1.125, 1e-15);
  EXPECT_NEAR(filter.covariance()(0, 1), 0.75, 1e-15);
  EXPECT_NEAR(filter.covariance()(1, 0), 0.75, 1e-15);
  EXPECT_NEAR(filter.covariance()(1, 1), 1.5, 1e-15);
}

TEST(Kalman, NoTimeChangesNothing) {
  Filter3 filter;
  filter.start({1, 2, 3}, Eigen::Matrix3d::Identity(), 2, {4, 5, 6});
  const Filter3 before = filter;
  filter.predict(0, 10);
  EXPECT_EQ(state_of(filter), state_of(before));
  EXPECT_EQ(filter.covariance(), before.covariance());
}

TEST(Kalman, InnovationIsThatOfTheUpdateAndChangesNothing) {
  Filter3 filter;
  filter.start({1, 2, 3}, Eigen::Matrix3d::Identity(), 2);
  filter.predict(0.1, 3);
  const Vector6 before = state_of(filter);
  const Eigen::Vector3d z(2, 2, 5);
  const Eigen::Matrix3d R = 0.3 * Eigen::Matrix3d::Identity();
  const Innovation<3> alone = filter.innovation(z, R);
  EXPECT_EQ(state_of(filter), before);
  const auto updated = filter.update(z, R);
  ASSERT_TRUE(updated.has_value());
  EXPECT_EQ(alone.y, updated->y);
  EXPECT_EQ(alone.S, updated->S);
}

TEST(Kalman, AgreesWithOpencvOverIrregularTimes) {
  std::mt19937 random(1);
  cv::KalmanFilter theirs(6, 3, 0, CV_64F);
  Filter3 ours;
  const Eigen::Matrix3d R0 = random_covariance(random);
  ours.start({1, -2, 10}, R0, 1.5, {0.1, 0.2, -0.3});
  cv::Mat start;
  cv::eigen2cv(state_of(ours), start);
  start.copyTo(theirs.statePost);
  cv::Mat covariance;
  cv::eigen2cv(Filter3::Covariance(ours.covariance()), covariance);
  covariance.copyTo(theirs.errorCovPost);
  cv::setIdentity(theirs.measurementMatrix);
  std::uniform_real_distribution<double> step(0.001, 0.4);
  for (int k = 0; k < 300; ++k) {
    const double dt = step(random);
    const double s_a = 0.5 + step(random);
    cv::setIdentity(theirs.transitionMatrix);
    theirs.processNoiseCov = cv::Mat::zeros(6, 6, CV_64F);
    for (int i = 0; i < 3; ++i) {
      theirs.transitionMatrix.at<double>(i, i + 3) = dt;
      theirs.processNoiseCov.at<double>(i, i) = s_a * s_a * std::pow(dt, 4) / 4;
      theirs.processNoiseCov.at<double>(i, i + 3) = s_a * s_a * std::pow(dt, 3) / 2;
      theirs.processNoiseCov.at<double>(i + 3, i) = s_a * s_a * std::pow(dt, 3) / 2;
      theirs.processNoiseCov.at<double>(i + 3, i + 3) = s_a * s_a * dt * dt;
    }
    theirs.predict();
    ours.predict(dt, s_a);
    if (k % 5 != 4) {  // every fifth measurement is missing
      const Eigen::Vector3d z = ours.position() + normal3(random);
      const Eigen::Matrix3d R = random_covariance(random);
      cv::Mat z_cv;
      cv::eigen2cv(z, z_cv);
      cv::eigen2cv(R, theirs.measurementNoiseCov);
      theirs.correct(z_cv);
      ASSERT_TRUE(ours.update(z, R).has_value());
    }
    Vector6 x;
    Filter3::Covariance P;
    cv::cv2eigen(theirs.statePost, x);
    cv::cv2eigen(theirs.errorCovPost, P);
    ASSERT_LT((state_of(ours) - x).norm(), 1e-9 * (1 + x.norm())) << k;
    ASSERT_LT((ours.covariance() - P).norm(), 1e-9 * P.norm()) << k;
  }
}

/// Part of 100 time steps in which the normalised estimation error squared, averaged over 20 objects, lies within its
/// 95 % bounds. Each object starts with a velocity of standard deviation 2, is pushed by accelerations of standard
/// deviation 0.8, constant in each step, and measured with R; the filter is told `told` R.
double part_consistent(double told, std::uint32_t first_seed) {
  constexpr int kObjects = 20;
  constexpr int kSteps = 100;
  // chi-squared with 20 x 6 = 120 degrees of freedom: 2.5 % are under 91.573, 2.5 % over 152.211
  constexpr double kLow = 91.573 / kObjects;
  constexpr double kHigh = 152.211 / kObjects;
  Eigen::Matrix3d R;
  R << 0.04, 0.01, 0.05, 0.01, 0.05, -0.02, 0.05, -0.02, 0.4;
  const Eigen::Matrix3d root = R.llt().matrixL();
  std::array<double, kSteps> nees{};
  for (std::uint32_t object = 0; object < kObjects; ++object) {
    std::mt19937 random(first_seed + object);
    Eigen::Vector3d p = 10 * normal3(random);
    Eigen::Vector3d v = 2 * normal3(random);
    Filter3 filter;
    filter.start(p + root * normal3(random), told * R, 2);
    for (double& value : nees) {
      const double dt = 0.02 + 0.03 * static_cast<double>(random() % 3);
      const Eigen::Vector3d a = 0.8 * normal3(random);
      p += v * dt + a * (dt * dt / 2);
      v += a * dt;
      filter.predict(dt, 0.8);
      EXPECT_TRUE(filter.update(p + root * normal3(random), told * R).has_value());
      Vector6 error = state_of(filter);
      error.head<3>() -= p;
      error.tail<3>() -= v;
      value += error.dot(filter.covariance().ldlt().solve(error)) / kObjects;
    }
  }
  int inside = 0;
  for (double value : nees) inside += value > kLow && value < kHigh ? 1 : 0;
  return static_cast<double>(inside) / kSteps;
}

TEST(Kalman, ErrorsAreAsLargeAsTheCovarianceSays) {
  double sum = 0;
  for (std::uint32_t series = 0; series < 5; ++series) sum += part_consistent(1, 1 + 1000 * series);
  EXPECT_GT(sum / 5, 0.88);
}

TEST(Kalman, WrongMeasurementNoiseShowsInTheErrors) {
  for (std::uint32_t series = 0; series < 3; ++series) {
    EXPECT_LT(part_consistent(4, 1 + 1000 * series), 0.1);
    EXPECT_LT(part_consistent(0.25, 1 + 1000 * series), 0.1);
  }
}

TEST(Kalman, CovarianceStaysSymmetricAndPositiveDefinite) {
  std::mt19937 random(3);
  Filter3 filter;
  filter.start({0, 0, 10}, Eigen::Matrix3d::Identity(), 1e4);
  double largest = 0;
  for (int k = 0; k < 2000; ++k) {
    filter.predict(k % 7 == 0 ? 2.0 : 1e-3, 0.01);
    largest = std::max(largest, filter.covariance().cwiseAbs().maxCoeff());
    // From 1e-8 to 1e8: what a plain (I - K H) P does not survive.
    const double scale = std::pow(10.0, static_cast<double>(random() % 17) - 8);
    ASSERT_TRUE(filter.update(normal3(random), scale * random_covariance(random)).has_value());
    const Filter3::Covariance& P = filter.covariance();
    ASSERT_LT((P - P.transpose()).cwiseAbs().maxCoeff(), 1e-15 * largest) << k;
    ASSERT_EQ(P.llt().info(), Eigen::Success) << k;
  }
}

TEST(Kalman, NotANumberIsAFaultAndLeavesTheState) {
  Filter3 filter;
  filter.start({1, 2, 3}, Eigen::Matrix3d::Identity(), 2, {4, 5, 6});
  const Filter3 before = filter;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const Eigen::Matrix3d good = Eigen::Matrix3d::Identity();
  EXPECT_EQ(filter.update({nan, 0, 0}, good).error(), Fault::kNotFinite);
  EXPECT_EQ(filter.update({0, infinity, 0}, good).error(), Fault::kNotFinite);
  Eigen::Matrix3d bad = good;
  bad(1, 2) = nan;
  EXPECT_EQ(filter.update({0, 0, 0}, bad).error(), Fault::kNotFinite);
  EXPECT_EQ(state_of(filter), state_of(before));
  EXPECT_EQ(filter.covariance(), before.covariance());
  EXPECT_TRUE(filter.update({0, 0, 0}, good).has_value());
}

TEST(Kalman, SingularInnovationIsAFaultAndLeavesTheState) {
  Filter3 filter;
  filter.start({1, 2, 3}, Eigen::Matrix3d::Zero(), 0);
  const Filter3 before = filter;
  EXPECT_EQ(filter.update({2, 2, 2}, Eigen::Matrix3d::Zero()).error(), Fault::kSingular);
  EXPECT_EQ(state_of(filter), state_of(before));
  EXPECT_EQ(filter.covariance(), before.covariance());
}

TEST(Kalman, AKnownAccelerationMovesTheStateAndNotItsCovariance) {
  Filter3 falls;
  falls.start({1, 2, 3}, Eigen::Matrix3d::Identity(), 2, {4, 5, 6});
  Filter3 floats = falls;
  falls.predict(0.5, 1, {0, 9.81, 0});
  floats.predict(0.5, 1);
  EXPECT_NEAR((falls.position() - floats.position() - Eigen::Vector3d(0, 9.81 / 8, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((falls.velocity() - floats.velocity() - Eigen::Vector3d(0, 9.81 / 2, 0)).norm(), 0, 1e-12);
  EXPECT_EQ(falls.covariance(), floats.covariance());
}

}  // namespace
}  // namespace stereotrack
