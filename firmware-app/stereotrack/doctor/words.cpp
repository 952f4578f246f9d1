#include "firmware-app/stereotrack/doctor/words.hpp"
#include "firmware-app/formatted.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string_view>

namespace stereotrack::doctor {

namespace {

using capture::v4l2::CameraFacts;

constexpr std::size_t kMostFormats = 5;

/// The fastest rate of a size; 0: not told.
double fastest(const CameraFacts::Size& size) {
  return size.rates.empty() ? 0 : *std::max_element(size.rates.begin(), size.rates.end());
}

}  // namespace

std::string joined(const std::vector<std::string>& words, const std::string& between) {
  std::string all;
  for (const std::string& word : words) {
    if (!word.empty()) all += (all.empty() ? "" : between) + word;
  }
  return all;
}

std::string count_text(int count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

std::string us_text(double us) {
  if (std::abs(us) < 1000) return formatted("%.0f us", us);
  return formatted(std::abs(us) < 10'000 ? "%.2f ms" : "%.1f ms", us * 1e-3);
}

const char* driver_name(config::CameraDriver driver) noexcept {
  switch (driver) {
    case config::CameraDriver::kLibcamera: return "libcamera";
    case config::CameraDriver::kV4l2: break;
  }
  return "v4l2";
}

std::string formats_text(const CameraFacts& camera) {
  std::vector<std::string> names;
  const CameraFacts::Size* largest = nullptr;
  for (const CameraFacts::Format& format : camera.formats) {
    if (format.name.empty() || format.sizes.empty()) continue;
    names.emplace_back(format.name);
    for (const CameraFacts::Size& size : format.sizes) {
      if (largest == nullptr || size.max_width * size.max_height > largest->max_width * largest->max_height)
        largest = &size;
    }
  }
  if (largest == nullptr) return {};
  const std::size_t all = names.size();
  if (all > kMostFormats) names.resize(kMostFormats);
  std::string text = joined(names, " ") + (all > kMostFormats ? " ..." : "") +
                     formatted(" to %dx%d", largest->max_width, largest->max_height);
  if (fastest(*largest) > 0) text += formatted(" at %.4g/s", fastest(*largest));
  return text;
}

std::string controls_text(const CameraFacts& camera) {
  std::vector<std::string> found;
  for (const char* const wanted : {"exposure", "gain", "trigger", "sync"}) {
    const auto has_it = [wanted](const CameraFacts::Control& control) {
      std::string name = control.name;
      std::transform(name.begin(), name.end(), name.begin(),
                     [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
      return name.find(wanted) != std::string::npos;
    };
    if (std::any_of(camera.controls.begin(), camera.controls.end(), has_it)) found.emplace_back(wanted);
  }
  return found.empty() ? "" : "; " + joined(found, " ");
}

double suggested_readout_us(const Findings& findings, const CaptureMeasure& measure) {
  const config::CameraConfig& camera = findings.configuration.camera;
  double in_force_us = camera.readout_us;
  if (in_force_us <= 0) {
    in_force_us = measure.period_ms * 1e3;
    for (const CameraFound& found : findings.found.cameras) {
      for (const CameraFacts::Format& format : found.facts.formats) {
        for (const CameraFacts::Size& size : format.sizes) {
          const bool is_it =
              measure.name.find(found.facts.path) != std::string::npos && size.includes(camera.width, camera.height);
          if (is_it && fastest(size) > 0) in_force_us = std::min(in_force_us, 1e6 / fastest(size));
        }
      }
    }
  }
  return in_force_us + std::max(0.0, -measure.delay_min_us) + 100;
}

}  // namespace stereotrack::doctor
