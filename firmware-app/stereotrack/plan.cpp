#include "firmware-app/stereotrack/plan.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <ostream>
#include <string>
#include <vector>

#include "firmware-app/formatted.hpp"
#include "firmware-app/stereotrack/picture_size.hpp"
#include "pipeline/pipeline_config.hpp"

namespace stereotrack {
namespace {

constexpr std::array<double, 6> kUsualViews_deg{20, 30, 45, 60, 75, 90};
// Where tests/replay measures `far`: smaller ones are found, and lost again.
constexpr double kLeastTarget_px = 6;

}  // namespace

PlannedLens plan_lens(const PlanArguments& arguments, double width_px, double view_deg) noexcept {
  const double z = arguments.range_m;
  const double e = arguments.disparity_error_px;
  const double half_view = std::tan(view_deg * std::numbers::pi / 360);
  PlannedLens lens;
  lens.view_deg = view_deg;
  lens.focal_px = width_px / (2 * half_view);
  lens.baseline_m = arguments.baseline_m.value_or(z * z * e / (lens.focal_px * arguments.accuracy_m));
  lens.accuracy_m = z * z * e / (lens.focal_px * lens.baseline_m);
  lens.nearest_m = lens.focal_px * lens.baseline_m / (PipelineConfig{}.disparity.reach * width_px);
  lens.overlap_m = lens.baseline_m / (2 * half_view);
  lens.target_px = lens.focal_px * arguments.target_m / z;
  lens.skew_ms = 1e3 * e * z / (lens.focal_px * arguments.speed_m_s);
  lens.turn_deg = std::atan(e / lens.focal_px) * 180 / std::numbers::pi;
  return lens;
}

int run_plan(const PlanArguments& arguments, std::ostream& out) {
  const auto [width, height] = parse_picture_size(arguments.size);
  const double z = arguments.range_m;
  out << formatted("%dx%d, distance at %g m within %g m (standard deviation), disparity within %g px:\n", width, height,
                   z, arguments.accuracy_m, arguments.disparity_error_px);
  out << formatted("focal length x baseline >= %.4g px m\n\n",
                   z * z * arguments.disparity_error_px / arguments.accuracy_m);
  out << "  view   focal  baseline  accuracy  nearest  target    skew     turn\n"
         "   deg      px         m         m        m      px      ms      deg\n";
  std::vector<double> views(kUsualViews_deg.begin(), kUsualViews_deg.end());
  if (arguments.view_deg) views = {*arguments.view_deg};
  for (const double view : views) {
    const PlannedLens lens = plan_lens(arguments, width, view);
    const double nearest = std::max(lens.nearest_m, lens.overlap_m);
    std::string limits;
    if (lens.accuracy_m > 1.0005 * arguments.accuracy_m) limits += " too coarse";
    if (nearest >= z) limits += " nothing is near enough to measure";
    if (lens.target_px < kLeastTarget_px) limits += " target too small";
    out << formatted("%6.1f %7.0f %9.3f %9.3f %8.2f %7.1f %7.2f %8.4f%s%s\n", view, lens.focal_px, lens.baseline_m,
                     lens.accuracy_m, nearest, lens.target_px, lens.skew_ms, lens.turn_deg, limits.empty() ? "" : " ",
                     limits.c_str());
  }
  out << formatted(
      "\naccuracy: at %g m; it goes with the square of the distance\n"
      "nearest: from where both views see a target and its disparity is looked for (disparity.reach)\n"
      "target: width in the picture of %g m at %g m; %g px are needed\n"
      "skew: between the pictures of a pair; more moves a target of %g m/s by more than the disparity's error\n"
      "turn: of one camera against the other that does the same; what the mount and the calibration must hold\n",
      z, arguments.target_m, z, kLeastTarget_px, arguments.speed_m_s);
  return 0;
}

}  // namespace stereotrack
