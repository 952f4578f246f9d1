#pragma once

#include <string>

#include "pipeline/geometry/calibration.hpp"

namespace stereotrack::calibration {

/// Refuses what cannot be a stereo rig: throws std::runtime_error with one line, `name` first.
///   a NaN or infinity; focal length <= 0; principal point far outside of the picture (more than half its
///   side; where no size is known, more than four focal lengths from the corner); sizes of the two cameras
///   differ; R not a rotation (largest element of R^T R - I over 0.001, or det < 0); baseline zero;
///   baseline not along x (seen from halfway between the cameras, |x| must exceed |y| and |z|);
///   left and right exchanged (x > 0); where sizes are known, a lens equation that cannot be inverted in
///   the middle half of the picture.
void check(const StereoCalibration& calibration, const std::string& name);

/// Refuses a calibration that was made for pictures of another size than width x height, or that, taken at
/// this size, fails check(). Throws like it.
void check_size(const StereoCalibration& calibration, int width, int height, const std::string& name);

}  // namespace stereotrack::calibration
