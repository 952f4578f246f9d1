#include "firmware-app/stereotrack/doctor/measure.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "drivers/gpio/line.hpp"
#include "drivers/gpio/simulated_chip.hpp"
#include "firmware-app/runtime/clock.hpp"
#include "tests/support/scripted_camera.hpp"

// Nothing here depends on how fast the machine is: what is measured is only compared with what was done.
namespace stereotrack::doctor {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using test::ScriptedCamera;
using test::SensorScript;
using ::testing::HasSubstr;
using trigger::Side;

const RealTime kOff{.mode = config::RealTimeMode::kOff};

capture::CameraInfo info_of(const std::string& name) {
  capture::CameraInfo info;
  info.name = name;
  info.model = "scripted";
  info.width = 64;
  info.height = 48;
  info.format = PixelFormat::kGrey8;
  info.period = milliseconds(10);
  info.buffers = 8;
  return info;
}

/// Two sensors that expose as time goes by, whose frames arrive `delay` after the middle of their exposure; the right
/// one exposes `phase` later.
class Sensors {
 public:
  Sensors(nanoseconds delay, nanoseconds phase) : delay_(delay), phase_(phase), thread_([this] { run(); }) {}
  Sensors(const Sensors&) = delete;
  Sensors& operator=(const Sensors&) = delete;
  ~Sensors() {
    stop_.store(true);
    thread_.join();
  }

  SensorScript left{info_of("left eye")};
  SensorScript right{info_of("right eye")};
  std::atomic<bool> mute_right{false};
  std::atomic<bool> lose_left{false};

 private:
  void run() {
    for (std::uint64_t n = 1; !stop_.load(); ++n) {
      std::this_thread::sleep_for(milliseconds(10));
      const nanoseconds exposed = runtime::monotonic_now().time_since_epoch() - delay_;
      if (lose_left.load() && n > 5) left.lose();
      // 7 is lost on the way, 9 is damaged.
      if (n % 10 != 7) (void)left.expose({.number = n, .time = exposed, .sequence = n, .damaged = n % 10 == 9});
      if (!mute_right.load()) (void)right.expose({.number = n, .time = exposed + phase_, .sequence = n});
    }
  }

