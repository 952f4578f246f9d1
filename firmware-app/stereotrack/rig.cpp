#include "firmware-app/stereotrack/rig.hpp"

#include <charconv>
#include <filesystem>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "drivers/capture/replay/replay.hpp"

namespace stereotrack {

namespace fs = std::filesystem;

namespace {

std::uint64_t parse_ordinal(std::string_view text, const std::string& said, std::uint64_t absent) {
  if (text.empty()) return absent;
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value == 0) {
    throw config::Error(said + ": want A:B with ordinals from 1, as in 100:250");
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

FrameRange parse_frames(const std::string& text, const std::string& option) {
  const std::string said = option + " " + text;
  const std::size_t colon = text.find(':');
  const std::string_view view = text;
  FrameRange range;
  if (colon == std::string::npos) {
    range.first = range.last = parse_ordinal(view, said, 0);
  } else {
    range.first = parse_ordinal(view.substr(0, colon), said, 1);
    range.last = parse_ordinal(view.substr(colon + 1), said, UINT64_MAX);
  }
  if (range.first == 0 || range.first > range.last) {
    throw config::Error(said + ": the first frame comes after the last; want A:B with A <= B");
  }
  return range;
}

Rig open_rig(const RigArguments& arguments) {
  Rig rig;
  const bool synthetic = arguments.source.starts_with(kSynthetic);
  if (arguments.truth && !synthetic) {
    throw config::Error("--truth: of " + arguments.source + " none is known; synthetic:NAME has one");
  }
  const fs::path folder = synthetic ? fs::path() : folder_of(arguments.source);
  std::optional<std::string> file = arguments.config;
  if (!file && !synthetic && fs::exists(folder / "stereotrack.toml")) file = (folder / "stereotrack.toml").string();
  std::vector<config::Layer> below;
  if (record::is_recording(arguments.source)) {
    open_recording(arguments.source, rig);
    if (!arguments.config) {
      file.reset();
      below.push_back(config::text_layer(arguments.source, rig.recording->configuration()));
    }
  }
  rig.loaded = load_configuration(file, arguments.set, std::move(below));
  const config::Configuration& configuration = rig.configuration();

  if (synthetic) {
    open_scene(arguments.source, rig, arguments.truth.has_value());
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
    try {
      read_calibration(arguments.calibration.value_or(folder.string()), {.kitti_colour = is_kitti_colour(folder)}, rig);
    } catch (const std::runtime_error& error) {
      if (arguments.calibration) throw;
      throw std::runtime_error(std::string(error.what()) +
                               " (a stereo source needs a calibration: give --calibration FILE, or use mono:PATH)");
    }
  }
  check_rig(rig);
  return rig;
}

}  // namespace stereotrack
