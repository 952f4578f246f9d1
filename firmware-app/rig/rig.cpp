#include "firmware-app/rig/rig.hpp"

#include <cstdio>
#include <ostream>
#include <stdexcept>
#include <utility>

#include "config/calibration/check.hpp"
#include "config/rules.hpp"
#include "config/zones.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"

namespace stereotrack {

config::Loaded load_configuration(const std::optional<std::string>& file, const std::vector<std::string>& set,
                                  std::vector<config::Layer> below) {
  std::vector<config::Layer> layers = std::move(below);
  if (file) layers.push_back(config::file_layer(*file));
  for (const std::string& entry : set) layers.push_back(config::override_layer(entry));
  return config::load(layers);
}

void open_recording(const std::string& path, Rig& rig) {
  auto recording = std::make_unique<record::RecordingSource>(path);
  rig.calibration = recording->calibration();
  rig.calibration_name = path;
  rig.unit_m = recording->about().unit_m;
  rig.recording = recording.get();
  rig.source = std::move(recording);
}

void open_scene(const std::string& name, Rig& rig, bool truth) {
  const config::Configuration& configuration = rig.configuration();
  capture::SyntheticOptions options;
  options.fps = configuration.source.fps;
  options.seed = configuration.synthetic.seed;
  options.frames = static_cast<std::uint64_t>(configuration.synthetic.frames);
  options.width = configuration.synthetic.width;
  options.height = configuration.synthetic.height;
  options.truth = truth;
  std::unique_ptr<capture::SyntheticSource> scene;
  try {
    scene = capture::open_synthetic(name.substr(kSynthetic.size()), options);
  } catch (const capture::SceneError& error) {
    throw config::Error(error.what());
  }
  rig.calibration = scene->calibration();
  rig.calibration_name = name;
  rig.unit_m = 1;
  rig.scene = scene.get();
  rig.source = std::move(scene);
}

void read_calibration(const std::string& path, const calibration::ReadOptions& options, Rig& rig) {
  rig.calibration_name = path;
  const calibration::CalibrationFile read = calibration::read_calibration_file(path, options);
  rig.calibration = read.stereo;
  rig.unit_m = calibration::unit_m(read.format).value_or(0);
}

void check_rig(Rig& rig) { check_rig(rig, rig.source->info()); }

void check_rig(Rig& rig, const capture::SourceInfo& info) {
  const config::Configuration& configuration = rig.configuration();
  if (configuration.calibration.unit_m > 0) rig.unit_m = configuration.calibration.unit_m;
  config::check_metres(rig.loaded, rig.unit_m);
  if (rig.calibration) calibration::check_size(*rig.calibration, info.width, info.height, rig.calibration_name);
}

Pipeline make_pipeline(const PipelineConfig& config, const StereoCalibration* calibration,
                       const capture::SourceInfo& info, Arena& arena, const StageObserver& observer,
                       const DecisionObserver& decisions) {
  Pipeline::Setup setup;
  setup.width = info.width;
  setup.height = info.height;
  setup.colour = has_colour(info.format);
  setup.calibration = calibration;
  setup.observer = observer;
  setup.decisions = decisions;
  const Result<Pipeline> pipeline = Pipeline::create(config, setup, arena);
  if (!pipeline.has_value()) {
    throw std::runtime_error(info.name + ": no pipeline for pictures of " + std::to_string(info.width) + "x" +
                             std::to_string(info.height) + ": " + to_string(pipeline.error()));
  }
  return *pipeline;
}

Pipeline make_pipeline(const Rig& rig, const capture::SourceInfo& info, Arena& arena, const StageObserver& observer,
                       const DecisionObserver& decisions) {
  return make_pipeline(config::pipeline_of(rig.configuration(), rig.unit_m), info.stereo ? &*rig.calibration : nullptr,
                       info, arena, observer, decisions);
}

void print_memory(std::ostream& out, const MemoryUse& memory) {
  const auto row = [&out](const char* name, const std::string& bytes) {
    char line[64];
    (void)std::snprintf(line, sizeof line, "%-10s %12s\n", name, bytes.c_str());
    out << line;
  };
  row("memory", "bytes");
  for (std::size_t i = 0; i < kMemoryParts; ++i) {
    const auto part = static_cast<MemoryPart>(i);
    row(to_string(part), std::to_string(memory.bytes(part)));
  }
  row("total", std::to_string(memory.total()));
}

}  // namespace stereotrack
