#include "drivers/telemetry/durable_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <exception>

#include "drivers/telemetry/endpoint.hpp"

namespace stereotrack::telemetry {
namespace {

/// False with errno.
bool write_all(int fd, std::string_view content) noexcept {
  while (!content.empty()) {
    const ssize_t written = ::write(fd, content.data(), content.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    content.remove_prefix(static_cast<std::size_t>(written));
  }
  return ::fsync(fd) == 0;
}

}  // namespace

void write_durably(const std::filesystem::path& path, std::string_view content) {
  const auto fail = [&] {
    throw std::system_error(errno, std::generic_category(), path.string() + ": cannot be written");
  };
  const std::filesystem::path part = path.string() + ".new";
  {
    const Socket file(::open(part.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, S_IRUSR | S_IWUSR));
    if (file.fd() < 0) fail();
    if (!write_all(file.fd(), content)) {
      const int error = errno;
      ::unlink(part.c_str());
      errno = error;
      fail();
    }
  }
  if (::rename(part.c_str(), path.c_str()) != 0) {
    const int error = errno;
    ::unlink(part.c_str());
    errno = error;
    fail();
  }
  if (!sync_folder_of(path)) fail();
}

bool sync_folder_of(const std::filesystem::path& path) noexcept {
  int error = 0;
  try {
    const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
    const Socket directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (directory.fd() < 0 || ::fsync(directory.fd()) != 0) error = errno;
  } catch (const std::exception&) {
    error = ENOMEM;
  }
  if (error != 0) errno = error;
  return error == 0;
}

}  // namespace stereotrack::telemetry
