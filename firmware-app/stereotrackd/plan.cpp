#include "firmware-app/stereotrackd/plan.hpp"

#include <algorithm>
#include <array>
#include <string_view>

#include "config/schema.hpp"
#include "drivers/telemetry/udp_sender.hpp"
#include "firmware-app/signals/set_up.hpp"

namespace stereotrack::daemon {

namespace {

/// Keys, beside zones and signals, that can change while the daemon runs.
constexpr std::array<std::string_view, 2> kDestinations{"telemetry.destinations", "telemetry.multicast_ttl"};

}  // namespace

std::unique_ptr<Plan> make_plan(const config::Configuration& configuration, double unit_m, bool with_rules) {
  const config::LatencyConfig& latency = configuration.latency;
  const std::chrono::nanoseconds stale_after(static_cast<std::int64_t>((latency.output_ms + latency.stale_ms) * 1e6));
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
    next.zones = wanted.zones;
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
  if (running.zones == wanted.zones && running.signals == wanted.signals) return difference;
  // A rule may change under a line; the lines themselves were requested at start.
  if (signals::line_specs(running) == signals::line_specs(wanted)) {
    difference.rules = true;
  } else {
    difference.refused.emplace_back("signal");
  }
  return difference;
}

}  // namespace stereotrack::daemon
