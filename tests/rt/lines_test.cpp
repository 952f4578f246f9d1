#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <string>
#include <vector>

#include "drivers/gpio/input_lines.hpp"
#include "drivers/gpio/line.hpp"
#include "drivers/gpio/simulated_chip.hpp"
#include "firmware-app/signals/signal_rules.hpp"
#include "tests/rt/heap_watch.hpp"

namespace stereotrack::signals {
namespace {

using std::chrono::milliseconds;

TEST(Lines, TenThousandOutputsMakeNoHeapCall) {
  // Targets come and go, the tracks are unknown now and then, and the chip is gone for a while.
  SignalRules::Config config;
  config.unit_m = 1;
  config.stale_after = milliseconds(500);
  Zone zone;
  zone.x_m = zone.y_m = zone.z_m = {-5, 5};
  ASSERT_TRUE(config.zones.push(zone));
  const std::array<Condition, 6> conditions{Condition::kConfirmed,     Condition::kInZone,
                                            Condition::kDistanceBelow, Condition::kTimeToReachBelow,
                                            Condition::kHeartbeat,     Condition::kDeadlineMissed};
  std::vector<gpio::LineSpec> specs;
  for (const Condition when : conditions) {
    Signal signal;
    signal.when = when;
    if (when == Condition::kInZone) signal.zone = 0;
    signal.limit_m = 3;
    signal.limit_s = 2;
    signal.half_period = milliseconds(100);
    signal.hold = milliseconds(70);
    ASSERT_TRUE(config.signals.push(signal));
    specs.push_back({{"sim", std::string("rt").append(std::to_string(specs.size()))}, specs.size() % 2 == 0, false});
  }
  SignalRules rules = *SignalRules::create(config);
  gpio::OutputLines lines = gpio::open_lines(specs, "test");
  std::array<TrackReport, 16> targets;
  for (TrackReport& target : targets) {
    target.state = TrackState::kConfirmed;
    target.has_depth = true;
  }

  gpio::LineBits ever_changed = 0;
  gpio::LineBits ever_failed = 0;
  std::uint64_t heap_calls = 0;
  for (int i = 0; i < 10'000; ++i) {
    if (i == 5000 || i == 5100) gpio::simulated_chip::set_gone("rt0", i == 5000);
    if (i == 5100) {
      EXPECT_EQ(lines.reopen(), 0b111111U);
    }
    for (std::size_t k = 0; k < targets.size(); ++k) {
      targets[k].position = {0.1 * static_cast<double>(k), 0, 6 + 5 * ((i / 40) % 2 == 0 ? 1.0 : -1.0)};
      targets[k].velocity = {0, 0, -1};
    }
    const test::HeapWatch watch;
    const MonotonicTime now(milliseconds(20 * i));
    const SignalRules::Inputs inputs{.tracks = {targets.data(), static_cast<std::size_t>(i % 17)},
                                     .tracks_known = i % 97 != 0,
                                     .depth_known = i % 89 != 0,
                                     .deadline_missed = i % 13 == 0,
                                     .healthy = i % 301 != 0};
    gpio::OutputLines::SetResult result = lines.set(rules.decide(inputs, now), now);
    ever_changed |= result.changed;
    ever_failed |= result.failed;
    const auto change = rules.next_change();
    if (change && *change < now + milliseconds(20)) {
      result = lines.set(rules.advance(*change), *change);
      ever_changed |= result.changed;
    }
    static_cast<void>(lines.read(0));
    heap_calls += watch.calls();
  }
  EXPECT_EQ(heap_calls, 0U);
  EXPECT_EQ(ever_changed, 0b111111U) << "all lines moved";
  EXPECT_EQ(ever_failed, 0b111111U) << "and their chip was gone for a while";
  EXPECT_EQ(lines.gone(), 0U) << "and came back";
}

TEST(Lines, EdgesAreReadWithoutAHeapCall) {
  const std::vector<gpio::InputSpec> specs{{.name = {"sim", "rt_in_a"}, .edges = gpio::Edges::kBoth},
                                           {.name = {"sim", "rt_in_b"}, .edges = gpio::Edges::kBoth}};
  gpio::InputLines lines = gpio::open_inputs(specs, "test");
  std::array<gpio::EdgeEvent, 8> events;
  std::size_t read = 0;
  std::uint64_t heap_calls = 0;
  for (int i = 0; i < 10'000; ++i) {
    const MonotonicTime now{milliseconds(i)};
    for (const char* line : {"rt_in_a", "rt_in_b"}) gpio::simulated_chip::drive(line, i % 2 == 0, now);
    const test::HeapWatch watch;
    if (i % 5 == 0) {
      for (std::size_t count = lines.read(events); count > 0; count = lines.read(events)) read += count;
    }
    lines.probe();
    heap_calls += watch.calls();
  }
  EXPECT_EQ(heap_calls, 0U);
  EXPECT_GT(read, 19'000U);
}

}  // namespace
}  // namespace stereotrack::signals
