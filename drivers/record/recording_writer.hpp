#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <span>
#include <string>

#include "drivers/record/format.hpp"

namespace stereotrack::record {

/// Writes a recording, record by record, to `PATH.part`, which commit() renames to `PATH`: a file of that name is
/// whole. For the service thread: it waits for the disk, and never throws once it was made. After the first write that
/// failed (disk full) nothing more is written and nothing stays. What a process leaves that ends amid it, or a power
/// cut, is keep_torn()'s. One thread.
class RecordingWriter {
 public:
  RecordingWriter() = default;
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;
  ~RecordingWriter() { abandon(); }

  /// Begins a file; one that was begun before is abandoned. False: see status().
  [[nodiscard]] bool open(const std::filesystem::path& path) noexcept;

  /// One record of that payload. False: see status().
  bool write(RecordKind kind, std::span<const std::byte> payload) noexcept;

  /// What was written so far is on the disk. False: see status().
  bool flush() noexcept;

  /// The end record; makes the file whole: on the disk, under its name. False: see status(); nothing stays, or the
  /// whole file whose folder alone could not be synced.
  [[nodiscard]] bool commit() noexcept;

  /// Deletes what was written of an unfinished file.
  void abandon() noexcept;

  [[nodiscard]] bool is_open() const noexcept { return file_ >= 0; }
  [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }
  /// Empty while all is well; else the one line to tell. Allocates.
  [[nodiscard]] std::string status() const;

 private:
  bool put(std::span<const std::byte> bytes) noexcept;

  std::filesystem::path path_;
  std::filesystem::path part_;
  int file_ = -1;
  int error_ = 0;
  bool named_ = false;  // under its name, whole
  std::uint32_t number_ = 0;
  std::uint64_t bytes_ = 0;
  EndMeta end_;
};

}  // namespace stereotrack::record
