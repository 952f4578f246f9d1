#include "drivers/capture/libcamera/libcamera.hpp"

#include <stdexcept>

namespace stereotrack::capture::libcamera {

std::unique_ptr<Camera> open(const Settings& settings, std::vector<std::string>* /*notes*/) {
  throw std::runtime_error("camera " + settings.device +
                           ": there is no module for libcamera: use camera.driver = \"v4l2\"");
}

Listing list_cameras() { return {{}, {}, {"libcamera: there is no module for it"}}; }

}  // namespace stereotrack::capture::libcamera
