// Cameras whose parts the program connects: vimc, with two sensors, debayers, a scaler and three video nodes.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>

#include "tests/system/board/capture/vivid.hpp"

namespace stereotrack::capture::v4l2::test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

class Media : public VividTest {
 protected:
  void SetUp() override {
    VividTest::SetUp();
    ASSERT_TRUE(std::filesystem::exists(kRaw)) << "no vimc";
  }
  static Settings vimc(const char* device, const char* format, int width, int height) {
    Settings wanted;
    wanted.device = device;
    wanted.format = format;
    wanted.width = width;
    wanted.height = height;
    wanted.fps = 30;
    wanted.readout_us = 0;
    return wanted;
  }
  static constexpr const char* kRaw = "/dev/v4l/by-path/platform-vimc.0-video-index0";
  static constexpr const char* kScaled = "/dev/v4l/by-path/platform-vimc.0-video-index2";
  static constexpr const char* kOtherRaw = "/dev/v4l/by-path/platform-vimc.1-video-index0";
};

TEST_F(Media, TheSensorIsSetToTheFormatAndSizeThatAreWanted) {
  std::vector<std::string> notes;
  for (const char* const format : {"rggb8", "bggr10", "grbg8"}) {
    for (const int width : {640, 320}) {
      const auto camera = started(vimc(kRaw, format, width, width * 3 / 4), &notes);
      EXPECT_THAT(camera->info().model, HasSubstr("Sensor A"));
      EXPECT_EQ(camera->info().width, width);
      const SensorFrame frame = nth_frame(*camera, 3);
      EXPECT_FALSE(frame.damaged);
      const Picture picture = camera->picture(frame.buffer);
      const std::uint8_t* const row = picture.row(picture.height / 2);
      EXPECT_NE(std::count(row, row + picture_bytes(picture.format, width, 1), row[0]), picture.stride_bytes) << format;
    }
  }
  EXPECT_THAT(notes, Not(Contains(HasSubstr("frame rate"))));
}

TEST_F(Media, AutoTakesTheCheapestThatPasses) {
  EXPECT_EQ(open(vimc(kRaw, "auto", 640, 480))->info().format, PixelFormat::kBayerRggb8);
  EXPECT_THAT(refusal([&] { (void)open(vimc(kRaw, "yuyv", 640, 480)); }),
              AllOf(HasSubstr("has no format yuyv"), HasSubstr("Sensor A"), HasSubstr("rggb8")));
}

TEST_F(Media, AWayThroughDebayerAndScalerIsConnectedForEitherSensor) {
  for (const char* const sensor : {"Sensor B", "Sensor A", "Sensor B"}) {
    Settings wanted = vimc(kScaled, "rgb8", 640, 480);
    wanted.sensor = sensor;
    const auto camera = started(wanted);
    EXPECT_THAT(camera->info().model, HasSubstr(sensor));
    EXPECT_EQ(camera->info().format, PixelFormat::kRgb8);
    EXPECT_FALSE(nth_frame(*camera, 3).damaged);
  }
}

// The sensor's other, fixed link goes to a debayer, which takes mosaics alone.
TEST_F(Media, WhatAFixedNeighbourDoesNotTakeIsRefusedAtTheStart) {
  EXPECT_THAT(refusal([&] { (void)started(vimc(kRaw, "rgb8", 640, 480)); }),
              AllOf(HasSubstr("its parts do not fit together"), HasSubstr("media-ctl -p")));
}

TEST_F(Media, ASensorThatIsNotThereIsRefusedWithThoseThatAre) {
  Settings wanted = vimc(kRaw, "auto", 640, 480);
  wanted.sensor = "imx219";
  EXPECT_THAT(refusal([&] { (void)open(wanted); }),
              AllOf(HasSubstr("no sensor imx219 leads to it"), HasSubstr("Sensor A, Sensor B")));
}

TEST_F(Media, TwoOfThemStreamSideBySide) {
  const auto left = started(vimc(kRaw, "rggb8", 640, 480));
  const auto right = started(vimc(kOtherRaw, "rggb8", 640, 480));
  for (int i = 0; i < 5; ++i) {
    left->give_back(nth_frame(*left).buffer);
    right->give_back(nth_frame(*right).buffer);
  }
}

}  // namespace
}  // namespace stereotrack::capture::v4l2::test
