#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "drivers/telemetry/sink.hpp"

namespace stereotrack::telemetry {

/// telemetry.bin: each datagram after its length in bytes, u32, low byte first.
/// Written to `PATH.part`, which commit() renames to `PATH`: a file of that name is whole. Without a
/// commit, or after a write failed (disk full), nothing stays. Making one throws std::runtime_error.
class FileSink final : public Sink {
 public:
  explicit FileSink(std::filesystem::path path);
  ~FileSink() override;

  /// After the first write that failed nothing more is written; every datagram counts as failed.
  void send(std::span<const std::byte> datagram) noexcept override;

  /// Makes the file whole: on the disk, under its name. Once, at the end. False: see status().
  [[nodiscard]] bool commit() noexcept;

  /// Empty while all is well; else the one line to tell.
  [[nodiscard]] std::string status() const;

 private:
  struct Close {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };

  std::filesystem::path path_;
  std::filesystem::path part_;
  std::unique_ptr<std::FILE, Close> file_;
  int error_ = 0;
};

}  // namespace stereotrack::telemetry
