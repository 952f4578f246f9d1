#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "drivers/capture/frame_source.hpp"
#include "drivers/record/recording_source.hpp"
#include "pipeline/core/arena.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack {

/// What the user said on the command line about where pictures come from and how to look at them.
struct RigArguments {
  std::string source;                      ///< SOURCE
  std::optional<std::string> calibration;  ///< --calibration; else the source's own folder is asked
  std::optional<std::string> config;  ///< --config; else the recording's, or stereotrack.toml in the source's folder
  std::vector<std::string> set;       ///< --set KEY=VALUE, in order
};

/// Ordinals from `first` to `last`, both included.
struct FrameRange {
  std::uint64_t first = 1;
  std::uint64_t last = UINT64_MAX;
};

/// A:B, A:, :B, or N. Throws config::Error.
[[nodiscard]] FrameRange parse_frames(const std::string& text);

/// Configuration alone: preset, what lies below (a recording's own), file, --set. Throws config::Error.
[[nodiscard]] config::Loaded load_configuration(const std::optional<std::string>& file,
                                                const std::vector<std::string>& set,
                                                std::vector<config::Layer> below = {});

/// A source, its calibration and configuration, opened and checked against each other.
struct Rig {
  config::Loaded loaded;
  std::unique_ptr<capture::FrameSource> source;
  const record::RecordingSource* recording = nullptr;  ///< the source, where it is a recording of ours
  std::optional<StereoCalibration> calibration;        ///< none for mono
  std::string calibration_name;                        ///< for messages
  double unit_m = 0;                                   ///< metres in one unit of the calibration, 0 = not known

  [[nodiscard]] const config::Configuration& configuration() const noexcept { return loaded.configuration; }
};

/// Throws config::Error (exit 2) or std::runtime_error (exit 1), one line each.
[[nodiscard]] Rig open_rig(const RigArguments& arguments);

/// The pipeline for a rig. Throws std::runtime_error with the stage's fault in words.
[[nodiscard]] Pipeline make_pipeline(const Rig& rig, Arena& arena, const StageObserver& observer = {});

}  // namespace stereotrack
