// When lines changed, seen from outside at the pin, and whether that was when telemetry says that it should be.
//
//     line_times watch FILE VALUE...
//         until SIGTERM. VALUE are gpio-sim's files of what lines show. FILE: "NS INDEX LEVEL" a line of text, for what
//         each shows at first and for each change; CLOCK_MONOTONIC as it was when the change was seen, kEvery after it
//         happened at most where it is let run: start it with chrt
//     line_times kill PROCESS
//         with SIGKILL; says when, in CLOCK_MONOTONIC [ns]
//     line_times compare TELEMETRY FILE INDEX LATENCY_MS LATE_MS NEAR
//         line INDEX is a signal of "distance_below", NEAR in calibration units, or of "confirmed" where NEAR is 0;
//         active high, without hold. With each message whose targets begin or cease to fulfil that it has to change,
//         between capture + LATENCY_MS - 1 ms and LATE_MS after that, and at no other time until the last message.
//         TELEMETRY is of keep_telemetry, of one session. Says how many changes there were and how far from their times
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/system/board/live/telemetry_file.hpp"

namespace stereotrack {
namespace {

constexpr long kEvery_ns = 100'000;

std::atomic<bool> g_ends{false};

std::int64_t monotonic_ns() {
  timespec now{};
  (void)clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * std::int64_t{1'000'000'000} + now.tv_nsec;
}

int watch(const char* path, int count, char** values) {
  std::vector<int> files;
  for (int i = 0; i < count; ++i) {
    files.push_back(::open(values[i], O_RDONLY | O_CLOEXEC));
    if (files.back() < 0) throw std::runtime_error(std::string(values[i]) + ": " + std::strerror(errno));
  }
  std::FILE* out = std::fopen(path, "w");
  if (out == nullptr) throw std::runtime_error(std::string(path) + ": cannot be written");
  (void)std::signal(SIGTERM, [](int) { g_ends = true; });
  std::vector<char> seen(files.size(), '?');
  bool is_first = true;
  while (!g_ends) {
    for (std::size_t i = 0; i < files.size(); ++i) {
      char level = '?';
      const bool read = ::pread(files[i], &level, 1, 0) == 1;
      if (!read || level == seen[i]) continue;
      seen[i] = level;
      (void)std::fprintf(out, "%lld %zu %c\n", static_cast<long long>(monotonic_ns()), i, level);
      // Who waits for a change reads the file.
      (void)std::fflush(out);
    }
    if (is_first) {
      (void)std::printf("watching\n");
      (void)std::fflush(stdout);
      is_first = false;
    }
    const timespec nap{0, kEvery_ns};
    (void)nanosleep(&nap, nullptr);
  }
  return std::fclose(out) == 0 ? 0 : 1;
}

int kill_now(const char* process) {
  (void)std::printf("%lld\n", static_cast<long long>(monotonic_ns()));
  return ::kill(std::atoi(process), SIGKILL) == 0 ? 0 : 1;
}

struct Change {
  std::int64_t ns = 0;
  bool active = false;
};

/// What targets ask of the line: due times of messages with which it changes, from inactive on. `end`: of the last.
std::vector<Change> wanted_changes(const char* path, std::int64_t latency_ns, double near, std::int64_t& end) {
  std::map<std::uint64_t, Change> messages;
  each_datagram(path, [&](const telemetry::Datagram& datagram, std::span<const std::byte>) {
    if (datagram.status) return;
    Change& message = messages[datagram.header.sequence];
    message.ns = datagram.header.capture_time_ns + latency_ns;
    for (const telemetry::Target& target : datagram.targets) {
      const bool counts =
          target.state == telemetry::TargetState::kConfirmed || target.state == telemetry::TargetState::kCoasting;
      const bool fulfils = near == 0 || (target.has_depth && static_cast<double>(target.distance) < near);
      message.active = message.active || (counts && fulfils);
    }
  });
  std::vector<Change> changes;
  bool active = false;
  for (const auto& [sequence, message] : messages) {
    if (message.active != active) changes.push_back(message);
    active = message.active;
    end = message.ns;
  }
  return changes;
}

std::vector<Change> seen_changes(const char* path, std::size_t index) {
  std::ifstream in(path);
  std::vector<Change> changes;
  std::int64_t ns = 0;
  std::size_t line = 0;
  char level = '0';
  while (in >> ns >> line >> level) {
    if (line == index) changes.push_back({ns, level == '1'});
  }
  if (changes.empty()) throw std::runtime_error(std::string(path) + ": says nothing of the line");
  if (changes.front().active) throw std::runtime_error(std::string(path) + ": the line was active before");
  changes.erase(changes.begin());
  return changes;
}

int compare(char** words) {
  const auto in_ns = [](const char* ms) { return static_cast<std::int64_t>(std::atof(ms) * 1e6); };
  std::int64_t end = 0;
  const std::vector<Change> wanted = wanted_changes(words[0], in_ns(words[3]), std::atof(words[5]), end);
  std::vector<Change> seen = seen_changes(words[1], static_cast<std::size_t>(std::atoi(words[2])));
  std::erase_if(seen, [&](const Change& change) { return change.ns > end + in_ns(words[4]); });
  std::int64_t earliest = INT64_MAX;
  std::int64_t latest = INT64_MIN;
  const std::size_t both = std::min(wanted.size(), seen.size());
  std::size_t wrong = std::max(wanted.size(), seen.size()) - both;
  for (std::size_t i = 0; i < both; ++i) {
    const std::int64_t late = seen[i].ns - wanted[i].ns;
    earliest = std::min(earliest, late);
    latest = std::max(latest, late);
    if (seen[i].active == wanted[i].active && late >= -1'000'000 && late <= in_ns(words[4])) continue;
    ++wrong;
    (void)std::printf("change %zu: to %s, due %lld; seen to %s at %lld\n", i, wanted[i].active ? "active" : "inactive",
                      static_cast<long long>(wanted[i].ns), seen[i].active ? "active" : "inactive",
                      static_cast<long long>(seen[i].ns));
  }
  (void)std::printf("wanted %zu seen %zu wrong %zu", wanted.size(), seen.size(), wrong);
  if (both > 0) {
    (void)std::printf(" late_ms %.3f to %.3f", static_cast<double>(earliest) * 1e-6,
                      static_cast<double>(latest) * 1e-6);
  }
  (void)std::printf("\n");
  return wrong == 0 && both > 0 ? 0 : 1;
}

}  // namespace
}  // namespace stereotrack

int main(int count, char** words) {
  const std::string verb = count > 1 ? words[1] : "";
  try {
    if (verb == "watch" && count > 3) return stereotrack::watch(words[2], count - 3, words + 3);
    if (verb == "kill" && count == 3) return stereotrack::kill_now(words[2]);
    if (verb == "compare" && count == 8) return stereotrack::compare(words + 2);
  } catch (const std::exception& error) {
    (void)std::fprintf(stderr, "line_times: %s\n", error.what());
    return 1;
  }
  (void)std::fprintf(stderr,
                     "usage: line_times watch FILE VALUE... | kill PROCESS | "
                     "compare TELEMETRY FILE INDEX LATENCY_MS LATE_MS NEAR\n");
  return 2;
}
