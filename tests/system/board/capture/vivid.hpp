#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "drivers/capture/v4l2/device.hpp"
#include "drivers/capture/v4l2/v4l2.hpp"

/// The board's two cameras (guest/devices), as tests use them.
namespace stereotrack::capture::v4l2::test {

inline constexpr const char* kLeft = "/dev/video0";
inline constexpr const char* kRight = "/dev/video1";

/// As another program would change a camera.
class Other {
 public:
  explicit Other(const std::string& path) { EXPECT_EQ(device_.open(path), 0) << path; }

  /// By the control's name, as v4l2-ctl -l lists it with other letters: "Timestamp Source". A button: any value.
  void set(std::string_view name, std::int64_t value = 1) const {
    v4l2_query_ext_ctrl query{};
    query.id = V4L2_CTRL_FLAG_NEXT_CTRL;
    while (device_.ask(VIDIOC_QUERY_EXT_CTRL, query) == 0) {
      if (name == query.name) {
        v4l2_control control{query.id, static_cast<std::int32_t>(value)};
        EXPECT_EQ(device_.ask(VIDIOC_S_CTRL, control), 0) << name << " = " << value;
        return;
      }
      query.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    }
    ADD_FAILURE() << "no control " << name;
  }
  [[nodiscard]] const Device& device() const { return device_; }

 private:
  Device device_;
};

inline void write_file(const std::string& path, std::string_view text) {
  std::ofstream file(path);
  file << text << std::flush;
  EXPECT_TRUE(file.good()) << path;
}

/// vivid anew, with other parameters than the board's.
inline void load_vivid(const std::string& parameters) {
  const std::string command =
      "modprobe -r vivid && modprobe vivid n_devs=2 node_types=0x1,0x1 num_inputs=1,1 input_types=0,0 vid_cap_nr=0,1 "
      "no_error_inj=0 " +
      parameters + " && udevadm settle";
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
}

/// A camera with the same things set, whatever the last test did to it.
class VividTest : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* const path : {kLeft, kRight}) {
      const Other other(path);
      other.set("Wrap Sequence Number", 0);
      other.set("Wrap Timestamp", 0);
      other.set("Timestamp Source", 0);
      other.set("Percentage of Dropped Buffers", 0);
      other.set("Test Pattern", 0);
      other.set("OSD Text Mode", 2);
      other.set("Gain, Automatic", 0);
      other.set("Gain", 100);
    }
  }

  static Settings settings(const char* device = kLeft) {
    Settings wanted;
    wanted.device = device;
    wanted.width = 320;
    wanted.height = 180;
    wanted.fps = 50;
    wanted.format = "grey8";
    wanted.readout_us = 0;
    return wanted;
  }
  static std::unique_ptr<Camera> started(const Settings& wanted, std::vector<std::string>* notes = nullptr) {
    auto camera = open(wanted, notes);
    camera->start();
    return camera;
  }

  /// Waits as the capture thread does.
  static Camera::Take wait_take(Camera& camera, SensorFrame& frame, int limit_ms = 2000) {
    pollfd waiting{camera.descriptor(), POLLIN, 0};
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(limit_ms);
    while (std::chrono::steady_clock::now() < end) {
      const Camera::Take take = camera.take(frame);
      if (take != Camera::Take::kNothing) return take;
      (void)::poll(&waiting, 1, limit_ms);
    }
    return Camera::Take::kNothing;
  }
  /// The nth frame from now on, taken; those before are given back.
  static SensorFrame nth_frame(Camera& camera, int n = 1) {
    SensorFrame frame;
    for (int i = 1; i <= n; ++i) {
      EXPECT_EQ(wait_take(camera, frame), Camera::Take::kFrame) << camera.failure();
      if (i < n) camera.give_back(frame.buffer);
    }
    return frame;
  }
  /// What it throws; empty: nothing.
  template <class Work>
  static std::string refusal(Work&& work) {
    try {
      work();
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return {};
  }
};

}  // namespace stereotrack::capture::v4l2::test
