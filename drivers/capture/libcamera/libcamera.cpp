#include "drivers/capture/libcamera/libcamera.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <stdexcept>
#include <utility>

#include "drivers/capture/libcamera/formats.hpp"
#include "drivers/capture/libcamera/loader.hpp"
#include "drivers/capture/libcamera/stream.hpp"
#include "drivers/capture/pixel_format_names.hpp"

namespace stereotrack::capture::libcamera {
namespace {

using std::chrono::nanoseconds;

std::string number_text(double number) {
  char text[32];
  (void)std::snprintf(text, sizeof text, "%.4g", number);
  return text;
}

std::string size_text(int width, int height) { return std::to_string(width) + 'x' + std::to_string(height); }

nanoseconds read_clock(clockid_t clock) {
  timespec now{};
  (void)::clock_gettime(clock, &now);
  return std::chrono::seconds(now.tv_sec) + nanoseconds(now.tv_nsec);
}

/// What this board has slept. Read on both sides of the other clock: a moment between costs half of its length.
nanoseconds boottime_ahead() {
  const nanoseconds before = read_clock(CLOCK_MONOTONIC);
  const nanoseconds boottime = read_clock(CLOCK_BOOTTIME);
  const nanoseconds after = read_clock(CLOCK_MONOTONIC);
  return boottime - (before + (after - before) / 2);
}

/// `complaint`: Session's.
std::string cameras_text(const std::vector<LibcameraFacts>& cameras, const std::string& complaint) {
  const std::string complains = complaint.empty() ? "" : ", and complains of \"" + complaint + '"';
  if (cameras.empty()) {
    return "it knows none" + complains +
           ": is one connected, and no other program looking for cameras? That makes them busy";
  }
  std::string text = "it knows ";
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    text += (i == 0 ? "" : ", ") + std::to_string(i) + ": " + static_cast<const char*>(cameras[i].id) + " (" +
            static_cast<const char*>(cameras[i].model) + ')';
  }
  return text + complains;
}

/// Its place.
std::uint32_t find_camera(const Session& session, const std::vector<LibcameraFacts>& cameras,
                          const std::string& device) {
  const auto known = [&] { return cameras_text(cameras, session.complaint()); };
  const auto count = static_cast<std::uint32_t>(cameras.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    if (device == static_cast<const char*>(cameras[i].id)) return i;
  }
  const bool is_place = !device.empty() && device.size() < 4 &&
                        std::all_of(device.begin(), device.end(), [](char c) { return c >= '0' && c <= '9'; });
  if (is_place) {
    if (const unsigned long place = std::strtoul(device.c_str(), nullptr, 10); place < count) {
      return static_cast<std::uint32_t>(place);
    }
    refuse(device, "libcamera has no camera of that place; " + known());
  }
  std::vector<std::uint32_t> found;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::string id = static_cast<const char*>(cameras[i].id);
    const std::string model = static_cast<const char*>(cameras[i].model);
    if (id.find(device) != std::string::npos || model.find(device) != std::string::npos) found.push_back(i);
  }
  if (found.empty()) refuse(device, "libcamera has none of that name; " + known());
  if (found.size() > 1) {
    refuse(device, "libcamera has several of that name: want an id, or a place; " + known());
  }
  return found.front();
}

bool has_size(const LibcameraFormat& format, int width, int height) {
  return width == 0 || (width >= format.least_width && width <= format.most_width && height >= format.least_height &&
                        height <= format.most_height);
}

std::string sizes_text(const std::vector<LibcameraFormat>& offered, const KnownFormat& known) {
  std::string text;
  for (const LibcameraFormat& each : offered) {
    if (each.fourcc != known.fourcc || each.modifier != known.modifier) continue;
    text += (text.empty() ? "" : ", ") + size_text(each.least_width, each.least_height);
    if (each.most_width != each.least_width || each.most_height != each.least_height) {
      text += " to " + size_text(each.most_width, each.most_height);
    }
  }
  return text;
}

struct Choice {
  const KnownFormat* known = nullptr;
  bool is_raw = false;
};

