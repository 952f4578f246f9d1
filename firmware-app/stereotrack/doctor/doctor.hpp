#pragma once

#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>

namespace stereotrack {

/// `stereotrack doctor [--config FILE] [--seconds N] [--line CHIP:LINE] [--no-measure] [--json] [--write FILE]
/// [--calibration FILE]`
struct DoctorArguments {
  std::optional<std::string> config;       ///< what is checked; else defaults on the cameras that there are
  std::optional<std::string> calibration;  ///< for the configuration that is written
  std::optional<std::filesystem::path> write;
  std::optional<std::string> line;  ///< the only line that is ever driven
  double seconds = 5;               ///< of each measurement [s]
  bool measure = true;
  bool json = false;
  std::filesystem::path root = "/";  ///< where sys, proc and dev are
};

/// Looks at the board, measures, tells. Answers the exit code: 0 ready, 1 works with limits, 2 cannot run. Throws
/// config::Error for a wrong configuration, line name or file to write.
int run_doctor(const DoctorArguments& arguments, std::ostream& out, std::ostream& messages);

}  // namespace stereotrack
