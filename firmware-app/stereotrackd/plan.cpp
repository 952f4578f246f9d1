#include "firmware-app/stereotrackd/plan.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <string_view>
#include <utility>

#include "config/milliseconds.hpp"
#include "config/schema.hpp"
#include "config/zones.hpp"
#include "drivers/telemetry/udp_sender.hpp"
#include "firmware-app/signals/set_up.hpp"

namespace stereotrack::daemon {

namespace {

/// Keys, beside zones and signals, that can change while the daemon runs.
constexpr std::array<std::string_view, 2> kDestinations{"telemetry.destinations", "telemetry.multicast_ttl"};

using Zones = std::vector<config::ZoneConfig>;

const config::ZoneConfig* find(const Zones& zones, const std::string& name) {
  const auto found = std::find_if(zones.begin(), zones.end(), [&](const auto& zone) { return zone.name == name; });
  return found == zones.end() ? nullptr : &*found;
}

/// Those that a pipeline with this working volume uses, in their order, which counts.
Zones of_pipeline(const Zones& zones, const std::string& volume) {
  Zones used;
  std::copy_if(zones.begin(), zones.end(), std::back_inserter(used),
               [&](const auto& zone) { return config::is_for_pipeline(zone, volume); });
  return used;
}

/// What the daemon has after a reload: the pipeline's zones as they are, then the others as they are wanted.
Zones zones_after(const config::Configuration& running, const config::Configuration& wanted) {
  const std::string& volume = running.objects.volume;
  Zones next = of_pipeline(running.zones, volume);
  if (next == of_pipeline(wanted.zones, volume)) return wanted.zones;
  const std::size_t fixed = next.size();
  for (config::ZoneConfig zone : wanted.zones) {
    const bool stays = std::any_of(next.begin(), next.begin() + static_cast<std::ptrdiff_t>(fixed),
                                   [&](const auto& used) { return used.name == zone.name; });
    if (stays) continue;
    // The pipeline does not know it until the restart, and the next reload has to say so again.
    zone.targets = config::ZoneTargets::kAll;
    zone.min_size_m = zone.max_size_m = 0;
    next.push_back(std::move(zone));
  }
  return next;
}

/// "zone NAME" of each that only a restart can change.
void refuse_zones(const config::Configuration& running, const config::Configuration& wanted,
                  std::vector<std::string>& refused) {
  const std::string& volume = running.objects.volume;
  const Zones before = of_pipeline(running.zones, volume);
  const Zones after = of_pipeline(wanted.zones, volume);
  if (before == after) return;
  const std::size_t known = refused.size();
  for (const config::ZoneConfig& zone : before) {
    const config::ZoneConfig* now = find(after, zone.name);
    if (now == nullptr || !(*now == zone)) refused.push_back("zone " + zone.name);
  }
  for (const config::ZoneConfig& zone : after) {
    if (find(before, zone.name) == nullptr) refused.push_back("zone " + zone.name);
  }
  if (refused.size() == known) refused.emplace_back("zone: the order");
}

}  // namespace

std::unique_ptr<Plan> make_plan(const config::Configuration& configuration, double unit_m, bool with_rules) {
  const config::LatencyConfig& latency = configuration.latency;
  const std::chrono::nanoseconds stale_after = config::from_ms(latency.output_ms + latency.stale_ms);
  gpio::LineBits zones = 0;
  for (std::size_t i = 0; i < configuration.signals.size(); ++i) {
    if (configuration.signals[i].when == config::SignalWhen::kInZone) zones |= gpio::LineBits{1} << i;
  }
  const std::vector<telemetry::Endpoint> to = telemetry::parse_endpoints(configuration.telemetry.destinations);
  auto plan = std::make_unique<Plan>();
  plan->sink = std::make_unique<telemetry::UdpSender>(
      to, telemetry::UdpSender::Config{.multicast_hops = configuration.telemetry.multicast_ttl});
  if (with_rules) plan->rules = signals::make_rules(configuration, unit_m, stale_after);
  plan->zones = zones;
  return plan;
}

config::Configuration accepted(const config::Configuration& running, const config::Configuration& wanted,
                               const Difference& difference) {
  config::Configuration next = running;
  if (difference.destinations) {
    next.telemetry.destinations = wanted.telemetry.destinations;
    next.telemetry.multicast_ttl = wanted.telemetry.multicast_ttl;
  }
  if (difference.rules) {
    next.zones = zones_after(running, wanted);
    next.signals = wanted.signals;
  }
  if (difference.inputs) {
    next.inputs = wanted.inputs;
    next.record.on_input = wanted.record.on_input;
  }
  return next;
}

Difference difference(const config::Configuration& running, const config::Configuration& wanted) {
  config::Configuration before = running;
  config::Configuration after = wanted;
  const std::vector<config::Key> before_keys = config::keys_of(before);
  const std::vector<config::Key> after_keys = config::keys_of(after);
  Difference difference;
  for (std::size_t i = 0; i < before_keys.size(); ++i) {
    const config::Key& key = before_keys[i];
    if (key.kind == config::Kind::kTables) continue;  // zones, signals and inputs, below
    if (key.get() == after_keys[i].get()) continue;
    if (std::find(kDestinations.begin(), kDestinations.end(), key.name) != kDestinations.end()) {
      difference.destinations = true;
    } else if (key.name == "record.on_input") {
      difference.inputs = true;
    } else {
      difference.refused.push_back(key.name);
    }
  }
  difference.inputs = difference.inputs || running.inputs != wanted.inputs;
  refuse_zones(running, wanted, difference.refused);
  if (running.zones == zones_after(running, wanted) && running.signals == wanted.signals) return difference;
  // A rule may change under a line; the lines themselves were requested at start.
  if (signals::line_specs(running) == signals::line_specs(wanted)) {
    difference.rules = true;
  } else {
    difference.refused.emplace_back("signal");
  }
  return difference;
}

}  // namespace stereotrack::daemon
