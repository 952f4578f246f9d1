#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>

#include "pipeline/geometry/rectified_geometry.hpp"

namespace stereotrack {

/// A position and what is known about it: mean and 3x3 covariance. Of (X, Y, Z) in the left rectified
/// camera frame [calibration unit], or of (u, v, d) on the left canvas [px].
struct Estimate3 {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// Smallest disparity that is still believed to be a distance [px]: at 0.25 px the usual sub-pixel error
/// of 0.1 to 0.2 px is as large as the value, and first-order covariances mean nothing any more.
inline constexpr double kMinDisparity = 0.25;

/// Point and uncertainty from a match.
///     Z = f b / d,  X = (u - cx) b / d,  Y = (v - cy) b / d
///     C = J S J^T,  S = diag(s_u^2, s_v^2, s_d^2)
///         | b/d   0   -X/d |
///     J = |  0   b/d  -Y/d |        so that s_Z = Z^2 / (f b) s_d: an ellipsoid drawn out along the ray
///         |  0    0   -Z/d |
/// First order in S (Matthies & Shafer 1987); checked against finite differences.
/// In: (u, v, d) on the left canvas and their standard deviations >= 0 [px].
/// Nothing if d < min_disparity or a value is not finite. O(1), any thread.
[[nodiscard]] inline std::optional<Estimate3> triangulate(const RectifiedGeometry& geometry, const Eigen::Vector3d& uvd,
                                                          const Eigen::Vector3d& sigma_uvd,
                                                          double min_disparity = kMinDisparity) noexcept {
  const double d = uvd.z();
  if (!(d >= min_disparity && d > 0) || !uvd.allFinite() || !sigma_uvd.allFinite()) return std::nullopt;
  const double scale = geometry.baseline / d;
  Estimate3 point;
  point.mean << (uvd.x() - geometry.cx_left) * scale, (uvd.y() - geometry.cy) * scale, geometry.f * scale;
  Eigen::Matrix3d jacobian;
  jacobian << scale, 0, -point.mean.x() / d, 0, scale, -point.mean.y() / d, 0, 0, -point.mean.z() / d;
  const Eigen::Matrix3d scaled = jacobian * sigma_uvd.asDiagonal();
  point.covariance = scaled * scaled.transpose();
  return point;
}

/// The inverse: where a point is expected on the left canvas, and how surely (prediction windows).
///     u = cx + f X / Z,  v = cy + f Y / Z,  d = f b / Z
///     S = J C J^T
///         | f/Z   0   -f X/Z^2 |
///     J = |  0   f/Z  -f Y/Z^2 |
///         |  0    0   -f b/Z^2 |
/// Nothing if Z <= 0 (behind the cameras) or a value is not finite. O(1), any thread.
[[nodiscard]] inline std::optional<Estimate3> project(const RectifiedGeometry& geometry,
                                                      const Eigen::Vector3d& position,
                                                      const Eigen::Matrix3d& covariance) noexcept {
  const double z = position.z();
  if (!(z > 0) || !position.allFinite() || !covariance.allFinite()) return std::nullopt;
  const double scale = geometry.f / z;
  if (!std::isfinite(scale * scale)) return std::nullopt;
  Estimate3 image;
  image.mean << geometry.cx_left + scale * position.x(), geometry.cy + scale * position.y(), scale * geometry.baseline;
  Eigen::Matrix3d jacobian;
  jacobian << scale, 0, -scale * position.x() / z, 0, scale, -scale * position.y() / z, 0, 0,
      -scale * geometry.baseline / z;
  image.covariance = jacobian * covariance * jacobian.transpose();
  return image;
}

}  // namespace stereotrack
