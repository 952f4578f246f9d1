#pragma once

#include "pipeline/track/track_report.hpp"

namespace stereotrack::signals {

/// A confirmed target at a position, with depth.
inline TrackReport target_at(double x, double y, double z) {
  TrackReport target;
  target.id = 1;
  target.state = TrackState::kConfirmed;
  target.measured = true;
  target.has_depth = true;
  target.position = {x, y, z};
  return target;
}

/// One of 10 x 20 px around a point of the picture, without depth.
inline TrackReport target_in_picture(double x, double y) {
  TrackReport target;
  target.id = 1;
  target.state = TrackState::kConfirmed;
  target.measured = true;
  target.image_x = x;
  target.image_y = y;
  target.box = {static_cast<int>(x) - 5, static_cast<int>(y) - 10, 10, 20};
  return target;
}

}  // namespace stereotrack::signals
