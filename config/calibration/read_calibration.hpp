#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "pipeline/geometry/calibration.hpp"

namespace stereotrack::calibration {

/// The kinds of calibration file that are read; told apart by their content, not by their names.
enum class Format : std::uint8_t {
  kOpenCv,  ///< FileStorage (yml, xml, json): K1 D1 K2 D2 R T or M1 D1 M2 D2 R T, in one file or in two
  kKalibr,  ///< camchain.yaml: cam0 left, cam1 right
  kRos,     ///< pair of camera_info files (yaml or ini)
  kEuroc,   ///< pair of sensor.yaml
  kKitti,   ///< calib.txt
};

/// Metres in one unit of T: 1 where the format prescribes metres, else not known.
[[nodiscard]] std::optional<double> unit_m(Format format) noexcept;

struct ReadOptions {
  bool kitti_colour = false;  ///< KITTI: cameras 2 and 3 instead of 0 and 1
};

struct CalibrationFile {
  StereoCalibration stereo;
  Format format = Format::kOpenCv;
};

/// Reads and checks a calibration. `source` is
///     FILE         one file that holds both cameras; or intrinsics with `extrinsics` beside it (the same
///                  name with that word); or EuRoC's cam0/sensor.yaml with ../cam1 beside it
///     FILE,FILE    OpenCV intrinsics and extrinsics, in this order; or left and right (ROS, EuRoC)
///     FOLDER       holding mav0/ or cam0/ cam1/ (EuRoC), calib.txt (KITTI), calibration.yml, camchain.yaml,
///                  intrinsics.yml with extrinsics.yml, or left.yaml with right.yaml (first found)
///
/// What is not said in the format's own documentation:
///     OpenCV   D of 4, 5, 8, 12 or 14 coefficients, row or column; image_size, or image_width and
///              image_height, if there; key distortion_model: equidistant for cv::fisheye's coefficients
///     Kalibr   T_cn_cnm1 of cam1, else T_cam_imu or T_imu_cam of both; pinhole with radtan, equidistant, none
///     ROS      with R_l, R_r the rectification and P the projection matrices, b = P_r[3]/P_r[0] - P_l[3]/P_l[0]:
///              R = R_r^T R_l, T = R_r^T (b, 0, 0); plumb_bob, rational_polynomial, equidistant
///     EuRoC    T_BS: camera to body
///     KITTI    pictures are rectified: T = (b, 0, 0), b the x of K^-1 P's fourth column, right minus left;
///              the few millimetres that cameras 2 and 3 differ in y and z are left out
///
/// Throws std::runtime_error with one line: file, line or key, what is wrong, the way out.
[[nodiscard]] CalibrationFile read_calibration_file(const std::string& source, const ReadOptions& options = {});
[[nodiscard]] StereoCalibration read_calibration(const std::string& source, const ReadOptions& options = {});

/// Writes K1 D1 K2 D2 R T (and image_size where known) as OpenCV FileStorage YAML: shortest numbers that read
/// back to the same bits, so the same calibration gives the same file. Replaces the file at once, when whole.
/// Throws std::runtime_error with one line naming the file.
void write_opencv(const std::string& path, const StereoCalibration& calibration);

}  // namespace stereotrack::calibration
