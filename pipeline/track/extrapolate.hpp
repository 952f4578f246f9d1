#pragma once

#include "pipeline/core/stage.hpp"
#include "pipeline/track/track_report.hpp"

namespace stereotrack {

/// What extrapolation must know of the tracker and the picture.
struct Extrapolation {
  double acceleration = 0;  ///< Tracker::Config::acceleration [1/s^2], >= 0
  int width = 0;            ///< of the raw left picture [px]
  int height = 0;           ///< [px]
};

/// A target as it is expected to be `seconds` (>= 0) after its frame: the tracker's own model of nearly constant
/// velocity, (3.26) and (3.27), with its own process noise, of which acceleration x distance is the standard deviation.
///     p' = p + v s     v' = v     P' = F P F^T + Q        box' = box + v_image s, clipped to the picture
/// Depth that would lie behind the camera is no depth: has_depth becomes false. A box that has left the picture is
/// empty. Age grows by `seconds`. Hull, size and confidence stay those of the frame. A NaN stays one: the encoder
/// refuses it. Any thread, O(1).
void extrapolate(const Extrapolation& model, double seconds, TrackReport& report) noexcept;

/// What is said of a target in place of a pair of its own in which it could have been measured.
inline void coast(TrackReport& report) noexcept {
  report.measured = false;
  if (report.state == TrackState::kConfirmed) report.state = TrackState::kCoasting;
}

}  // namespace stereotrack
