#include "config/signals.hpp"

#include <algorithm>
#include <string_view>

namespace stereotrack::config {
namespace {

constexpr double kFarthest_m = 1000;
constexpr double kLargestPicture_px = 100000;

/// Names stand in logs and metrics.
std::string check_name(std::string_view text) {
  constexpr std::size_t kLongest = 32;
  const bool good =
      !text.empty() && text.size() <= kLongest &&
      text.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") == text.npos;
  return good ? std::string() : quoted(text) + " is no name: give 1 to 32 letters, digits, _ and -";
}

std::vector<Key> keys_of_zone(ZoneConfig& zone) {
  const auto range = [](std::string_view name, std::array<double, 2>& member, const std::string& axis) {
    return key(name, member, -kFarthest_m, kFarthest_m, "m",
               axis + ", from and to, of a box in the left rectified camera's frame; [0, 0]: anywhere.");
  };
  return {
      required(key("name", zone.name, check_name, "What signals and objects.volume call it.")),
      range("x_m", zone.x_m, "Left to right"),
      range("y_m", zone.y_m, "Up (negative) to down"),
      range("z_m", zone.z_m, "Near to far"),
      key("picture", zone.picture, kMaxCorners, -kLargestPicture_px, kLargestPicture_px, "px",
          "Or corners [x, y] of a polygon in the raw left picture; needs no depth."),
      key("anchor", zone.anchor, {{"centre", ZoneAnchor::kCentre}, {"bottom", ZoneAnchor::kBottom}},
          "Which point of a target has to lie in that polygon: its centre, or the middle of its box's last row, where "
          "what stands on the ground touches it."),
      key("targets", zone.targets,
          {{"all", ZoneTargets::kAll}, {"none_begin", ZoneTargets::kNoneBegin}, {"ignore", ZoneTargets::kIgnore}},
          "What is tracked there: all; only targets that began elsewhere; or nothing: the pixels of a polygon are "
          "never "
          "foreground, and what is in a box is rejected."),
      key("min_size_m", zone.min_size_m, 0, kLargestSize_m, "m",
          "There in place of objects.min_size_m, if not 0; of several zones, the first that has one."),
      key("max_size_m", zone.max_size_m, 0, kLargestSize_m, "m", "Likewise, of objects.max_size_m."),
  };
}

std::vector<Key> keys_of_signal(SignalConfig& signal) {
  return {
      required(key("name", signal.name, check_name, "What logs and metrics call it.")),
      required(key("line", signal.line, check_line,
                   "CHIP:LINE; CHIP is a path, a name or a label, LINE a number or a name. Chip sim is simulated.")),
      key("when", signal.when,
          {{"confirmed", SignalWhen::kConfirmed},
           {"in_zone", SignalWhen::kInZone},
           {"distance_below", SignalWhen::kDistanceBelow},
           {"time_to_reach_below", SignalWhen::kTimeToReachBelow},
           {"heartbeat", SignalWhen::kHeartbeat},
           {"deadline_missed", SignalWhen::kDeadlineMissed}},
          "What it tells: there is a target, one in the zone, one nearer than limit_m, one that arrives in less than "
          "limit_s; all is well (the line toggles); an output leaves without a result of its own."),
      key("zone", signal.zone, check_zone_or_none, "Only targets in this zone count; empty: all do."),
      key("limit_m", signal.limit_m, 0, kFarthest_m, "m", "Distance from the left camera, for distance_below."),
      key("limit_s", signal.limit_s, 0, 3600, "s",
          "Distance over closing speed along the line of sight, for time_to_reach_below."),
      key("period_ms", signal.period_ms, 2, 60000, "ms", "Of a heartbeat, both edges."),
      key("mode", signal.mode, {{"level", SignalMode::kLevel}, {"pulse", SignalMode::kPulse}},
          "Active while the condition holds, or for pulse_ms from when it begins to."),
      key("pulse_ms", signal.pulse_ms, 0, 60000, "ms", "Width of a pulse."),
      key("hold_ms", signal.hold_ms, 0, 60000, "ms",
          "A condition that began to hold counts as holding for at least so long: flicker is one activation."),
      active_key("active", signal.active, "Level of the line when it is active."),
      key("safe", signal.safe, {{"inactive", SafeState::kInactive}, {"active", SafeState::kActive}},
          "State of the line at start, at stop, and while what it tells is not known."),
  };
}

std::vector<Key> keys_of_input(InputConfig& input) {
  return {
      required(key("name", input.name, check_name, "What logs and metrics call it.")),
      required(
          key("line", input.line, check_line,
              "CHIP:LINE, as a signal's. Where LINE of chip sim is a path, it is a FIFO: echo 1 > PATH drives it.")),
      key("edge", input.edge,
          {{"rising", InputEdge::kRising}, {"falling", InputEdge::kFalling}, {"both", InputEdge::kBoth}},
          "Which edges count: becoming active, inactive, or both."),
      active_key("active", input.active, "Level of the line when it is active."),
      bias_key("bias", input.bias,
               "What the chip holds the line's level with where nothing drives it; not every chip can."),
      key("debounce_ms", input.debounce_ms, 0, 1000, "ms",
          "A level counts once it was still for so long. Needs a build with libgpiod 2.x."),
      key("apart_ms", input.apart_ms, 0, 3600000, "ms",
          "Edges that come sooner after one that triggered trigger nothing."),
  };
}

/// What is wrong with a table, and which of its keys says so.
struct Wrong {
  std::string_view key;
  std::string what;
};

Wrong wrong_of(const ZoneConfig& zone, const ZoneRules::Config& everywhere) {
  const auto given = [](const std::array<double, 2>& range) { return range[0] != 0 || range[1] != 0; };
  const bool in_space = given(zone.x_m) || given(zone.y_m) || given(zone.z_m);
  if (in_space && !zone.picture.empty()) {
    return {"picture", "the zone has metres, too: give a box in space or a polygon in the picture"};
  }
  if (!in_space && zone.picture.empty()) {
    return {"name", "the zone is everywhere: give x_m, y_m or z_m, or the corners of picture"};
  }
  if (!zone.picture.empty() && zone.picture.size() < 3) {
    return {"picture", "a polygon has at least 3 corners: give more"};
  }
  const auto falls = [](const std::array<double, 2>& range) { return range[0] > range[1]; };
  for (const auto& [name, range] : {std::pair{"x_m", zone.x_m}, {"y_m", zone.y_m}, {"z_m", zone.z_m}}) {
    if (falls(range)) return {name, "it ends before it begins: give [FROM, TO]"};
  }
  const std::string_view sized = zone.min_size_m > 0 ? "min_size_m" : zone.max_size_m > 0 ? "max_size_m" : "";
  if (sized.empty()) return {};
  if (zone.targets == ZoneTargets::kIgnore) return {sized, "nothing is tracked in an ignored zone: leave the size out"};
  const double least_m = zone.min_size_m > 0 ? zone.min_size_m : everywhere.min_size_m;
  const double most_m = zone.max_size_m > 0 ? zone.max_size_m : everywhere.max_size_m;
  if (most_m > 0 && least_m > most_m) {
    return {sized, "no size is left between the zone's limits and those of [objects]: give min_size_m <= max_size_m"};
  }
  return {};
}

std::string names_of(const std::vector<ZoneConfig>& zones) {
  std::string names;
  for (const ZoneConfig& zone : zones) names += (names.empty() ? "" : ", ") + quoted(zone.name);
  return names;
}

std::string no_such_zone(const std::string& name, const std::vector<ZoneConfig>& zones) {
  const std::string names = names_of(zones);
  return "there is no zone " + quoted(name) + ": " +
         (names.empty() ? "write a [[zone]] of this name" : "there are " + names);
}

/// Empty: nothing is.
std::string wrong_of_volume(const Configuration& c) {
  const std::string& volume = c.objects.volume;
  if (volume.empty()) return {};
  const auto zone = std::find_if(c.zones.begin(), c.zones.end(), [&](const auto& each) { return each.name == volume; });
  if (zone == c.zones.end()) return no_such_zone(volume, c.zones);
  if (!zone->picture.empty()) {
    return "zone " + quoted(volume) + " is a polygon in the picture: name one with x_m, y_m or z_m";
  }
  if (zone->targets == ZoneTargets::kIgnore) {
    return "zone " + quoted(volume) + " is ignored, nothing would be tracked: name another, or leave its targets out";
  }
  return {};
}

Wrong wrong_of(const SignalConfig& signal, const std::vector<ZoneConfig>& zones) {
  const bool about_targets = signal.when != SignalWhen::kHeartbeat && signal.when != SignalWhen::kDeadlineMissed;
  if (signal.when == SignalWhen::kInZone && signal.zone.empty()) return {"zone", "it is missing: in_zone needs it"};
  if (!signal.zone.empty() && !about_targets) {
    return {"zone", "heartbeat and deadline_missed are not about targets: leave the zone out"};
  }
  const bool known =
      std::any_of(zones.begin(), zones.end(), [&](const auto& zone) { return zone.name == signal.zone; });
  if (!signal.zone.empty() && !known) return {"zone", no_such_zone(signal.zone, zones)};
  if (signal.when == SignalWhen::kDistanceBelow && !(signal.limit_m > 0)) {
    return {"limit_m", "distance_below needs it: give a distance above 0"};
  }
  if (signal.when == SignalWhen::kTimeToReachBelow && !(signal.limit_s > 0)) {
    return {"limit_s", "time_to_reach_below needs it: give a time above 0"};
  }
  if (signal.mode == SignalMode::kPulse && signal.when == SignalWhen::kHeartbeat) {
    return {"mode", "a heartbeat toggles: leave the mode out, and give period_ms"};
  }
  if (signal.mode == SignalMode::kPulse && !(signal.pulse_ms > 0)) {
    return {"pulse_ms", "a pulse needs it: give a width above 0"};
  }
  return {};
}

/// The first table of a list that says the same as one before it.
template <class Table>
void check_unique(const Loaded& loaded, std::string_view list, const std::vector<Table>& tables,
                  std::string Table::*member, std::string_view key, std::string_view way_out) {
  for (std::size_t i = 0; i < tables.size(); ++i) {
    for (std::size_t before = 0; before < i; ++before) {
      if (tables[i].*member != tables[before].*member) continue;
      const std::string first = table_name(list, before) + "." + std::string(key);
      throw error_at(loaded.origins, table_name(list, i) + "." + std::string(key),
                     quoted(tables[i].*member) + " is that of " + table_name(list, before) + ", too (" +
                         loaded.origins.find(first)->second + "): " + std::string(way_out));
    }
  }
}

/// At the key, or where its table begins if the key was not given.
void refuse_if(const Loaded& loaded, const std::string& table, const Wrong& wrong) {
  if (wrong.what.empty()) return;
  const std::string name = table + "." + std::string(wrong.key);
  if (loaded.origins.contains(name)) throw error_at(loaded.origins, name, wrong.what);
  throw error_at(loaded.origins, table, std::string(wrong.key) + ": " + wrong.what);
}

}  // namespace

std::string check_line(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  const bool good = colon != text.npos && colon > 0 && colon + 1 < text.size() && text.find_first_of(" \t\r\n") != 0 &&
                    text.find_last_of(" \t\r\n") != text.size() - 1;
  if (good) return {};
  return quoted(text) +
         " is no GPIO line: write CHIP:LINE, for example \"gpiochip0:17\", \"pinctrl-bcm2711:GPIO17\" or \"sim:near\"";
}

std::string check_zone_or_none(std::string_view text) { return text.empty() ? std::string() : check_name(text); }

Key active_key(std::string_view name, ActiveLevel& member, std::string_view doc) {
  return key(name, member, {{"high", ActiveLevel::kHigh}, {"low", ActiveLevel::kLow}}, doc);
}

Key bias_key(std::string_view name, InputBias& member, std::string_view doc) {
  return key(name, member,
             {{"as_is", InputBias::kAsIs},
              {"none", InputBias::kNone},
              {"pull_up", InputBias::kPullUp},
              {"pull_down", InputBias::kPullDown}},
             doc);
}

Key zones_key(std::vector<ZoneConfig>& zones) {
  ZoneConfig gate;
  gate.name = "gate";
  gate.x_m = {-1, 1};
  gate.y_m = {-2, 2};
  gate.z_m = {0.5, 5};
  return tables("zone", zones, kMaxZones, keys_of_zone, gate,
                "A place, for signals (docs/SIGNALS.md) and for rules about what is tracked there (docs/TRACKING.md).");
}

Key signals_key(std::vector<SignalConfig>& signals) {
  SignalConfig near;
  near.name = "near";
  near.line = "gpiochip0:17";
  near.when = SignalWhen::kDistanceBelow;
  near.zone = "gate";
  near.limit_m = 3;
  near.hold_ms = 200;
  return tables("signal", signals, kMaxSignals, keys_of_signal, near,
                "A GPIO line that tells something about targets or about the rig itself; docs/SIGNALS.md.");
}

Key inputs_key(std::vector<InputConfig>& inputs) {
  InputConfig door;
  door.name = "door";
  door.line = "gpiochip0:5";
  door.active = ActiveLevel::kLow;
  door.bias = InputBias::kPullUp;
  return tables("input", inputs, kMaxInputs, keys_of_input, door,
                "A GPIO line whose edges are a reason to record; docs/RECORDING.md.");
}

void check_signals(const Loaded& loaded) {
  const Configuration& c = loaded.configuration;
  for (std::size_t i = 0; i < c.zones.size(); ++i) {
    refuse_if(loaded, table_name("zone", i), wrong_of(c.zones[i], c.pipeline.zones));
  }
  for (std::size_t i = 0; i < c.signals.size(); ++i) {
    refuse_if(loaded, table_name("signal", i), wrong_of(c.signals[i], c.zones));
  }
  check_unique(loaded, "zone", c.zones, &ZoneConfig::name, "name", "give each zone its own name");
  if (const std::string wrong = wrong_of_volume(c); !wrong.empty()) {
    throw error_at(loaded.origins, "objects.volume", wrong);
  }
  check_unique(loaded, "signal", c.signals, &SignalConfig::name, "name", "give each signal its own name");
  check_unique(loaded, "signal", c.signals, &SignalConfig::line, "line", "a line has one rule");
  check_unique(loaded, "input", c.inputs, &InputConfig::name, "name", "give each input its own name");
  check_unique(loaded, "input", c.inputs, &InputConfig::line, "line", "give each input its own line");
  for (std::size_t i = 0; i < c.inputs.size(); ++i) {
    for (std::size_t k = 0; k < c.signals.size(); ++k) {
      if (c.inputs[i].line != c.signals[k].line) continue;
      const std::string driven = table_name("signal", k);
      refuse_if(loaded, table_name("input", i),
                {"line", quoted(c.inputs[i].line) + " is driven by " + driven + " (" +
                             loaded.origins.find(driven + ".line")->second + "): a line is read or driven"});
    }
  }
}

}  // namespace stereotrack::config
