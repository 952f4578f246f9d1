#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>

#include "config/calibration/formats.hpp"

namespace stereotrack::calibration {

StereoCalibration read_kitti(const TextFile& file, bool colour) {
  const auto projection = [&file](const std::string& key) {
    std::istringstream lines(file.text);
    std::string line;
    for (int number = 1; std::getline(lines, line); ++number) {
      if (line.rfind(key + ":", 0) != 0) continue;
      std::istringstream row(line.substr(key.size() + 1));
      row.imbue(std::locale::classic());
      std::vector<double> p;
      for (double value = 0; row >> value;) p.push_back(value);
      if (p.size() != 12 || !row.eof()) {
        throw std::runtime_error(file.path + ":" + std::to_string(number) + ": " + key + " must be 12 numbers");
      }
      if (!(p[0] > 0 && p[5] > 0) || p[1] != 0 || p[4] != 0 || p[8] != 0 || p[9] != 0 || p[10] != 1) {
        throw std::runtime_error(file.path + ":" + std::to_string(number) + ": " + key +
                                 " is not a projection matrix fx 0 cx tx, 0 fy cy ty, 0 0 1 tz");
      }
      return p;
    }
    throw std::runtime_error(file.path + ": " + key + " is missing; KITTI's calib.txt has P0 to P3");
  };
  const std::vector<double> l = projection(colour ? "P2" : "P0");
  const std::vector<double> r = projection(colour ? "P3" : "P1");
  StereoCalibration result;
  const auto set = [](CameraModel& camera, const std::vector<double>& p) {
    camera.fx = p[0];
    camera.fy = p[5];
    camera.cx = p[2];
    camera.cy = p[6];
  };
  set(result.left, l);
  set(result.right, r);
  const auto x = [](const std::vector<double>& p) { return (p[3] - p[2] * p[11]) / p[0]; };
  result.t_right_left = {x(r) - x(l), 0, 0};
  return result;
}

}  // namespace stereotrack::calibration
