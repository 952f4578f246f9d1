#include "pipeline/track/coloured_noise_filter.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core/eigen.hpp>
#include <opencv2/video/tracking.hpp>
#include <random>

#include "pipeline/track/kalman.hpp"
#include "tests/unit/track/correlated_error.hpp"

namespace stereotrack {
namespace {

using Filter3 = ColouredNoiseFilter<3>;
using test::normal3;
using Vector6 = Eigen::Matrix<double, 6, 1>;

Eigen::Matrix3d slanted_noise() {
  Eigen::Matrix3d R;
  R << 0.04, 0.01, 0.05, 0.01, 0.05, -0.02, 0.05, -0.02, 0.4;
  return R;
}

TEST(ColouredNoiseFilter, AgreesWithOpencvsFilterOfTheSameNineStates) {
  std::mt19937 random(1);
  cv::KalmanFilter theirs(9, 3, 0, CV_64F);
  Filter3 ours;
  const Eigen::Matrix3d R = slanted_noise();
  ours.start({1, -2, 10}, R, 1.5, {0.1, 0.2, -0.3});
  const auto put = [](const auto& from, cv::Mat& to) {
    cv::Mat made;
    cv::eigen2cv(from, made);
    made.copyTo(to);
  };
  put(Filter3::State(ours.state()), theirs.statePost);
  put(Filter3::Covariance(ours.state_covariance()), theirs.errorCovPost);
  put(Eigen::Matrix3d((1 - Filter3::kSlowPart) * R), theirs.measurementNoiseCov);
  theirs.measurementMatrix = cv::Mat::zeros(3, 9, CV_64F);
  for (int i = 0; i < 3; ++i)
    theirs.measurementMatrix.at<double>(i, i) = theirs.measurementMatrix.at<double>(i, i + 6) = 1;
  std::uniform_real_distribution<double> step(0.001, 0.4);
  for (int k = 0; k < 300; ++k) {
    const double dt = step(random);
    const double s_a = 0.5 + step(random);
    const double f = std::exp(-dt / Filter3::kSlow_s);
    cv::setIdentity(theirs.transitionMatrix);
    theirs.processNoiseCov = cv::Mat::zeros(9, 9, CV_64F);
    for (int i = 0; i < 3; ++i) {
      theirs.transitionMatrix.at<double>(i, i + 3) = dt;
      theirs.transitionMatrix.at<double>(i + 6, i + 6) = f;
      theirs.processNoiseCov.at<double>(i, i) = s_a * s_a * std::pow(dt, 4) / 4;
      theirs.processNoiseCov.at<double>(i, i + 3) = s_a * s_a * std::pow(dt, 3) / 2;
      theirs.processNoiseCov.at<double>(i + 3, i) = s_a * s_a * std::pow(dt, 3) / 2;
      theirs.processNoiseCov.at<double>(i + 3, i + 3) = s_a * s_a * dt * dt;
      for (int j = 0; j < 3; ++j) {
        theirs.processNoiseCov.at<double>(i + 6, j + 6) = (1 - f * f) * Filter3::kSlowPart * R(i, j);
      }
    }
    theirs.predict();
    ours.predict(dt, s_a, Eigen::Vector3d::Zero());
    if (k % 5 != 4) {  // every fifth measurement is missing
      const Eigen::Vector3d z = ours.position() + normal3(random);
      cv::Mat z_cv;
      cv::eigen2cv(z, z_cv);
      theirs.correct(z_cv);
      const Innovation<3> alone = ours.innovation(z, R);
      const auto updated = ours.update(z, R);
      ASSERT_TRUE(updated.has_value());
      EXPECT_EQ(alone.y, updated->y);
      EXPECT_EQ(alone.S, updated->S);
    }
    Filter3::State x;
    Filter3::Covariance P;
    cv::cv2eigen(theirs.statePost, x);
    cv::cv2eigen(theirs.errorCovPost, P);
    ASSERT_LT((ours.state() - x).norm(), 1e-8 * (1 + x.norm())) << k;
    ASSERT_LT((ours.state_covariance() - P).norm(), 1e-8 * P.norm()) << k;
  }
}

TEST(ColouredNoiseFilter, AKnownAccelerationMovesTheStateAndNotItsCovariance) {
  Filter3 falls;
  falls.start({1, 2, 3}, Eigen::Matrix3d::Identity(), 2, {4, 5, 6});
  Filter3 floats = falls;
  falls.predict(0.5, 1, {0, 9.81, 0});
  floats.predict(0.5, 1, Eigen::Vector3d::Zero());
  EXPECT_NEAR((falls.position() - floats.position() - Eigen::Vector3d(0, 9.81 / 8, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((falls.velocity() - floats.velocity() - Eigen::Vector3d(0, 9.81 / 2, 0)).norm(), 0, 1e-12);
  EXPECT_EQ(falls.covariance(), floats.covariance());
}

/// Mean over 20 objects of constant velocity, and over what comes after the first second, of the normalised estimation
/// error squared a degree of freedom: 1 where the covariance is true. Errors of measurements go on as the filter says;
/// it is told `told` R.
template <class Filter>
double mean_nees(double told, std::uint32_t first_seed) {
  constexpr int kObjects = 20;
  constexpr int kSteps = 150;
  constexpr double kPeriod = 1.0 / 30;
  const Eigen::Matrix3d R = slanted_noise();
  double sum = 0;
  for (std::uint32_t object = 0; object < kObjects; ++object) {
    std::mt19937 random(first_seed + object);
    Eigen::Vector3d p = 10 * normal3(random);
    const Eigen::Vector3d v = 2 * normal3(random);
    test::CorrelatedError error_of(R, random);
    Filter filter;
    filter.start(p + error_of.after(0, random), told * R, 2, Eigen::Vector3d::Zero());
    for (int k = 0; k < kSteps; ++k) {
      p += v * kPeriod;
      filter.predict(kPeriod, 1e-3, Eigen::Vector3d::Zero());
      EXPECT_TRUE(filter.update(p + error_of.after(kPeriod, random), told * R).has_value());
      Vector6 error;
      error << filter.position() - p, filter.velocity() - v;
      if (k >= 30) sum += error.dot(filter.covariance().ldlt().solve(error)) / 6;
    }
  }
  return sum / kObjects / (kSteps - 30);
}

// Twenty objects have 120 degrees of freedom: a frame's mean lies within 0.763 and 1.268 in 95 of 100 cases.
TEST(ColouredNoiseFilter, ErrorsAreAsLargeAsTheCovarianceSays) {
  for (const std::uint32_t series : {1U, 1001U, 2001U}) {
    EXPECT_GT(mean_nees<Filter3>(1, series), 0.763);
    EXPECT_LT(mean_nees<Filter3>(1, series), 1.268);
  }
}

TEST(ColouredNoiseFilter, WrongMeasurementNoiseShowsInTheErrors) {
  for (const std::uint32_t series : {1U, 1001U, 2001U}) {
    EXPECT_LT(mean_nees<Filter3>(4, series), 0.763);
    EXPECT_GT(mean_nees<Filter3>(0.25, series), 1.268);
  }
}

// What it is for: with a filter to which each error is new, the same R is as wrong as a fifth of it.
TEST(ColouredNoiseFilter, AFilterForWhiteNoiseTrustsItselfTooMuch) {
  EXPECT_GT(mean_nees<ConstantVelocityFilter<3>>(1, 1), 3);
}

TEST(ColouredNoiseFilter, WhereItIsExpectedToBeMeasuredIncludesTheErrorThatItHad) {
  Filter3 filter;
  filter.start({0, 0, 10}, Eigen::Matrix3d::Identity() * 1e-4, 0.1, Eigen::Vector3d::Zero());
  for (int k = 0; k < 60; ++k) {
    filter.predict(1.0 / 30, 0.01, Eigen::Vector3d::Zero());
    ASSERT_TRUE(filter.update({0, 0, 10}, Eigen::Matrix3d::Identity() * 1e-4).has_value());
  }
  // Its outline is cut from now on: the place stays, the measurement is expected to stay wrong, for a while.
  filter.predict(1.0 / 30, 0.01, Eigen::Vector3d::Zero());
  ASSERT_TRUE(filter.update({0.03, 0, 10}, Eigen::Matrix3d::Identity() * 1e-4).has_value());
  EXPECT_LT(filter.position().x(), 0.008);
  EXPECT_GT(filter.expected().x(), 0.01);
  filter.predict(5, 0.01, Eigen::Vector3d::Zero());
  EXPECT_NEAR(filter.expected().x(), filter.position().x(), 1e-6);
}

TEST(ColouredNoiseFilter, CovarianceStaysSymmetricAndPositiveDefinite) {
  std::mt19937 random(3);
  Filter3 filter;
  filter.start({0, 0, 10}, slanted_noise(), 100, Eigen::Vector3d::Zero());
  for (int k = 0; k < 5000; ++k) {
    filter.predict(k % 7 == 0 ? 2.0 : 1e-3, 0.01, Eigen::Vector3d::Zero());
    // From a millimetre to ten metres: a ball before the camera, half a car at the edge.
    const double scale = std::pow(10.0, static_cast<double>(random() % 9) - 6);
    ASSERT_TRUE(filter.update(normal3(random), scale * slanted_noise()).has_value());
    const Filter3::Covariance& P = filter.state_covariance();
    ASSERT_LT((P - P.transpose()).cwiseAbs().maxCoeff(), 1e-12 * P.cwiseAbs().maxCoeff()) << k;
    ASSERT_GT(P.ldlt().vectorD().minCoeff(), 0) << k;
  }
}

TEST(ColouredNoiseFilter, BadNumbersAreAFaultAndLeaveTheState) {
  Filter3 filter;
  filter.start({1, 2, 3}, Eigen::Matrix3d::Identity(), 2, {4, 5, 6});
  const Filter3 before = filter;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Eigen::Matrix3d bad = Eigen::Matrix3d::Identity();
  EXPECT_EQ(filter.update({nan, 0, 0}, bad).error(), Fault::kNotFinite);
  bad(1, 2) = nan;
  EXPECT_EQ(filter.update({0, 0, 0}, bad).error(), Fault::kNotFinite);
  EXPECT_EQ(filter.state(), before.state());
  EXPECT_EQ(filter.state_covariance(), before.state_covariance());
  Filter3 sure;
  sure.start({1, 2, 3}, Eigen::Matrix3d::Zero(), 0, Eigen::Vector3d::Zero());
  EXPECT_EQ(sure.update({2, 2, 2}, Eigen::Matrix3d::Zero()).error(), Fault::kSingular);
  EXPECT_EQ(sure.position(), Eigen::Vector3d(1, 2, 3));
}

}  // namespace
}  // namespace stereotrack
