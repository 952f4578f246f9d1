#include "firmware-app/stereotrack/doctor/suggest.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>

#include <csignal>
#include <fstream>

#include "config/load.hpp"
#include "firmware-app/stereotrack/doctor/measure.hpp"
#include "tests/support/run_program.hpp"
#include "tests/unit/doctor/found.hpp"

namespace stereotrack::doctor {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Formats = std::vector<capture::v4l2::CameraFacts::Format>;

const Formats kGrey{{"GREY", "grey8", {size_of(640, 480, {25, 30, 60})}}};

config::Configuration chosen_of(const std::vector<CameraFound>& cameras, int width = 640, int height = 480,
                                double fps = 30) {
  config::Configuration configuration;
  configuration.camera.width = width;
  configuration.camera.height = height;
  configuration.camera.fps = fps;
  EXPECT_TRUE(choose_cameras(cameras, configuration));
  return configuration;
}

TEST(ChooseCameras, TwoOfOneKindAreTakenAndAnotherLeftAlone) {
  const auto c =
      chosen_of({camera_at(0, "bcm2835-codec", "codec", "platform:codec", kGrey),
                 camera_at(1, "uvcvideo", "Webcam", "usb-9", kGrey), camera_at(2, "uvcvideo", "Eye", "usb-1", kGrey),
                 camera_at(4, "uvcvideo", "Eye", "usb-2", kGrey)});
  EXPECT_EQ(c.source.name, "cameras");
  EXPECT_EQ(c.camera.left.device, "bus:usb-1");
  EXPECT_EQ(c.camera.right.device, "bus:usb-2");
  EXPECT_EQ(c.camera.format, "grey8");
  EXPECT_EQ(c.camera.fps, 30);
}

TEST(ChooseCameras, TwoNodesOfOneCameraAreOneCamera) {
  const auto c = chosen_of(
      {camera_at(0, "vimc", "vimc", "platform:vimc.0", kGrey), camera_at(1, "vimc", "vimc", "platform:vimc.0", kGrey)});
  EXPECT_EQ(c.camera.left.device, "/dev/video0");  // the bus names two nodes
  EXPECT_EQ(c.camera.right.device, "");
}

TEST(ChooseCameras, APlaceThatLastsIsTheName) {
  std::vector<CameraFound> cameras{camera_at(0, "unicam", "unicam", "platform:a", kGrey),
                                   camera_at(1, "unicam", "unicam", "platform:b", kGrey)};
  cameras[0].facts.links = {"/dev/v4l/by-id/usb-Eye", "/dev/v4l/by-path/platform-a-video-index0"};
  cameras[1].facts.links = {"/dev/v4l/by-path/platform-b-video-index0"};
  EXPECT_EQ(chosen_of(cameras).camera.left.device, "/dev/v4l/by-path/platform-a-video-index0");
  EXPECT_EQ(chosen_of(cameras).camera.right.device, "/dev/v4l/by-path/platform-b-video-index0");
  // Of one alone it may be the other's tomorrow.
  cameras[1].facts.links.clear();
  EXPECT_EQ(chosen_of(cameras).camera.left.device, "bus:platform:a");
  EXPECT_EQ(chosen_of(cameras).camera.right.device, "bus:platform:b");
}

TEST(ChooseCameras, SizeFormatAndRateAreWhatBothHave) {
  const Formats left{
      {"YUYV", "yuyv", {size_of(1920, 1080, {30}), size_of(800, 600, {15, 60}), size_of(320, 240, {30})}},
      {"GREY", "grey8", {size_of(1920, 1080, {30})}}};
  const Formats right{
      {"YUYV", "yuyv", {size_of(1920, 1080, {30}), size_of(800, 600, {10, 12.5, 90}), size_of(320, 240, {30})}}};
  const std::vector<CameraFound> cameras{camera_at(0, "a", "Eye", "1", left), camera_at(1, "a", "Eye", "2", right)};
  // As asked for; else the largest below it; else the smallest.
  auto c = chosen_of(cameras, 1920, 1080);
  EXPECT_EQ(c.camera.width, 1920);
  EXPECT_EQ(c.camera.format, "yuyv");
  c = chosen_of(cameras, 1024, 768);
  EXPECT_EQ(c.camera.width, 800);
  EXPECT_EQ(c.camera.fps, 12.5);  // both can, and no faster
  c = chosen_of(cameras, 100, 100);
  EXPECT_EQ(c.camera.width, 320);
  EXPECT_EQ(c.camera.height, 240);
}

TEST(ChooseCameras, OfARangeEveryRateIsThere) {
  const Formats range{{"GREY", "grey8", {{16, 16, 1920, 1080, {120, 1}}}}};
  const auto c = chosen_of({camera_at(0, "a", "Eye", "1", range)}, 640, 480, 30);
  EXPECT_EQ(c.camera.width, 640);
  EXPECT_EQ(c.camera.fps, 30);
  EXPECT_EQ(c.camera.right.device, "");
}

TEST(ChooseCameras, TheKernelsCamerasComeBeforeLibcamerasAndTwoBeforeOne) {
  std::vector<CameraFound> cameras;
  for (const char* const id : {"/base/soc/i2c0/imx296@1a", "/base/soc/i2c1/imx296@1a"}) {
    cameras.push_back(
        camera_at(0, "libcamera", "imx296", "external", {{"R8", "grey8", {{64, 64, 1456, 1088, {60, 1}}}}}));
    cameras.back().driver = config::CameraDriver::kLibcamera;
    cameras.back().facts.path = id;
  }
  cameras.push_back(camera_at(0, "uvcvideo", "Eye", "usb-1", kGrey));
  const auto c = chosen_of(cameras);
  EXPECT_EQ(c.camera.driver, config::CameraDriver::kLibcamera);
  EXPECT_EQ(c.camera.left.device, "/base/soc/i2c0/imx296@1a");
  EXPECT_EQ(c.camera.right.device, "/base/soc/i2c1/imx296@1a");
  EXPECT_EQ(c.camera.width, 640);
  EXPECT_EQ(c.camera.fps, 30);
  cameras.push_back(camera_at(1, "uvcvideo", "Eye", "usb-2", kGrey));
  EXPECT_EQ(chosen_of(cameras).camera.driver, config::CameraDriver::kV4l2);
  EXPECT_EQ(chosen_of(cameras).camera.left.device, "bus:usb-1");
}

TEST(ChooseCameras, WhatCannotBeUsedIsNotChosen) {
  config::Configuration c;
  EXPECT_FALSE(choose_cameras({}, c));
  std::vector<CameraFound> cameras{camera_at(0, "a", "Eye", "1", {{"MJPG", "", {size_of(640, 480, {30})}}}),
                                   camera_at(1, "a", "Eye", "2", kGrey)};
  cameras[1].facts.problem = "no permission for /dev/video1";
  EXPECT_FALSE(choose_cameras(cameras, c));
}

config::Configuration loaded(const std::string& text) {
  const std::vector<config::Layer> layers{config::text_layer("suggested", text)};
  return config::load(layers).configuration;
}

TEST(Suggest, LoadsAndSaysWhatWasChosenAndMeasured) {
  const config::Configuration c = loaded(suggest(good_board(), "/etc/stereotrack/calibration.yml"));
  EXPECT_EQ(c.source.name, "cameras");
  EXPECT_EQ(c.camera.left.device, "bus:usb-1");
  EXPECT_EQ(c.camera.right.device, "bus:usb-2");
  EXPECT_EQ(c.camera.width, 640);
  EXPECT_EQ(c.camera.fps, 30);
  EXPECT_EQ(c.camera.format, "grey8");
  EXPECT_EQ(c.camera.tolerance, 0.25);
  EXPECT_EQ(c.camera.readout_us, 0);
  EXPECT_EQ(c.calibration.file, "/etc/stereotrack/calibration.yml");
  EXPECT_EQ(c.latency.output_ms, 29);
}

TEST(Suggest, WithoutACalibrationTheRightCameraIsACommentAndTakesItsPlaceByOneKeyStroke) {
  std::string text = suggest(good_board(), std::nullopt);
  EXPECT_EQ(loaded(text).camera.right.device, "");
  EXPECT_EQ(loaded(text).calibration.file, "");
  for (const char* const line : {"#right.device", "#[calibration]", "#file"}) {
    const std::size_t at = text.find(line);
    ASSERT_NE(at, std::string::npos) << text;
    text.erase(at, 1);
  }
  EXPECT_EQ(loaded(text).camera.right.device, "bus:usb-2");
  EXPECT_EQ(loaded(text).calibration.file, "calibration.yml");
}

TEST(Suggest, WhatTheCamerasLackIsMadeUpFor) {
  Findings f = good_board();
  f.capture[1].delay_min_us = -900;
  f.pair = PairMeasure{.phase_ms = -9.5, .drift_ppm = 20};
  const config::Configuration c = loaded(suggest(f, "c.yml"));
  EXPECT_EQ(c.camera.tolerance, 0.5);
  // 9 ms were in force, 0.9 were missing, and 0.1 for good measure.
  EXPECT_EQ(c.camera.readout_us, 10'000);
}

// The daemon does not start without it.
TEST(Suggest, AReadoutThatNobodyTellsIsWritten) {
  Findings f = good_board();
  f.capture[0].readout_is_guessed = true;
  f.capture[0].readout_us = 16'666.4;
  EXPECT_EQ(loaded(suggest(f, "c.yml")).camera.readout_us, 16'667);
}

// They may stand together by chance, and half a period apart at the next start.
TEST(Suggest, TwoWhoseDriftIsNotKnownArePairedWhereverTheyStand) {
  Findings f = good_board();
  f.pair = PairMeasure{.phase_ms = 0.5, .drift_ppm = std::nullopt};
  EXPECT_EQ(loaded(suggest(f, "c.yml")).camera.tolerance, 0.5);
  f.pair = PairMeasure{.phase_ms = 0.5, .drift_ppm = 0};
  EXPECT_EQ(loaded(suggest(f, "c.yml")).camera.tolerance, 0.25);
}

TEST(Suggest, NamesTheDriverWhereItIsNotTheKernels) {
  Findings f = good_board();
  f.configuration.camera.driver = config::CameraDriver::kLibcamera;
  EXPECT_EQ(loaded(suggest(f, "c.yml")).camera.driver, config::CameraDriver::kLibcamera);
}

TEST(Suggest, WhatWasNotMeasuredIsNotSaid) {
  Findings f = good_board();
  f.latency.reset();
  f.capture.clear();
  f.pair.reset();
  const std::string text = suggest(f, std::nullopt);
  EXPECT_THAT(text, Not(HasSubstr("[latency]")));
  EXPECT_EQ(loaded(text).camera.left.device, "bus:usb-1");
}

TEST(Suggest, NamesOfDriversDoNotBreakTheFile) {
  Findings f = good_board();
  f.host = "mast\nleft.device = 3";
  f.kernel.board = "\"board\"\r";
  f.capture[0].name = "eye\n[source]";
  f.configuration.camera.left.device = "name:\"Eye\" \\ 2";
  const config::Configuration c = loaded(suggest(f, "a \"b\".yml"));
  EXPECT_EQ(c.camera.left.device, "name:\"Eye\" \\ 2");
  EXPECT_EQ(c.calibration.file, "a \"b\".yml");
}

std::string refusal_of_writing(const std::filesystem::path& path) {
  try {
    write_new_file(path, "text");
  } catch (const config::Error& error) {
    return error.what();
  }
  return {};
}

TEST(WriteNewFile, WritesOnceAndNeverOver) {
  const test::TempDir folder;
  const auto path = folder / "rig.toml";
  EXPECT_EQ(refusal_of_writing(path), "");
  EXPECT_EQ(test::read_text(path), "text");
  std::ofstream(path) << "mine";
  EXPECT_THAT(refusal_of_writing(path), HasSubstr("is there already and stays as it is"));
  EXPECT_EQ(test::read_text(path), "mine");
  // A link that leads nowhere is something, too.
  std::filesystem::create_symlink(folder / "elsewhere", folder / "link");
  EXPECT_THAT(refusal_of_writing(folder / "link"), HasSubstr("is there already"));
  EXPECT_FALSE(std::filesystem::exists(folder / "elsewhere"));
  EXPECT_THAT(refusal_of_writing(folder / "no/such/rig.toml"), HasSubstr("cannot be made: No such file"));
}

TEST(WriteNewFile, AFullDiskLeavesNothing) {
  const test::TempDir folder;
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit little{2, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &little), 0);
  const std::string refusal = refusal_of_writing(folder / "rig.toml");
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  (void)std::signal(SIGXFSZ, handler);
  EXPECT_THAT(refusal, HasSubstr("rig.toml: cannot be written: File too large"));
  EXPECT_FALSE(std::filesystem::exists(folder / "rig.toml"));
}

}  // namespace
}  // namespace stereotrack::doctor
