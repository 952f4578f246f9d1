#include "drivers/telemetry/file_sink.hpp"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace stereotrack::telemetry {

FileSink::FileSink(std::filesystem::path path) : path_(std::move(path)), part_(path_.string() + ".part") {
  file_.reset(std::fopen(part_.c_str(), "wbe"));
  if (!file_) {
    const int error = errno;
    throw std::runtime_error(part_.string() + ": cannot be written: " + std::strerror(error) +
                             "; choose an output folder that exists and is writable");
  }
}

FileSink::~FileSink() {
  if (!file_) return;
  file_.reset();
  ::unlink(part_.c_str());
}

void FileSink::send(std::span<const std::byte> datagram) noexcept {
  if (!file_ || error_ != 0) {
    ++counters_.failed;
    return;
  }
  const auto size = static_cast<std::uint32_t>(datagram.size());
  const std::array<unsigned char, 4> length{static_cast<unsigned char>(size), static_cast<unsigned char>(size >> 8U),
                                            static_cast<unsigned char>(size >> 16U),
                                            static_cast<unsigned char>(size >> 24U)};
  if (std::fwrite(length.data(), 1, length.size(), file_.get()) != length.size() ||
      std::fwrite(datagram.data(), 1, datagram.size(), file_.get()) != datagram.size()) {
    error_ = errno;
    ++counters_.failed;
    return;
  }
  ++counters_.sent;
}

bool FileSink::commit() noexcept {
  if (!file_) return false;
  if (error_ == 0 && std::fflush(file_.get()) != 0) error_ = errno;
  // A device such as /dev/null cannot be synchronised and says EINVAL: nothing is lost by that.
  if (error_ == 0 && ::fsync(::fileno(file_.get())) != 0 && errno != EINVAL) error_ = errno;
  if (std::fclose(file_.release()) != 0 && error_ == 0) error_ = errno;
  if (error_ == 0 && std::rename(part_.c_str(), path_.c_str()) != 0) error_ = errno;
  if (error_ != 0) ::unlink(part_.c_str());
  return error_ == 0;
}

std::string FileSink::status() const {
  if (error_ == 0) return {};
  return path_.string() + ": not written: " + std::strerror(error_) +
         (error_ == ENOSPC ? "; free space or choose another output folder" : "; check the output folder");
}

}  // namespace stereotrack::telemetry
