#pragma once

#include <vector>

#include "config/calibration/read_calibration.hpp"
#include "config/calibration/text.hpp"

/// One reader a format; see read_calibration.hpp for what each takes. Not checked yet.
namespace stereotrack::calibration {

[[nodiscard]] StereoCalibration read_opencv(const std::vector<TextFile>& files);
[[nodiscard]] StereoCalibration read_kalibr(const TextFile& file);
[[nodiscard]] StereoCalibration read_ros(const TextFile& left, const TextFile& right);
[[nodiscard]] StereoCalibration read_euroc(const TextFile& left, const TextFile& right);
[[nodiscard]] StereoCalibration read_kitti(const TextFile& file, bool colour);

}  // namespace stereotrack::calibration