/// Refuses where the camera does not offer the format.
Choice choose_format(const std::vector<LibcameraFormat>& offered, const Settings& settings, const std::string& name) {
  const auto find = [&](const KnownFormat& known, bool of_that_size) {
    return std::find_if(offered.begin(), offered.end(), [&](const LibcameraFormat& each) {
      return each.fourcc == known.fourcc && each.modifier == known.modifier &&
             (!of_that_size || has_size(each, settings.width, settings.height));
    });
  };
  const KnownFormat* const wanted = settings.format == "auto" ? nullptr : find_format(settings.format);
  if (wanted == nullptr && settings.format != "auto") refuse(name, "there is no format " + settings.format);
  for (const bool of_that_size : {true, false}) {
    for (const KnownFormat& known : known_formats()) {
      if (wanted != nullptr && &known != wanted) continue;
      const auto found = find(known, of_that_size);
      if (found != offered.end()) return {&known, found->is_raw != 0};
    }
  }
  std::string all;
  for (const LibcameraFormat& each : offered) {
    const KnownFormat* const known = find_format(each.fourcc, each.modifier);
    const std::string text =
        known != nullptr ? std::string(known->name) : format_text(each.fourcc, each.modifier) + " (of no use)";
    if (all.find(text) == std::string::npos) all += (all.empty() ? "" : ", ") + text;
  }
  refuse(name, (settings.format == "auto" ? "has no format that can be used" : "has no format " + settings.format) +
                   "; it has " + (all.empty() ? "none" : all));
}

nanoseconds choose_period(const LibcameraSetup& setup, const Settings& settings, const std::string& name,
                          std::vector<std::string>& notes) {
  const auto rate = [](nanoseconds period) { return number_text(1 / std::chrono::duration<double>(period).count()); };
  if (setup.duration > 0) {
    const nanoseconds period(setup.duration);
    if (settings.fps > 0 && std::abs(1e9 / settings.fps - static_cast<double>(setup.duration)) > 1e7 / settings.fps) {
      notes.push_back("delivers " + rate(period) + " frames/s, not " + number_text(settings.fps) +
                      ": it can do no other rate nearer to that");
    }
    return period;
  }
  if (settings.fps <= 0) refuse(name, "libcamera does not tell its frame rate: set it (fps)");
  notes.push_back("libcamera cannot hold it to a frame rate: it is taken to deliver " + number_text(settings.fps) +
                  " frames/s, as is configured");
  return nanoseconds(std::llround(1e9 / settings.fps));
}

void tell_controls(const LibcameraSetup& setup, const Settings& settings, std::vector<std::string>& notes) {
  const auto tell = [&](const char* what, std::optional<double> wanted, double got, const std::string& unit) {
    if (!wanted) return;
    if (got <= 0) {
      notes.push_back(std::string(what) + " cannot be set: it stays automatic");
    } else if (std::abs(got - *wanted) > 0.01 * *wanted) {
      notes.push_back(std::string(what) + " is " + number_text(got) + unit + ", not " + number_text(*wanted) + unit +
                      ": its limits");
    }
  };
  tell("exposure", settings.exposure_us, static_cast<double>(setup.exposure) / 1000, " us");
  tell("gain", settings.gain, setup.gain, "");
}

std::unique_ptr<Camera> open_in(std::shared_ptr<Session> session, const Settings& settings,
                                std::vector<std::string>* notes) {
  Stream::Parts parts;
  parts.session = std::move(session);
  const LibcameraModule& module = parts.session->module();
  const std::vector<LibcameraFacts> cameras = parts.session->cameras();
  const std::uint32_t place = find_camera(*parts.session, cameras, settings.device);
  const LibcameraFacts& facts = cameras[place];
  const std::string id = static_cast<const char*>(facts.id);
  const std::string name = settings.device == id ? id : settings.device + " (" + id + ")";

  if (facts.is_gone != 0) refuse(name, "is not connected any more: check its plug and power");
  const std::vector<LibcameraFormat> offered = parts.session->formats(place);
  const Choice choice = choose_format(offered, settings, name);
  const KnownFormat& known = *choice.known;
  LibcameraWish wish{};
  wish.fourcc = known.fourcc;
  wish.modifier = known.modifier;
  wish.is_raw = choice.is_raw ? 1 : 0;
  wish.width = settings.width;
  wish.height = settings.height;
  wish.buffers = static_cast<std::uint32_t>(std::clamp(settings.buffers, 1, int{kLibcameraMostBuffers}));
  if (settings.fps > 0) wish.duration = std::llround(1e9 / settings.fps);
  if (settings.exposure_us) wish.exposure = from_us(*settings.exposure_us).count();
  if (settings.gain) wish.gain = static_cast<float>(*settings.gain);

  char why[kLibcameraTextSize] = "";
  LibcameraStream* opened = nullptr;
  const int outcome =
      module.open(parts.session->manager(), place, &wish, &parts.setup, &opened, static_cast<char*>(why));
  const LibcameraSetup& setup = parts.setup;
  if (outcome == kLibcameraAdjusted) {
    const KnownFormat* const became = find_format(setup.fourcc, setup.modifier);
    refuse(name, "cannot deliver " + size_text(settings.width, settings.height) + ' ' + std::string(known.name) +
                     ", libcamera would make " + size_text(setup.width, setup.height) + ' ' +
                     (became != nullptr ? std::string(became->name) : format_text(setup.fourcc, setup.modifier)) +
                     " of it; it offers " + sizes_text(offered, known));
  }
  if (outcome != kLibcameraOpened || opened == nullptr) refuse(name, static_cast<const char*>(why));
  parts.stream = {opened, StreamCloser{&module}};
  if (!fits_format(known.format, setup.width, setup.height)) {
    refuse(name, size_text(setup.width, setup.height) + " is no size for " + std::string(known.name));
  }
  if (setup.buffers < 2 || setup.buffers > kLibcameraMostBuffers) {
    refuse(name, "libcamera gives it " + std::to_string(setup.buffers) + " buffers: two at least are needed");
  }

  std::vector<std::string> told;
  parts.info.name = name;
  parts.info.model = std::string(static_cast<const char*>(facts.model)) + ", libcamera " + module.library();
  parts.info.width = setup.width;
  parts.info.height = setup.height;
  parts.info.format = known.format;
  parts.info.period = choose_period(setup, settings, name, told);
  parts.info.buffers = setup.buffers;
  tell_controls(setup, settings, told);
  if (setup.buffers < wish.buffers) {
    told.push_back("libcamera gives it " + std::to_string(setup.buffers) + " buffers, not " +
                   std::to_string(wish.buffers) + ": frames are lost where the pipeline is late");
  }
  // Sensors are as fast as they can be read.
  parts.readout = settings.readout_us        ? from_us(*settings.readout_us)
                  : facts.duration_least > 0 ? std::min(parts.info.period, nanoseconds(facts.duration_least))
                                             : parts.info.period;
  parts.boottime_ahead = boottime_ahead();
  auto stream = std::make_unique<Stream>(std::move(parts));
  if (notes != nullptr) {
    for (const std::string& note : told) notes->push_back("camera " + name + ": " + note);
  }
  return stream;
}

}  // namespace

