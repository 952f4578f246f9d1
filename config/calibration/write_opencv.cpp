#include <charconv>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/calibration/read_calibration.hpp"

namespace stereotrack::calibration {
namespace {

std::string number(double value) {
  char text[32];
  const std::to_chars_result end = std::to_chars(text, text + sizeof text, value);
  return {text, end.ptr};
}

std::string matrix(const char* key, int rows, int cols, const std::vector<double>& values) {
  std::string text = std::string(key) + ": !!opencv-matrix\n   rows: " + std::to_string(rows) +
                     "\n   cols: " + std::to_string(cols) + "\n   dt: d\n   data: [ ";
  for (std::size_t i = 0; i < values.size(); ++i) text += (i == 0 ? "" : ", ") + number(values[i]);
  return text + " ]\n";
}

std::string camera_matrix(const char* key, const CameraModel& c) {
  return matrix(key, 3, 3, {c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1});
}

/// The shortest of the lengths that OpenCV knows.
std::string distortion(const char* key, const CameraModel& c) {
  int count = 4;
  if (c.lens == LensModel::kRadtan) {
    count = 14;
    for (int shorter : {12, 8, 5}) {
      bool zero = true;
      for (std::size_t i = static_cast<std::size_t>(shorter); i < c.distortion.size(); ++i) {
        zero = zero && c.distortion[i] == 0;
      }
      if (zero) count = shorter;
    }
  }
  return matrix(key, 1, count, {c.distortion.begin(), c.distortion.begin() + count});
}

}  // namespace

void write_opencv(const std::string& path, const StereoCalibration& calibration) {
  const CameraModel& left = calibration.left;
  const CameraModel& right = calibration.right;
  if (left.lens != right.lens) {
    throw std::runtime_error(path + ": cameras with different lens models cannot be written as one OpenCV file");
  }
  std::string text = "%YAML:1.0\n---\n";
  if (left.width > 0 && left.height > 0) {
    text += "image_size: [ " + std::to_string(left.width) + ", " + std::to_string(left.height) + " ]\n";
  }
  if (left.lens == LensModel::kEquidistant) text += "distortion_model: equidistant\n";
  const Eigen::Matrix3d& R = calibration.R_right_left;
  const Eigen::Vector3d& t = calibration.t_right_left;
  text += camera_matrix("K1", left) + distortion("D1", left) + camera_matrix("K2", right) + distortion("D2", right);
  text += matrix("R", 3, 3, {R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1), R(1, 2), R(2, 0), R(2, 1), R(2, 2)});
  text += matrix("T", 3, 1, {t.x(), t.y(), t.z()});

  const std::string partial = path + ".part";
  std::ofstream file(partial, std::ios::binary | std::ios::trunc);
  if (!file) throw std::runtime_error(path + ": cannot be written; is the folder there and writable?");
  file << text;
  file.close();
  std::error_code error;
  if (!file.fail()) std::filesystem::rename(partial, path, error);
  if (file.fail() || error) {
    std::remove(partial.c_str());
    throw std::runtime_error(path + ": cannot be written whole; is the disk full?");
  }
}

}  // namespace stereotrack::calibration
