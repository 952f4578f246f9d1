#pragma once

#include <iosfwd>
#include <optional>
#include <string>

namespace stereotrack {

/// `stereotrack plan --range M --accuracy M [...]`: which lens and baseline a wanted range and accuracy ask for.
struct PlanArguments {
  double range_m = 0;                ///< --range: the farthest that targets are to be measured, > 0
  double accuracy_m = 0;             ///< --accuracy: standard deviation of their distance there, > 0
  std::string size = "640x480";      ///< --size: of the sensor [px]
  std::optional<double> view_deg;    ///< --view: angle of view across, 1..170; else those of usual lenses
  std::optional<double> baseline_m;  ///< --baseline: that the rig has; else that which is needed
  double disparity_error_px = 0.25;  ///< --disparity-error: standard deviation of a target's disparity
  double target_m = 0.5;             ///< --target: width of the smallest target
  double speed_m_s = 2;              ///< --speed: of the fastest, across the view
};

/// One lens of a plan. Z = range_m, e = disparity_error_px, W the sensor's width.
struct PlannedLens {
  double view_deg = 0;
  double focal_px = 0;    ///< f = W / (2 tan(view / 2)), pinhole
  double baseline_m = 0;  ///< b: as given, or Z^2 e / (f accuracy)
  double accuracy_m = 0;  ///< sd(Z) = Z^2 e / (f b)
  double nearest_m = 0;   ///< f b / (0.7 W): disparity.reach of the configuration as it ships
  double overlap_m = 0;   ///< b / (2 tan(view / 2)): nearer, the views have nothing in common
  double target_px = 0;   ///< width of the smallest target at Z
  double skew_ms = 0;     ///< between the pictures of a pair, which moves the fastest target by e at Z
  double turn_deg = 0;    ///< of one camera about the upright axis, which moves a disparity by e
};

[[nodiscard]] PlannedLens plan_lens(const PlanArguments& arguments, double width_px, double view_deg) noexcept;

/// Writes the plan to `out` and answers the exit code, 0. Throws config::Error, one line, on a size that is none.
int run_plan(const PlanArguments& arguments, std::ostream& out);

}  // namespace stereotrack
