#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/rect.hpp"

namespace stereotrack {

enum class TrackState : std::uint8_t {
  kTentative,  ///< seen, not yet believed
  kConfirmed,  ///< believed and measured in this frame
  kCoasting,   ///< believed, not measured in this frame: predicted
};

/// One target as the tracker knows it at the capture time of a frame.
/// Camera frame: left rectified camera, x right, y down, z forward, unit of the calibration's T.
struct TrackReport {
  std::uint32_t id = 0;  ///< from 1, never used again
  TrackState state = TrackState::kTentative;
  bool measured = false;        ///< a detection of this frame went into it
  bool has_depth = false;       ///< position and velocity are known; false in mono mode or where stereo failed
  Rect box;                     ///< tight around the visible object, raw left picture, clipped [px]
  FixedVector<Point, 48> hull;  ///< convex hull of the object, raw left picture, clockwise on the screen
  double image_x = 0;           ///< centre of the object in the raw left picture [px]
  double image_y = 0;
  double image_vx = 0;  ///< its velocity in the picture [px/s]
  double image_vy = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< centroid of the visible surface [calibration unit]
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< [calibration unit / s]
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();  ///< of (position, velocity)
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  ///< that it is expected to have [calibration unit / s^2]
  double acceleration_sd = 0;                              ///< and how far off that may be, each axis
  double confidence = 0;                                   ///< 0..1
  double age_s = 0;                                        ///< since its first detection [s]
};

}  // namespace stereotrack
