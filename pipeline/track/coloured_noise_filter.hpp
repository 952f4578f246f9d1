#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "pipeline/core/pinned_math.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/track/innovation.hpp"

namespace stereotrack {

/// Kalman filter of a point that moves with nearly constant velocity in D dimensions, as kalman.hpp has it, and whose
/// measurement is wrong by much the same from one frame to the next: the outline is cut in the same way, the matcher
/// prefers the same side of a pixel. A filter that takes these errors for new ones each time believes that it knows the
/// place far better than it does, and takes them for motion.
/// State x = (p, v, e), measured z = p + e + w; e is a first-order Gauss-Markov process of standing covariance c R, w
/// of (1 - c) R (Bar-Shalom, Li, Kirubarajan, 8.3.2; c = kSlowPart, tau = kSlow_s):
///     F = [I dt I 0; 0 I 0; 0 0 f I]     f = exp(-dt / tau)     H = [I 0 I]     B = [dt^2/2 I; dt I; 0]
///     Q = [s_a^2 dt^4/4 I  s_a^2 dt^3/2 I  0;  s_a^2 dt^3/2 I  s_a^2 dt^2 I  0;  0  0  (1 - f^2) c R]
/// Predicted by (3.26), (3.27), updated by (3.28)-(3.32), in Joseph's form, block by block.
/// Any length unit, seconds. One thread. O(D^3).
template <int D>
class ColouredNoiseFilter {
 public:
  using Vector = Eigen::Matrix<double, D, 1>;
  using Matrix = Eigen::Matrix<double, D, D>;
  using State = Eigen::Matrix<double, 3 * D, 1>;
  using Covariance = Eigen::Matrix<double, 3 * D, 3 * D>;

  /// How much of R goes on, and for how long [s]. Measured against the truth of the scenes `eleven` and `crossing`: of
  /// the variance of a target's error, two thirds are still there after a frame of 1/30 s and a third after five.
  static constexpr double kSlowPart = 0.7;
  static constexpr double kSlow_s = 0.2;

  /// A first measurement of position with covariance R; velocity about `velocity`, known within velocity_sd.
  void start(const Vector& z, const Matrix& R, double velocity_sd, const Vector& velocity) noexcept {
    slow_ = kSlowPart * R;
    x_ << z, velocity, Vector::Zero();
    P_.setZero();
    block(kPlace, kPlace) = R;
    block(kVelocity, kVelocity) = Matrix::Identity() * (velocity_sd * velocity_sd);
    block(kError, kError) = slow_;
    block(kPlace, kError) = -slow_;
    block(kError, kPlace) = -slow_;
  }

  /// One that has mean and covariance of several, weighed; weights add up to 1.
  template <class Filters, class Weights>
  [[nodiscard]] static ColouredNoiseFilter mixed(const Filters& filters, const Weights& weights,
                                                 std::size_t count) noexcept {
    ColouredNoiseFilter made;
    made.x_.setZero();
    made.P_.setZero();
    made.slow_ = filters[0].slow_;
    for (std::size_t i = 0; i < count; ++i) made.x_ += weights[i] * filters[i].x_;
    for (std::size_t i = 0; i < count; ++i) {
      const State off = filters[i].x_ - made.x_;
      made.P_ += weights[i] * (filters[i].P_ + off * off.transpose());
    }
    return made;
  }

