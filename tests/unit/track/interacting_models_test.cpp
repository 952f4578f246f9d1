#include "pipeline/track/interacting_models.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <span>

#include "tests/unit/track/correlated_error.hpp"

namespace stereotrack {
namespace {

using Models3 = InteractingModels<3>;
using Model3 = Models3::Model;
using Filter3 = Models3::Filter;

using test::CorrelatedError;
using test::normal3;

constexpr double kPeriod = 1.0 / 30;

const std::array<Model3, 2> kSteadyAndTurning{
    {{.acceleration_sd = 0.2, .lasts_s = 5}, {.acceleration_sd = 8, .lasts_s = 0.2}}};

TEST(InteractingModels, OneModelIsItsFilter) {
  std::mt19937 random(1);
  const std::array<Model3, 1> one{{{.acceleration_sd = 2, .lasts_s = 1}}};
  Models3 models;
  Filter3 filter;
  const Eigen::Matrix3d R = 0.3 * Eigen::Matrix3d::Identity();
  models.start(1, {1, 2, 10}, R, 3);
  filter.start({1, 2, 10}, R, 3, Eigen::Vector3d::Zero());
  for (int k = 0; k < 100; ++k) {
    models.predict(one, kPeriod);
    filter.predict(kPeriod, 2, Eigen::Vector3d::Zero());
    const Eigen::Vector3d z = filter.position() + normal3(random);
    EXPECT_NEAR((models.innovation(z, R).S - filter.innovation(z, R).S).norm(), 0, 1e-9);
    ASSERT_TRUE(models.update(z, R).has_value());
    ASSERT_TRUE(filter.update(z, R).has_value());
    ASSERT_NEAR((models.position() - filter.position()).norm(), 0, 1e-9);
    ASSERT_NEAR((models.velocity() - filter.velocity()).norm(), 0, 1e-9);
    ASSERT_NEAR((models.covariance() - filter.covariance()).norm(), 0, 1e-9);
  }
  EXPECT_EQ(models.probability(0), 1);
}

/// RMS error of the velocity in the last second before a turn, and how many frames it takes from the turn on
/// until the velocity is within half of what changed; a mean of 20 walkers.
struct Response {
  double steady_error = 0;
  double frames_to_turn = 0;
};
Response respond(std::span<const Model3> by) {
  constexpr int kWalkers = 20;
  Response response;
  for (std::uint32_t walker = 0; walker < kWalkers; ++walker) {
    std::mt19937 random(walker + 1);
    const Eigen::Matrix3d R = 0.03 * 0.03 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d p(0, 0, 5);
    const Eigen::Vector3d before(1.4, 0, 0);
    const Eigen::Vector3d after(0, 0, 1.4);
    CorrelatedError error_of(R, random);
    Models3 models;
    models.start(by.size(), p + error_of.after(0, random), R, 5);
    double squares = 0;
    int frames = 0;
    for (int k = 0; k < 120; ++k) {
      const Eigen::Vector3d v = k < 90 ? before : after;
      p += v * kPeriod;
      models.predict(by, kPeriod);
      EXPECT_TRUE(models.update(p + error_of.after(kPeriod, random), R).has_value());
      const double error = (models.velocity() - v).norm();
      if (k >= 60 && k < 90) squares += error * error / 30;
      if (k >= 90 && frames == k - 90 && error > 0.5 * (after - before).norm()) ++frames;
    }
    response.steady_error += std::sqrt(squares) / kWalkers;
    response.frames_to_turn += static_cast<double>(frames) / kWalkers;
  }
  return response;
}

TEST(InteractingModels, WhoGoesStraightIsSmoothedAndWhoTurnsIsFollowed) {
  const Response both = respond(kSteadyAndTurning);
  const Response quiet = respond(std::span(kSteadyAndTurning).first(1));
  const Response restless = respond(std::span(kSteadyAndTurning).last(1));
  EXPECT_LT(both.steady_error, 0.4 * restless.steady_error);
  EXPECT_LT(both.steady_error, 3 * quiet.steady_error);
  EXPECT_LT(both.frames_to_turn, 1.5 * restless.frames_to_turn + 1);
  EXPECT_LT(both.frames_to_turn, 0.5 * quiet.frames_to_turn);
}

TEST(InteractingModels, TellsWhatFallsFromWhatFloats) {
  const std::array<Model3, 3> with_gravity{{{.acceleration_sd = 0.2, .lasts_s = 5},
                                            {.acceleration_sd = 8, .lasts_s = 0.2},
                                            {.acceleration_sd = 0.2, .lasts_s = 5, .acceleration = {0, 9.81, 0}}}};
  for (const bool falls : {true, false}) {
    std::mt19937 random(7);
    Eigen::Vector3d p(0, -2, 8);
    Eigen::Vector3d v(2, -4, 0);
    const Eigen::Matrix3d R = 0.02 * 0.02 * Eigen::Matrix3d::Identity();
    CorrelatedError error_of(R, random);
    Models3 models;
    models.start(3, p + error_of.after(0, random), R, 10);
    for (int k = 0; k < 24; ++k) {
      const Eigen::Vector3d a(0, falls ? 9.81 : 0, 0);
      p += v * kPeriod + a * (kPeriod * kPeriod / 2);
      v += a * kPeriod;
      models.predict(with_gravity, kPeriod);
      ASSERT_TRUE(models.update(p + error_of.after(kPeriod, random), R).has_value());
    }
    EXPECT_GT(models.probability(falls ? 2 : 0), 0.7) << falls;
    EXPECT_LT(models.probability(falls ? 0 : 2), 0.1) << falls;
  }
}

/// Mean of the normalised estimation error squared, over 20 objects and what comes after 20 steps, divided by the
/// degrees of freedom: 1 where the covariance is true. The objects jump between the models as these say; the filters
/// are told `told` R.
double mean_nees(double told) {
  constexpr int kObjects = 20;
  constexpr int kSteps = 600;
  double sum = 0;
  int count = 0;
  for (std::uint32_t object = 0; object < kObjects; ++object) {
    std::mt19937 random(object + 1);
    std::uniform_real_distribution<double> part;
    Eigen::Vector3d p(0, 0, 5);
    Eigen::Vector3d v = 2 * normal3(random);
    const Eigen::Matrix3d R = 0.03 * 0.03 * Eigen::Matrix3d::Identity();
    CorrelatedError error_of(R, random);
    Models3 models;
    models.start(2, p + error_of.after(0, random), told * R, 2);
    std::size_t moves = 0;
    for (int k = 0; k < kSteps; ++k) {
      if (part(random) > std::exp(-kPeriod / kSteadyAndTurning[moves].lasts_s)) moves = 1 - moves;
      const Eigen::Vector3d a = kSteadyAndTurning[moves].acceleration_sd * normal3(random);
      p += v * kPeriod + a * (kPeriod * kPeriod / 2);
      v += a * kPeriod;
      models.predict(kSteadyAndTurning, kPeriod);
      EXPECT_TRUE(models.update(p + error_of.after(kPeriod, random), told * R).has_value());
      Eigen::Matrix<double, 6, 1> error;
      error << models.position() - p, models.velocity() - v;
      if (k < 20) continue;
      sum += error.dot(models.covariance().ldlt().solve(error)) / 6;
      ++count;
    }
  }
  return sum / count;
}

// Twenty objects have 120 degrees of freedom: a frame's mean lies within 0.763 and 1.268 in 95 of 100 cases.
TEST(InteractingModels, ErrorsAreAsLargeAsTheCovarianceSays) {
  const double true_noise = mean_nees(1);
  EXPECT_GT(true_noise, 0.763);
  EXPECT_LT(true_noise, 1.268);
  EXPECT_LT(mean_nees(4), 0.763);
  EXPECT_GT(mean_nees(0.25), 1.268);
}

TEST(InteractingModels, BadNumbersAreAFaultAndLeaveTheState) {
  Models3 models;
  models.start(2, {1, 2, 3}, Eigen::Matrix3d::Identity(), 2, {4, 5, 6});
  models.predict(kSteadyAndTurning, kPeriod);
  const Models3 before = models;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(models.update({nan, 0, 0}, Eigen::Matrix3d::Identity()).error(), Fault::kNotFinite);
  EXPECT_EQ(models.position(), before.position());
  EXPECT_EQ(models.covariance(), before.covariance());
  EXPECT_EQ(models.probability(0), before.probability(0));
}

TEST(InteractingModels, AWildMeasurementLeavesEachModelPossible) {
  Models3 models;
  models.start(2, {0, 0, 5}, 1e-4 * Eigen::Matrix3d::Identity(), 1);
  for (int k = 0; k < 80; ++k) {
    models.predict(kSteadyAndTurning, kPeriod);
    ASSERT_TRUE(models.update({0, 0, k == 25 ? 500.0 : 5.0}, 1e-4 * Eigen::Matrix3d::Identity()).has_value());
    EXPECT_TRUE(models.covariance().allFinite());
    EXPECT_NEAR(models.probability(0) + models.probability(1), 1, 1e-9);
    EXPECT_GT(models.probability(0), 0);
    EXPECT_GT(models.probability(1), 0);
  }
  EXPECT_NEAR(models.position().z(), 5, 0.1);
}

}  // namespace
}  // namespace stereotrack
