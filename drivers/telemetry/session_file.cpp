#include "drivers/telemetry/session_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <iterator>
#include <limits>
#include <string>

#include "drivers/telemetry/durable_file.hpp"
#include "drivers/telemetry/endpoint.hpp"

namespace stereotrack::telemetry {
namespace {

constexpr const char* kWritable =
    "; it must be a directory that this user may write to (under systemd: StateDirectory=)";

/// 0 if there is no file yet.
std::uint64_t last_session(const std::filesystem::path& path) {
  const Socket file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.fd() < 0 && errno == ENOENT) return 0;
  // 20 digits, a line end, and one more to see that there is too much.
  std::array<char, 22> text{};
  const ssize_t size = file.fd() < 0 ? -1 : ::read(file.fd(), text.data(), text.size());
  if (size < 0)
    throw SessionError(path.string() + ": cannot be read: " + std::strerror(errno) + "; chown or remove it");
  const char* end = text.data() + size;
  if (size > 0 && end[-1] == '\n') --end;
  std::uint64_t number = 0;
  const auto [parsed, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc{} || parsed != end || size == std::ssize(text) ||
      number == std::numeric_limits<std::uint64_t>::max()) {
    throw SessionError(path.string() +
                       ": does not hold the number of the last session; write one that is higher than receivers have "
                       "seen (stereotrack monitor shows it), or remove the file to begin at 1");
  }
  return number;
}

}  // namespace

std::uint64_t next_session(const std::filesystem::path& directory) {
  const Socket lock(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (lock.fd() < 0) {
    throw SessionError("state directory " + directory.string() + ": " + std::strerror(errno) + kWritable);
  }
  while (::flock(lock.fd(), LOCK_EX) != 0) {
    if (errno == EINTR) continue;
    throw SessionError("state directory " + directory.string() + ": cannot be locked: " + std::strerror(errno) +
                       "; keep it on a local disk");
  }
  const std::filesystem::path path = directory / "session";
  const std::uint64_t session = last_session(path) + 1;
  try {
    write_durably(path, std::to_string(session) + '\n');
  } catch (const std::system_error& error) {
    throw SessionError(error.what() + std::string(kWritable) + ", on a disk that is not full");
  }
  return session;
}

}  // namespace stereotrack::telemetry
