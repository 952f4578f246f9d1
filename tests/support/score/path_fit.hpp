#pragma once

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>

namespace stereotrack::score {

struct PathPoint {
  double time = 0;  ///< frames or seconds; the fit gives rates in the same unit
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// Degrees of the polynomials of x, y and z in time.
using PathDegrees = std::array<int, 3>;
inline constexpr PathDegrees kStraight = {1, 1, 1};   ///< a straight line at constant speed
inline constexpr PathDegrees kBallistic = {2, 3, 2};  ///< a thrown ball: gravity and drag bend y most

struct PathFit {
  std::size_t points = 0;
  Eigen::Vector3d rms = Eigen::Vector3d::Zero();       ///< of the residuals of x, y, z, each
  double rms_3d = 0;                                   ///< root of the mean squared distance
  double largest = 0;                                  ///< largest distance of a point from the path
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< of the fitted path, in the middle of its time
};

/// Least squares of each coordinate over time, by Householder QR on time scaled to -1..1 (powers of frame
/// numbers in the hundreds would lose half the digits). rms divides by the number of points.
/// Throws std::runtime_error if there are too few different times for a degree.
inline PathFit fit_path(std::span<const PathPoint> points, const PathDegrees& degrees) {
  if (points.empty()) throw std::runtime_error("a path needs points");
  double first = points[0].time;
  double last = points[0].time;
  for (const PathPoint& point : points) {
    first = std::min(first, point.time);
    last = std::max(last, point.time);
  }
  const double middle = (first + last) / 2;
  const double half = last > first ? (last - first) / 2 : 1;
  const auto count = static_cast<Eigen::Index>(points.size());

  PathFit fit;
  fit.points = points.size();
  Eigen::MatrixX3d residual(count, 3);
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::MatrixXd powers(count, degrees[axis] + 1);
    Eigen::VectorXd value(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const PathPoint& point = points[static_cast<std::size_t>(i)];
      value(i) = point.position(axis);
      powers(i, 0) = 1;
      for (Eigen::Index k = 1; k < powers.cols(); ++k) powers(i, k) = powers(i, k - 1) * (point.time - middle) / half;
    }
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(powers);
    if (qr.rank() < powers.cols()) {
      throw std::runtime_error(std::to_string(points.size()) + " points are too few for a path of degree " +
                               std::to_string(degrees[axis]));
    }
    const Eigen::VectorXd coefficient = qr.solve(value);
    residual.col(axis) = value - powers * coefficient;
    fit.rms(axis) = std::sqrt(residual.col(axis).squaredNorm() / static_cast<double>(count));
    if (degrees[axis] > 0) fit.velocity(axis) = coefficient(1) / half;
  }
  fit.rms_3d = std::sqrt(residual.squaredNorm() / static_cast<double>(count));
  fit.largest = residual.rowwise().norm().maxCoeff();
  return fit;
}

/// Root mean squared distance of the points from the straight line that fits them best, whatever the speed:
/// orthogonal regression, the smaller two singular values of the centred points.
inline double distance_from_line(std::span<const PathPoint> points) {
  if (points.empty()) throw std::runtime_error("a line needs points");
  Eigen::MatrixX3d centred(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) {
    centred.row(static_cast<Eigen::Index>(i)) = points[i].position.transpose();
  }
  const Eigen::RowVector3d centre = centred.colwise().mean();
  centred.rowwise() -= centre;
  const Eigen::VectorXd singular = Eigen::JacobiSVD<Eigen::MatrixXd>(centred).singularValues();
  double sum = 0;
  for (Eigen::Index i = 1; i < singular.size(); ++i) sum += singular(i) * singular(i);
  return std::sqrt(sum / static_cast<double>(points.size()));
}

}  // namespace stereotrack::score
