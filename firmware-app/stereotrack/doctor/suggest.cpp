#include "firmware-app/stereotrack/doctor/suggest.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "config/error.hpp"
#include "config/key.hpp"
#include "config/load.hpp"
#include "drivers/capture/libcamera/libcamera.hpp"
#include "firmware-app/formatted.hpp"
#include "firmware-app/stereotrack/doctor/words.hpp"

namespace stereotrack::doctor {

namespace {

using capture::v4l2::CameraFacts;
using Size = CameraFacts::Size;

struct Resolution {
  int width = 0;
  int height = 0;
  [[nodiscard]] std::int64_t area() const { return std::int64_t{width} * height; }
};

const Size* find_size(const CameraFacts& camera, std::string_view format, const Resolution& wanted) {
  for (const CameraFacts::Format& each : camera.formats) {
    if (each.name != format) continue;
    for (const Size& size : each.sizes) {
      if (size.includes(wanted.width, wanted.height)) return &size;
    }
  }
  return nullptr;
}

/// As wanted, where it may be; of a range only the ends are told.
double rate_of(const std::vector<double>& rates, double wanted) {
  if (rates.empty()) return wanted;
  const auto [lowest, highest] = std::minmax_element(rates.begin(), rates.end());
  const bool is_range = rates.size() == 2 && *highest > 4 * *lowest;
  if (is_range) return std::clamp(wanted, *lowest, *highest);
  double best = *lowest;
  for (const double rate : rates) {
    if (rate <= wanted * 1.001) best = std::max(best, rate);
  }
  return best;
}

struct Delivery {
  std::string format;
  Resolution size;
  double fps = 0;
};

/// What all of these cameras can deliver, nearest to what is wanted; none: they have nothing in common.
std::optional<Delivery> common(const std::vector<const CameraFacts*>& cameras,
                               const std::vector<std::string_view>& formats, const config::CameraConfig& wanted) {
  const Resolution asked{wanted.width, wanted.height};
  std::vector<Resolution> sizes{asked};
  for (const CameraFacts::Format& format : cameras.front()->formats) {
    if (format.name.empty()) continue;
    for (const Size& size : format.sizes) {
      sizes.push_back({size.max_width, size.max_height});
      sizes.push_back({size.width, size.height});
    }
  }
  // The one that is asked for; those below it, the largest first; the others, the smallest first.
  std::stable_sort(sizes.begin() + 1, sizes.end(), [&asked](const Resolution& a, const Resolution& b) {
    const bool a_fits = a.area() <= asked.area();
    const bool b_fits = b.area() <= asked.area();
    if (a_fits != b_fits) return a_fits;
    return a_fits ? a.area() > b.area() : a.area() < b.area();
  });
  for (const Resolution& size : sizes) {
    for (const std::string_view format : formats) {
      double fps = wanted.fps;
      const bool all = std::all_of(cameras.begin(), cameras.end(), [&](const CameraFacts* camera) {
        const Size* const found = find_size(*camera, format, size);
        if (found != nullptr) fps = std::min(fps, rate_of(found->rates, fps));
        return found != nullptr;
      });
      // What the configuration's own range does not take is no use.
      if (all && size.width >= 16 && size.height >= 16 && size.width <= 8192 && size.height <= 8192 && fps >= 0.1) {
        return Delivery{std::string(format), size, fps};
      }
    }
  }
  return std::nullopt;
}

std::string path_link(const CameraFacts& camera) {
  for (const std::string& link : camera.links) {
    if (link.find("/by-path/") != std::string::npos) return link;
  }
  return {};
}

/// Names that stay, by the places where they are plugged in. The link of one alone is no such name: two nodes of one
/// place ask udev for the same, and who gets it may change.
std::vector<std::string> lasting_names(const std::vector<const CameraFacts*>& cameras,
                                       const std::vector<const CameraFacts*>& all) {
  std::vector<std::string> names;
  names.reserve(cameras.size());
  for (const CameraFacts* const camera : cameras) names.push_back(path_link(*camera));
  if (std::none_of(names.begin(), names.end(), [](const std::string& name) { return name.empty(); })) return names;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const std::string& bus = cameras[i]->bus;
    const auto same = std::count_if(all.begin(), all.end(), [&bus](const CameraFacts* c) { return c->bus == bus; });
    names[i] = same == 1 && !bus.empty() ? "bus:" + bus : cameras[i]->path;
  }
  return names;
}

void apply(const Delivery& delivery, config::CameraConfig& camera) {
  camera.format = delivery.format;
  camera.width = delivery.size.width;
  camera.height = delivery.size.height;
  camera.fps = delivery.fps;
}

/// With a point, as the configuration wants numbers.
std::string number_text(double value) {
  std::string text = formatted("%.6g", value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

/// What drivers and boards call themselves must not end a comment.
std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char letter) { return letter < 0x20 || letter == 0x7F; }, ' ');
  return text;
}

