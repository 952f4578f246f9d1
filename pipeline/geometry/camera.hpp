#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "pipeline/core/result.hpp"
#include "pipeline/geometry/calibration.hpp"

namespace stereotrack {

/// A pinhole camera with a lens: from a ray to the pixel that it lights, and back.
///
/// A ray in front of the camera is written as its normalized point (x, y) = (X/Z, Y/Z), Z > 0; r^2 = x^2 + y^2.
///
/// kRadtan, as OpenCV's projectPoints (Brown 1966; rational: Claus & Fitzgibbon 2005; thin prism: Weng 1992;
/// tilt: Louhichi 2007), coefficients k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tau_x tau_y:
///     g   = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
///     x'  = x g + 2 p1 x y + p2 (r^2 + 2 x^2) + s1 r^2 + s2 r^4
///     y'  = y g + p1 (r^2 + 2 y^2) + 2 p2 x y + s3 r^2 + s4 r^4
///     s (x'', y'', 1) = [R33 0 -R13; 0 R33 -R23; 0 0 1] R(tau_x, tau_y) (x', y', 1),  R = R_y(tau_y) R_x(tau_x)
/// kEquidistant (Kannala & Brandt 2006, OpenCV fisheye, Kalibr "equidistant"), coefficients k1 k2 k3 k4:
///     theta = atan r,  theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)
///     (x'', y'') = theta_d / r (x, y)
/// Both:
///     u = fx x'' + cx,  v = fy y'' + cy       [px], (0, 0) the centre of the first pixel
///
/// Domain: a polynomial fitted to a picture bends back outside of it, and a ray far outside would land
/// inside the picture again. Rays beyond the first r at which the radial part stops growing, or beyond
/// kMaxRadius, have no pixel: project() answers nothing.
///
/// Same bits on every machine: + - * / sqrt and pinned_math.hpp. Immutable after create(); any thread.
class Camera {
 public:
  static constexpr double kMaxRadius = 10.0;  ///< tan of 84 degrees

  /// Faults: kNotFinite (a NaN or infinity in the model), kBadConfig (focal length not positive).
  [[nodiscard]] static Result<Camera> create(const CameraModel& model) noexcept;

  /// Normalized point -> raw pixel [px]; nothing outside the domain. Agrees with cv::projectPoints and
  /// cv::fisheye::distortPoints to 1e-9 px. About 15 ns.
  [[nodiscard]] std::optional<Eigen::Vector2d> project(const Eigen::Vector2d& normalized) const noexcept;

  /// Raw pixel -> normalized point, by Newton's method with halved steps: at most 30 steps, until the
  /// reprojection is within 1e-9 px. Nothing where it does not converge or leaves the domain.
  /// project(unproject(p)) = p within 2e-9 px. About 120 ns.
  [[nodiscard]] std::optional<Eigen::Vector2d> unproject(const Eigen::Vector2d& pixel) const noexcept;

  /// The same, starting at `guess` (the neighbour's answer): fewer steps.
  [[nodiscard]] std::optional<Eigen::Vector2d> unproject(const Eigen::Vector2d& pixel,
                                                         const Eigen::Vector2d& guess) const noexcept;

  /// First radius r at which the lens equation bends back, at most kMaxRadius.
  [[nodiscard]] double max_radius() const noexcept { return max_radius_; }
  [[nodiscard]] const CameraModel& model() const noexcept { return model_; }

 private:
  Camera() noexcept = default;

  [[nodiscard]] bool grows_at(double radius) const noexcept;
  [[nodiscard]] Eigen::Vector2d distort_radtan(const Eigen::Vector2d& p, Eigen::Matrix2d* jacobian) const noexcept;
  [[nodiscard]] std::optional<Eigen::Vector2d> undistort_radtan(const Eigen::Vector2d& distorted,
                                                                const Eigen::Vector2d& guess) const noexcept;
  [[nodiscard]] double theta_distorted(double theta, double* derivative) const noexcept;
  [[nodiscard]] std::optional<Eigen::Vector2d> undistort_equidistant(const Eigen::Vector2d& distorted) const noexcept;

  CameraModel model_;
  bool tilted_ = false;
  Eigen::Matrix3d tilt_ = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d untilt_ = Eigen::Matrix3d::Identity();
  double max_radius_ = kMaxRadius;
};

}  // namespace stereotrack
