#include "config/rules.hpp"

#include <algorithm>

#include "config/schema.hpp"
#include "config/signals.hpp"
#include "pipeline/effort.hpp"

namespace stereotrack::config {
namespace {

std::string destinations_differ(const Configuration& c) {
  std::vector<std::string> sorted = c.telemetry.destinations;
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice == sorted.end()) return {};
  return quoted(*twice) +
         " stands there twice, its receiver would take every second datagram for a replay: name it once";
}

std::string seeds_over_candidates(const Configuration& c) {
  if (c.pipeline.foreground.high_sd >= c.pipeline.foreground.low_sd) return {};
  return "low_sd is above high_sd, a seed must also be a candidate: give low_sd <= high_sd";
}

std::string level_set_has_iterations(const Configuration& c) {
  if (!c.pipeline.shape.level_set || c.pipeline.shape.level_set_config.max_iterations > 0) return {};
  return "the level set is on and may not iterate: give at least 1, or level_set.on = false";
}

std::string split_stays_split(const Configuration& c) {
  if (c.pipeline.objects.merge_depth <= c.pipeline.objects.split_depth) return {};
  return "merge_depth is above split_depth, what is split would be merged again: give merge_depth <= split_depth";
}

std::string efforts_are_known(const Configuration& c) {
  std::string known;
  for (std::size_t i = 0; i < kEfforts; ++i)
    known += (i == 0 ? "" : ", ") + std::string(to_string(static_cast<Effort>(i)));
  for (const std::string& name : c.shed.order) {
    const auto is_it = [&](std::size_t i) { return name == to_string(static_cast<Effort>(i)); };
    bool found = false;
    for (std::size_t i = 0; i < kEfforts; ++i) found = found || is_it(i);
    if (!found) return quoted(name) + " is no effort: there are " + known;
    if (std::count(c.shed.order.begin(), c.shed.order.end(), name) > 1) {
      return quoted(name) + " stands there twice: name each effort once";
    }
  }
  return {};
}

std::string shed_leaves_a_gap(const Configuration& c) {
  if (c.shed.below < c.shed.above) return {};
  return "shed.below is not under shed.above, efforts would come and go in turns: give below < above";
}

std::string decided_before_it_leaves(const Configuration& c) {
  if (c.latency.lead_ms < c.latency.output_ms) return {};
  return "lead_ms is not under output_ms, a result would be decided before its picture is taken: give lead_ms < "
         "output_ms";
}

bool has_cameras(const Configuration& c) { return c.source.name == "cameras"; }

std::string cameras_have_devices(const Configuration& c) {
  if (!has_cameras(c) || !c.camera.left.device.empty()) return {};
  return "source.name is \"cameras\", and no left one is named: give its device, for example \"/dev/video0\"";
}

std::string cameras_differ(const Configuration& c) {
  if (!has_cameras(c) || c.camera.right.device != c.camera.left.device) return {};
  return quoted(c.camera.right.device) + " is both cameras: give two devices, or leave the right one out for mono";
}

std::string one_camera_has_both_views(const Configuration& c) {
  if (!has_cameras(c) || !c.camera.side_by_side || c.camera.right.device.empty()) return {};
  return "the left camera has both views, " + quoted(c.camera.right.device) + " would be a third: leave it out";
}

std::string libcamera_connects_by_itself(const Configuration& c) {
  if (!has_cameras(c) || c.camera.driver != CameraDriver::kLibcamera) return {};
  if (c.camera.left.sensor.empty() && c.camera.right.sensor.empty()) return {};
  return "libcamera connects a camera's parts by itself: leave the sensor out, name it as the device";
}

std::string libcamera_has_no_black_level(const Configuration& c) {
  if (!has_cameras(c) || c.camera.driver != CameraDriver::kLibcamera || c.camera.black_level < 0) return {};
  return "libcamera sets the black level by itself: leave it out";
}

std::string exposure_fits_into_a_period(const Configuration& c) {
  if (c.camera.exposure_us * c.camera.fps < 1e6) return {};
  return "an exposure takes longer than there is time between two frames: shorten it, or lower camera.fps";
}

std::string heap_is_for_dmabufs(const Configuration& c) {
  if (c.camera.heap.empty() || c.camera.memory == CameraMemory::kDmabuf) return {};
  return "camera.heap gives dma-bufs, and camera.memory wants none: set it to \"dmabuf\", or leave the heap out";
}

bool has_trigger(const Configuration& c, TriggerMode mode) { return has_cameras(c) && c.trigger.mode == mode; }

std::string trigger_has_its_line(const Configuration& c) {
  const bool wanted = has_trigger(c, TriggerMode::kGpio) || has_trigger(c, TriggerMode::kExternal);
  if (!wanted || !c.trigger.line.empty()) return {};
  return "trigger.line is missing, gpio and external need it: give CHIP:LINE, for example \"gpiochip0:17\"";
}

std::string trigger_has_its_pwm(const Configuration& c) {
  if (!has_trigger(c, TriggerMode::kPwm) || !c.trigger.pwm_chip.empty()) return {};
  return "trigger.pwm_chip is missing, pwm needs it: give a chip of /sys/class/pwm, for example \"pwmchip0\"";
}

std::string trigger_line_is_nobody_elses(const Configuration& c) {
  if (!has_trigger(c, TriggerMode::kGpio) && !has_trigger(c, TriggerMode::kExternal)) return {};
  const auto has_it = [&](const auto& table) { return table.line == c.trigger.line; };
  const auto signal = std::find_if(c.signals.begin(), c.signals.end(), has_it);
  if (signal != c.signals.end())
    return quoted(c.trigger.line) + " is that of signal " + signal->name + ", too: give two";
  const auto input = std::find_if(c.inputs.begin(), c.inputs.end(), has_it);
  if (input != c.inputs.end()) return quoted(c.trigger.line) + " is that of input " + input->name + ", too: give two";
  return {};
}

std::string pulse_fits_into_a_period(const Configuration& c) {
  const bool ours = has_trigger(c, TriggerMode::kGpio) || has_trigger(c, TriggerMode::kPwm);
  const double late_us = c.trigger.mode == TriggerMode::kGpio ? c.trigger.late_us : 0;
  if (!ours || (c.trigger.pulse_us + late_us) * c.camera.fps < 1e6) return {};
  return late_us > 0 ? "a pulse that begins late_us late is not over when the next one is due: shorten one of them, or "
                       "lower camera.fps"
                     : "a pulse takes longer than there is time between two: shorten it, or lower camera.fps";
}

std::string sizes_leave_room(const Configuration& c) {
  const ZoneRules::Config& sizes = c.pipeline.zones;
  if (sizes.max_size_m == 0 || sizes.min_size_m <= sizes.max_size_m) return {};
  return "min_size_m is above max_size_m, no object has such a size: give min_size_m <= max_size_m";
}

/// Set by the user, not by a preset or a default.
bool said_by_user(const Loaded& loaded, std::string_view key) {
  const auto origin = loaded.origins.find(key);
  return origin != loaded.origins.end() && !origin->second.starts_with("config/presets/");
}

bool is_zero(const Value& value) {
  if (const auto* numbers = std::get_if<std::vector<double>>(&value)) {
    return std::all_of(numbers->begin(), numbers->end(), [](double number) { return number == 0; });
  }
  return std::get<double>(value) == 0;
}

}  // namespace

