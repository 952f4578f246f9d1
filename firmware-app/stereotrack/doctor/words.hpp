#pragma once

#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include "firmware-app/stereotrack/doctor/findings.hpp"

/// How things are put into words, for the report and for comments of a configuration.
namespace stereotrack::doctor {

/// Those that are not empty.
[[nodiscard]] std::string joined(const std::vector<std::string>& words, const std::string& between);
[[nodiscard]] std::string count_text(int count, const std::string& what);  ///< "1 core", "4 cores"
[[nodiscard]] std::string us_text(double us);                              ///< "37 us", "1.25 ms"

[[nodiscard]] const char* driver_name(config::CameraDriver driver) noexcept;  ///< as camera.driver has it

/// "grey8 yuyv to 1280x720 at 60/s"; empty: none that can be used.
[[nodiscard]] std::string formats_text(const capture::v4l2::CameraFacts& camera);
/// "; exposure gain trigger": controls that matter, by the driver's names; empty: none.
[[nodiscard]] std::string controls_text(const capture::v4l2::CameraFacts& camera);

/// camera.readout_us [us] where it was guessed, or frames bore times after their arrival: what was in force, and what
/// was missing. Empty: none is needed.
[[nodiscard]] std::optional<double> suggested_readout_us(const CaptureMeasure& measure);

}  // namespace stereotrack::doctor
