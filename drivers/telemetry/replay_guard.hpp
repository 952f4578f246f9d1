#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <vector>

#include "drivers/telemetry/datagram.hpp"

namespace stereotrack::telemetry {

/// The highest that was seen of one rig.
struct Mark {
  std::uint32_t rig = 0;
  std::uint64_t session = 0;
  std::uint64_t message = 0;  ///< 4 sequence + part - 1 of its messages, 0 = none yet
  std::uint64_t status = 0;   ///< sequence of its statuses, 0 = none yet

  [[nodiscard]] bool operator==(const Mark&) const noexcept = default;
};

/// Takes each datagram once. To be asked only about datagrams whose seal is good: what it has seen it believes.
///     number = 4 sequence + part - 1 of a message, Status.sequence of a status; each kind has its own window
///     fresh: a higher session (both windows begin anew), or in the same one a number over the highest, or one of the
///            kWindow - 1 below it that has not been there
/// So a message may come 15 messages late; what comes later cannot be told from a repetition and is one.
/// kRigs rigs at most: one that is forgotten could be replayed, so that a further one is not taken. O(rigs), no heap.
/// One thread.
class ReplayGuard {
 public:
  static constexpr std::size_t kRigs = 64;
  static constexpr std::uint64_t kWindow = 64;

  enum class Verdict : std::uint8_t {
    kFresh,
    kReplayed,     ///< was there before, or came too late to tell
    kOldSession,   ///< of a session under the highest of its rig
    kTooManyRigs,  ///< none of the kRigs rigs that it knows
  };

  /// After kFresh it is remembered.
  [[nodiscard]] Verdict admit(const Datagram& datagram) noexcept;

  /// What a later guard must know; valid until the next call.
  [[nodiscard]] std::span<const Mark> marks() const noexcept { return {marks_.begin(), marks_.size()}; }
  /// Begins with what an earlier one knew: nothing up to its marks is fresh. Beyond kRigs they are left out.
  void restore(std::span<const Mark> marks) noexcept;

 private:
  struct Windows {
    std::uint64_t messages = 0;  ///< bit i: highest - i has been there
    std::uint64_t statuses = 0;
  };
  [[nodiscard]] static bool take(std::uint64_t number, std::uint64_t& highest, std::uint64_t& seen) noexcept;

  FixedVector<Mark, kRigs> marks_;
  FixedVector<Windows, kRigs> windows_;  ///< in the order of marks_
};

/// The marks' file cannot be used; the line names it and the way out. Bad usage: exit code 2.
class MarksFileError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Text, a rig a line: RIG SESSION MESSAGE STATUS. A file that is not there holds none. Throws MarksFileError: to go on
/// without the marks of a file that cannot be read would be to take what was to be refused.
[[nodiscard]] std::vector<Mark> load_marks(const std::filesystem::path& path);
/// Replaces the file as a whole. Throws MarksFileError.
void save_marks(const std::filesystem::path& path, std::span<const Mark> marks);

}  // namespace stereotrack::telemetry
