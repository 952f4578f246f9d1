#include <Eigen/LU>
#include <stdexcept>
#include <string>

#include "config/calibration/formats.hpp"

namespace stereotrack::calibration {
namespace {

using Pose = Eigen::Matrix4d;

Pose pose(const TextFile& file, const YAML::Node& node, const std::string& key) {
  const std::vector<double> values = numbers(file, node, key, 16);
  const Pose T = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
  if (T.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    throw std::runtime_error(place(file, node) + ": " + key + " must end with the row 0 0 0 1");
  }
  return T;
}

void set_relative(StereoCalibration& calibration, const Pose& T_right_left) {
  calibration.R_right_left = T_right_left.topLeftCorner<3, 3>();
  calibration.t_right_left = T_right_left.topRightCorner<3, 1>();
}

/// intrinsics, resolution and distortion, which Kalibr and EuRoC write alike.
CameraModel camera(const TextFile& file, const YAML::Node& node, const std::string& coefficients_key) {
  CameraModel model;
  const YAML::Node kind = child(file, node, "camera_model");
  if (word(file, kind, "camera_model") != "pinhole") {
    throw std::runtime_error(place(file, kind) + ": camera model " + kind.Scalar() +
                             " is not supported; calibrate as pinhole with radtan or equidistant");
  }
  const std::vector<double> k = numbers(file, child(file, node, "intrinsics"), "intrinsics", 4);
  model.fx = k[0];
  model.fy = k[1];
  model.cx = k[2];
  model.cy = k[3];
  const YAML::Node resolution = child(file, node, "resolution");
  const std::vector<double> size = numbers(file, resolution, "resolution", 2);
  model.width = side(size[0], place(file, resolution), "width");
  model.height = side(size[1], place(file, resolution), "height");
  const YAML::Node distortion = child(file, node, "distortion_model");
  const std::string name = word(file, distortion, "distortion_model");
  const LensModel lens = lens_model(name, place(file, distortion));
  if (name == "none") return model;
  const YAML::Node coefficients = child(file, node, coefficients_key);
  set_distortion(model, lens, numbers(file, coefficients, coefficients_key), place(file, coefficients));
  return model;
}

bool has(const YAML::Node& node, const std::string& key) { return node[key].IsDefined() && !node[key].IsNull(); }

}  // namespace

StereoCalibration read_kalibr(const TextFile& file) {
  const YAML::Node root = parse_yaml(file);
  for (const char* which : {"cam0", "cam1"}) {
    if (!has(root, which)) {
      throw std::runtime_error(file.path + ": " + which +
                               " is missing; a stereo calibration has cam0 (left) and cam1 (right)");
    }
  }
  const YAML::Node cam0 = root["cam0"];
  const YAML::Node cam1 = root["cam1"];
  StereoCalibration result;
  result.left = camera(file, cam0, "distortion_coeffs");
  result.right = camera(file, cam1, "distortion_coeffs");
  if (has(cam1, "T_cn_cnm1")) {
    set_relative(result, pose(file, cam1["T_cn_cnm1"], "T_cn_cnm1"));
  } else if (has(cam0, "T_cam_imu") && has(cam1, "T_cam_imu")) {
    set_relative(result,
                 pose(file, cam1["T_cam_imu"], "T_cam_imu") * pose(file, cam0["T_cam_imu"], "T_cam_imu").inverse());
  } else if (has(cam0, "T_imu_cam") && has(cam1, "T_imu_cam")) {
    set_relative(result,
                 pose(file, cam1["T_imu_cam"], "T_imu_cam").inverse() * pose(file, cam0["T_imu_cam"], "T_imu_cam"));
  } else {
    throw std::runtime_error(place(file, cam1) +
                             ": how the cameras stand is missing; add T_cn_cnm1 to cam1, or T_cam_imu to both");
  }
  return result;
}

StereoCalibration read_euroc(const TextFile& left, const TextFile& right) {
  const YAML::Node l = parse_yaml(left);
  const YAML::Node r = parse_yaml(right);
  StereoCalibration result;
  result.left = camera(left, l, "distortion_coefficients");
  result.right = camera(right, r, "distortion_coefficients");
  set_relative(result,
               pose(right, child(right, r, "T_BS"), "T_BS").inverse() * pose(left, child(left, l, "T_BS"), "T_BS"));
  return result;
}

}  // namespace stereotrack::calibration
