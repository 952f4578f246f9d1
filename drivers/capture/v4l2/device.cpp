#include "drivers/capture/v4l2/device.hpp"

#include <fcntl.h>
#include <grp.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <stdexcept>
#include <utility>

namespace stereotrack::capture::v4l2 {

int ask_kernel(int descriptor, unsigned long request, void* argument) noexcept {
  int answer = 0;
  do {
    answer = ::ioctl(descriptor, request, argument);
  } while (answer < 0 && errno == EINTR);
  return answer < 0 ? errno : 0;
}

Device::Device(Device&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

Device& Device::operator=(Device&& other) noexcept {
  if (this != &other) {
    close();
    descriptor_ = std::exchange(other.descriptor_, -1);
  }
  return *this;
}

Device::~Device() { close(); }

int Device::open(const std::string& path) noexcept {
  close();
  do {
    descriptor_ = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  } while (descriptor_ < 0 && errno == EINTR);
  return descriptor_ < 0 ? errno : 0;
}

int Device::open_beside(const Device& other) noexcept {
  if (!other.is_open()) return EBADF;
  char path[32];
  (void)std::snprintf(path, sizeof path, "/proc/self/fd/%d", other.descriptor());
  return open(path);
}

void Device::close() noexcept {
  if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
}

void refuse(std::string_view name, const std::string& what) {
  throw std::runtime_error("camera " + std::string(name) + ": " + what);
}

const char* error_text(int error) noexcept {
  switch (error) {
    case EACCES:
    case EPERM: return "no permission";
    case EBUSY: return "busy";
    case EINVAL: return "refused as invalid";
    case EIO: return "input/output error";
    case ENODEV:
    case ENXIO: return "the device is gone";
    case ENOENT: return "no such device";
    case ENOMEM: return "no memory left";
    case ENOSPC: return "no bandwidth left on its bus";
    case ENOTTY: return "not known to the driver";
    case EPIPE: return "its parts do not fit together, or the stream has ended";
    case EPROTO: return "the device does not answer as it should";
    case ERANGE: return "out of range";
    case ETIMEDOUT: return "the device does not answer";
    default: return "the driver refuses";
  }
}

std::string open_refusal(const std::string& path, int error) {
  const std::string number = " (errno " + std::to_string(error) + ")";
  switch (error) {
    case ENOENT: return path + " is not there: plug it in, or load its driver";
    case EBUSY: return path + " is busy: another program has it (fuser -v " + path + " tells which): stop that";
    case ENODEV:
    case ENXIO: return path + " has no device behind it: plug it in, or load its driver";
    case EACCES:
    case EPERM: break;
    default: return path + " cannot be opened: " + error_text(error) + number;
  }
  struct stat facts {};
  const bool known = ::stat(path.c_str(), &facts) == 0 && facts.st_gid != 0;
  const group* const entry = known ? ::getgrgid(facts.st_gid) : nullptr;
  return "no permission for " + path + ": add the program's user to the group " +
         (entry == nullptr ? "video" : entry->gr_name);
}

}  // namespace stereotrack::capture::v4l2
