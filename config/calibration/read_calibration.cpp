#include "config/calibration/read_calibration.hpp"

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/calibration/check.hpp"
#include "config/calibration/formats.hpp"

namespace fs = std::filesystem;

namespace stereotrack::calibration {
namespace {

constexpr const char* kKnown =
    "OpenCV FileStorage, Kalibr camchain, ROS camera_info, EuRoC sensor.yaml, KITTI calib.txt";

Format detect(const TextFile& file) {
  const auto unsupported = [&file](const std::string& what, const std::string& instead) {
    throw std::runtime_error(file.path + ": " + what + " is not supported; " + instead);
  };
  if (has_key(file, "value0") && has_key(file, "T_imu_cam")) {
    unsupported("Basalt's JSON calibration",
                "calibrate with Kalibr (pinhole-radtan or pinhole-equi) and give its camchain.yaml");
  }
  if (has_key(file, "mirror_parameters")) {
    unsupported("the MEI camera model", "calibrate as pinhole with OpenCV (K1 D1 K2 D2 R T) or Kalibr");
  }
  if (has_key(file, "model_type")) {
    unsupported("camodocal's file of one camera", "write both cameras as OpenCV K1 D1 K2 D2 R T");
  }
  if (has_key(file, "body_T_cam0")) {
    unsupported("VINS-Fusion's configuration", "write both cameras as OpenCV K1 D1 K2 D2 R T or a Kalibr camchain");
  }
  if (has_key(file, "Camera.fx") || has_key(file, "Camera1.fx")) {
    unsupported("ORB-SLAM's settings file", "write both cameras as OpenCV K1 D1 K2 D2 R T");
  }
  if (has_key(file, "P_rect_00")) {
    unsupported("KITTI's raw calib_cam_to_cam.txt", "give the odometry data set's calib.txt with P0 to P3");
  }
  if (has_key(file, "cam0") || has_key(file, "cam1")) return Format::kKalibr;
  if (has_key(file, "T_BS")) return Format::kEuroc;
  // Before KITTI: OpenCV's files often hold P1 and P2 as well.
  if (file.text.find("opencv-matrix") != std::string::npos) return Format::kOpenCv;
  for (const char* key : {"K1", "M1", "K2", "M2"}) {
    if (has_key(file, key)) return Format::kOpenCv;
  }
  if (has_key(file, "P0") || has_key(file, "P2")) return Format::kKitti;
  if (has_key(file, "camera_matrix") || file.text.find("camera matrix") != std::string::npos) return Format::kRos;
  throw std::runtime_error(file.path + ": not a calibration that is known; known are " + kKnown);
}

std::string text_of(Format format) {
  switch (format) {
    case Format::kOpenCv: return "OpenCV FileStorage";
    case Format::kKalibr: return "Kalibr camchain";
    case Format::kRos: return "ROS camera_info";
    case Format::kEuroc: return "EuRoC sensor.yaml";
    case Format::kKitti: return "KITTI calib.txt";
  }
  return "unknown";
}

/// The file's name with one word exchanged, if such a file exists beside it.
std::string beside(const std::string& path, const std::string& word, const std::string& other) {
  std::string name = fs::path(path).filename().string();
  const std::size_t at = name.find(word);
  if (at == std::string::npos) return {};
  name.replace(at, word.size(), other);
  const fs::path sibling = fs::path(path).parent_path() / name;
  return fs::exists(sibling) ? sibling.string() : std::string();
}

CalibrationFile read_two(const std::string& first, const std::string& second) {
  const TextFile a = read_text(first);
  const TextFile b = read_text(second);
  const Format format = detect(a);
  const Format other = detect(b);
  if (format != other) {
    throw std::runtime_error(first + " is " + text_of(format) + " but " + second + " is " + text_of(other) +
                             "; give two files of one kind");
  }
  switch (format) {
    case Format::kOpenCv: return {read_opencv({a, b}), format};
    case Format::kRos: return {read_ros(a, b), format};
    case Format::kEuroc: return {read_euroc(a, b), format};
    case Format::kKalibr:
    case Format::kKitti: break;
  }
  throw std::runtime_error(first + ": a " + text_of(format) + " holds both cameras; give one file");
}

CalibrationFile read_one(const std::string& path, const ReadOptions& options) {
  const TextFile file = read_text(path);
  const Format format = detect(file);
  switch (format) {
    case Format::kOpenCv: {
      const bool has_pose = has_key(file, "R") && has_key(file, "T");
      const std::string extrinsics = has_pose ? "" : beside(path, "intrinsics", "extrinsics");
      if (!extrinsics.empty()) return {read_opencv({file, read_text(extrinsics)}), format};
      return {read_opencv({file}), format};
    }
    case Format::kKalibr: return {read_kalibr(file), format};
    case Format::kKitti: return {read_kitti(file, options.kitti_colour), format};
    case Format::kEuroc: {
      const fs::path folder = fs::absolute(path).parent_path();
      const fs::path right = folder.parent_path() / "cam1" / "sensor.yaml";
      if (folder.filename() == "cam0" && fs::exists(right)) return read_two(path, right.string());
      break;
    }
    case Format::kRos: break;
  }
  throw std::runtime_error(path + ": " + text_of(format) + " describes one camera; give both as LEFT,RIGHT");
}

CalibrationFile read_folder(const std::string& folder, const ReadOptions& options) {
  const fs::path root(folder);
  for (const fs::path& mav : {root / "mav0", root}) {
    const fs::path left = mav / "cam0" / "sensor.yaml";
    const fs::path right = mav / "cam1" / "sensor.yaml";
    if (fs::exists(left) || fs::exists(right)) return read_two(left.string(), right.string());
  }
  for (const char* name : {"calib.txt", "calibration.yml", "calibration.yaml", "camchain.yaml", "intrinsics.yml"}) {
    if (fs::exists(root / name)) return read_one((root / name).string(), options);
  }
  if (fs::exists(root / "left.yaml") && fs::exists(root / "right.yaml")) {
    return read_two((root / "left.yaml").string(), (root / "right.yaml").string());
  }
  throw std::runtime_error(folder +
                           ": no calibration in this folder (looked for mav0, cam0/sensor.yaml, calib.txt,"
                           " calibration.yml, camchain.yaml, intrinsics.yml, left.yaml); name the file");
}

CalibrationFile read_any(const std::string& source, const ReadOptions& options) {
  if (fs::is_directory(source)) return read_folder(source, options);
  const std::size_t comma = source.find(',');
  if (comma == std::string::npos || fs::exists(source)) return read_one(source, options);
  return read_two(source.substr(0, comma), source.substr(comma + 1));
}

}  // namespace

std::optional<double> unit_m(Format format) noexcept {
  if (format == Format::kOpenCv) return std::nullopt;
  return 1.0;
}

CalibrationFile read_calibration_file(const std::string& source, const ReadOptions& options) {
  CalibrationFile file = read_any(source, options);
  check(file.stereo, source);
  return file;
}

StereoCalibration read_calibration(const std::string& source, const ReadOptions& options) {
  return read_calibration_file(source, options).stereo;
}

}  // namespace stereotrack::calibration