std::unique_ptr<Camera> open(const Settings& settings, std::vector<std::string>* notes) {
  std::vector<std::string> problems;
  const std::shared_ptr<Session> session = Session::get(problems);
  if (!session) {
    std::string all;
    for (const std::string& problem : problems) all += (all.empty() ? "" : "; ") + problem;
    refuse(settings.device, all);
  }
  try {
    return open_in(session, settings, notes);
  } catch (const std::runtime_error& error) {
    // Its manager looks once. Whoever has the other cameras closes them when they are lost, and opens them again.
    if (session->module().renew(session->manager()) == 0) throw;
    throw std::runtime_error(std::string(error.what()) +
                             "; devices were plugged in meanwhile: libcamera looks for them once none is open");
  }
}

Listing list_cameras() {
  Listing listing;
  const std::shared_ptr<Session> session = Session::get(listing.problems);
  if (!session) return listing;
  listing.module = session->module_text();
  listing.problems = session->problems();
  const std::vector<LibcameraFacts> cameras = session->cameras();
  if (cameras.empty()) listing.problems.push_back("libcamera: " + cameras_text(cameras, session->complaint()));
  for (std::uint32_t i = 0; i < cameras.size(); ++i) {
    const LibcameraFacts& facts = cameras[i];
    if (facts.is_gone != 0) continue;
    CameraFacts& camera = listing.cameras.emplace_back();
    camera.id = static_cast<const char*>(facts.id);
    camera.model = static_cast<const char*>(facts.model);
    camera.location = static_cast<const char*>(facts.location);
    for (const LibcameraFormat& offered : session->formats(i)) {
      const std::string fourcc = format_text(offered.fourcc, offered.modifier);
      if (camera.formats.empty() || camera.formats.back().fourcc != fourcc) {
        const KnownFormat* const known = find_format(offered.fourcc, offered.modifier);
        camera.formats.push_back({fourcc, known != nullptr ? known->name : std::string_view(), {}});
      }
      camera.formats.back().sizes.push_back(
          {offered.least_width, offered.least_height, offered.most_width, offered.most_height});
    }
    const auto us = [](std::int64_t time) { return static_cast<double>(time) / 1000; };
    if (facts.exposure_most > 0) camera.exposure_us = {us(facts.exposure_least), us(facts.exposure_most)};
    if (facts.gain_most > 0) camera.gain = {facts.gain_least, facts.gain_most};
    if (facts.duration_most > 0 && facts.duration_least > 0) {
      camera.fps = {1e6 / us(facts.duration_most), 1e6 / us(facts.duration_least)};
    }
  }
  return listing;
}

}  // namespace stereotrack::capture::libcamera
