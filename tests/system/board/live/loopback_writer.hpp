#pragma once

// Who writes into a v4l2loopback device, of Debian 12 and of 13.

#include <linux/videodev2.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>

#include "drivers/capture/v4l2/device.hpp"

namespace stereotrack::test {

/// The device with that format and rate, ready for readers, in which pictures then are put with write(2). Throws where
/// it cannot be had so. Not in the device's own buffers: VIDIOC_REQBUFS of a writer would unmap those of its readers.
[[nodiscard]] inline capture::v4l2::Device open_loopback(const std::string& path, int width, int height,
                                                         std::uint32_t pixels, double fps) {
  capture::v4l2::Device device;
  const auto check = [&](int error, const char* what) {
    if (error != 0) throw std::runtime_error(path + ": " + what + ": " + std::strerror(error));
  };
  check(device.open(path), "cannot be opened");
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  format.fmt.pix.width = static_cast<std::uint32_t>(width);
  format.fmt.pix.height = static_cast<std::uint32_t>(height);
  format.fmt.pix.pixelformat = pixels;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  check(device.ask(VIDIOC_S_FMT, format), "does not take the format");
  if (format.fmt.pix.pixelformat != pixels || format.fmt.pix.width != static_cast<std::uint32_t>(width)) {
    throw std::runtime_error(path + ": takes another format than that of the pictures");
  }
  v4l2_streamparm rate{};
  rate.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  rate.parm.output.timeperframe = {1000, static_cast<std::uint32_t>(fps * 1000)};
  check(device.ask(VIDIOC_S_PARM, rate), "does not take the rate");
  int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  const int error = device.ask(VIDIOC_STREAMON, type);
  if (error == EINVAL) {
    // From v4l2loopback 0.13 on write(2) starts it, and readers may start before only where the format is kept: a
    // control of its own, by its number in v4l2loopback.h.
    v4l2_control keep_format{V4L2_CID_USER_BASE | 0xf000U, 1};
    check(device.ask(VIDIOC_S_CTRL, keep_format), "does not keep its format");
  } else {
    check(error, "does not start");
  }
  return device;
}

}  // namespace stereotrack::test
