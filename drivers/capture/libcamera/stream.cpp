#include "drivers/capture/libcamera/stream.hpp"

#include <stdexcept>
#include <utility>

namespace stereotrack::capture::libcamera {

void refuse(const std::string& name, const std::string& what) {
  throw std::runtime_error("camera " + name + ": " + what);
}

Stream::Stream(Parts parts)
    : parts_(std::move(parts)),
      module_(&parts_.session->module()),
      finder_({.boottime_ahead = parts_.boottime_ahead, .period = parts_.info.period, .readout = parts_.readout}) {
  counters_.begin(parts_.info.buffers);
  place_pictures();
}

void Stream::place_pictures() {
  const CameraInfo& info = parts_.info;
  const std::uint64_t stride = parts_.setup.stride;
  const auto rows = static_cast<std::uint64_t>(memory_rows(info.format, info.height));
  const std::size_t row = row_bytes(info.format, info.width);
  if (stride < row) {
    refuse(info.name, "its rows are " + std::to_string(stride) + " bytes apart and " + std::to_string(row) +
                          " long: choose another size or format");
  }
  bytes_ = (rows - 1) * stride + row;
  const std::uint64_t first_plane = stride * static_cast<std::uint64_t>(info.height);
  for (std::uint32_t i = 0; i < info.buffers; ++i) {
    const std::uint8_t* data = nullptr;
    std::uint64_t bytes = 0;
    if (module_->plane(parts_.stream.get(), i, 0, &data, &bytes) == 0) refuse(info.name, "a buffer has no memory");
    const std::uint8_t* colours = nullptr;
    std::uint64_t more = 0;
    if (info.format == PixelFormat::kNv12 && module_->plane(parts_.stream.get(), i, 1, &colours, &more) != 0) {
      // A picture is one piece of memory to us.
      if (colours != data + first_plane) {
        refuse(info.name, "brightness and colours of its pictures lie apart: choose another format, such as yuyv");
      }
      bytes = first_plane + more;
    }
    if (bytes < bytes_) {
      refuse(info.name, "a buffer of it has " + std::to_string(bytes) + " bytes, and a picture " +
                            std::to_string(bytes_) + ": choose another size or format");
    }
    pictures_[i] = {data, info.width, info.height, static_cast<std::ptrdiff_t>(stride), info.format};
  }
}

void Stream::start() {
  char why[kLibcameraTextSize] = "";
  if (module_->start(parts_.stream.get(), static_cast<char*>(why)) == 0)
    refuse(parts_.info.name, static_cast<const char*>(why));
}

std::string Stream::failure() const {
  if (loss_ == nullptr) return {};
  return "camera " + parts_.info.name + " (" + parts_.info.model + "): after " +
         std::to_string(counters_.get().frames) + " frames it " + loss_;
}

}  // namespace stereotrack::capture::libcamera
