#pragma once

#include <Eigen/Core>

#include "pipeline/core/result.hpp"
#include "pipeline/track/innovation.hpp"

namespace stereotrack {

/// Kalman filter of a point that moves with nearly constant velocity in D dimensions.
/// State x = (p, v), measured z = p.
///     x_k = F x_{k-1} + B u + w,   w ~ N(0, Q)                            (3.24), u: an acceleration that is known
///     z_k = H x_k + v,       v ~ N(0, R)                                  (3.25)
///     predict   x' = F x + B u                                            (3.26)
///               P' = F P F^T + Q                                          (3.27)
///     update    y = z - H x'                                              (3.28)
///               S = H P' H^T + R                                          (3.29)
///               K = P' H^T S^-1                                           (3.30)
///               x = x' + K y                                              (3.31)
///               P = (I - K H) P'                                          (3.32)
/// The document prints (3.29) as a second (3.28); S as above is the standard one. (3.32) is computed in Joseph's
/// form (I - K H) P' (I - K H)^T + K R K^T, equal in exact arithmetic and symmetric in ours.
///     F = [I dt I; 0 I]     B = [dt^2/2 I; dt I]     H = [I 0]
///     Q = s_a^2 [dt^4/4 I  dt^3/2 I; dt^3/2 I  dt^2 I]
/// Q: an acceleration of standard deviation s_a, constant within one step (Bar-Shalom, Li, Kirubarajan, 6.3.2).
/// Any length unit, seconds. One thread. O(D^3).
template <int D>
class ConstantVelocityFilter {
 public:
  using Vector = Eigen::Matrix<double, D, 1>;
  using Matrix = Eigen::Matrix<double, D, D>;
  using State = Eigen::Matrix<double, 2 * D, 1>;
  using Covariance = Eigen::Matrix<double, 2 * D, 2 * D>;

  /// A first measurement of position with covariance R; velocity about `velocity`, known within velocity_sd.
  void start(const Vector& z, const Matrix& R, double velocity_sd, const Vector& velocity = Vector::Zero()) noexcept {
    x_.template head<D>() = z;
    x_.template tail<D>() = velocity;
    P_.setZero();
    P_.template topLeftCorner<D, D>() = R;
    P_.template bottomRightCorner<D, D>() = Matrix::Identity() * (velocity_sd * velocity_sd);
  }

  /// Goes on from a state and covariance that another filter had.
  void resume(const State& x, const Covariance& P) noexcept {
    x_ = x;
    P_ = P;
  }

  /// (3.26), (3.27) over dt seconds, dt >= 0, with accelerations of standard deviation acceleration_sd about
  /// `acceleration`, which is u.
  void predict(double dt, double acceleration_sd, const Vector& acceleration = Vector::Zero()) noexcept {
    Covariance F = Covariance::Identity();
    F.template topRightCorner<D, D>() = Matrix::Identity() * dt;
    const double q = acceleration_sd * acceleration_sd;
    Covariance Q;
    Q.template topLeftCorner<D, D>() = Matrix::Identity() * (q * dt * dt * dt * dt / 4);
    Q.template topRightCorner<D, D>() = Matrix::Identity() * (q * dt * dt * dt / 2);
    Q.template bottomLeftCorner<D, D>() = Q.template topRightCorner<D, D>();
    Q.template bottomRightCorner<D, D>() = Matrix::Identity() * (q * dt * dt);
    x_ = (F * x_).eval();
    x_.template head<D>() += acceleration * (dt * dt / 2);
    x_.template tail<D>() += acceleration * dt;
    P_ = (F * P_ * F.transpose() + Q).eval();
  }

  [[nodiscard]] Innovation<D> innovation(const Vector& z, const Matrix& R) const noexcept {
    return {z - position(), position_covariance() + R};
  }

  /// (3.28)-(3.32). Faults, state untouched: kNotFinite (z or R), kSingular (S).
  [[nodiscard]] Result<Innovation<D>> update(const Vector& z, const Matrix& R) noexcept {
    const Innovation<D> innovation = this->innovation(z, R);
    const Result<Matrix> S_inverse = innovation.inverse();
    if (!S_inverse) return fail(S_inverse.error());
    const Eigen::Matrix<double, 2 * D, D> K = P_.template leftCols<D>() * *S_inverse;
    Covariance rest = Covariance::Identity();
    rest.template leftCols<D>() -= K;
    x_ = (x_ + K * innovation.y).eval();
    P_ = (rest * P_ * rest.transpose() + K * R * K.transpose()).eval();
    return innovation;
  }

  [[nodiscard]] Vector position() const noexcept { return x_.template head<D>(); }
  [[nodiscard]] Vector velocity() const noexcept { return x_.template tail<D>(); }
  [[nodiscard]] Matrix position_covariance() const noexcept { return P_.template topLeftCorner<D, D>(); }
  [[nodiscard]] const Covariance& covariance() const noexcept { return P_; }

  /// What crosses frames: pipeline/core/state.hpp.
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.x_, self.P_);
  }

 private:
  State x_ = State::Zero();
  Covariance P_ = Covariance::Identity();
};

}  // namespace stereotrack
