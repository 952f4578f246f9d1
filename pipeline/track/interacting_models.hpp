#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "pipeline/core/pinned_math.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/track/coloured_noise_filter.hpp"

namespace stereotrack {

/// One target, several ways in which it may move: a Kalman filter (coloured_noise_filter.hpp) for each, which share
/// what they know as far as the target may have changed from one way to another. Who goes on steadily is smoothed by
/// the quiet filter; who turns is followed by the restless one within a few frames. Interacting multiple models (Blom
/// and Bar-Shalom 1988; Bar-Shalom, Li, Kirubarajan, 11.6.6), M models of probability mu_i:
///     p_ii = exp(-dt / lasts_i)     p_ij = (1 - p_ii) / (M - 1)       stays as it is, or becomes any other
///     c_j = sum_i p_ij mu_i         mu_i|j = p_ij mu_i / c_j
///     x0_j = sum_i mu_i|j x_i       P0_j = sum_i mu_i|j (P_i + (x_i - x0_j)(x_i - x0_j)^T)
///     each filter predicts from (x0_j, P0_j) and is updated:  mu_j ~ c_j N(y_j; 0, S_j)
///     x = sum_j mu_j x_j            P = sum_j mu_j (P_j + (x_j - x)(x_j - x)^T)
/// Any length unit, seconds. One thread. O(M D^3 + M^2 D^2).
template <int D>
class InteractingModels {
 public:
  using Filter = ColouredNoiseFilter<D>;
  using Vector = typename Filter::Vector;
  using Matrix = typename Filter::Matrix;
  static constexpr std::size_t kMost = 3;

  struct Model {
    double acceleration_sd = 0;            ///< process noise [unit/s^2]
    double lasts_s = 1;                    ///< how long a target moves so, on average [s], > 0
    Vector acceleration = Vector::Zero();  ///< that it is known to have [unit/s^2]
  };

  /// A first measurement of position with covariance R, by as many models; velocity about `velocity`, known within
  /// velocity_sd. All models are as likely. models: 1..kMost.
  void start(std::size_t models, const Vector& z, const Matrix& R, double velocity_sd,
             const Vector& velocity = Vector::Zero()) noexcept {
    filters_[0].start(z, R, velocity_sd, velocity);
    filters_.fill(filters_[0]);
    count_ = static_cast<std::uint32_t>(std::clamp<std::size_t>(models, 1, kMost));
    probabilities_.fill(0);
    for (std::size_t j = 0; j < count_; ++j) probabilities_[j] = 1.0 / static_cast<double>(count_);
    combine();
  }

  /// Over dt seconds, dt >= 0. The same models each time, as many as at start(); their values may change.
  void predict(std::span<const Model> models, double dt) noexcept {
    const std::array<Filter, kMost> before = filters_;
    std::array<double, kMost> prior{};
    for (std::size_t j = 0; j < count_; ++j) {
      std::array<double, kMost> share{};  // p_ij mu_i, then mu_i|j
      for (std::size_t i = 0; i < count_; ++i) {
        const double stays = count_ == 1 ? 1 : pinned_exp(-dt / models[i].lasts_s);
        share[i] = probabilities_[i] * (i == j ? stays : (1 - stays) / static_cast<double>(count_ - 1));
        prior[j] += share[i];
      }
      for (double& part : share) part /= prior[j];
      filters_[j] = Filter::mixed(before, share, count_);
      filters_[j].predict(dt, models[j].acceleration_sd, models[j].acceleration);
    }
    probabilities_ = prior;
    combine();
  }

  /// Of all models together.
  [[nodiscard]] Innovation<D> innovation(const Vector& z, const Matrix& R) const noexcept {
    return combined_.innovation(z, R);
  }

  /// Faults, state untouched: kNotFinite (z or R), kSingular (S of a model).
  [[nodiscard]] Result<void> update(const Vector& z, const Matrix& R) noexcept {
    std::array<Filter, kMost> updated = filters_;
    std::array<double, kMost> distance{};  // squared Mahalanobis
    std::array<double, kMost> volume{};    // determinant of S
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < count_; ++j) {
      const Result<Innovation<D>> one = updated[j].update(z, R);
      if (!one) return fail(one.error());
      distance[j] = one->squared_distance();
      volume[j] = one->S.determinant();
      if (!std::isfinite(distance[j]) || !(volume[j] > 0)) return fail(Fault::kSingular);
      least = std::min(least, distance[j]);
    }
    filters_ = updated;
    double sum = 0;
    for (std::size_t j = 0; j < count_; ++j) {
      // A model that fits badly now may fit in the next frame.
      const double fit = pinned_exp((least - distance[j]) / 2) * std::sqrt(volume[0] / volume[j]);
      probabilities_[j] = std::max(probabilities_[j] * fit, kLeast);
      sum += probabilities_[j];
    }
    for (double& probability : probabilities_) probability /= sum;
    combine();
    return {};
  }

  [[nodiscard]] Vector position() const noexcept { return combined_.position(); }
  [[nodiscard]] Vector velocity() const noexcept { return combined_.velocity(); }
  [[nodiscard]] Matrix position_covariance() const noexcept { return combined_.position_covariance(); }
  /// Of (position, velocity).
  [[nodiscard]] auto covariance() const noexcept { return combined_.covariance(); }
  /// How likely it is that the target moves by that model, 0..1.
  [[nodiscard]] double probability(std::size_t model) const noexcept { return probabilities_[model]; }

  /// What is to be expected of all models together: their mean acceleration, and the noise about it.
  [[nodiscard]] Model expected_motion(std::span<const Model> models) const noexcept {
    Model all;
    double square = 0;
    for (std::size_t j = 0; j < count_; ++j) {
      all.acceleration += probabilities_[j] * models[j].acceleration;
      square += probabilities_[j] * models[j].acceleration_sd * models[j].acceleration_sd;
    }
    all.acceleration_sd = std::sqrt(square);
    return all;
  }

  /// What crosses frames: pipeline/core/state.hpp.
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive.bounded(self.count_, 1, kMost);
    archive(self.filters_[0], self.filters_[1], self.filters_[2], self.probabilities_, self.combined_);
  }

 private:
  static constexpr double kLeast = 1e-6;

  void combine() noexcept { combined_ = Filter::mixed(filters_, probabilities_, count_); }

  std::uint32_t count_ = 1;
  std::array<Filter, kMost> filters_;
  std::array<double, kMost> probabilities_{1, 0, 0};
  Filter combined_;
};

}  // namespace stereotrack
