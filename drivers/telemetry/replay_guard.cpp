#include "drivers/telemetry/replay_guard.hpp"

#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>

#include "drivers/telemetry/durable_file.hpp"

namespace stereotrack::telemetry {
namespace {

/// Takes a decimal number and the space behind it off `line`; false if there is none.
template <class Number>
bool take_number(std::string_view& line, Number& number) noexcept {
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), number);
  if (error != std::errc{}) return false;
  line.remove_prefix(static_cast<std::size_t>(end - line.data()));
  if (line.empty()) return true;
  if (line.front() != ' ') return false;
  line.remove_prefix(1);
  return true;
}

std::optional<Mark> parse_mark(std::string_view line) noexcept {
  Mark mark;
  if (!take_number(line, mark.rig) || !take_number(line, mark.session) || !take_number(line, mark.message) ||
      !take_number(line, mark.status) || !line.empty()) {
    return std::nullopt;
  }
  return mark;
}

}  // namespace

bool ReplayGuard::take(std::uint64_t number, std::uint64_t& highest, std::uint64_t& seen) noexcept {
  if (number > highest) {
    const std::uint64_t ahead = number - highest;
    seen = (ahead < kWindow ? seen << ahead : 0) | 1U;
    highest = number;
    return true;
  }
  const std::uint64_t back = highest - number;
  if (back >= kWindow) return false;
  const std::uint64_t bit = std::uint64_t{1} << back;
  if ((seen & bit) != 0) return false;
  seen |= bit;
  return true;
}

ReplayGuard::Verdict ReplayGuard::admit(const Datagram& datagram) noexcept {
  const Header& header = datagram.header;
  std::size_t at = 0;
  while (at < marks_.size() && marks_[at].rig != header.rig) ++at;
  if (at == marks_.size()) {
    if (!marks_.push({.rig = header.rig, .session = header.session}) || !windows_.push({})) {
      return Verdict::kTooManyRigs;
    }
  }
  Mark& mark = marks_[at];
  Windows& seen = windows_[at];
  if (header.session < mark.session) return Verdict::kOldSession;
  if (header.session > mark.session) {
    mark = {.rig = header.rig, .session = header.session};
    seen = {};
  }
  const bool fresh = datagram.status ? take(datagram.status_sequence, mark.status, seen.statuses)
                                     : take(4 * header.sequence + header.part - 1, mark.message, seen.messages);
  return fresh ? Verdict::kFresh : Verdict::kReplayed;
}

void ReplayGuard::restore(std::span<const Mark> marks) noexcept {
  constexpr std::uint64_t kAll = std::numeric_limits<std::uint64_t>::max();
  marks_.clear();
  windows_.clear();
  for (const Mark& mark : marks) {
    if (!marks_.push(mark) || !windows_.push({kAll, kAll})) break;
  }
}

std::vector<Mark> load_marks(const std::filesystem::path& path) {
  const auto fail = [&](const std::string& why) {
    throw MarksFileError(path.string() + ": " + why +
                         "; without it replays of what it knew would be taken: " + "remove it to begin anew");
  };
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored) && !ignored) return {};
  std::ifstream file(path);
  if (!file) fail(std::string("cannot be read: ") + std::strerror(errno));
  std::vector<Mark> marks;
  int number = 0;
  for (std::string line; std::getline(file, line);) {
    ++number;
    const auto mark = parse_mark(line);
    if (!mark) fail("line " + std::to_string(number) + " is not RIG SESSION MESSAGE STATUS");
    marks.push_back(*mark);
  }
  if (file.bad()) fail(std::string("cannot be read: ") + std::strerror(errno));
  if (marks.size() > ReplayGuard::kRigs) fail("more than " + std::to_string(ReplayGuard::kRigs) + " rigs");
  return marks;
}

void save_marks(const std::filesystem::path& path, std::span<const Mark> marks) {
  std::ostringstream text;
  for (const Mark& mark : marks) {
    text << mark.rig << ' ' << mark.session << ' ' << mark.message << ' ' << mark.status << '\n';
  }
  try {
    write_durably(path, text.str());
  } catch (const std::system_error& error) {
    throw MarksFileError(error.what() + std::string("; give --state a file in a folder that this user may write to"));
  }
}

}  // namespace stereotrack::telemetry
