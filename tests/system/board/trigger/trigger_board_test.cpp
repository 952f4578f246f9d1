// Pulses and edges on lines of the kernel's gpio-sim, read and driven in its sysfs, and frames of its test cameras.
// These run free, so whether their frames answer a pulse is chance: what is asserted of them holds either way.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/capture/stereo_cameras/stereo_cameras.hpp"
#include "drivers/capture/v4l2/v4l2.hpp"
#include "drivers/trigger/edges.hpp"
#include "drivers/trigger/pulse_train.hpp"

namespace stereotrack::trigger {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

constexpr milliseconds kPeriod{40};
constexpr milliseconds kWidth{12};
constexpr milliseconds kLate{10};

MonotonicTime now() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return MonotonicTime(std::chrono::seconds(time.tv_sec) + nanoseconds(time.tv_nsec));
}

bool pin_is_high(int line) {
  char level = '0';
  std::ifstream("/run/rig/sim_gpio" + std::to_string(line) + "/value") >> level;
  return level == '1';
}
void pull(int line, bool up) {
  std::ofstream("/run/rig/sim_gpio" + std::to_string(line) + "/pull") << (up ? "pull-up" : "pull-down") << std::flush;
}

std::unique_ptr<PulseTrain> train() {
  const gpio::LineSpec spec{.name = {"rig", "TRIGGER"}};
  auto made = PulseTrain::create({.period = kPeriod, .width = kWidth, .late = kLate},
                                 gpio::open_lines({&spec, 1}, "trigger_board_test"));
  EXPECT_TRUE(made.has_value());
  return std::move(*made);
}

gpio::InputSpec ready() { return {.name = {"rig", "READY"}, .edges = gpio::Edges::kRising}; }

/// Does something again and again in a thread of its own, until it goes out of scope.
class Meanwhile {
 public:
  explicit Meanwhile(std::function<void()> work)
      : thread_([this, work = std::move(work)] {
          while (!stop_.load()) work();
        }) {}
  Meanwhile(const Meanwhile&) = delete;
  Meanwhile& operator=(const Meanwhile&) = delete;
  ~Meanwhile() {
    stop_.store(true);
    thread_.join();
  }

