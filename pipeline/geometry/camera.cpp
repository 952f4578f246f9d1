#include "pipeline/geometry/camera.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "pipeline/core/pinned_math.hpp"

namespace stereotrack {
namespace {

constexpr int kMaxSteps = 30;
constexpr double kTolerancePx = 1e-9;
constexpr double kRadiusStep = 1.0 / 512;

Eigen::Matrix3d tilt_matrix(double tau_x, double tau_y) noexcept {
  const double cx = pinned_cos(tau_x);
  const double sx = pinned_sin(tau_x);
  const double cy = pinned_cos(tau_y);
  const double sy = pinned_sin(tau_y);
  Eigen::Matrix3d about_x;
  about_x << 1, 0, 0, 0, cx, sx, 0, -sx, cx;
  Eigen::Matrix3d about_y;
  about_y << cy, 0, -sy, 0, 1, 0, sy, 0, cy;
  const Eigen::Matrix3d rotation = about_y * about_x;
  Eigen::Matrix3d to_plane;
  to_plane << rotation(2, 2), 0, -rotation(0, 2), 0, rotation(2, 2), -rotation(1, 2), 0, 0, 1;
  return to_plane * rotation;
}

Eigen::Vector2d apply(const Eigen::Matrix3d& homography, const Eigen::Vector2d& p) noexcept {
  const Eigen::Vector3d q = homography * Eigen::Vector3d(p.x(), p.y(), 1.0);
  return {q.x() / q.z(), q.y() / q.z()};
}

}  // namespace

Result<Camera> Camera::create(const CameraModel& model) noexcept {
  for (double value : {model.fx, model.fy, model.cx, model.cy}) {
    if (!std::isfinite(value)) return fail(Fault::kNotFinite);
  }
  for (double value : model.distortion) {
    if (!std::isfinite(value)) return fail(Fault::kNotFinite);
  }
  if (!(model.fx > 0 && model.fy > 0)) return fail(Fault::kBadConfig);

  Camera camera;
  camera.model_ = model;
  const double tau_x = model.distortion[12];
  const double tau_y = model.distortion[13];
  if (model.lens == LensModel::kRadtan && (tau_x != 0 || tau_y != 0)) {
    // A sensor tilted by a right angle or more sees nothing.
    if (!(std::fabs(tau_x) < 1.5 && std::fabs(tau_y) < 1.5)) return fail(Fault::kBadConfig);
    camera.tilted_ = true;
    camera.tilt_ = tilt_matrix(tau_x, tau_y);
    camera.untilt_ = camera.tilt_.inverse();
  }

  double good = 0;
  double bad = kRadiusStep;
  while (bad < kMaxRadius && camera.grows_at(bad)) {
    good = bad;
    bad += kRadiusStep;
  }
  if (bad >= kMaxRadius) {
    camera.max_radius_ = kMaxRadius;
    return camera;
  }
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (good + bad);
    (camera.grows_at(middle) ? good : bad) = middle;
  }
  camera.max_radius_ = good;
  return camera;
}

bool Camera::grows_at(double radius) const noexcept {
  if (model_.lens == LensModel::kEquidistant) {
    double derivative = 0;
    const double theta_d = theta_distorted(pinned_atan(radius), &derivative);
    return theta_d > 0 && derivative > 0;
  }
  const std::array<double, 14>& k = model_.distortion;
  const double r2 = radius * radius;
  const double numerator = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const double denominator = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
  const double d_numerator = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);
  const double d_denominator = k[5] + r2 * (2 * k[6] + r2 * 3 * k[7]);
  if (!(denominator > 0 && numerator > 0)) return false;
  // d/dr of r N/D, times D^2
  return numerator * denominator + 2 * r2 * (d_numerator * denominator - numerator * d_denominator) > 0;
}

Eigen::Vector2d Camera::distort_radtan(const Eigen::Vector2d& p, Eigen::Matrix2d* jacobian) const noexcept {
  const std::array<double, 14>& k = model_.distortion;
  const double x = p.x();
  const double y = p.y();
  const double r2 = x * x + y * y;
  const double numerator = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const double denominator = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
  const double g = numerator / denominator;
  if (jacobian != nullptr) {
    const double d_numerator = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);
    const double d_denominator = k[5] + r2 * (2 * k[6] + r2 * 3 * k[7]);
    const double dg = (d_numerator - g * d_denominator) / denominator;  // dg / d(r^2)
    const double prism_x = k[8] + 2 * k[9] * r2;
    const double prism_y = k[10] + 2 * k[11] * r2;
    const double mixed = 2 * x * y * dg + 2 * k[2] * x + 2 * k[3] * y;
    *jacobian << g + 2 * x * x * dg + 2 * k[2] * y + 6 * k[3] * x + 2 * x * prism_x, mixed + 2 * y * prism_x,
        mixed + 2 * x * prism_y, g + 2 * y * y * dg + 6 * k[2] * y + 2 * k[3] * x + 2 * y * prism_y;
  }
  return {x * g + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x) + r2 * (k[8] + k[9] * r2),
          y * g + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y + r2 * (k[10] + k[11] * r2)};
}

