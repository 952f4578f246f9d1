#pragma once

#include "pipeline/core/stage.hpp"
#include "pipeline/track/track_report.hpp"

namespace stereotrack {

/// What extrapolation must know of the picture.
struct Extrapolation {
  int width = 0;   ///< of the raw left picture [px]
  int height = 0;  ///< [px]
};

/// A target as it is expected to be `seconds` (>= 0) after its frame: (3.26) and (3.27) with the acceleration that the
/// tracker expects of it, and its noise.
///     p' = p + v s + a s^2 / 2     v' = v + a s     P' = F P F^T + Q        box' = box + v_image s, clipped
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
