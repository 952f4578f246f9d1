#include "firmware-app/signals/set_up.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "config/error.hpp"
#include "config/milliseconds.hpp"
#include "config/signals.hpp"
#include "config/zones.hpp"

namespace stereotrack::signals {
namespace {

static_assert(config::kMaxSignals == kMaxSignals && config::kMaxZones == kMaxZones);

[[nodiscard]] Condition condition_of(config::SignalWhen when) {
  switch (when) {
    case config::SignalWhen::kConfirmed: return Condition::kConfirmed;
    case config::SignalWhen::kInZone: return Condition::kInZone;
    case config::SignalWhen::kDistanceBelow: return Condition::kDistanceBelow;
    case config::SignalWhen::kTimeToReachBelow: return Condition::kTimeToReachBelow;
    case config::SignalWhen::kHeartbeat: return Condition::kHeartbeat;
    case config::SignalWhen::kDeadlineMissed: return Condition::kDeadlineMissed;
  }
  return Condition::kConfirmed;
}

[[nodiscard]] Signal signal_of(const config::SignalConfig& said, const std::vector<config::ZoneConfig>& zones) {
  Signal signal;
  signal.when = condition_of(said.when);
  if (!said.zone.empty()) {
    const auto zone = std::find_if(zones.begin(), zones.end(),
                                   [&](const config::ZoneConfig& each) { return each.name == said.zone; });
    signal.zone = static_cast<std::size_t>(zone - zones.begin());  // one that is not there is refused by the rules
  }
  signal.limit_m = said.limit_m;
  signal.limit_s = said.limit_s;
  signal.mode = said.mode == config::SignalMode::kPulse ? Signal::Mode::kPulse : Signal::Mode::kLevel;
  signal.pulse = config::from_ms(said.pulse_ms);
  signal.hold = config::from_ms(said.hold_ms);
  signal.half_period = config::from_ms(said.period_ms) / 2;
  signal.safe = said.safe == config::SafeState::kActive;
  return signal;
}

}  // namespace

std::vector<gpio::LineSpec> line_specs(const config::Configuration& configuration) {
  std::vector<gpio::LineSpec> specs;
  for (const config::SignalConfig& said : configuration.signals) {
    try {
      specs.push_back({.name = gpio::parse_line_name(said.line),
                       .active_low = said.active == config::ActiveLevel::kLow,
                       .safe = said.safe == config::SafeState::kActive});
    } catch (const std::runtime_error& error) {
      throw config::Error("signal " + said.name + ": " + error.what());
    }
  }
  return specs;
}

SignalRules make_rules(const config::Configuration& configuration, double unit_m,
                       std::chrono::nanoseconds stale_after) {
  SignalRules::Config config;
  config.unit_m = unit_m;
  config.stale_after = stale_after;
  for (const config::ZoneConfig& said : configuration.zones) (void)config.zones.push(config::zone_of(said));
  for (const config::SignalConfig& said : configuration.signals) {
    (void)config.signals.push(signal_of(said, configuration.zones));
  }
  auto rules = SignalRules::create(config);
  if (!rules.has_value()) {
    throw config::Error("zones and signals: " + std::string(to_string(rules.error())) +
                        ": give calibration.unit_m if they are in metres, or see docs/SIGNALS.md");
  }
  return *rules;
}

gpio::Edges edges_of(config::InputEdge edge) noexcept {
  switch (edge) {
    case config::InputEdge::kRising: return gpio::Edges::kRising;
    case config::InputEdge::kFalling: return gpio::Edges::kFalling;
    case config::InputEdge::kBoth: break;
  }
  return gpio::Edges::kBoth;
}

gpio::Bias bias_of(config::InputBias bias) noexcept {
  switch (bias) {
    case config::InputBias::kAsIs: break;
    case config::InputBias::kNone: return gpio::Bias::kNone;
    case config::InputBias::kPullUp: return gpio::Bias::kPullUp;
    case config::InputBias::kPullDown: return gpio::Bias::kPullDown;
  }
  return gpio::Bias::kAsIs;
}

}  // namespace stereotrack::signals