std::optional<Eigen::Vector2d> Camera::undistort_radtan(const Eigen::Vector2d& distorted,
                                                        const Eigen::Vector2d& guess) const noexcept {
  const double tolerance = kTolerancePx / std::max(model_.fx, model_.fy);
  Eigen::Vector2d p = guess;
  Eigen::Matrix2d jacobian;
  Eigen::Vector2d residual = distorted - distort_radtan(p, &jacobian);
  double error2 = residual.squaredNorm();
  for (int step = 0; step < kMaxSteps && error2 > tolerance * tolerance; ++step) {
    const double det = jacobian(0, 0) * jacobian(1, 1) - jacobian(0, 1) * jacobian(1, 0);
    if (!(std::fabs(det) > 1e-12)) return std::nullopt;
    Eigen::Vector2d move((jacobian(1, 1) * residual.x() - jacobian(0, 1) * residual.y()) / det,
                         (jacobian(0, 0) * residual.y() - jacobian(1, 0) * residual.x()) / det);
    bool better = false;
    for (int halving = 0; halving < 10 && !better; ++halving) {
      const Eigen::Vector2d candidate = p + move;
      Eigen::Matrix2d candidate_jacobian;
      const Eigen::Vector2d candidate_residual = distorted - distort_radtan(candidate, &candidate_jacobian);
      const double candidate_error2 = candidate_residual.squaredNorm();
      better = candidate_error2 < error2;
      if (better) {
        p = candidate;
        jacobian = candidate_jacobian;
        residual = candidate_residual;
        error2 = candidate_error2;
      }
      move *= 0.5;
    }
    if (!better) break;
  }
  if (!(error2 <= tolerance * tolerance) || !(p.squaredNorm() <= max_radius_ * max_radius_)) return std::nullopt;
  return p;
}

double Camera::theta_distorted(double theta, double* derivative) const noexcept {
  const std::array<double, 14>& k = model_.distortion;
  const double t2 = theta * theta;
  if (derivative != nullptr) {
    *derivative = 1 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])));
  }
  return theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
}

std::optional<Eigen::Vector2d> Camera::undistort_equidistant(const Eigen::Vector2d& distorted) const noexcept {
  const double theta_d = std::sqrt(distorted.squaredNorm());
  if (theta_d < 1e-8) return distorted;
  // theta_d grows over the whole domain, so the answer lies between these two.
  double low = 0;
  double high = pinned_atan(max_radius_);
  if (!(theta_d <= theta_distorted(high, nullptr))) return std::nullopt;
  const double tolerance = kTolerancePx / std::max(model_.fx, model_.fy);
  double theta = std::min(theta_d, high);
  for (int step = 0; step < 2 * kMaxSteps; ++step) {
    double derivative = 0;
    const double error = theta_distorted(theta, &derivative) - theta_d;
    if (std::fabs(error) <= 0.1 * tolerance) break;
    (error > 0 ? high : low) = theta;
    const double newton = theta - error / derivative;
    theta = newton > low && newton < high ? newton : 0.5 * (low + high);
  }
  if (!(std::fabs(theta_distorted(theta, nullptr) - theta_d) <= tolerance)) return std::nullopt;
  const double scale = pinned_tan(theta) / theta_d;
  return Eigen::Vector2d(distorted.x() * scale, distorted.y() * scale);
}

std::optional<Eigen::Vector2d> Camera::project(const Eigen::Vector2d& normalized) const noexcept {
  const double r2 = normalized.squaredNorm();
  if (!(r2 <= max_radius_ * max_radius_)) return std::nullopt;
  Eigen::Vector2d p = normalized;
  if (model_.lens == LensModel::kEquidistant) {
    const double r = std::sqrt(r2);
    if (r > 1e-8) p *= theta_distorted(pinned_atan(r), nullptr) / r;
  } else {
    p = distort_radtan(normalized, nullptr);
    if (tilted_) p = apply(tilt_, p);
  }
  return Eigen::Vector2d(model_.fx * p.x() + model_.cx, model_.fy * p.y() + model_.cy);
}

std::optional<Eigen::Vector2d> Camera::unproject(const Eigen::Vector2d& pixel) const noexcept {
  return unproject(pixel, Eigen::Vector2d((pixel.x() - model_.cx) / model_.fx, (pixel.y() - model_.cy) / model_.fy));
}

std::optional<Eigen::Vector2d> Camera::unproject(const Eigen::Vector2d& pixel,
                                                 const Eigen::Vector2d& guess) const noexcept {
  Eigen::Vector2d distorted((pixel.x() - model_.cx) / model_.fx, (pixel.y() - model_.cy) / model_.fy);
  if (!std::isfinite(distorted.x()) || !std::isfinite(distorted.y())) return std::nullopt;
  if (model_.lens == LensModel::kEquidistant) return undistort_equidistant(distorted);
  if (tilted_) distorted = apply(untilt_, distorted);
  return undistort_radtan(distorted, guess);
}

}  // namespace stereotrack
