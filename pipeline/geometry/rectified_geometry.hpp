#pragma once

namespace stereotrack {

enum class View : unsigned char { kLeft, kRight };

/// The two canvases onto which rectification draws, and how they turn a match into a point:
///     d = (u_left - cx_left) - (u_right - cx_right)   disparity [px], 0 at infinity
///     Z = f b / d,  X = (u_left - cx_left) Z / f,  Y = (v - cy) Z / f
/// in the left rectified camera frame: x right along the baseline, y down, z forward; unit of the calibration.
/// Rows of both canvases are the same rows in space. (u, v) = (0, 0) is the centre of the first pixel.
struct RectifiedGeometry {
  int width_left = 0;   ///< [px]
  int width_right = 0;  ///< [px]
  int height = 0;       ///< of both [px]
  double f = 0;         ///< focal length of both, both directions [px]
  double cx_left = 0;   ///< [px]
  double cx_right = 0;  ///< [px]
  double cy = 0;        ///< of both [px]
  double baseline = 0;  ///< > 0 [calibration unit]
  int offset = 0;       ///< cx_left - cx_right, exactly: u_right = u_left - d - offset
};

}  // namespace stereotrack
