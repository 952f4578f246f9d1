// Which camera is meant, what it offers, what it makes of a wish, and what is refused.
#include <gmock/gmock.h>

#include "tests/system/board/capture/vivid.hpp"

namespace stereotrack::capture::v4l2::test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

TEST_F(VividTest, ACameraIsFoundByPathLinkAndBus) {
  Settings wanted = settings();
  EXPECT_EQ(open(wanted)->info().name, "/dev/video0");
  wanted.device = "bus:platform:vivid-001";
  EXPECT_EQ(open(wanted)->info().name, "bus:platform:vivid-001 (/dev/video1)");
  ASSERT_EQ(::symlink(kRight, "/run/right-camera"), 0);
  wanted.device = "/run/right-camera";
  EXPECT_EQ(open(wanted)->info().name, "/run/right-camera (/dev/video1)");
  EXPECT_EQ(open(wanted)->info().model, "vivid, platform:vivid-001");
  ::unlink("/run/right-camera");
}

TEST_F(VividTest, AnAmbiguousOrAbsentCameraIsRefusedWithTheListOfAll) {
  Settings wanted = settings();
  for (const char* const name : {"name:vivid", "name:none such", "bus:usb-1", "left", "/dev/video99"}) {
    wanted.device = name;
    const std::string line = refusal([&] { (void)open(wanted); });
    EXPECT_THAT(line, AllOf(HasSubstr(name), HasSubstr("/dev/video0 (bus:platform:vivid-000, name:vivid)"),
                            HasSubstr("/dev/video1 (bus:platform:vivid-001"), Not(HasSubstr("\n"))));
  }
  wanted.device = "name:vivid";
  EXPECT_THAT(refusal([&] { (void)open(wanted); }), HasSubstr("several are called that"));
}

TEST_F(VividTest, WhatIsNoCameraIsRefused) {
  Settings wanted = settings();
  for (const char* const name : {"/dev/null", "/dev/media0", "/etc/passwd", "/dev"}) {
    wanted.device = name;
    EXPECT_THAT(refusal([&] { (void)open(wanted); }), HasSubstr(name)) << name;
  }
}

TEST_F(VividTest, WithoutPermissionTheGroupIsNamed) {
  ASSERT_EQ(::seteuid(65534), 0);
  const std::string line = refusal([&] { (void)open(settings()); });
  const std::vector<CameraFacts> cameras = list_cameras();
  ASSERT_EQ(::seteuid(0), 0);
  EXPECT_THAT(line, AllOf(HasSubstr("no permission for /dev/video0"), HasSubstr("group video")));
  ASSERT_FALSE(cameras.empty());
  EXPECT_THAT(cameras[0].problem, HasSubstr("group video"));
}

TEST_F(VividTest, AllCamerasAreListedWithWhatTheyOffer) {
  const std::vector<CameraFacts> cameras = list_cameras();
  ASSERT_GE(cameras.size(), 2U);
  EXPECT_EQ(cameras[0].path, kLeft);
  EXPECT_EQ(cameras[0].card, "vivid");
  EXPECT_EQ(cameras[0].bus, "platform:vivid-000");
  EXPECT_EQ(cameras[0].driver, "vivid");
  std::vector<std::string> names;
  for (const auto& format : cameras[0].formats) {
    if (!format.name.empty()) names.emplace_back(format.name);
  }
  EXPECT_THAT(names,
              AllOf(Contains("grey8"), Contains("yuyv"), Contains("nv12"), Contains("grey16"), Contains("rggb8")));
  const auto& sizes = cameras[0].formats[0].sizes;
  ASSERT_FALSE(sizes.empty());
  EXPECT_EQ(sizes[0].width, 320);
  EXPECT_EQ(sizes[0].max_height, 180);
  EXPECT_THAT(sizes[0].rates, Contains(60.0));
  const auto gain = std::find_if(cameras[0].controls.begin(), cameras[0].controls.end(),
                                 [](const auto& control) { return control.name == "Gain"; });
  ASSERT_NE(gain, cameras[0].controls.end());
  EXPECT_EQ(gain->maximum, 255);
  EXPECT_EQ(gain->value, 100);
}

TEST_F(VividTest, SizeFormatAndRateAreAsWanted) {
  std::vector<std::string> notes;
  Settings wanted = settings();
  wanted.width = 640;
  wanted.height = 480;
  wanted.fps = 25;
  wanted.format = "yuyv";
  const auto camera = open(wanted, &notes);
  EXPECT_EQ(camera->info().width, 640);
  EXPECT_EQ(camera->info().height, 480);
  EXPECT_EQ(camera->info().format, PixelFormat::kYuyv);
  EXPECT_EQ(camera->info().period, std::chrono::milliseconds(40));
  EXPECT_EQ(camera->info().buffers, 8U);
}

