#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "firmware-app/stereotrack/doctor/findings.hpp"

namespace stereotrack::doctor {

/// Sets source and camera keys to the cameras that fit best: two of the same driver and kind that have a format and
/// size in common, the kernel's before libcamera's, else one, in mono. Of formats the one that the driver calls
/// cheapest; of sizes that of the configuration (camera.width, camera.height), else the largest below it, else the
/// smallest; of rates the fastest up to camera.fps. Names are those that stay the same after a restart, where there are
/// any. False: there is no camera to use.
[[nodiscard]] bool choose_cameras(const std::vector<CameraFound>& cameras, config::Configuration& configuration);

/// The configuration for this board as TOML, with what was measured in comments. `calibration`: its file; without one
/// the right camera stands in a comment, since two views need it: the text always passes --check-config. Throws
/// config::Error where the configuration would not load, which is a defect here.
[[nodiscard]] std::string suggest(const Findings& findings, const std::optional<std::string>& calibration);

/// Writes it to a new file. Throws config::Error with one line: there is one already (it stays as it is), or it cannot
/// be written.
void write_new_file(const std::filesystem::path& path, const std::string& text);

}  // namespace stereotrack::doctor
