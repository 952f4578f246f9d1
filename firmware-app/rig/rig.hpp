#pragma once

#include <iosfwd>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/calibration/read_calibration.hpp"
#include "config/load.hpp"
#include "drivers/capture/frame_source.hpp"
#include "drivers/record/recording_source.hpp"
#include "pipeline/core/arena.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack {

namespace capture {
class SyntheticSource;
}

/// What starts the name of a scene that is drawn: synthetic:NAME.
inline constexpr std::string_view kSynthetic = "synthetic:";

/// A source, its calibration and configuration, opened and checked against each other: what every program begins with.
/// The functions fill it in this order: load_configuration(), then open_scene(), open_recording() (before
/// the configuration, where it is to lie below) or a source of the program's own and read_calibration(), then
/// check_rig(). All throw config::Error (exit 2) or std::runtime_error (exit 1), one line.
struct Rig {
  config::Loaded loaded;
  std::unique_ptr<capture::FrameSource> source;
  const record::RecordingSource* recording = nullptr;  ///< the source, where it is a recording of ours
  const capture::SyntheticSource* scene = nullptr;     ///< the source, where it is a scene that is drawn
  std::optional<StereoCalibration> calibration;        ///< none for mono
  std::string calibration_name;                        ///< for messages
  double unit_m = 0;                                   ///< metres in one unit of the calibration, 0 = not known

  [[nodiscard]] const config::Configuration& configuration() const noexcept { return loaded.configuration; }
};

/// Preset, what lies below (a recording's own), file, then --set entries.
[[nodiscard]] config::Loaded load_configuration(const std::optional<std::string>& file,
                                                const std::vector<std::string>& set,
                                                std::vector<config::Layer> below = {});

/// Opens a recording of ours, which brings its calibration and unit, and its configuration for who wants it.
void open_recording(const std::string& path, Rig& rig);

/// Draws synthetic:NAME, which brings its calibration, as [synthetic] and source.fps say; `truth`: and works out its
/// ground truth for every pair.
void open_scene(const std::string& name, Rig& rig, bool truth = false);

/// The calibration of a stereo source.
void read_calibration(const std::string& path, const calibration::ReadOptions& options, Rig& rig);

/// calibration.unit_m, keys in metres, and the size of the pictures; of a source that is not the rig's own, of `info`.
void check_rig(Rig& rig, const capture::SourceInfo& info);
void check_rig(Rig& rig);

/// The pipeline for what a source delivers; `calibration` is null for mono. Throws std::runtime_error with the stage's
/// fault in words.
[[nodiscard]] Pipeline make_pipeline(const PipelineConfig& config, const StereoCalibration* calibration,
                                     const capture::SourceInfo& info, Arena& arena, const StageObserver& observer = {},
                                     const DecisionObserver& decisions = {});
[[nodiscard]] Pipeline make_pipeline(const Rig& rig, const capture::SourceInfo& info, Arena& arena,
                                     const StageObserver& observer = {}, const DecisionObserver& decisions = {});

/// What a pipeline took, by part, as a table for people.
void print_memory(std::ostream& out, const MemoryUse& memory);

}  // namespace stereotrack
