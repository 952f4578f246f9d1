#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "config/load.hpp"
#include "drivers/capture/stereo_cameras/stereo_cameras.hpp"
#include "drivers/capture/v4l2/v4l2.hpp"

namespace stereotrack {

/// The source.name of cameras.
inline constexpr std::string_view kCameras = "cameras";

/// What the driver of a side is asked for: of either driver, and by V4L2 besides.
[[nodiscard]] capture::CameraSettings camera_settings(const config::CameraConfig& camera, trigger::Side side);
[[nodiscard]] capture::v4l2::Settings v4l2_settings(const config::CameraConfig& camera, trigger::Side side);

/// How two of them become pairs.
[[nodiscard]] capture::StereoCameras::Config pairing_config(const config::Configuration& configuration);

/// What becomes of a camera that wants camera.readout_us, which is not set.
enum class MissingReadout : std::uint8_t {
  kRefused,
  kGuessed,  ///< for who measures: CameraInfo::readout_is_guessed
};

/// Opens the camera of a side as camera.* says, now and each time that it was lost. `say`, which may be called by the
/// thread that opens, is told what the driver made of the wish; it must outlive what is returned.
[[nodiscard]] capture::StereoCameras::Open camera_opener(const config::CameraConfig& camera,
                                                         std::function<void(const std::string&)> say,
                                                         MissingReadout missing = MissingReadout::kRefused);

/// Opens and starts the cameras. Throws config::Error (the keys), or std::runtime_error naming the device. `trigger`:
/// what tells of pulses, of open_trigger(); null: nobody.
[[nodiscard]] std::unique_ptr<capture::StereoCameras> open_cameras(const config::Loaded& loaded,
                                                                   std::function<void(const std::string&)> say,
                                                                   std::unique_ptr<trigger::Trigger> trigger = nullptr);

/// What --check-config says of them: each is opened as a run would, and closed again.
struct CameraCheck {
  capture::SourceInfo info;           ///< of the source that they would be; its width is 0 where none could be opened
  std::vector<std::string> lines;     ///< a camera each, of those that can do what is asked
  std::vector<std::string> notes;     ///< what the driver made of the wish
  std::vector<std::string> failures;  ///< one line each: what cannot be had, and the way out
};
[[nodiscard]] CameraCheck check_cameras(const config::Loaded& loaded);

}  // namespace stereotrack
