#include "firmware-app/stereotrack/doctor/words.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string_view>

#include "firmware-app/formatted.hpp"

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

std::optional<double> suggested_readout_us(const CaptureMeasure& measure) {
  const bool comes_early = measure.delay.count > 0 && measure.delay_min_us < 0;
  if (!comes_early && !measure.readout_is_guessed) return std::nullopt;
  const double in_force_us = measure.readout_us.value_or(0);
  return comes_early ? in_force_us - measure.delay_min_us + 100 : in_force_us;
}

}  // namespace stereotrack::doctor
