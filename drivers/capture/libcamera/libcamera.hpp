#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/capture/camera.hpp"

/// Cameras that need libcamera: sensors behind an image processor, which the kernel's interface alone does not tame.
///
/// libcamera itself is reached through a module that is loaded at run time (module.h, module/). Which modules are
/// tried, in this order, in each folder the newest libcamera first, until one fits:
///     $STEREOTRACK_MODULE_PATH   folders, with ':' between
///     ../lib/stereotrack         beside the folder of the program
///     LIBDIR/stereotrack         where the project is installed to
/// A module's file is stereotrack-libcamera-SOVERSION.so, of the libcamera that it was built against. Once loaded it
/// stays, as does the process's one manager of cameras while any of them is open. open() and list_cameras() may be
/// called by one thread at a time.
namespace stereotrack::capture::libcamera {

/// device: id, place in list_cameras() from 0, or what only its id or model has. fps: frames are held to this rate.
/// readout_us: of use only where stamps are of no clock of ours, see clock_finder.hpp.
using Settings = CameraSettings;

/// Opens and sets up one sensor; start() makes it stream.
/// Throws std::runtime_error with one line that names the device and the way out: no module, and why none; none or
/// several cameras of that name, and which there are; busy; a size or format that cannot be had.
/// `notes`: what libcamera made of the wish where that is no reason to stop, one line each, with the device's name:
/// controls that the camera lacks or clamps, a rate that it cannot be held to, fewer buffers.
///
/// Its frames:
/// * mid_exposure is SensorTimestamp + exposure / 2: the middle of the exposure of the first row;
/// * their clock is found by when frames come, clock_map() follows it;
/// * settings in force are those that libcamera tells with each frame;
/// * sequences count what libcamera lost only where its pipeline does, so CameraInfo::counts_lost is false;
/// * a camera that is gone just falls silent: StereoCameras has a time-out;
/// * one that comes back, or comes late, is found by another manager alone, which there can only be once no camera is
///   open. So where open() fails and devices were plugged in since the manager looked, the cameras that are open are
///   lost, as failure() says, and may be opened again.
[[nodiscard]] std::unique_ptr<Camera> open(const Settings& settings, std::vector<std::string>* notes = nullptr);

/// What one camera is and offers, for people.
struct CameraFacts {
  struct Size {
    int width = 0, height = 0;          ///< [px]
    int max_width = 0, max_height = 0;  ///< the same, where it is no range
  };
  struct Format {
    std::string fourcc;     ///< as libcamera names it: of DRM, and "/packed", "/0x..." for a modifier
    std::string_view name;  ///< Settings::format; empty: cannot be used
    std::vector<Size> sizes;
  };
  struct Range {
    double least = 0, most = 0;
  };
  std::string id;        ///< Settings::device
  std::string model;     ///< of the sensor
  std::string location;  ///< "front", "back", "external"; empty: not told
  std::vector<Format> formats;
  std::optional<Range> exposure_us;  ///< none: it cannot be set
  std::optional<Range> gain;         ///< likewise
  std::optional<Range> fps;          ///< likewise; of the mode that libcamera would take by itself
};
struct Listing {
  std::vector<CameraFacts> cameras;   ///< in libcamera's order
  std::string module;                 ///< "libcamera v0.0.3, PATH of the module"; empty: there is none
  std::vector<std::string> problems;  ///< why there is no module, or cameras cannot be asked for: one line each, with
                                      ///< the way out. With a module: of newer ones that could not be loaded
};
/// All that libcamera knows. Waits for it, some tenths of a second; cameras that a program has open are listed.
[[nodiscard]] Listing list_cameras();

/// Names of formats as Settings::format and `auto` know them, in the order in which `auto` takes them.
[[nodiscard]] std::vector<std::string_view> format_names();

}  // namespace stereotrack::capture::libcamera
