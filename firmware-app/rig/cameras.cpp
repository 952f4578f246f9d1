#include "firmware-app/rig/cameras.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "config/error.hpp"
#include "config/milliseconds.hpp"
#include "drivers/capture/libcamera/libcamera.hpp"
#include "firmware-app/formatted.hpp"
#include "firmware-app/rig/trigger.hpp"

namespace stereotrack {

namespace {

using trigger::Side;

std::string source_name(const config::CameraConfig& camera) {
  return camera.left.device + (camera.right.device.empty() ? "" : ", " + camera.right.device);
}

bool is_libcamera(const config::CameraConfig& camera) { return camera.driver == config::CameraDriver::kLibcamera; }

std::optional<double> set_by_user(double value) { return value > 0 ? std::optional(value) : std::nullopt; }

void check_format(const config::Loaded& loaded) {
  const std::vector<std::string_view> names =
      is_libcamera(loaded.configuration.camera) ? capture::libcamera::format_names() : capture::v4l2::format_names();
  const std::string& wanted = loaded.configuration.camera.format;
  if (std::find(names.begin(), names.end(), wanted) != names.end()) return;
  std::string all;
  for (const std::string_view name : names) all += (all.empty() ? "" : ", ") + std::string(name);
  throw config::error_at(loaded.origins, "camera.format", "\"" + wanted + "\" is no format: want one of " + all);
}

std::string line_of(Side side, const capture::CameraInfo& info) {
  return std::string(side == Side::kLeft ? "left" : "right") + " camera: " + info.name + ", " + info.model + ": " +
         capture::delivery_text(info) +
         formatted(" at %.1f frames/s", 1.0 / std::chrono::duration<double>(info.period).count());
}

}  // namespace

capture::CameraSettings camera_settings(const config::CameraConfig& camera, Side side) {
  capture::CameraSettings settings;
  settings.device = (side == Side::kLeft ? camera.left : camera.right).device;
  settings.width = camera.width;
  settings.height = camera.height;
  settings.format = camera.format;
  settings.fps = camera.fps;
  settings.buffers = camera.buffers;
  settings.exposure_us = set_by_user(camera.exposure_us);
  settings.gain = set_by_user(camera.gain);
  settings.readout_us = set_by_user(camera.readout_us);
  return settings;
}

capture::v4l2::Settings v4l2_settings(const config::CameraConfig& camera, Side side) {
  capture::v4l2::Settings settings;
  static_cast<capture::CameraSettings&>(settings) = camera_settings(camera, side);
  settings.sensor = (side == Side::kLeft ? camera.left : camera.right).sensor;
  settings.heap = camera.heap;
  if (camera.memory == config::CameraMemory::kDmabuf) {
    settings.memory = camera.heap.empty() ? capture::v4l2::Memory::kExported : capture::v4l2::Memory::kImported;
  }
  if (camera.black_level >= 0) settings.black_level = camera.black_level;
  settings.control_delay_frames = camera.control_delay_frames;
  return settings;
}

capture::StereoCameras::Config pairing_config(const config::Configuration& configuration) {
  const config::CameraConfig& camera = configuration.camera;
  const config::TriggerConfig& trigger = configuration.trigger;
  capture::StereoCameras::Config pairing;
  pairing.name = source_name(camera);
  pairing.stereo = !camera.right.device.empty();
  pairing.side_by_side = camera.side_by_side;
  pairing.tolerance = camera.tolerance;
  pairing.timeout = config::from_ms(camera.timeout_ms);
  pairing.exposure = config::from_ms(camera.exposure_us * 1e-3);
  pairing.steer = camera.steer;
  if (trigger.mode == config::TriggerMode::kFreeRun) return pairing;
  // The sensors could do another rate; they get this one.
  pairing.triggered = true;
  pairing.period = trigger_period(configuration);
  pairing.pulse_delay = config::from_ms(trigger.delay_us * 1e-3);
  return pairing;
}

capture::StereoCameras::Open camera_opener(const config::CameraConfig& camera,
                                           std::function<void(const std::string&)> say, MissingReadout missing) {
  return [camera, say = std::move(say), missing](Side side) {
    std::vector<std::string> notes;
    std::unique_ptr<capture::Camera> opened;
    if (is_libcamera(camera)) {
      opened = capture::libcamera::open(camera_settings(camera, side), &notes);
    } else {
      capture::v4l2::Settings settings = v4l2_settings(camera, side);
      settings.guesses_readout = missing == MissingReadout::kGuessed;
      opened = capture::v4l2::open(settings, &notes);
    }
    for (const std::string& note : notes) say(note);
    return opened;
  };
}

std::unique_ptr<capture::StereoCameras> open_cameras(const config::Loaded& loaded,
                                                     std::function<void(const std::string&)> say,
                                                     std::unique_ptr<trigger::Trigger> trigger) {
  check_format(loaded);
  return std::make_unique<capture::StereoCameras>(camera_opener(loaded.configuration.camera, std::move(say)),
                                                  pairing_config(loaded.configuration), std::move(trigger));
}

CameraCheck check_cameras(const config::Loaded& loaded) {
  check_format(loaded);
  const config::CameraConfig& camera = loaded.configuration.camera;
  CameraCheck check;
  const auto open = camera_opener(camera, [&check](const std::string& note) { check.notes.push_back(note); });
  std::optional<capture::CameraInfo> first;
  std::vector<std::unique_ptr<capture::Camera>> opened;  // together, as in a run: they may share a bus
  for (const Side side : {Side::kLeft, Side::kRight}) {
    if (side == Side::kRight && camera.right.device.empty()) continue;
    try {
      opened.push_back(open(side));
      const capture::CameraInfo& info = opened.back()->info();
      check.lines.push_back(line_of(side, info));
      if (!first) first = info;
      const std::string differs = capture::difference_of(info, *first);
      if (!differs.empty()) check.failures.push_back(differs);
    } catch (const std::runtime_error& error) {
      check.failures.emplace_back(error.what());
    }
  }
  if (!first) return check;
  const capture::StereoCameras::Config pairing = pairing_config(loaded.configuration);
  if (std::string wrong = capture::split_refusal(pairing, *first); !wrong.empty()) {
    check.failures.push_back(std::move(wrong));
  }
  check.info = capture::source_info(pairing, *first);
  return check;
}

}  // namespace stereotrack