std::string comment_of(const Findings& f, const std::string& side) {
  for (const CaptureMeasure& camera : f.capture) {
    if (camera.side != side) continue;
    return one_line(
               "# " + camera.name + ": " + camera.delivers +
               (camera.failure.empty() ? ", arrives " + us_text(camera.delay.p50_us) + " after its exposure" : "")) +
           "\n";
  }
  return {};
}

bool choose_of(const std::vector<CameraFound>& cameras, config::CameraDriver driver, bool two,
               config::CameraConfig& chosen) {
  const bool of_kernel = driver == config::CameraDriver::kV4l2;
  std::vector<const CameraFacts*> all;
  for (const CameraFound& camera : cameras) {
    if (camera.driver == driver && camera.facts.problem.empty()) all.push_back(&camera.facts);
  }
  const auto names_of = [&](const std::vector<const CameraFacts*>& chosen_ones) {
    if (of_kernel) return lasting_names(chosen_ones, all);
    std::vector<std::string> ids;
    ids.reserve(chosen_ones.size());
    for (const CameraFacts* const camera : chosen_ones) ids.push_back(camera->path);
    return ids;
  };
  const std::vector<std::string_view> formats =
      of_kernel ? capture::v4l2::format_names() : capture::libcamera::format_names();
  // Two of one kind first, then two of one driver. The kernel's nodes on one bus are one camera's.
  for (const bool alike : {true, false}) {
    if (!two) break;
    for (std::size_t i = 0; i < all.size(); ++i) {
      for (std::size_t j = i + 1; j < all.size(); ++j) {
        const CameraFacts& left = *all[i];
        const CameraFacts& right = *all[j];
        if (left.driver != right.driver || (of_kernel && left.bus == right.bus) || (alike && left.card != right.card))
          continue;
        const auto delivery = common({&left, &right}, formats, chosen);
        if (!delivery) continue;
        apply(*delivery, chosen);
        const std::vector<std::string> names = names_of({&left, &right});
        chosen.left.device = names[0];
        chosen.right.device = names[1];
        return true;
      }
    }
  }
  for (const CameraFacts* const camera : two ? std::vector<const CameraFacts*>() : all) {
    const auto delivery = common({camera}, formats, chosen);
    if (!delivery) continue;
    apply(*delivery, chosen);
    chosen.left.device = names_of({camera}).front();
    chosen.right.device.clear();
    return true;
  }
  return false;
}

}  // namespace

bool choose_cameras(const std::vector<CameraFound>& cameras, config::Configuration& configuration) {
  configuration.source.name = "cameras";
  for (const bool two : {true, false}) {
    for (const auto driver : {config::CameraDriver::kV4l2, config::CameraDriver::kLibcamera}) {
      configuration.camera.driver = driver;
      if (choose_of(cameras, driver, two, configuration.camera)) return true;
    }
  }
  configuration.camera.driver = config::CameraDriver::kV4l2;
  return false;
}

