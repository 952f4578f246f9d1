#include "drivers/capture/synthetic/path.hpp"

#include <algorithm>
#include <utility>

namespace stereotrack::capture::synthetic {
namespace {

constexpr double kSlowing_s = 0.6;  ///< from walking to standing, and back

/// Integral of the smoothstep from 0 to 1: how far behind a soft start falls.
double smoothstep_integral(double x) noexcept {
  if (x <= 0) return 0;
  if (x >= 1) return x - 0.5;
  return x * x * x - 0.5 * x * x * x * x;
}

}  // namespace

Path::Path(std::vector<Vec3> points, const Timing& timing) : timing_(timing) {
  points_.reserve(points.size() + 2);
  points_.push_back(points[0] * 2.0 - points[1]);
  points_.insert(points_.end(), points.begin(), points.end());
  points_.push_back(points[points.size() - 1] * 2.0 - points[points.size() - 2]);

  const std::size_t steps = (points.size() - 1) * kSteps;
  lengths_.assign(steps + 1, 0.0);
  Vec3 previous = point(0);
  for (std::size_t i = 1; i <= steps; ++i) {
    const Vec3 here = point(static_cast<double>(i) / kSteps);
    lengths_[i] = lengths_[i - 1] + length(here - previous);
    previous = here;
  }
  end_s_ = timing_.start_s + length_m() / timing_.speed_m_s;
  if (timing_.pause_at_s < end_s_) end_s_ += timing_.pause_s;
}

Vec3 Path::point(double u) const noexcept {
  const auto segment = std::min(static_cast<std::size_t>(u), points_.size() - 4);
  const double t = u - static_cast<double>(segment);
  const Vec3* p = &points_[segment];
  const Vec3 a = p[1] * 2.0;
  const Vec3 b = p[2] - p[0];
  const Vec3 c = p[0] * 2.0 - p[1] * 5.0 + p[2] * 4.0 - p[3];
  const Vec3 d = p[1] * 3.0 - p[0] - p[2] * 3.0 + p[3];
  return (a + (b + (c + d * t) * t) * t) * 0.5;
}

Vec3 Path::tangent(double u) const noexcept {
  const auto segment = std::min(static_cast<std::size_t>(u), points_.size() - 4);
  const double t = u - static_cast<double>(segment);
  const Vec3* p = &points_[segment];
  const Vec3 b = p[2] - p[0];
  const Vec3 c = p[0] * 2.0 - p[1] * 5.0 + p[2] * 4.0 - p[3];
  const Vec3 d = p[1] * 3.0 - p[0] - p[2] * 3.0 + p[3];
  return b + (c * 2.0 + d * (3.0 * t)) * t;
}

double Path::time_lost(double t_s) const noexcept {
  const double down = (t_s - timing_.pause_at_s) / kSlowing_s;
  const double up = down - timing_.pause_s / kSlowing_s;
  return kSlowing_s * (smoothstep_integral(down) - smoothstep_integral(up));
}

Place3 Path::at(double t_s) const noexcept {
  const double t = clamp(t_s, timing_.start_s, end_s_);
  Place3 place;
  place.pace = timing_.pause_s > 0 ? 1.0 - (smoothstep(timing_.pause_at_s, timing_.pause_at_s + kSlowing_s, t) -
                                            smoothstep(timing_.pause_at_s + timing_.pause_s,
                                                       timing_.pause_at_s + timing_.pause_s + kSlowing_s, t))
                                   : 1.0;
  const double lost = timing_.pause_s > 0 ? time_lost(t) : 0.0;
  place.travelled = clamp((t - timing_.start_s - lost) * timing_.speed_m_s, 0.0, length_m());

  const auto above = std::upper_bound(lengths_.begin(), lengths_.end() - 1, place.travelled);
  const auto i = std::max<std::ptrdiff_t>(above - lengths_.begin(), 1);
  const double low = lengths_[static_cast<std::size_t>(i - 1)];
  const double high = lengths_[static_cast<std::size_t>(i)];
  const double part = high > low ? (place.travelled - low) / (high - low) : 0.0;
  const double u = (static_cast<double>(i - 1) + part) / kSteps;
  place.position = point(u);
  Vec3 heading = tangent(u);
  heading.y = 0;
  place.heading = length(heading) > 1e-9 ? normalized(heading) : Vec3{0, 0, 1};
  return place;
}

}  // namespace stereotrack::capture::synthetic
