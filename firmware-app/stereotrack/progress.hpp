#pragma once

#include <chrono>
#include <cstdint>
#include <iosfwd>
#include <optional>
#include <string>

namespace stereotrack {

/// How far a run is: on a terminal one line that is redrawn, with rate and remaining time; else a plain line
/// every ten seconds.
class Progress {
 public:
  /// total: number of steps where known. Whether `out` is a terminal is asked of the process's standard error.
  Progress(std::ostream& out, std::optional<std::uint64_t> total);

  void step();
  /// A line of its own that the progress line does not overwrite.
  void message(const std::string& text);
  void finish();

 private:
  [[nodiscard]] std::string line() const;

  std::ostream& out_;
  std::optional<std::uint64_t> total_;
  bool terminal_;
  std::uint64_t done_ = 0;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point shown_;
};

}  // namespace stereotrack
