#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <random>

#include "pipeline/track/coloured_noise_filter.hpp"

namespace stereotrack::test {

[[nodiscard]] inline Eigen::Vector3d normal3(std::mt19937& random) {
  std::normal_distribution<double> standard;
  return {standard(random), standard(random), standard(random)};
}

/// Errors of measurements with covariance R that go on from one to the next as ColouredNoiseFilter says.
class CorrelatedError {
 public:
  CorrelatedError(const Eigen::Matrix3d& R, std::mt19937& random)
      : root_(R.llt().matrixL()), slow_(std::sqrt(kPart) * root_ * normal3(random)) {}

  /// The next, dt seconds later.
  [[nodiscard]] Eigen::Vector3d after(double dt, std::mt19937& random) {
    const double f = std::exp(-dt / ColouredNoiseFilter<3>::kSlow_s);
    slow_ = f * slow_ + std::sqrt((1 - f * f) * kPart) * root_ * normal3(random);
    return slow_ + std::sqrt(1 - kPart) * root_ * normal3(random);
  }

 private:
  static constexpr double kPart = ColouredNoiseFilter<3>::kSlowPart;
  Eigen::Matrix3d root_;
  Eigen::Vector3d slow_;
};

}  // namespace stereotrack::test
