#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/run_program.hpp"

// The program as it is installed, on the machine that runs the tests, whatever that is.
namespace stereotrack::doctor {
namespace {

namespace fs = std::filesystem;
using test::ProgramResult;
using test::run_program;
using test::TempDir;
using ::testing::HasSubstr;

const std::string kTool = STEREOTRACK_BIN_DIR "/stereotrack";

ProgramResult doctor(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {kTool, "doctor"});
  return run_program(arguments);
}

bool has_video_nodes() {
  for (const auto& entry : fs::directory_iterator("/dev")) {
    if (entry.path().filename().string().starts_with("video")) return true;
  }
  return false;
}

/// A scene in place of cameras: runs anywhere.
std::string scene_config(const TempDir& folder, const std::string& more = "") {
  return folder
      .write("rig.toml",
             "[source]\nname = \"synthetic:eleven\"\nfps = 50.0\n[synthetic]\nwidth = 160\nheight = 120\n" + more)
      .string();
}

TEST(DoctorCommand, AMachineWithoutCamerasIsToldSoWithTheWayOut) {
  if (has_video_nodes()) GTEST_SKIP() << "this machine has cameras";
  const ProgramResult done = doctor({"--no-measure"});
  EXPECT_EQ(done.exit_code, 2) << done.err;
  EXPECT_THAT(done.out, HasSubstr("PROBLEM camera      there is none in /dev/video*"));
  EXPECT_THAT(done.out, HasSubstr("sudo dmesg | grep"));
  EXPECT_THAT(done.out, HasSubstr("cannot run (exit code 2): camera"));
  const TempDir folder;
  const ProgramResult write = doctor({"--no-measure", "--write", (folder / "rig.toml").string()});
  EXPECT_EQ(write.exit_code, 2);
  EXPECT_THAT(write.err, HasSubstr("not written: there is no camera"));
  EXPECT_FALSE(fs::exists(folder / "rig.toml"));
}

TEST(DoctorCommand, ASceneIsMeasuredAndTheReportIsOneScreen) {
  const TempDir folder;
  const ProgramResult done =
      doctor({"--config", scene_config(folder), "--seconds", "0.3", "--line", "sim:doctor_command"});
  EXPECT_TRUE(done.exit_code == 0 || done.exit_code == 1) << done.out << done.err;
  for (const char* const topic :
       {"kernel", "cpu", "memory", "rights", "clock", "gpio", "pwm", "wake-up", "line", "pipeline", "latency"}) {
    EXPECT_THAT(done.out, ::testing::ContainsRegex(std::string("(OK|NOTE) +") + topic + " ")) << done.out;
  }
  EXPECT_THAT(done.out, HasSubstr("160x120 colour stereo"));
  EXPECT_LE(std::count(done.out.begin(), done.out.end(), '\n'), 40);
}

TEST(DoctorCommand, JsonIsOneObjectWithTheExitCode) {
  const TempDir folder;
  const ProgramResult done = doctor({"--config", scene_config(folder), "--no-measure", "--json"});
  const auto json = nlohmann::json::parse(done.out);
  EXPECT_EQ(json.at("exit_code"), done.exit_code);
  EXPECT_NE(json.at("found").at("kernel").at("release"), "");
  EXPECT_GE(json.at("found").at("cpu").at("cores"), 1);
  EXPECT_TRUE(json.at("measured").at("pipeline").is_null());
}

TEST(DoctorCommand, ConfiguredCamerasLinesAndCalibrationThatAreNotThereAreProblems) {
  const TempDir folder;
  const std::string config =
      folder
          .write("rig.toml",
                 "[source]\nname = \"cameras\"\n[camera]\nleft.device = \"/dev/no-camera\"\n"
                 "right.device = \"/dev/no-other\"\n[calibration]\nfile = \"/no/calibration.yml\"\n"
                 "[[signal]]\nname = \"near\"\nline = \"gpiochip77:3\"\nwhen = \"confirmed\"\n")
          .string();
  for (const bool measure : {false, true}) {
    std::vector<std::string> arguments{"--config", config};
    if (measure) {
      arguments.insert(arguments.end(), {"--seconds", "0.2", "--json"});
    } else {
      arguments.emplace_back("--no-measure");
    }
    const ProgramResult done = doctor(arguments);
    EXPECT_EQ(done.exit_code, 2) << done.err;
    for (const char* const what : {"/dev/no-camera", "/dev/no-other", "/no/calibration.yml", "signal near"}) {
      EXPECT_THAT(done.out, HasSubstr(what));
    }
  }
}

TEST(DoctorCommand, BadUsageIsOneLineAndExitCodeTwo) {
  const TempDir folder;
  const std::string there = folder.write("there.toml", "mine").string();
  const std::string bad = folder.write("bad.toml", "[latency]\noutput = 3\n").string();
  struct Case {
    std::vector<std::string> arguments;
    std::string says;
  };
  for (const Case& c : {Case{{"--write", there}, "is there already and stays as it is"},
                        {{"--config", bad}, "latency.output: unknown key"},
                        {{"--config", (folder / "absent.toml").string()}, "absent.toml"},
                        {{"--line", "nonsense"}, "CHIP:LINE"},
                        {{"--line", "sim:x", "--no-measure"}, "--no-measure"},
                        {{"--config", bad, "--write", (folder / "new.toml").string()}, "--config"},
                        {{"--seconds", "0"}, "--seconds"},
                        {{"--no-measure", "--calibration", (folder / "absent.yml").string()}, "absent.yml"}}) {
    const ProgramResult done = doctor(c.arguments);
    EXPECT_EQ(done.exit_code, 2) << c.says;
    EXPECT_THAT(done.err, HasSubstr(c.says));
    EXPECT_EQ(std::count(done.err.begin(), done.err.end(), '\n'), 1) << done.err;
  }
  EXPECT_EQ(test::read_text(there), "mine");
}

TEST(DoctorCommand, HelpNamesTheExitCodes) {
  const ProgramResult done = doctor({"--help"});
  EXPECT_EQ(done.exit_code, 0);
  EXPECT_THAT(done.out, HasSubstr("Exit code: 0 ready, 1 works with limits, which are named, 2 cannot run."));
}

}  // namespace
}  // namespace stereotrack::doctor
