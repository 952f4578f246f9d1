#pragma once

#include <cstdint>
#include <filesystem>
#include <stdexcept>

namespace stereotrack::telemetry {

/// The counter cannot be used; the line names it and the way out.
class SessionError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The number of this run: one more than the last run's, from 1, kept as decimal text in `directory`/session.
/// Why a counter: a receiver refuses sessions under the highest it saw, and so what was recorded in an earlier run. The
/// clock of a machine without battery goes back, the kernel's boot id does not rise and does not change with a restart.
/// The raised number is on the disk when this returns: after a power cut it is not given again. Two callers at once,
/// also in two processes, get two numbers (flock on the directory; waits for the other). To be called once, at start.
/// Throws SessionError: no directory, no right, disk full, or the file holds no number.
[[nodiscard]] std::uint64_t next_session(const std::filesystem::path& directory);

}  // namespace stereotrack::telemetry
