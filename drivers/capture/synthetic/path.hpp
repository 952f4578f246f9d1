#pragma once

#include <array>
#include <vector>

#include "drivers/capture/synthetic/vec.hpp"

namespace stereotrack::capture::synthetic {

/// Where a thing is that follows a way at a given time.
struct Place3 {
  Vec3 position;
  Vec3 heading{0, 0, 1};  ///< unit, level
  double travelled = 0;   ///< along the way [m]
  double pace = 1;        ///< speed as a part of the usual one: 0 in a pause
};

/// A smooth way through points (Catmull-Rom spline: continuous direction), gone along at a constant speed
/// except for one optional pause with soft ends. Positions are polynomials of the points: no library
/// function but sqrt.
class Path {
 public:
  struct Timing {
    double start_s = 0;       ///< at the first point
    double speed_m_s = 1;     ///< > 0
    double pause_at_s = 1e9;  ///< when the slowing down begins
    double pause_s = 0;       ///< lost time
  };

  Path() = default;
  Path(std::vector<Vec3> points, const Timing& timing);

  void delay(double by_s) noexcept {
    timing_.start_s += by_s;
    timing_.pause_at_s += by_s;
    end_s_ += by_s;
  }
  [[nodiscard]] double start_s() const noexcept { return timing_.start_s; }
  [[nodiscard]] double end_s() const noexcept { return end_s_; }
  [[nodiscard]] double length_m() const noexcept { return lengths_.empty() ? 0.0 : lengths_.back(); }
  /// For start_s <= t <= end_s; clamped to the ends outside.
  [[nodiscard]] Place3 at(double t_s) const noexcept;

 private:
  static constexpr int kSteps = 24;  ///< length table entries a segment

  [[nodiscard]] Vec3 point(double u) const noexcept;
  [[nodiscard]] Vec3 tangent(double u) const noexcept;
  [[nodiscard]] double time_lost(double t_s) const noexcept;

  std::vector<Vec3> points_;     ///< with one more at each end
  std::vector<double> lengths_;  ///< from the start, every 1/kSteps segment
  Timing timing_;
  double end_s_ = 0;
};

}  // namespace stereotrack::capture::synthetic
