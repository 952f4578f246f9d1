#pragma once

#include <Eigen/Core>
#include <Eigen/LU>

#include "pipeline/core/result.hpp"

namespace stereotrack {

/// By how much a measurement in D dimensions is off from where it was expected, and how far off it may be.
template <int D>
struct Innovation {
  using Vector = Eigen::Matrix<double, D, 1>;
  using Matrix = Eigen::Matrix<double, D, D>;

  Vector y;  ///< (3.28)
  Matrix S;  ///< (3.29)

  /// S^-1. Faults: kNotFinite (y or S), kSingular.
  [[nodiscard]] Result<Matrix> inverse() const noexcept {
    if (!y.allFinite() || !S.allFinite()) return fail(Fault::kNotFinite);
    Matrix inverse;
    bool invertible = false;
    S.computeInverseWithCheck(inverse, invertible, 1e-300);
    if (!invertible) return fail(Fault::kSingular);
    return inverse;
  }

  /// y^T S^-1 y, squared Mahalanobis distance; not finite where S is singular.
  [[nodiscard]] double squared_distance() const noexcept { return y.dot(S.inverse() * y); }
};

}  // namespace stereotrack
