#include <stdexcept>

#include "drivers/gpio/locate.hpp"
#include "firmware-app/rig/cameras.hpp"
#include "firmware-app/stereotrack/doctor/probe.hpp"

namespace stereotrack::doctor {

namespace {

LineFound look_up(std::string key, const std::string& line, bool output,
                  const std::vector<gpio::gpiod::ChipListing>& chips) {
  LineFound found{.key = std::move(key), .line = line, .output = output, .consumer = {}, .problem = {}};
  try {
    const gpio::LineName name = gpio::parse_line_name(line);
    const gpio::gpiod::Found place = gpio::locate(name);
    for (const gpio::gpiod::ChipListing& chip : chips) {
      if (chip.chip.path != place.path || place.offset >= chip.lines.size()) continue;
      const gpio::LineFacts& facts = chip.lines[place.offset];
      if (facts.used) found.consumer = facts.consumer.empty() ? "a driver" : facts.consumer;
    }
  } catch (const std::runtime_error& error) {
    found.problem = error.what();
  }
  return found;
}

}  // namespace

std::vector<LineFound> probe_lines(const config::Configuration& configuration) {
  std::vector<LineFound> lines;
  const std::vector<gpio::gpiod::ChipListing> chips = gpio::gpiod::list_chips();
  lines.reserve(configuration.signals.size() + configuration.inputs.size() + 1);
  for (const config::SignalConfig& signal : configuration.signals) {
    lines.push_back(look_up("signal " + signal.name, signal.line, true, chips));
  }
  for (const config::InputConfig& input : configuration.inputs) {
    lines.push_back(look_up("input " + input.name, input.line, false, chips));
  }
  const config::TriggerConfig& trigger = configuration.trigger;
  const bool is_driven = trigger.mode == config::TriggerMode::kGpio;
  if (configuration.source.name == kCameras && (is_driven || trigger.mode == config::TriggerMode::kExternal)) {
    lines.push_back(look_up("trigger", trigger.line, is_driven, chips));
  }
  return lines;
}

}  // namespace stereotrack::doctor
