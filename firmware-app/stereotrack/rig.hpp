#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "firmware-app/rig/rig.hpp"

namespace stereotrack {

/// What the user said on the command line about where pictures come from and how to look at them.
struct RigArguments {
  std::string source;                      ///< SOURCE
  std::optional<std::string> calibration;  ///< --calibration; else the source's own folder is asked
  std::optional<std::string> config;  ///< --config; else the recording's, or stereotrack.toml in the source's folder
  std::vector<std::string> set;       ///< --set KEY=VALUE, in order
  std::optional<std::string> truth;   ///< --truth FILE: of a synthetic scene, for its ground truth
};

/// Ordinals from `first` to `last`, both included.
struct FrameRange {
  std::uint64_t first = 1;
  std::uint64_t last = UINT64_MAX;
};

/// A:B, A:, :B, or N, of the option that the message names. Throws config::Error.
[[nodiscard]] FrameRange parse_frames(const std::string& text, const std::string& option = "--frames");

/// What they name, opened and checked. Throws config::Error (exit 2) or std::runtime_error (exit 1), one line each.
[[nodiscard]] Rig open_rig(const RigArguments& arguments);

}  // namespace stereotrack
