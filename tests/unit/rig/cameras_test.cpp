#include "firmware-app/rig/cameras.hpp"

#include <gtest/gtest.h>

namespace stereotrack {
namespace {

using namespace std::chrono_literals;
using capture::v4l2::Memory;
using trigger::Side;

/// Each key set to what no standard is.
config::CameraConfig camera() {
  config::CameraConfig c;
  c.left = {"/dev/left", "Sensor A"};
  c.right = {"/dev/right", "Sensor B"};
  c.width = 322;
  c.height = 242;
  c.format = "grey10";
  c.fps = 17;
  c.buffers = 5;
  c.exposure_us = 4321;
  c.gain = 2.5;
  c.black_level = 7;
  c.control_delay_frames = 4;
  c.readout_us = 8765;
  c.timeout_ms = 321;
  c.tolerance = 0.375;
  return c;
}

TEST(RigCameras, EachKeyReachesTheDriverOfEitherSide) {
  for (const Side side : {Side::kLeft, Side::kRight}) {
    const capture::v4l2::Settings asked = v4l2_settings(camera(), side);
    EXPECT_EQ(asked.device, side == Side::kLeft ? "/dev/left" : "/dev/right");
    EXPECT_EQ(asked.sensor, side == Side::kLeft ? "Sensor A" : "Sensor B");
    EXPECT_EQ(asked.width, 322);
    EXPECT_EQ(asked.height, 242);
    EXPECT_EQ(asked.format, "grey10");
    EXPECT_EQ(asked.fps, 17);
    EXPECT_EQ(asked.buffers, 5);
    EXPECT_EQ(asked.exposure_us, 4321);
    EXPECT_EQ(asked.gain, 2.5);
    EXPECT_EQ(asked.black_level, 7);
    EXPECT_EQ(asked.control_delay_frames, 4);
    EXPECT_EQ(asked.readout_us, 8765);
    EXPECT_EQ(asked.memory, Memory::kMapped);
  }
}

TEST(RigCameras, WhatIsNotSetIsLeftToTheDriver) {
  const capture::v4l2::Settings asked = v4l2_settings({}, Side::kLeft);
  EXPECT_FALSE(asked.exposure_us);
  EXPECT_FALSE(asked.gain);
  EXPECT_FALSE(asked.readout_us);
  EXPECT_FALSE(asked.black_level);
  EXPECT_EQ(asked.control_delay_frames, 2);
}

TEST(RigCameras, DmabufsAreTheDriversOrAHeaps) {
  config::CameraConfig c = camera();
  c.memory = config::CameraMemory::kDmabuf;
  EXPECT_EQ(v4l2_settings(c, Side::kRight).memory, Memory::kExported);
  c.heap = "/dev/udmabuf";
  EXPECT_EQ(v4l2_settings(c, Side::kRight).memory, Memory::kImported);
  EXPECT_EQ(v4l2_settings(c, Side::kRight).heap, "/dev/udmabuf");
}

TEST(RigCameras, APairIsMadeAsTheTriggerSays) {
  config::Configuration c;
  c.camera = camera();
  capture::StereoCameras::Config pairing = pairing_config(c);
  EXPECT_EQ(pairing.name, "/dev/left, /dev/right");
  EXPECT_TRUE(pairing.stereo);
  EXPECT_FALSE(pairing.triggered);
  EXPECT_EQ(pairing.tolerance, 0.375);
  EXPECT_EQ(pairing.timeout, 321ms);
  EXPECT_EQ(pairing.exposure, 4321us);
  c.trigger.mode = config::TriggerMode::kGpio;
  c.trigger.delay_us = 23;
  c.camera.fps = 20;
  pairing = pairing_config(c);
  EXPECT_TRUE(pairing.triggered);
  EXPECT_EQ(pairing.period, 50ms);
  EXPECT_EQ(pairing.pulse_delay, 23us);
  c.camera.right.device.clear();
  EXPECT_FALSE(pairing_config(c).stereo);
}

}  // namespace
}  // namespace stereotrack
