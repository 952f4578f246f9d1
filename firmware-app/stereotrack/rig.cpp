#include "firmware-app/stereotrack/rig.hpp"

#include <charconv>
#include <filesystem>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "config/calibration/check.hpp"
#include "config/calibration/read_calibration.hpp"
#include "config/rules.hpp"
#include "drivers/capture/replay/replay.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"

namespace stereotrack {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kSynthetic = "synthetic:";

std::uint64_t parse_ordinal(std::string_view text, const std::string& whole, std::uint64_t absent) {
  if (text.empty()) return absent;
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value == 0) {
    throw config::Error("--frames " + whole + ": want A:B with ordinals from 1, as in --frames 100:250");
  }
  return value;
}

// The folder that may hold calibration.yml and stereotrack.toml of a recording.
fs::path folder_of(const std::string& source) {
  std::string path = source;
  for (const std::string_view prefix : {"sbs:", "mono:"}) {
    if (path.starts_with(prefix)) path = path.substr(prefix.size());
  }
  if (const std::size_t comma = path.find(','); comma != std::string::npos) path = path.substr(0, comma);
  std::error_code ignored;
  return fs::is_directory(path, ignored) ? fs::path(path) : fs::path(path).parent_path();
}

bool is_kitti_colour(const fs::path& folder) {
  std::error_code ignored;
  return fs::is_directory(folder / "image_2", ignored) && !fs::is_directory(folder / "image_0", ignored);
}

}  // namespace

FrameRange parse_frames(const std::string& text) {
  const std::size_t colon = text.find(':');
  const std::string_view view = text;
  FrameRange range;
  if (colon == std::string::npos) {
    range.first = range.last = parse_ordinal(view, text, 0);
  } else {
    range.first = parse_ordinal(view.substr(0, colon), text, 1);
    range.last = parse_ordinal(view.substr(colon + 1), text, UINT64_MAX);
  }
  if (range.first == 0 || range.first > range.last) {
    throw config::Error("--frames " + text + ": the first frame comes after the last; want A:B with A <= B");
  }
  return range;
}

config::Loaded load_configuration(const std::optional<std::string>& file, const std::vector<std::string>& set,
                                  std::vector<config::Layer> below) {
  std::vector<config::Layer> layers = std::move(below);
  if (file) layers.push_back(config::file_layer(*file));
  for (const std::string& entry : set) layers.push_back(config::override_layer(entry));
  return config::load(layers);
}

Rig open_rig(const RigArguments& arguments) {
  Rig rig;
  const bool synthetic = arguments.source.starts_with(kSynthetic);
  const fs::path folder = synthetic ? fs::path() : folder_of(arguments.source);
  std::optional<std::string> file = arguments.config;
  if (!file && !synthetic && fs::exists(folder / "stereotrack.toml")) file = (folder / "stereotrack.toml").string();
  std::vector<config::Layer> below;
  if (record::is_recording(arguments.source)) {
    auto recording = std::make_unique<record::RecordingSource>(arguments.source);
    if (!arguments.config) {
      file.reset();
      below.push_back(config::text_layer(arguments.source, recording->configuration()));
    }
    rig.calibration = recording->calibration();
    rig.calibration_name = arguments.source;
    rig.unit_m = recording->about().unit_m;
    rig.recording = recording.get();
    rig.source = std::move(recording);
  }
  rig.loaded = load_configuration(file, arguments.set, std::move(below));
  const config::Configuration& configuration = rig.configuration();

  if (synthetic) {
    capture::SyntheticOptions options;
    options.fps = configuration.source.fps;
    options.seed = configuration.synthetic.seed;
    options.frames = static_cast<std::uint64_t>(configuration.synthetic.frames);
    options.width = configuration.synthetic.width;
    options.height = configuration.synthetic.height;
    std::unique_ptr<capture::SyntheticSource> scene;
    try {
      scene = capture::open_synthetic(arguments.source.substr(kSynthetic.size()), options);
    } catch (const capture::SceneError& error) {
      throw config::Error(error.what());
    }
    rig.calibration = scene->calibration();
    rig.calibration_name = arguments.source;
    rig.unit_m = 1;
    rig.source = std::move(scene);
  } else if (rig.recording == nullptr) {
    rig.source = capture::open_replay(arguments.source, {.fps = configuration.source.fps,
                                                         .flip = configuration.source.flip,
                                                         .swap = configuration.source.swap,
                                                         .shift_rows = configuration.source.shift_rows});
  }
  const capture::SourceInfo& info = rig.source->info();
  if (arguments.calibration || (info.stereo && !rig.calibration)) {
    if (!info.stereo) {
      throw config::Error("--calibration " + *arguments.calibration + ": " + arguments.source +
                          " is a mono source, which takes none; leave the option out");
    }
    rig.calibration_name = arguments.calibration.value_or(folder.string());
    calibration::CalibrationFile read;
    try {
      read = calibration::read_calibration_file(rig.calibration_name, {.kitti_colour = is_kitti_colour(folder)});
    } catch (const std::runtime_error& error) {
      if (arguments.calibration) throw;
      throw std::runtime_error(std::string(error.what()) +
                               " (a stereo source needs a calibration: give --calibration FILE, or use mono:PATH)");
    }
    rig.calibration = read.stereo;
    rig.unit_m = calibration::unit_m(read.format).value_or(0);
  }
  if (configuration.calibration.unit_m > 0) rig.unit_m = configuration.calibration.unit_m;
  config::check_metres(rig.loaded, rig.unit_m);
  if (rig.calibration) calibration::check_size(*rig.calibration, info.width, info.height, rig.calibration_name);
  return rig;
}

Pipeline make_pipeline(const Rig& rig, Arena& arena, const StageObserver& observer) {
  const capture::SourceInfo& info = rig.source->info();
  Pipeline::Setup setup;
  setup.width = info.width;
  setup.height = info.height;
  setup.colour = has_colour(info.format);
  setup.calibration = info.stereo ? &*rig.calibration : nullptr;
  setup.observer = observer;
  const Result<Pipeline> pipeline = Pipeline::create(rig.configuration().pipeline, setup, arena);
  if (!pipeline.has_value()) {
    throw std::runtime_error(info.name + ": no pipeline for pictures of " + std::to_string(info.width) + "x" +
                             std::to_string(info.height) + ": " + to_string(pipeline.error()));
  }
  return *pipeline;
}

}  // namespace stereotrack