  /// (3.26), (3.27) over dt seconds, dt >= 0, with accelerations of standard deviation acceleration_sd about
  /// `acceleration`.
  void predict(double dt, double acceleration_sd, const Vector& acceleration) noexcept {
    const double f = pinned_exp(-dt / kSlow_s);
    const double q = acceleration_sd * acceleration_sd;
    x_.template segment<D>(kPlace) += dt * velocity() + dt * dt / 2 * acceleration;
    x_.template segment<D>(kVelocity) += dt * acceleration;
    x_.template segment<D>(kError) *= f;
    const Matrix vp = block(kVelocity, kPlace);
    const Matrix vv = block(kVelocity, kVelocity);
    const Matrix ve = block(kVelocity, kError);
    block(kPlace, kPlace) += dt * (vp + vp.transpose()) + dt * dt * vv + q * dt * dt * dt * dt / 4 * Matrix::Identity();
    block(kVelocity, kPlace) += dt * vv + q * dt * dt * dt / 2 * Matrix::Identity();
    block(kVelocity, kVelocity) += q * dt * dt * Matrix::Identity();
    block(kPlace, kError) = (f * (block(kPlace, kError) + dt * ve)).eval();
    block(kVelocity, kError) = f * ve;
    block(kError, kError) = (f * f * block(kError, kError) + (1 - f * f) * slow_).eval();
    block(kPlace, kVelocity) = block(kVelocity, kPlace).transpose();
    block(kError, kPlace) = block(kPlace, kError).transpose();
    block(kError, kVelocity) = block(kVelocity, kError).transpose();
  }

  [[nodiscard]] Innovation<D> innovation(const Vector& z, const Matrix& R) const noexcept {
    return {z - expected(), expected_covariance() + (1 - kSlowPart) * R};
  }

  /// (3.28)-(3.32). Faults, state untouched: kNotFinite (z or R), kSingular (S).
  [[nodiscard]] Result<Innovation<D>> update(const Vector& z, const Matrix& R) noexcept {
    const Innovation<D> innovation = this->innovation(z, R);
    const Result<Matrix> S_inverse = innovation.inverse();
    if (!S_inverse) return fail(S_inverse.error());
    using Gain = Eigen::Matrix<double, 3 * D, D>;
    const Gain U = P_.template leftCols<D>() + P_.template rightCols<D>();
    const Gain K = U * *S_inverse;
    x_ += K * innovation.y;
    const Covariance AP = P_ - K.lazyProduct(U.transpose());  // the other product may ask for heap
    const Gain APH = AP.template leftCols<D>() + AP.template rightCols<D>();
    const Gain rest = (1 - kSlowPart) * K * R - APH;
    const Covariance joseph = AP + rest.lazyProduct(K.transpose());
    P_ = 0.5 * (joseph + joseph.transpose());
    slow_ = kSlowPart * R;
    return innovation;
  }

  [[nodiscard]] Vector position() const noexcept { return x_.template segment<D>(kPlace); }
  [[nodiscard]] Vector velocity() const noexcept { return x_.template segment<D>(kVelocity); }
  /// Where it is expected to be measured: the error that it had included.
  [[nodiscard]] Vector expected() const noexcept { return position() + x_.template segment<D>(kError); }
  /// Covariance of expected().
  [[nodiscard]] Matrix expected_covariance() const noexcept {
    const Matrix pe = P_.template block<D, D>(kPlace, kError);
    return position_covariance() + pe + pe.transpose() + P_.template block<D, D>(kError, kError);
  }
  [[nodiscard]] Matrix position_covariance() const noexcept { return P_.template topLeftCorner<D, D>(); }
  /// Of (position, velocity).
  [[nodiscard]] Eigen::Matrix<double, 2 * D, 2 * D> covariance() const noexcept {
    return P_.template topLeftCorner<2 * D, 2 * D>();
  }
  [[nodiscard]] const State& state() const noexcept { return x_; }
  [[nodiscard]] const Covariance& state_covariance() const noexcept { return P_; }

  /// What crosses frames: pipeline/core/state.hpp.
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.x_, self.P_, self.slow_);
  }

 private:
  static constexpr int kPlace = 0;
  static constexpr int kVelocity = D;
  static constexpr int kError = 2 * D;
  [[nodiscard]] auto block(int row, int column) noexcept { return P_.template block<D, D>(row, column); }

  State x_ = State::Zero();
  Covariance P_ = Covariance::Identity();
  Matrix slow_ = Matrix::Zero();  ///< c R of the latest measurement
};

}  // namespace stereotrack
