#include "config/calibration/check.hpp"

#include <Eigen/LU>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "pipeline/geometry/rectify.hpp"

namespace stereotrack::calibration {
namespace {

template <class... Parts>
[[noreturn]] void refuse(const std::string& name, const Parts&... parts) {
  std::ostringstream line;
  line.imbue(std::locale::classic());
  line << name << ": ";
  (line << ... << parts);
  throw std::runtime_error(line.str());
}

void check_camera(const CameraModel& camera, const char* which, const std::string& name) {
  for (double value : {camera.fx, camera.fy, camera.cx, camera.cy}) {
    if (!std::isfinite(value)) refuse(name, which, " camera matrix holds a value that is not finite; calibrate again");
  }
  for (double value : camera.distortion) {
    if (!std::isfinite(value)) refuse(name, which, " distortion holds a value that is not finite; calibrate again");
  }
  if (!(camera.fx > 0 && camera.fy > 0)) {
    refuse(name, which, " focal length is ", camera.fx, ", ", camera.fy,
           " px, must be positive; the file's camera matrix may be transposed or empty");
  }
  const auto outside = [](double c, double focal, int side) {
    return side > 0 ? c < -0.5 * side || c > 1.5 * side : std::fabs(c) > 4 * focal;
  };
  if (outside(camera.cx, camera.fx, camera.width) || outside(camera.cy, camera.fy, camera.height)) {
    refuse(name, which, " principal point ", camera.cx, ", ", camera.cy, " lies far outside of the picture",
           camera.width > 0 ? " of " + std::to_string(camera.width) + "x" + std::to_string(camera.height) : "",
           "; is the calibration for another picture size?");
  }
}

}  // namespace

void check(const StereoCalibration& calibration, const std::string& name) {
  check_camera(calibration.left, "left", name);
  check_camera(calibration.right, "right", name);
  const CameraModel& left = calibration.left;
  const CameraModel& right = calibration.right;
  if (left.width != right.width || left.height != right.height) {
    refuse(name, "left camera has ", left.width, "x", left.height, " px, right camera ", right.width, "x", right.height,
           "; both must have the same size");
  }

  const Eigen::Matrix3d& R = calibration.R_right_left;
  const Eigen::Vector3d& t = calibration.t_right_left;
  if (!R.allFinite()) refuse(name, "R holds a value that is not finite; calibrate again");
  if (!t.allFinite()) refuse(name, "T holds a value that is not finite; calibrate again");
  const double skew = (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(skew <= 1e-3)) {
    refuse(name, "R is not a rotation: R^T R differs from the identity by ", skew, "; calibrate again");
  }
  if (R.determinant() < 0) refuse(name, "R is not a rotation but mirrors (determinant -1); calibrate again");
  const double baseline = t.norm();
  if (!(baseline > 0)) refuse(name, "baseline is zero: T = 0, 0, 0; the file does not describe two cameras");

  const Eigen::Vector3d seen = half_rotation(R).transpose() * t;
  std::ostringstream T;
  T.imbue(std::locale::classic());
  T << "T = " << t.x() << ", " << t.y() << ", " << t.z();
  if (!(std::fabs(seen.x()) > std::fabs(seen.y()) && std::fabs(seen.x()) > std::fabs(seen.z()))) {
    refuse(name, "baseline is not along x: ", T.str(), "; cameras must stand side by side, turn the rig upright");
  }
  if (seen.x() > 0) {
    refuse(name, "left and right are exchanged: ", T.str(),
           ", T_x must be negative; exchange the cameras in the file, or calibrate with left first");
  }
  if (left.width > 0 && left.height > 0 && !plan_rectification(calibration, left.width, left.height).has_value()) {
    refuse(name, "lens distortion is not plausible: pixels near the picture's centre have no ray; calibrate again");
  }
}

void check_size(const StereoCalibration& calibration, int width, int height, const std::string& name) {
  const CameraModel& left = calibration.left;
  if (left.width > 0 && left.height > 0 && (left.width != width || left.height != height)) {
    refuse(name, "calibration is for ", left.width, "x", left.height, " px, the source gives ", width, "x", height,
           "; use the calibration of this source");
  }
  StereoCalibration sized = calibration;
  for (CameraModel* camera : {&sized.left, &sized.right}) {
    camera->width = width;
    camera->height = height;
  }
  check(sized, name);
}

}  // namespace stereotrack::calibration
