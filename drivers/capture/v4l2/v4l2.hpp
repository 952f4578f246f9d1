#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/capture/camera.hpp"

/// Cameras over the kernel's own interface, Video4Linux 2: no library between.
namespace stereotrack::capture::v4l2 {

/// How buffers reach the program.
enum class Memory : std::uint8_t {
  kMapped,    ///< the device's memory, mapped; cached where driver and kernel can do that
  kExported,  ///< the same memory as dma-bufs, with DMA_BUF_IOCTL_SYNC around each lease
  kImported,  ///< dma-bufs of Settings::heap, which the device writes to, with the same around each lease
};

/// device: /dev/video0, a link to it (/dev/v4l/by-path/...), bus:platform:vivid-000, name:CARD. readout_us: required
/// where the driver stamps the end of a frame and cannot tell how long the sensor takes to read it out.
struct Settings : CameraSettings {
  std::string sensor;  ///< where the driver has the program connect the camera's parts (media controller): the sensor's
                       ///< name, or how it begins. Empty: the one that is connected, or the nearest
  std::optional<int> black_level;  ///< in the driver's own unit
  int control_delay_frames = 2;    ///< from a change of a control to the first frame that was exposed with it
  bool guesses_readout = false;    ///< for who measures: the shortest period is taken where it is required and missing
  Memory memory = Memory::kMapped;
  std::string heap;  ///< of kImported: a dma-heap of the kernel's, /dev/dma_heap/system, or /dev/udmabuf: memory of the
                     ///< process. A device that wants its memory in one piece takes linux,cma or reserved alone
};

/// Opens and sets up one sensor; start() makes it stream.
/// Throws std::runtime_error with one line that names the device and the way out: none or several of that name (and
/// which there are), no permission, busy, not a camera, a size, format or number of buffers that cannot be had, no
/// readout_us where it is required.
/// `notes`: what the driver made of the wish where that is no reason to stop, one line each, with the device's name:
///   * controls that it lacks, refused or clamped, and another frame rate;
///   * stamps. CLOCK_MONOTONIC at the start of an exposure or the end of a frame is what the driver should promise.
///     Where it promises no clock, frames are stamped as they are taken, which is told here.
[[nodiscard]] std::unique_ptr<Camera> open(const Settings& settings, std::vector<std::string>* notes = nullptr);

/// What one device is and offers, for people.
struct CameraFacts {
  struct Size {
    int width = 0, height = 0;          ///< [px]
    int max_width = 0, max_height = 0;  ///< the same, where it is no range
    std::vector<double> rates;          ///< frames a second; of a range the highest and the lowest

    [[nodiscard]] bool includes(int wanted_width, int wanted_height) const noexcept {
      return width <= wanted_width && wanted_width <= max_width && height <= wanted_height &&
             wanted_height <= max_height;
    }
  };
  struct Format {
    std::string fourcc;
    std::string_view name;  ///< Settings::format; empty: cannot be used
    std::vector<Size> sizes;
  };
  struct Control {
    std::string name;
    std::int64_t minimum = 0, maximum = 0, step = 0, standard = 0;
    std::optional<std::int64_t> value;
  };
  std::string path;  ///< /dev/video0
  std::string card;
  std::string bus;
  std::string driver;
  std::vector<std::string> links;  ///< other names: /dev/v4l/by-path/...
  std::vector<Format> formats;
  std::vector<Control> controls;
  std::string problem;  ///< why it could not be asked, with the way out; empty: it could
};
/// All that can capture, by number, and those that could not be asked.
[[nodiscard]] std::vector<CameraFacts> list_cameras();

/// Names of formats as Settings::format and `auto` know them, in the order in which `auto` takes them.
[[nodiscard]] std::vector<std::string_view> format_names();

}  // namespace stereotrack::capture::v4l2
