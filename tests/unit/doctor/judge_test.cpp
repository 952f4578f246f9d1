#include "firmware-app/stereotrack/doctor/judge.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "firmware-app/stereotrack/doctor/measure.hpp"
#include "tests/unit/doctor/found.hpp"

namespace stereotrack::doctor {
namespace {

using ::testing::HasSubstr;

/// The items of a topic that are worse than fine, in words.
std::string told(const Findings& findings, const std::string& topic) {
  std::string text;
  for (const Item& item : judge(findings)) {
    if (item.topic != topic || item.verdict == Verdict::kOk) continue;
    text += std::string(to_string(item.verdict)) + " " + item.text + " | " + item.way_out + " | " + item.command + "\n";
  }
  return text;
}

TEST(Judge, ABoardOnWhichAllIsWellIsReady) {
  const std::vector<Item> items = judge(good_board());
  for (const Item& item : items) EXPECT_EQ(item.verdict, Verdict::kOk) << item.topic << ": " << item.text;
  EXPECT_EQ(exit_code(worst_of(items)), 0);
}

TEST(Judge, EachLimitIsANoteWithAWayOutAndNothingElseChanges) {
  struct Case {
    const char* topic;
    std::function<void(Findings&)> spoil;
    const char* says;
  };
  for (const Case& c : {
           Case{"kernel", [](Findings& f) { f.kernel.preemption = Preemption::kVoluntary; }, "PREEMPT_RT"},
           {"cpu", [](Findings& f) { f.cpu.governors = {"ondemand"}; }, "echo performance | sudo tee"},
           {"cpu", [](Findings& f) { f.cpu.throttled = true; }, "power supply"},
           {"cpu", [](Findings& f) { f.cpu.hottest_c = 85; }, "85 C"},
           {"memory", [](Findings& f) { f.memory.available_mb = 90; }, "little is left"},
           {"rights",
            [](Findings& f) {
              f.missing = {{"memory cannot be locked: no", "LimitMEMLOCK=infinity"}};
            },
            "setcap"},
           {"clock", [](Findings& f) { f.clocks.tai_error_us.reset(); }, "sudo apt install chrony"},
           {"clock", [](Findings& f) { f.clocks.source = "hpet"; }, "echo arch_sys_counter"},
           {"gpio", [](Findings& f) { f.chips[0].problem = "no permission for /dev/gpiochip0: add ..."; },
            "no permission"},
           {"capture", [](Findings& f) { f.capture[1].lost = 4; }, "4 lost"},
           {"capture", [](Findings& f) { f.capture[0].delay_min_us = -900; }, "camera.readout_us = 10000"},
           {"capture", [](Findings& f) { f.capture[0].readout_is_guessed = true; }, "camera.readout_us = 9000"},
           {"capture", [](Findings& f) { f.capture[0].frames = 70; }, "camera.exposure_us = 16666"},
           {"capture", [](Findings& f) { f.capture[0].jitter.p99_us = 4000; }, "jump"},
           {"capture", [](Findings& f) { f.capture[0].notes = {"camera x: has no gain"}; }, "has no gain"},
           {"sync", [](Findings& f) { f.pair = {.phase_ms = -9.5, .drift_ppm = 0}; }, "camera.tolerance = 0.5"},
           {"sync", [](Findings& f) { f.pair = {.phase_ms = 0.1, .drift_ppm = 20}; }, "nobody synchronises"},
           {"wake-up", [](Findings& f) { f.wake_up->latency.max_us = 1500; }, "over latency.late_ms = 1"},
           {"pipeline", [](Findings& f) { f.pipeline->compute.p99_us = 80'000; }, "camera.fps = 10.0"},
           {"camera", [](Findings& f) { f.configuration.camera.right.device = ""; }, "second one"},
           {"calibration", [](Findings& f) { f.has_calibration = false; }, "--calibration calibration.yml --write"},
           {"latency",
            [](Findings& f) {
              f.config = "rig.toml";
              f.latency->achievable_ms = 73;
            },
            "latency.output_ms = 73.0"},
       }) {
    Findings findings = good_board();
    c.spoil(findings);
    EXPECT_THAT(told(findings, c.topic), HasSubstr(c.says)) << c.topic;
    EXPECT_THAT(told(findings, c.topic), ::testing::StartsWith("NOTE ")) << c.topic;
    EXPECT_EQ(exit_code(worst_of(judge(findings))), 1) << c.topic;
  }
}

TEST(Judge, WhatKeepsItFromRunningIsAProblem) {
  struct Case {
    const char* topic;
    std::function<void(Findings&)> spoil;
    const char* says;
  };
  for (const Case& c : {
           Case{"camera",
                [](Findings& f) {
                  f.found.cameras.clear();
                  f.configuration.camera = {};
                  f.capture.clear();
                },
                "dmesg"},
           {"camera",
            [](Findings& f) {
              f.configuration.camera.driver = config::CameraDriver::kLibcamera;
              f.found.libcamera_problems = {"libcamera: there is no module for it: install it"};
            },
            "no module"},
           {"capture", [](Findings& f) { f.capture[1].failure = "camera /dev/video2: busy: ..."; },
            "right: camera /dev/video2"},
           {"config", [](Findings& f) { f.configuration_problems = {"calibration.yml: is not there"}; },
            "calibration.yml"},
           {"gpio",
            [](Findings& f) {
              f.lines = {{"signal near", "rig:NEAR", true, "", "GPIO line rig:NEAR: no such"}};
            },
            "signal near"},
           {"gpio",
            [](Findings& f) {
              f.lines = {{"signal near", "rig:NEAR", true, "gpioset", ""}};
            },
            "held by \"gpioset\""},
           {"line", [](Findings& f) { f.line = {.line = "rig:NEAR", .failures = 0, .latency = {}, .problem = "busy"}; },
            "busy"},
           {"rights",
            [](Findings& f) {
              f.configuration.realtime.mode = config::RealTimeMode::kEnforce;
              f.missing = {{"memory cannot be locked: no", "LimitMEMLOCK=infinity"}};
            },
            "memory cannot be locked"},
       }) {
    Findings findings = good_board();
    c.spoil(findings);
    EXPECT_THAT(told(findings, c.topic), ::testing::AllOf(HasSubstr("PROBLEM "), HasSubstr(c.says))) << c.topic;
    EXPECT_EQ(exit_code(worst_of(judge(findings))), 2) << c.topic;
  }
}

TEST(Judge, ThreadsThatAreRefusedAlikeAreOneItem) {
  Findings findings = good_board();
  findings.missing = {{"memory cannot be locked: Operation not permitted", "LimitMEMLOCK=infinity"},
                      {"thread st-publisher: real-time priority 82: Operation not permitted", "LimitRTPRIO=82"},
                      {"thread st-capture: real-time priority 81: Operation not permitted", "LimitRTPRIO=81"},
                      {"thread st-frames: real-time priority 80: Operation not permitted", "LimitRTPRIO=80"}};
  const std::string text = told(findings, "rights");
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2) << text;
  EXPECT_THAT(text, HasSubstr("st-publisher"));
  EXPECT_THAT(text, HasSubstr("and of 2 others"));
  EXPECT_THAT(text, HasSubstr("for user stereotrack"));
}

TEST(Judge, CamerasAreNoMatterToAScene) {
  Findings findings = good_board();
  findings.config = "rig.toml";
  findings.cameras_wanted = false;
  findings.found.cameras.clear();
  findings.capture.clear();
  findings.pair.reset();
  EXPECT_EQ(exit_code(worst_of(judge(findings))), 0);
}

TEST(Judge, ALineThatTheRunningDaemonHoldsIsFine) {
  Findings findings = good_board();
  findings.lines = {{"signal near", "rig:NEAR", true, "stereotrackd", ""}};
  EXPECT_EQ(told(findings, "gpio"), "");
}

// Worked by hand: 14 + 10 + 2 x 0.05 + 0.8 + 2.5 = 27.4.
TEST(Latency, IsTheSumOfWhatWasMeasuredRoundedUp) {
  Findings f;
  f.configuration.latency.lead_ms = 0.8;
  f.configuration.latency.output_ms = 40;
  CaptureMeasure left;
  left.side = "left";
  left.delay = {1000, 9'000, 10'000, 12'000, 12'500};
  CaptureMeasure right = left;
  right.side = "right";
  right.delay.p999_us = 13'000;
  f.capture = {left, right};
  f.pair = PairMeasure{.phase_ms = 1.0, .drift_ppm = {}};
  f.wake_up = WakeUpMeasure{.thread = "", .priority = 0, .beside_pipeline = false, .latency = {1000, 10, 30, 50, 90}};
  f.pipeline = PipelineMeasure{};
  f.pipeline->period_ms = 33;
  f.pipeline->compute = {1000, 7'000, 9'000, 10'000, 11'000};
  const auto verdict = latency_of(f);
  ASSERT_TRUE(verdict.has_value());
  EXPECT_DOUBLE_EQ(verdict->arrival_ms, 14);
  EXPECT_DOUBLE_EQ(verdict->compute_ms, 10);
  EXPECT_DOUBLE_EQ(verdict->wake_ms, 0.1);
  EXPECT_DOUBLE_EQ(verdict->spare_ms, 2.5);
  EXPECT_DOUBLE_EQ(verdict->achievable_ms, 28);
  EXPECT_FALSE(verdict->arrival_is_assumed);

  // Stamped 13 ms too late at most: what was 2 ms before its arrival takes 11.
  f.capture.pop_back();
  f.capture[0].delay = {1000, -12'500, -3'000, -2'000, -1'000};
  f.capture[0].delay_min_us = -13'000;
  EXPECT_DOUBLE_EQ(latency_of(f)->arrival_ms, 11);

  f.capture.clear();
  EXPECT_TRUE(latency_of(f)->arrival_is_assumed);
  EXPECT_DOUBLE_EQ(latency_of(f)->arrival_ms, 33);
  f.cameras_wanted = false;  // a film is there at once
  EXPECT_DOUBLE_EQ(latency_of(f)->arrival_ms, 0);
  f.pipeline.reset();
  EXPECT_FALSE(latency_of(f).has_value());
}

TEST(TailOf, NoneOneAndAThousand) {
  EXPECT_EQ(tail_of({}).count, 0U);
  const Tail one = tail_of({-2000});
  EXPECT_DOUBLE_EQ(one.p50_us, -2);
  EXPECT_DOUBLE_EQ(one.p999_us, -2);
  std::vector<std::int64_t> values;
  values.reserve(1000);
  for (int i = 1000; i >= 1; --i) values.push_back(i * 1000);
  const Tail all = tail_of(values);
  EXPECT_DOUBLE_EQ(all.p50_us, 500);
  EXPECT_DOUBLE_EQ(all.p99_us, 990);
  EXPECT_DOUBLE_EQ(all.p999_us, 999);
  EXPECT_DOUBLE_EQ(all.max_us, 1000);
}

}  // namespace
}  // namespace stereotrack::doctor
