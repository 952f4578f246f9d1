#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "config/load.hpp"
#include "drivers/telemetry/receiver.hpp"
#include "drivers/telemetry/udp_listener.hpp"
#include "drivers/telemetry/udp_sender.hpp"
#include "firmware-app/runtime/clock.hpp"
#include "firmware-app/stereotrackd/daemon.hpp"
#include "tests/support/moving_scene.hpp"
#include "tests/support/scene_film.hpp"

namespace stereotrack::test {

[[nodiscard]] inline config::Configuration configured(const std::vector<std::string>& set) {
  std::vector<config::Layer> layers;
  for (const std::string& entry : set) layers.push_back(config::override_layer(entry));
  return config::load(layers).configuration;
}

/// What came over a real socket.
class Ear {
 public:
  Ear() : listener_(telemetry::parse_endpoint("127.0.0.1:0", true)) {}

  [[nodiscard]] std::vector<telemetry::Endpoint> here() const { return {listener_.local()}; }

  /// Takes what waits.
  void listen() {
    std::array<std::byte, 2048> buffer{};
    for (std::ptrdiff_t size = listener_.receive(buffer); size >= 0; size = listener_.receive(buffer)) {
      const auto outcome = receiver_.accept(std::span(buffer).first(static_cast<std::size_t>(size)));
      if (outcome == telemetry::Outcome::kPair) pairs_.push_back(receiver_.pair());
      if (outcome == telemetry::Outcome::kPair || outcome == telemetry::Outcome::kPart) {
        auto& bytes = messages_[receiver_.datagram().header.sequence];
        bytes.insert(bytes.end(), buffer.begin(), buffer.begin() + size);
      }
      if (outcome == telemetry::Outcome::kStatus) statuses_.push_back(*receiver_.datagram().status);
    }
  }

  [[nodiscard]] const std::vector<telemetry::Pair>& pairs() const { return pairs_; }
  [[nodiscard]] const std::vector<telemetry::Status>& statuses() const { return statuses_; }
  /// The bytes of each, by sequence: parts one after the other.
  [[nodiscard]] const std::map<std::uint64_t, std::vector<std::byte>>& messages() const { return messages_; }
  [[nodiscard]] const telemetry::Receiver& receiver() const { return receiver_; }

 private:
  telemetry::UdpListener listener_;
  telemetry::Receiver receiver_;
  std::vector<telemetry::Pair> pairs_;
  std::vector<telemetry::Status> statuses_;
  std::map<std::uint64_t, std::vector<std::byte>> messages_;
};

[[nodiscard]] inline signals::SignalRules rules_of(std::vector<signals::Signal> wanted) {
  signals::SignalRules::Config config;
  for (const signals::Signal& signal : wanted) (void)config.signals.push(signal);
  config.unit_m = 1;
  config.stale_after = std::chrono::milliseconds(500);
  return *signals::SignalRules::create(config);
}

/// A daemon in this process: real threads, real time, real sockets, simulated lines.
struct LiveRig {
  explicit LiveRig(std::unique_ptr<capture::LiveSource> source, const std::vector<std::string>& set = {},
                   StageObserver also = {}, std::vector<gpio::LineSpec> lines = {},
                   std::vector<signals::Signal> wanted = {}, std::unique_ptr<trigger::PulseTrain> train = {})
      : configuration(configured(set)), calibration(MovingScene::calibration()) {
    daemon::Daemon::Parts parts;
    parts.configuration = &configuration;
    parts.calibration = &calibration;
    parts.unit_m = 1;
    parts.source = std::move(source);
    parts.train = std::move(train);
    parts.plan = std::make_unique<daemon::Plan>(
        daemon::Plan{std::make_unique<telemetry::UdpSender>(ear.here()), rules_of(std::move(wanted)), 0});
    parts.lines = gpio::open_lines(lines, "test");
    parts.session = 3;
    parts.also = also;
    daemon = std::make_unique<daemon::Daemon>(std::move(parts));
  }

  /// Runs until the source is over, or `enough` says so.
  void run(const std::function<bool()>& enough = [] { return false; }) {
    config::RealTimeConfig off = configuration.realtime;
    off.mode = config::RealTimeMode::kOff;
    (void)daemon->start(off, false);
    while (!daemon->is_over() && !enough()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      daemon->tend(runtime::monotonic_now());
      ear.listen();
      for (capture::SourceNote& note : daemon->tend_source()) notes.push_back(std::move(note));
    }
    daemon->stop();
    ear.listen();
  }

  [[nodiscard]] std::uint64_t outputs(const std::string& name) const {
    for (std::size_t i = 0; i < daemon::kScheduleCounters.size(); ++i) {
      if (name == daemon::kScheduleCounters[i].name) return daemon->vitals().schedule[i].get();
    }
    ADD_FAILURE() << name << " is no counter";
    return 0;
  }

  config::Configuration configuration;
  StereoCalibration calibration;
  Ear ear;
  std::vector<capture::SourceNote> notes;  ///< what the service would have logged
  std::unique_ptr<daemon::Daemon> daemon;
};

}  // namespace stereotrack::test
