#include <locale>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>

#include "config/calibration/formats.hpp"

namespace stereotrack::calibration {
namespace {

struct CameraInfo {
  CameraModel model;
  Eigen::Matrix3d rectification = Eigen::Matrix3d::Identity();
  double baseline_x = 0;  ///< P[3] / P[0]
};

CameraInfo make(const TextFile& file, double width, double height, const std::vector<double>& k, LensModel lens,
                const std::vector<double>& d, const std::vector<double>& r, const std::vector<double>& p) {
  CameraInfo info;
  info.model.width = side(width, file.path, "image width");
  info.model.height = side(height, file.path, "image height");
  info.model.fx = k[0];
  info.model.fy = k[4];
  info.model.cx = k[2];
  info.model.cy = k[5];
  if (!d.empty()) set_distortion(info.model, lens, d, file.path);
  info.rectification = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.data());
  if (!(p[0] > 0)) {
    throw std::runtime_error(file.path +
                             ": projection matrix has focal length 0, so the baseline is not known;"
                             " calibrate both cameras together");
  }
  info.baseline_x = p[3] / p[0];
  return info;
}

CameraInfo read_yaml(const TextFile& file) {
  const YAML::Node root = parse_yaml(file);
  for (const char* key : {"rectification_matrix", "projection_matrix"}) {
    if (!root[key].IsDefined()) {
      throw std::runtime_error(file.path + ": " + key +
                               " is missing, so how the cameras stand is not known; calibrate both cameras together");
    }
  }
  const YAML::Node model = child(file, root, "distortion_model");
  const LensModel lens = lens_model(word(file, model, "distortion_model"), place(file, model));
  return make(file, numbers(file, child(file, root, "image_width"), "image_width", 1)[0],
              numbers(file, child(file, root, "image_height"), "image_height", 1)[0],
              numbers(file, child(file, root, "camera_matrix"), "camera_matrix", 9), lens,
              numbers(file, child(file, root, "distortion_coefficients"), "distortion_coefficients"),
              numbers(file, root["rectification_matrix"], "rectification_matrix", 9),
              numbers(file, root["projection_matrix"], "projection_matrix", 12));
}

/// The older form of camera_calibration_parsers: a key on one line, its numbers on the next ones.
CameraInfo read_ini(const TextFile& file) {
  std::map<std::string, std::vector<double>> values;
  std::string key;
  std::istringstream lines(file.text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#' || line[first] == ';' || line[first] == '[') continue;
    line = line.substr(first, line.find_last_not_of(" \t\r") - first + 1);
    std::istringstream row(line);
    row.imbue(std::locale::classic());
    std::vector<double> found;
    for (double value = 0; row >> value;) found.push_back(value);
    if (found.empty()) {
      key = line;
      continue;
    }
    if (!row.eof()) throw std::runtime_error(file.path + ":" + std::to_string(number) + ": not a number in " + line);
    values[key].insert(values[key].end(), found.begin(), found.end());
  }
  const auto take = [&](const std::string& name, std::size_t count) {
    const std::vector<double>& found = values[name];
    if (found.size() != count) {
      throw std::runtime_error(file.path + ": " + name + " holds " + std::to_string(found.size()) +
                               " numbers, must be " + std::to_string(count));
    }
    return found;
  };
  return make(file, take("width", 1)[0], take("height", 1)[0], take("camera matrix", 9), LensModel::kRadtan,
              values["distortion"], take("rectification", 9), take("projection", 12));
}

CameraInfo read(const TextFile& file) { return has_key(file, "camera_matrix") ? read_yaml(file) : read_ini(file); }

}  // namespace

StereoCalibration read_ros(const TextFile& left, const TextFile& right) {
  const CameraInfo l = read(left);
  const CameraInfo r = read(right);
  StereoCalibration result;
  result.left = l.model;
  result.right = r.model;
  result.R_right_left = r.rectification.transpose() * l.rectification;
  result.t_right_left = r.rectification.transpose() * Eigen::Vector3d(r.baseline_x - l.baseline_x, 0, 0);
  return result;
}

}  // namespace stereotrack::calibration
