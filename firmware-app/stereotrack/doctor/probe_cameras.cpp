#include <utility>

#include "drivers/capture/libcamera/libcamera.hpp"
#include "firmware-app/stereotrack/doctor/probe.hpp"

namespace stereotrack::doctor {

namespace {

using capture::v4l2::CameraFacts;

CameraFound of_libcamera(const capture::libcamera::CameraFacts& facts) {
  CameraFound found;
  found.driver = config::CameraDriver::kLibcamera;
  found.facts.path = facts.id;
  found.facts.card = facts.model;
  found.facts.bus = facts.location;
  found.facts.driver = "libcamera";
  std::vector<double> rates;
  if (facts.fps) rates = {facts.fps->most, facts.fps->least};
  for (const auto& format : facts.formats) {
    CameraFacts::Format& row = found.facts.formats.emplace_back();
    row.fourcc = format.fourcc;
    row.name = format.name;
    for (const auto& size : format.sizes) {
      row.sizes.push_back({size.width, size.height, size.max_width, size.max_height, rates});
    }
  }
  const auto add = [&found](const char* name, const std::optional<capture::libcamera::CameraFacts::Range>& range) {
    if (!range) return;
    CameraFacts::Control& control = found.facts.controls.emplace_back();
    control.name = name;
    control.minimum = static_cast<std::int64_t>(range->least);
    control.maximum = static_cast<std::int64_t>(range->most);
  };
  add("exposure_us", facts.exposure_us);
  add("gain", facts.gain);
  return found;
}

}  // namespace

CamerasFound probe_cameras() {
  CamerasFound found;
  for (CameraFacts& facts : capture::v4l2::list_cameras()) {
    found.cameras.push_back({config::CameraDriver::kV4l2, std::move(facts)});
  }
  const capture::libcamera::Listing listing = capture::libcamera::list_cameras();
  for (const auto& facts : listing.cameras) found.cameras.push_back(of_libcamera(facts));
  found.libcamera = listing.module;
  found.libcamera_problems = listing.problems;
  return found;
}

}  // namespace stereotrack::doctor
