#include "drivers/record/recording_writer.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <exception>

#include "drivers/telemetry/durable_file.hpp"
#include "pipeline/core/checksum.hpp"

namespace stereotrack::record {

bool RecordingWriter::open(const std::filesystem::path& path) noexcept {
  abandon();
  error_ = 0;
  named_ = false;
  number_ = 0;
  bytes_ = 0;
  end_ = {};
  try {
    path_ = path;
    part_ = path.string() + ".part";
  } catch (const std::exception&) {
    error_ = ENOMEM;
    return false;
  }
  file_ = ::open(part_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file_ < 0) {
    error_ = errno;
    return false;
  }
  // Says that somebody writes it, as long as the process lives.
  (void)::flock(file_, LOCK_EX | LOCK_NB);
  const FileHeader header;
  return put(std::as_bytes(std::span(&header, 1)));
}

bool RecordingWriter::put(std::span<const std::byte> bytes) noexcept {
  if (file_ < 0 || error_ != 0) return false;
  bytes_ += bytes.size();
  while (!bytes.empty()) {
    const ::ssize_t written = ::write(file_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      error_ = written < 0 ? errno : EIO;
      return false;
    }
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return true;
}

bool RecordingWriter::write(RecordKind kind, std::span<const std::byte> payload) noexcept {
  RecordHeader header;
  header.kind = kind;
  header.number = ++number_;
  header.bytes = payload.size();
  header.sum = checksum(payload);
  const std::span<const std::byte> whole = std::as_bytes(std::span(&header, 1));
  header.header_sum = checksum(whole.first(offsetof(RecordHeader, header_sum)));
  if (kind == RecordKind::kFrame) ++end_.frames;
  if (kind == RecordKind::kOutput) ++end_.outputs;
  return put(whole) && put(payload);
}

bool RecordingWriter::flush() noexcept {
  if (file_ < 0 || error_ != 0) return false;
  if (::fdatasync(file_) != 0) error_ = errno;
  return error_ == 0;
}

bool RecordingWriter::commit() noexcept {
  const EndMeta end = end_;
  if (!write(RecordKind::kEnd, std::as_bytes(std::span(&end, 1)))) {
    abandon();
    return false;
  }
  if (::fsync(file_) != 0) error_ = errno;
  if (::close(file_) != 0 && error_ == 0) error_ = errno;
  file_ = -1;
  if (error_ == 0 && std::rename(part_.c_str(), path_.c_str()) != 0) error_ = errno;
  if (error_ != 0) {
    ::unlink(part_.c_str());
    return false;
  }
  named_ = true;
  if (!telemetry::sync_folder_of(path_)) error_ = errno;
  return error_ == 0;
}

void RecordingWriter::abandon() noexcept {
  if (file_ < 0) return;
  ::close(file_);
  file_ = -1;
  ::unlink(part_.c_str());
}

std::string RecordingWriter::status() const {
  if (error_ == 0) return {};
  if (named_) {
    return path_.string() +
           ": written, but a power cut may lose it: its folder cannot be synced: " + std::strerror(error_) +
           "; check the disk (record.directory)";
  }
  return path_.string() + ": not written: " + std::strerror(error_) +
         (error_ == ENOSPC ? "; free space or choose another folder (record.directory)"
                           : "; check the folder (record.directory)");
}

}  // namespace stereotrack::record