  nanoseconds delay_;
  nanoseconds phase_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

capture::StereoCameras::Open opener(Sensors& sensors) {
  return [&sensors](Side side) -> std::unique_ptr<capture::Camera> {
    return std::make_unique<ScriptedCamera>(side == Side::kLeft ? sensors.left : sensors.right);
  };
}

TEST(MeasureCapture, TellsWhatCameAndHowLongItTook) {
  Sensors sensors(milliseconds(4), milliseconds(1));
  const CaptureMeasures measures = measure_capture(opener(sensors), true, kOff, milliseconds(1500));
  ASSERT_EQ(measures.cameras.size(), 2U);
  const CaptureMeasure& left = measures.cameras[0];
  EXPECT_EQ(left.failure, "");
  EXPECT_EQ(left.side, "left");
  EXPECT_EQ(left.name, "left eye");
  EXPECT_EQ(left.delivers, "64x48 grey8");
  EXPECT_FALSE(left.colour);
  EXPECT_DOUBLE_EQ(left.period_ms, 10);
  EXPECT_GT(left.frames, 10U);
  EXPECT_GT(left.damaged, 0U);
  EXPECT_EQ(left.delay.count, left.frames - 3);
  EXPECT_LT(left.jitter.count, left.delay.count);  // distances over a gap are none
  EXPECT_GT(left.jitter.count, 0U);
  EXPECT_GE(left.delay_min_us, 4000);
  EXPECT_GE(left.delay.p50_us, 4000);
  // Exposed a millisecond later, it has a millisecond less.
  EXPECT_GE(measures.cameras[1].delay_min_us, 3000);
  ASSERT_TRUE(measures.pair.has_value());
  ASSERT_TRUE(measures.pair->phase_ms.has_value());
  EXPECT_NEAR(*measures.pair->phase_ms, 1.0, 0.01);
  // Every buffer is the driver's again.
  EXPECT_EQ(sensors.left.lost_in_closing() + sensors.right.lost_in_closing(), 0);
  EXPECT_EQ(sensors.left.given_back_wrongly() + sensors.right.given_back_wrongly(), 0);
}

TEST(MeasureCapture, StampsAfterTheArrivalShowAsNegative) {
  Sensors sensors(-milliseconds(50), nanoseconds(0));
  const CaptureMeasures measures = measure_capture(opener(sensors), false, kOff, milliseconds(300));
  ASSERT_EQ(measures.cameras.size(), 1U);
  EXPECT_LT(measures.cameras[0].delay_min_us, 0);
  EXPECT_FALSE(measures.pair.has_value());
}

TEST(MeasureCapture, ASilentOneIsToldAndTheOtherMeasured) {
  Sensors sensors(milliseconds(1), nanoseconds(0));
  sensors.mute_right.store(true);
  const CaptureMeasures measures = measure_capture(opener(sensors), true, kOff, milliseconds(300));
  EXPECT_EQ(measures.cameras[0].failure, "");
  EXPECT_THAT(measures.cameras[1].failure,
              HasSubstr("camera right eye: no frame came in 0.3 s: does it wait for a trigger"));
}

TEST(MeasureCapture, OneThatCannotBeOpenedOrStartedOrIsUnpluggedIsTold) {
  Sensors sensors(milliseconds(1), nanoseconds(0));
  sensors.right.refuse("camera right eye: busy: stop who holds it");
  CaptureMeasures measures = measure_capture(opener(sensors), true, kOff, milliseconds(300));
  EXPECT_EQ(measures.cameras[0].failure, "");
  EXPECT_GT(measures.cameras[0].frames, 0U);
  EXPECT_EQ(measures.cameras[1].failure, "camera right eye: busy: stop who holds it");
  sensors.right.refuse("");
  sensors.right.refuse_start("camera right eye: no bandwidth");
  measures = measure_capture(opener(sensors), true, kOff, milliseconds(100));
  EXPECT_EQ(measures.cameras[1].failure, "camera right eye: no bandwidth");
  sensors.right.refuse_start("");
  sensors.lose_left.store(true);
  measures = measure_capture(opener(sensors), true, kOff, milliseconds(500));
  EXPECT_THAT(measures.cameras[0].failure, HasSubstr("unplugged"));
  EXPECT_EQ(measures.cameras[1].failure, "");
}

TEST(MeasureCompute, PlaysTheSceneInTheSizeOfTheCameras) {
  config::Configuration configuration;
  configuration.source.name = "cameras";
  configuration.camera.width = 160;
  configuration.camera.height = 120;
  configuration.camera.fps = 100;
  configuration.camera.left.device = "a";
  configuration.camera.right.device = "b";
  configuration.realtime = kOff;
  for (const bool colour : {false, true}) {
    const ComputeMeasures measures = measure_compute(configuration, colour, milliseconds(300));
    EXPECT_EQ(measures.pipeline.problem, "");
    EXPECT_EQ(measures.pipeline.width, 160);
    EXPECT_EQ(measures.pipeline.height, 120);
    EXPECT_EQ(measures.pipeline.colour, colour);
    EXPECT_TRUE(measures.pipeline.stereo);
    EXPECT_DOUBLE_EQ(measures.pipeline.period_ms, 10);
    EXPECT_GE(measures.pipeline.compute.count, 20U);
    EXPECT_GT(measures.pipeline.compute.p50_us, 0);
    EXPECT_GE(measures.pipeline.drawn, 12);
    EXPECT_GT(measures.pipeline.memory_mb, 0);
    EXPECT_GT(measures.wake_up.latency.count, 0U);
    EXPECT_GE(measures.wake_up.latency.p50_us, 0);
    EXPECT_EQ(measures.wake_up.priority, 0);
    EXPECT_TRUE(measures.wake_up.beside_pipeline);
  }
  configuration.camera.right.device = "";
  EXPECT_FALSE(measure_compute(configuration, false, milliseconds(50)).pipeline.stereo);
}

TEST(MeasureCompute, TwoEyesInOnePictureAreHalfOfItEach) {
  config::Configuration configuration;
  configuration.source.name = "cameras";
  configuration.camera.width = 320;
  configuration.camera.height = 120;
  configuration.camera.side_by_side = true;
  configuration.realtime = kOff;
  const ComputeMeasures measures = measure_compute(configuration, false, milliseconds(50));
  EXPECT_EQ(measures.pipeline.width, 160);
  EXPECT_TRUE(measures.pipeline.stereo);
}

TEST(MeasureLine, SetsItToAndFroAndLeavesItInactive) {
  const LineMeasure measure = measure_line("sim:doctor_line", kOff, milliseconds(200));
  EXPECT_EQ(measure.problem, "");
  EXPECT_EQ(measure.failures, 0U);
  EXPECT_GT(measure.latency.count, 1U);
  EXPECT_GT(measure.latency.max_us, 0);
  EXPECT_EQ(gpio::simulated_chip::level("doctor_line"), false);
  EXPECT_GE(gpio::simulated_chip::edges("doctor_line"), measure.latency.count - 1);
  // It was let go.
  EXPECT_EQ(gpio::open_lines(std::vector{gpio::LineSpec{{"sim", "doctor_line"}, false, false}}, "test").size(), 1U);
}

TEST(MeasureLine, WhatCannotBeHadIsToldInOneLine) {
  EXPECT_THAT(measure_line("gpiochip77:3", kOff, milliseconds(10)).problem, HasSubstr("gpiochip77"));
  const auto held = gpio::open_lines(std::vector{gpio::LineSpec{{"sim", "doctor_held"}, false, false}}, "somebody");
  EXPECT_THAT(measure_line("sim:doctor_held", kOff, milliseconds(10)).problem, HasSubstr("somebody"));
}

}  // namespace
}  // namespace stereotrack::doctor