std::span<const Rule> rules() {
  static const std::vector<Rule> all = {
      {"telemetry_destinations_differ", {"telemetry.destinations"}, destinations_differ},
      {"seeds_over_candidates", {"foreground.low_sd", "foreground.high_sd"}, seeds_over_candidates},
      {"level_set_has_iterations", {"level_set.iterations", "level_set.on"}, level_set_has_iterations},
      {"efforts_are_known", {"shed.order"}, efforts_are_known},
      {"shed_leaves_a_gap", {"shed.below", "shed.above"}, shed_leaves_a_gap},
      {"decided_before_it_leaves", {"latency.lead_ms", "latency.output_ms"}, decided_before_it_leaves},
      {"cameras_have_devices", {"camera.left.device"}, cameras_have_devices},
      {"cameras_differ", {"camera.right.device", "camera.left.device"}, cameras_differ},
      {"one_camera_has_both_views", {"camera.right.device", "camera.side_by_side"}, one_camera_has_both_views},
      {"libcamera_connects_by_itself",
       {"camera.left.sensor", "camera.right.sensor", "camera.driver"},
       libcamera_connects_by_itself},
      {"libcamera_has_no_black_level", {"camera.black_level", "camera.driver"}, libcamera_has_no_black_level},
      {"exposure_fits_into_a_period", {"camera.exposure_us", "camera.fps"}, exposure_fits_into_a_period},
      {"heap_is_for_dmabufs", {"camera.heap", "camera.memory"}, heap_is_for_dmabufs},
      {"trigger_has_its_line", {"trigger.line", "trigger.mode"}, trigger_has_its_line},
      {"trigger_has_its_pwm", {"trigger.pwm_chip", "trigger.mode"}, trigger_has_its_pwm},
      {"trigger_line_is_nobody_elses", {"trigger.line"}, trigger_line_is_nobody_elses},
      {"pulse_fits_into_a_period", {"trigger.pulse_us", "trigger.late_us", "camera.fps"}, pulse_fits_into_a_period},
      {"sizes_leave_room", {"objects.min_size_m", "objects.max_size_m"}, sizes_leave_room},
      {"split_stays_split", {"objects.merge_depth", "objects.split_depth"}, split_stays_split},
  };
  return all;
}

void check_rules(const Loaded& loaded) {
  for (const Rule& rule : rules()) {
    std::string what = rule.broken(loaded.configuration);
    if (what.empty()) continue;
    const auto said = std::find_if(rule.keys.begin(), rule.keys.end(),
                                   [&](std::string_view key) { return said_by_user(loaded, key); });
    const std::string_view blamed = said == rule.keys.end() ? rule.keys.front() : *said;
    for (const std::string_view key : rule.keys) {
      if (key == blamed) continue;
      const auto origin = loaded.origins.find(key);
      what +=
          "; " + std::string(key) + " is from " + (origin == loaded.origins.end() ? "the defaults" : origin->second);
    }
    throw error_at(loaded.origins, blamed, what);
  }
  check_signals(loaded);
}

void check_metres(const Loaded& loaded, double unit_m) {
  Configuration copy = loaded.configuration;
  check_metres(keys_of(copy), loaded.origins, unit_m);
}

void check_metres(std::span<const Key> keys, const Origins& origins, double unit_m) {
  if (unit_m > 0) return;
  for (const Key& key : keys) {
    const std::size_t tables = key.kind == Kind::kTables ? static_cast<std::size_t>(std::get<double>(key.get())) : 0;
    for (std::size_t i = 0; i < tables; ++i) check_metres(key.keys(i), origins, unit_m);
    const bool metres = key.unit == "m" || key.unit.starts_with("m/");
    if (!metres || is_zero(key.get())) continue;
    throw error_at(origins, key.name,
                   "it is in metres, and the calibration's unit is not known: set calibration.unit_m to the metres in "
                   "one unit of T");
  }
}

}  // namespace stereotrack::config