std::string suggest(const Findings& f, const std::optional<std::string>& calibration) {
  const config::CameraConfig& camera = f.configuration.camera;
  const bool has_two = !camera.right.device.empty();
  const bool stereo = has_two && calibration.has_value();
  std::string text = "# Suggested by stereotrack doctor for " + one_line(joined({f.host, f.kernel.board}, ", ")) +
                     ".\n# All keys: config/stereotrack.sample.toml.\n\n[source]\nname = \"cameras\"\n\n[camera]\n";
  if (camera.driver != config::CameraDriver::kV4l2) {
    text += "driver = " + config::quoted(driver_name(camera.driver)) + "\n";
  }
  text += comment_of(f, "left");
  text += "left.device = " + config::quoted(camera.left.device) + "\n";
  if (has_two) {
    text += comment_of(f, "right");
    if (!stereo)
      text += "# Two views need their calibration: take the # away here and at [calibration] once you have it.\n#";
    text += "right.device = " + config::quoted(camera.right.device) + "\n";
  }
  text += "width = " + std::to_string(camera.width) + "\nheight = " + std::to_string(camera.height) +
          "\nformat = " + config::quoted(camera.format) + "\nfps = " + number_text(camera.fps) + "\n";
  std::optional<double> readout_us;
  for (const CaptureMeasure& measure : f.capture) {
    readout_us = std::max(readout_us, suggested_readout_us(measure));  // none is less than any
  }
  if (readout_us) {
    text +=
        "# The driver does not tell it, or less than frames take. This much fits what was measured; the sensor's data\n"
        "# sheet knows better.\nreadout_us = " +
        number_text(std::min(std::ceil(*readout_us), 1e7)) + "\n";
  }
  if (has_two && f.pair) {
    // Two that nobody synchronises may stand together by chance, and elsewhere at the next start.
    const double phase_ms = std::abs(f.pair->phase_ms.value_or(0));
    const std::string now = formatted("%.2f ms apart now", phase_ms);
    if (!f.pair->drift_ppm) {
      text += "# " + now + "; too short a time to see whether anything synchronises them.\ntolerance = 0.5\n";
    } else if (std::abs(*f.pair->drift_ppm) > 2 || phase_ms > camera.skew_limit_ms) {
      text += "# Nobody synchronises them: " + now + ".\ntolerance = 0.5\n";
    }
  }
  if (f.latency) {
    const LatencyVerdict& v = *f.latency;
    text += "\n[latency]\n# " +
            formatted("Measured: arrival %.1f%s, compute %.1f and a quarter of it, wake-ups %.2f, lead %.1f ms.",
                      v.arrival_ms, v.arrival_is_assumed ? " (assumed)" : "", v.compute_ms, v.wake_ms, v.lead_ms) +
            "\noutput_ms = " + number_text(std::clamp(v.achievable_ms, 1.0, 10'000.0)) + "\n";
  }
  if (has_two) {
    const std::string mark = stereo ? "" : "#";
    text += "\n" + mark + "[calibration]\n" + mark +
            "file = " + config::quoted(calibration.value_or("calibration.yml")) + "\n";
  }
  const std::vector<config::Layer> layers{config::text_layer("the suggested configuration", text)};
  (void)config::load(layers);
  return text;
}

void write_new_file(const std::filesystem::path& path, const std::string& text) {
  const auto refuse = [&path](const std::string& why) { throw config::Error(path.string() + ": " + why); };
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (file < 0 && errno == EEXIST) refuse("is there already and stays as it is: give --write another name, or move it");
  if (file < 0) refuse(std::string("cannot be made: ") + std::strerror(errno));
  std::size_t done = 0;
  int error = 0;
  while (done < text.size() && error == 0) {
    const ssize_t wrote = ::write(file, text.data() + done, text.size() - done);
    if (wrote >= 0) {
      done += static_cast<std::size_t>(wrote);
    } else if (errno != EINTR) {
      error = errno;
    }
  }
  if (error == 0 && ::fsync(file) != 0 && errno != EINVAL) error = errno;  // EINVAL: a pipe and its like
  if (::close(file) != 0 && error == 0) error = errno;
  if (error == 0) return;
  (void)::unlink(path.c_str());
  refuse(std::string("cannot be written: ") + std::strerror(error));
}

}  // namespace stereotrack::doctor