 private:
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// The train's thread.
std::function<void()> steps(PulseTrain& pulses) {
  return [&pulses] {
    const MonotonicTime next = pulses.step(now());
    if (const nanoseconds rest = next - now(); rest.count() > 0) std::this_thread::sleep_for(rest);
  };
}

TEST(TriggerBoard, EachPulseOfATrainIsAtThePinOnceAndTheLineRestsLow) {
  const auto pulses = train();
  const auto trigger = pulses->trigger();
  std::atomic<std::uint64_t> rises{0};
  bool last = false;
  const MonotonicTime begin = now();
  std::vector<Trigger::Pulse> told;
  {
    const Meanwhile meter([&] {
      const bool high = pin_is_high(0);
      if (high && !last) ++rises;
      last = high;
      std::this_thread::sleep_for(milliseconds(2));
    });
    {
      const Meanwhile giver(steps(*pulses));
      Trigger::Pulse pulse;
      while (now() - begin < std::chrono::seconds(3)) {
        while (trigger->take(pulse)) told.push_back(pulse);
        std::this_thread::sleep_for(milliseconds(10));
      }
    }
    pulses->end(now());
    Trigger::Pulse pulse;
    while (trigger->take(pulse)) told.push_back(pulse);
    std::this_thread::sleep_for(milliseconds(20));
  }
  const std::uint64_t given = pulses->counters().given.get();
  EXPECT_GT(given, 50U);
  EXPECT_EQ(rises.load(), given);
  EXPECT_EQ(pulses->counters().failed.get(), 0U);
  EXPECT_FALSE(pin_is_high(0));
  ASSERT_EQ(told.size(), given);
  for (std::size_t i = 0; i < told.size(); ++i) {
    EXPECT_EQ(told[i].number, i + 1);
    if (i > 0) {
      EXPECT_GE(told[i].time - told[i - 1].time, kPeriod - kLate);
    }
  }
}

TEST(TriggerBoard, EdgesOfSomebodyElseAreToldWithTheirKernelTimes) {
  pull(1, false);
  EdgeTrigger trigger(ready(), "trigger_board_test");
  Trigger::Pulse pulse;
  for (std::uint64_t n = 1; n <= 40; ++n) {
    const MonotonicTime before = now();
    pull(1, true);
    std::this_thread::sleep_for(milliseconds(15));
    ASSERT_TRUE(trigger.take(pulse)) << n;
    EXPECT_EQ(pulse.number, n);
    EXPECT_GE(pulse.time, before);
    EXPECT_LE(pulse.time, now());
    EXPECT_FALSE(trigger.take(pulse));
    pull(1, false);
    std::this_thread::sleep_for(milliseconds(15));
    EXPECT_FALSE(trigger.take(pulse)) << "a falling edge was told";
  }
}

// A wire from the one to the other: what is given is what is seen.
TEST(TriggerBoard, ATrainThatIsWiredToAnInputIsSeenThereEdgeByEdge) {
  pull(1, false);
  EdgeTrigger seen(ready(), "trigger_board_test");
  const auto pulses = train();
  const auto given = pulses->trigger();
  std::vector<Trigger::Pulse> at_output;
  std::vector<Trigger::Pulse> at_input;
  {
    bool level = false;
    const Meanwhile wire([&] {
      if (const bool high = pin_is_high(0); high != level) {
        level = high;
        pull(1, level);
      }
      std::this_thread::sleep_for(milliseconds(1));
    });
    {
      const Meanwhile giver(steps(*pulses));
      const MonotonicTime begin = now();
      Trigger::Pulse pulse;
      while (now() - begin < std::chrono::seconds(3)) {
        while (given->take(pulse)) at_output.push_back(pulse);
        while (seen.take(pulse)) at_input.push_back(pulse);
        std::this_thread::sleep_for(milliseconds(5));
      }
    }
    pulses->end(now());
    std::this_thread::sleep_for(milliseconds(30));
    Trigger::Pulse pulse;
    while (given->take(pulse)) at_output.push_back(pulse);
    while (seen.take(pulse)) at_input.push_back(pulse);
  }
  ASSERT_GT(at_output.size(), 50U);
  ASSERT_EQ(at_input.size(), at_output.size());
  for (std::size_t i = 0; i < at_input.size(); ++i) {
    EXPECT_EQ(at_input[i].number, at_output[i].number);
    EXPECT_GT(at_input[i].time, at_output[i].time);
    EXPECT_LT(at_input[i].time - at_output[i].time, kWidth) << "a pulse and its own edge";
  }
}

TEST(TriggerBoard, FramesOfCamerasThatRunFreePairWhetherTheyAnswerThePulsesOrNot) {
  const auto open = [](Side side) {
    capture::v4l2::Settings wanted;
    wanted.device = side == Side::kLeft ? "/dev/video0" : "/dev/video1";
    wanted.width = 320;
    wanted.height = 180;
    wanted.fps = 25;
    wanted.format = "grey8";
    wanted.readout_us = 0;
    return capture::v4l2::open(wanted);
  };
  const auto pulses = train();
  capture::StereoCameras::Config config;
  config.tolerance = 0.5;
  config.period = kPeriod;
  capture::StereoCameras cameras(open, config, pulses->trigger());
  capture::FramePool pool(4);
  capture::PairOutlet::Notices notices;
  capture::Doorbell bell;
  capture::PairOutlet outlet(pool, notices, bell);
  std::uint64_t pairs = 0;
  std::vector<capture::SourceNote> said;
  {
    const Meanwhile giver(steps(*pulses));
    const MonotonicTime begin = now();
    while (now() - begin < std::chrono::seconds(4)) {
      EXPECT_EQ(cameras.step(outlet, now() + milliseconds(100)), capture::LiveSource::Step::kGoing);
      while (const capture::PairLease lease = pool.take_oldest()) {
        if (lease->right.empty()) continue;
        ++pairs;
        EXPECT_LE(std::chrono::abs(*lease->skew), kPeriod / 2);
      }
      capture::PairNotice notice;
      while (notices.pop(notice)) {
      }
      cameras.tend(said);
    }
    pulses->end(now());
  }
  const capture::SourceFigures figures = cameras.figures();
  EXPECT_GT(pairs, 30U);
  EXPECT_TRUE(figures.has_trigger);
  EXPECT_FALSE(figures.trigger_silent);
  EXPECT_GT(figures.pulses, 60U);
  EXPECT_LE(figures.pulses, pulses->counters().given.get());
  for (const capture::CameraFigures& camera : figures.cameras) {
    EXPECT_EQ(camera.losses, 0U);
    std::printf("# missed %llu, doubled %llu, stray %llu\n", static_cast<unsigned long long>(camera.missed),
                static_cast<unsigned long long>(camera.doubled), static_cast<unsigned long long>(camera.stray));
  }
  for (const capture::SourceNote& note : said) std::printf("# %s\n", note.text.c_str());
}

}  // namespace
}  // namespace stereotrack::trigger