TEST_F(VividTest, AutoTakesGreyAndTheSizeThatIsSet) {
  Settings wanted = settings();
  wanted.width = 0;
  wanted.height = 0;
  wanted.format = "auto";
  wanted.fps = 0;
  { (void)open(settings()); }
  const auto camera = open(wanted);
  EXPECT_EQ(camera->info().format, PixelFormat::kGrey8);
  EXPECT_EQ(camera->info().width, 320);
  EXPECT_EQ(camera->info().height, 180);
}

TEST_F(VividTest, ASizeOrFormatThatIsNotOfferedIsRefusedWithThoseThatAre) {
  Settings wanted = settings();
  wanted.width = 333;
  EXPECT_THAT(refusal([&] { (void)open(wanted); }),
              AllOf(HasSubstr("333x180 cannot be had"), HasSubstr("320x180"), HasSubstr("1280x720")));
  wanted = settings();
  wanted.format = "grey10p";
  EXPECT_THAT(refusal([&] { (void)open(wanted); }), AllOf(HasSubstr("has no format grey10p"), HasSubstr("grey8, ")));
  wanted.format = "mjpeg";
  EXPECT_THAT(refusal([&] { (void)open(wanted); }), AllOf(HasSubstr("no format is called mjpeg"), HasSubstr("yuyv")));
}

TEST_F(VividTest, WhatTheDriverMakesOfARateIsTold) {
  std::vector<std::string> notes;
  Settings wanted = settings();
  wanted.fps = 7;
  EXPECT_NE(open(wanted, &notes)->info().period, std::chrono::nanoseconds(1'000'000'000 / 7));
  EXPECT_THAT(notes, Contains(AllOf(HasSubstr("/dev/video0"), HasSubstr("7 frames a second: the driver makes it"))));
}

TEST_F(VividTest, WhatTheDriverLacksIsToldOnce) {
  std::vector<std::string> notes;
  Settings wanted = settings();
  wanted.exposure_us = 5000;
  wanted.gain = 1.5;
  wanted.black_level = 4;
  { (void)open(wanted, &notes); }
  EXPECT_EQ(notes.size(), 2U);
  EXPECT_THAT(notes, AllOf(Contains(HasSubstr("no control of the exposure")),
                           Contains(HasSubstr("no control of the black level"))));
}

TEST_F(VividTest, GainIsSetAutomaticIsOffAndAClampedOneIsTold) {
  const Other other(kLeft);
  other.set("Gain, Automatic", 1);
  std::vector<std::string> notes;
  Settings wanted = settings();
  wanted.gain = 2;  // the driver starts with 100, which is taken for 1
  {
    const auto camera = started(wanted, &notes);
    EXPECT_EQ(nth_frame(*camera).settings.gain, 2.0F);
  }
  EXPECT_THAT(notes, Not(Contains(HasSubstr("gain"))));
  wanted.gain = 4;
  {
    const auto camera = started(wanted, &notes);
    EXPECT_EQ(nth_frame(*camera).settings.gain, 2.55F);
  }
  EXPECT_THAT(notes, Contains(HasSubstr("gain 4: the driver made it 2.55, number 255 of 0 to 255")));
}

TEST_F(VividTest, WhileGainIsAutomaticNobodyKnowsIt) {
  const Other other(kLeft);
  other.set("Gain, Automatic", 1);
  const auto camera = started(settings());
  EXPECT_EQ(nth_frame(*camera).settings.gain, std::nullopt);
}

TEST_F(VividTest, ACameraInUseIsBusy) {
  const auto camera = started(settings());
  EXPECT_THAT(refusal([&] { (void)open(settings()); }), HasSubstr("busy: another program streams from it"));
  Settings right = settings(kRight);
  EXPECT_EQ(refusal([&] { (void)started(right); }), "");
}

TEST_F(VividTest, MoreBuffersThanThereCanBeAreThoseThatThereCanBe) {
  Settings wanted = settings();
  wanted.buffers = 1000;
  EXPECT_EQ(open(wanted)->info().buffers, 32U);
  wanted.buffers = 0;
  EXPECT_EQ(open(wanted)->info().buffers, 3U);
}

TEST_F(VividTest, ALoopbackWithoutAWriterIsRefusedInOneLine) {
  Settings wanted = settings("/dev/video2");
  wanted.format = "auto";
  wanted.width = wanted.height = 0;
  const std::string line = refusal([&] { (void)started(wanted); });
  EXPECT_THAT(line, AllOf(HasSubstr("/dev/video2"), Not(HasSubstr("\n")))) << line;
}

}  // namespace
}  // namespace stereotrack::capture::v4l2::test
