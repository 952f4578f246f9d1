#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

namespace stereotrack {

/// How a lens bends a ray; see camera.hpp for the equations.
enum class LensModel : std::uint8_t {
  kRadtan,       ///< OpenCV's: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty; coefficients not given are 0
  kEquidistant,  ///< Kannala-Brandt / OpenCV fisheye: k1 k2 k3 k4
};

/// One camera: pinhole with a lens. Pixels: (0, 0) is the centre of the first pixel.
struct CameraModel {
  int width = 0;   ///< [px], 0 = the file does not say
  int height = 0;  ///< [px], 0 = the file does not say
  double fx = 0;   ///< [px]
  double fy = 0;   ///< [px]
  double cx = 0;   ///< [px]
  double cy = 0;   ///< [px]
  LensModel lens = LensModel::kRadtan;
  std::array<double, 14> distortion{};  ///< in the order of LensModel, rest 0
};

/// Two cameras and how they stand to each other: p_right = R_right_left * p_left + t_right_left,
/// as OpenCV's stereoCalibrate gives R and T. Lengths in the unit of the calibration file.
struct StereoCalibration {
  CameraModel left;
  CameraModel right;
  Eigen::Matrix3d R_right_left = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t_right_left = Eigen::Vector3d::Zero();
};

}  // namespace stereotrack
