#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "pipeline/core/time.hpp"

namespace stereotrack::capture {

/// How two cameras that nobody synchronises lie against each other: by how much the right one exposes later, and how
/// that wanders.
///
///     d_i = t_right - t_left, folded into [-P/2, P/2)     P = nominal period; one a frame of the right camera
///     seconds:   D_k = median of the d_i of second k,  unfolded: within P/2 of D_{k-1}
///     drift    = median over k < l of (D_l - D_k) / (T_l - T_k)                 Theil and Sen; of the last kSeconds
///     phase    = median over k of (D_k + drift (T_now - T_k)), folded
///
/// Medians, because frames come late, are lost and get a neighbour for their partner: up to 29 % of the seconds, and in
/// each of them half of the frames, may say what they like. Crystals differ by some 20e-6: at 30 pairs/s the phase goes
/// round once in half an hour, which is why it must be watched.
/// One thread, no memory but its own; a second that ends costs some 10 us.
class PhaseEstimator {
 public:
  static constexpr std::size_t kSeconds = 60;
  static constexpr std::size_t kLeast = 5;   ///< seconds from which on the drift is told
  static constexpr std::size_t kInOne = 64;  ///< frames of one second that are looked at

  /// `period` > 0.
  explicit PhaseEstimator(std::chrono::nanoseconds period) noexcept : period_(period) {}

  /// A right frame at `time` whose distance to some left frame is known. Times rise; one that falls starts anew.
  void add(CaptureTime time, std::chrono::nanoseconds distance) noexcept;

  /// A camera was started anew: what was known is no more.
  void restart() noexcept;

  [[nodiscard]] std::optional<std::chrono::nanoseconds> phase() const noexcept { return phase_; }
  /// Of the last whole second alone: what follows changes of a rate at once.
  struct Latest {
    CaptureTime time{};  ///< its middle
    std::chrono::nanoseconds phase{0};
  };
  [[nodiscard]] std::optional<Latest> latest() const noexcept;
  [[nodiscard]] std::optional<double> drift() const noexcept { return drift_; }  ///< [s/s]

 private:
  struct Second {
    CaptureTime time{};     ///< middle of its frames
    double distance_s = 0;  ///< unfolded
  };

  [[nodiscard]] double folded(double distance_s) const noexcept;
  void end_second() noexcept;
  void estimate() noexcept;

  std::chrono::nanoseconds period_;
  std::array<double, kInOne> distances_{};  ///< of this second [s]
  std::size_t count_ = 0;
  CaptureTime began_{};
  CaptureTime last_{};
  std::array<Second, kSeconds> seconds_{};  ///< oldest first
  std::size_t seconds_count_ = 0;
  std::optional<std::chrono::nanoseconds> phase_;
  std::optional<double> drift_;
};

}  // namespace stereotrack::capture
