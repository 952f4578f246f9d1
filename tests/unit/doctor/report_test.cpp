#include "firmware-app/stereotrack/doctor/report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/unit/doctor/found.hpp"

namespace stereotrack::doctor {
namespace {

using ::testing::HasSubstr;

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::string report_of(const Findings& findings) { return report(findings, judge(findings)); }

/// Everything there is, and everything wrong, with long names.
Findings crowded() {
  Findings f = good_board();
  f.kernel.preemption = Preemption::kVoluntary;
  f.cpu.governors = {"ondemand", "schedutil"};
  f.cpu.throttled = true;
  f.clocks.tai_error_us.reset();
  f.clocks.source = "hpet";
  for (int i = 0; i < 30; ++i) {
    f.found.cameras.push_back(camera_at(10 + i, "uvcvideo", "A camera with a name that goes on and on",
                                        "usb-0000:01:00.0-1.4.2", f.found.cameras[0].facts.formats));
    f.found.cameras.back().facts.problem = i % 3 == 0 ? std::string(300, 'x') : "";
  }
  f.chips.resize(9, f.chips[0]);
  f.missing = {{"memory cannot be locked: " + std::string(200, 'y'), "LimitMEMLOCK=infinity in the unit"},
               {"thread st-publisher: real-time priority 82: no", "LimitRTPRIO=82"}};
  f.capture[0].notes.assign(10, "camera bus:usb-1: refuses " + std::string(60, 'z') + " and goes on");
  f.configuration_problems.assign(
      6, "calibration.yml: what is wrong with it takes many words to say, really many of them");
  return f;
}

TEST(Report, IsOneScreenWhateverWasFound) {
  for (const Findings& findings : {good_board(), crowded(), Findings{}}) {
    const std::vector<std::string> lines = lines_of(report_of(findings));
    EXPECT_LE(lines.size(), static_cast<std::size_t>(kScreenLines));
    for (const std::string& line : lines) EXPECT_LE(line.size(), static_cast<std::size_t>(kScreenColumns)) << line;
  }
}

TEST(Report, WhereThereIsNoRoomWhatIsFineGoesFirstAndThatIsSaid) {
  const std::string text = report_of(crowded());
  EXPECT_THAT(text, ::testing::Not(HasSubstr("\nOK ")));
  EXPECT_THAT(text, HasSubstr("PROBLEM config"));
  EXPECT_THAT(text, HasSubstr("for which there is no room: stereotrack doctor --json"));
  EXPECT_THAT(lines_of(text).back(), ::testing::StartsWith("cannot run (exit code 2): config"));
}

TEST(Report, EachLimitIsFollowedByWhatToType) {
  Findings findings = good_board();
  findings.cpu.governors = {"ondemand"};
  const std::vector<std::string> lines = lines_of(report_of(findings));
  const auto note = std::find_if(lines.begin(), lines.end(), [](const auto& line) { return line.starts_with("NOTE"); });
  ASSERT_NE(note, lines.end());
  EXPECT_EQ(*note,
            "NOTE    cpu         4 cores to 2400 MHz, 51 C, governor ondemand: after each pause cores are slow at");
  EXPECT_EQ(note[1], "                    first");
  EXPECT_EQ(note[2], "         -> keep the frequency high, at each boot anew:");
  EXPECT_EQ(note[3],
            "            echo performance | sudo tee /sys/devices/system/cpu/cpufreq/policy*/scaling_governor");
  EXPECT_EQ(lines.back(), "works with limits (exit code 1): cpu");
}

TEST(Report, SaysWhereItIsAndThatAllIsWell) {
  const std::vector<std::string> lines = lines_of(report_of(good_board()));
  EXPECT_THAT(lines.front(), HasSubstr("stereotrack 0 doctor: mast, Raspberry Pi 5 Model B Rev 1.0, user stereotrack"));
  EXPECT_EQ(lines.back(), "ready (exit code 0)");
  EXPECT_THAT(report_of(good_board()), HasSubstr("/dev/video2 Eye, usb-2: grey8 to 1280x960 at 30/s <- right"));
}

TEST(Json, HasTheKeysThatArePromised) {
  Findings findings = good_board();
  findings.line = LineMeasure{.line = "rig:NEAR", .failures = 0, .latency = {1000, 3, 9, 12, 14}, .problem = ""};
  const auto json = nlohmann::json::parse(doctor::json(findings, judge(findings)));
  EXPECT_EQ(json.at("format"), 1);
  EXPECT_EQ(json.at("verdict"), "ready");
  EXPECT_EQ(json.at("exit_code"), 0);
  EXPECT_EQ(json.at("items").at(0).at("topic"), "kernel");
  EXPECT_EQ(json.at("items").at(0).at("verdict"), "ok");
  const auto& found = json.at("found");
  EXPECT_EQ(found.at("kernel").at("preemption"), "rt");
  EXPECT_EQ(found.at("cpu").at("governors").at(0), "performance");
  EXPECT_EQ(found.at("memory").at("dma_heaps").size(), 2U);
  EXPECT_TRUE(found.at("rights").at("locked_memory_limit_kb").is_null());
  EXPECT_EQ(found.at("gpio").at("chips").at(0).at("lines").at(1).at("consumer"), "spi0");
  EXPECT_EQ(found.at("cameras").at(1).at("formats").at(0).at("sizes").at(0).at("rates").at(2), 60);
  EXPECT_EQ(found.at("cameras").at(0).at("driver"), "v4l2");
  EXPECT_EQ(found.at("pwm").at(0).at("channels"), 4);
  const auto& measured = json.at("measured");
  EXPECT_EQ(measured.at("capture").at(1).at("side"), "right");
  EXPECT_EQ(measured.at("line").at("latency").at("max_us"), 14);
  EXPECT_EQ(measured.at("wake_up").at("priority"), 82);
  EXPECT_EQ(measured.at("latency").at("achievable_ms"), 29);
}

TEST(Json, IsValidWhateverDriversCallThemselves) {
  Findings findings = good_board();
  findings.found.cameras[0].facts.card = "\xff\xfe\"\\\n";
  EXPECT_TRUE(nlohmann::json::accept(doctor::json(findings, judge(findings))));
}

TEST(Json, WhatWasNotMeasuredIsNull) {
  const Findings nothing;
  const auto json = nlohmann::json::parse(doctor::json(nothing, judge(nothing)));
  EXPECT_EQ(json.at("verdict"), "cannot_run");
  EXPECT_EQ(json.at("exit_code"), 2);
  for (const char* const key : {"pair", "wake_up", "line", "pipeline", "latency"}) {
    EXPECT_TRUE(json.at("measured").at(key).is_null()) << key;
  }
}

}  // namespace
}  // namespace stereotrack::doctor
