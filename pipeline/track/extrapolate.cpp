#include "pipeline/track/extrapolate.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/track/kalman.hpp"

namespace stereotrack {

namespace {

// Way in whole pixels, bounded so that no sum of it overflows.
int whole_px(double way) noexcept {
  constexpr double kFar = 1 << 20;
  return std::isfinite(way) ? static_cast<int>(std::floor(std::clamp(way, -kFar, kFar) + 0.5)) : 0;
}

}  // namespace

void extrapolate(const Extrapolation& model, double seconds, TrackReport& report) noexcept {
  if (!(seconds > 0)) return;
  report.age_s += seconds;
  report.image_x += report.image_vx * seconds;
  report.image_y += report.image_vy * seconds;
  report.box.left += whole_px(report.image_vx * seconds);
  report.box.top += whole_px(report.image_vy * seconds);
  report.box = intersect(report.box, {0, 0, model.width, model.height});
  if (!report.has_depth) return;
  ConstantVelocityFilter<3>::State x;
  x << report.position, report.velocity;
  ConstantVelocityFilter<3> filter;
  filter.resume(x, report.covariance);
  filter.predict(seconds, report.acceleration_sd, report.acceleration);
  report.position = filter.position();
  report.velocity = filter.velocity();
  report.covariance = filter.covariance();
  report.has_depth = !(report.position.z() <= 0);
}

}  // namespace stereotrack
