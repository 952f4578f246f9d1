#pragma once

#include <string>

#include "pipeline/geometry/calibration.hpp"

namespace stereotrack::record {

/// A calibration as it stands in a recording: lines of names and numbers, which read back to the same bits. A program
/// without OpenCV reads it too.
[[nodiscard]] std::string to_text(const StereoCalibration& calibration);
/// Throws std::runtime_error, one line that begins with `name`.
[[nodiscard]] StereoCalibration calibration_from_text(const std::string& text, const std::string& name);

}  // namespace stereotrack::record
