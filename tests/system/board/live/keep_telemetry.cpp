// What a live rig sends, kept and compared byte by byte.
//
//     keep_telemetry listen ADDR:PORT FILE
//         until SIGTERM; says "listening" first. FILE has the form of a replay's telemetry.bin
//     keep_telemetry compare LIVE REPLAYED
//         each message in REPLAYED has to be in LIVE, with the same bytes. Says how many there are, how many of them
//         have targets, and the first that differ
//     keep_telemetry sessions FILE
//         a line each, in the order in which they were heard: its first and last message, how many there were, how many
//         went without a result of their own (flags 64 and 128), how many of its statuses, and all health that it told
//         of
//     keep_telemetry offsets FILE
//         TAI minus capture clock [s], a line for each change by over a second
#include <poll.h>
#include <sys/signalfd.h>

#include <array>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/telemetry/file_sink.hpp"
#include "drivers/telemetry/receiver.hpp"
#include "drivers/telemetry/udp_listener.hpp"
#include "tests/system/board/live/telemetry_file.hpp"

namespace stereotrack {
namespace {

struct Message {
  std::vector<std::byte> bytes;  ///< of its parts, one after the other
  std::size_t targets = 0;
};
using Messages = std::map<std::uint64_t, Message>;

int listen(const char* address, const char* path) {
  telemetry::UdpListener listener(telemetry::parse_endpoint(address));
  telemetry::FileSink file(path);
  sigset_t ends;
  sigemptyset(&ends);
  sigaddset(&ends, SIGTERM);
  (void)sigprocmask(SIG_BLOCK, &ends, nullptr);
  const int signals = signalfd(-1, &ends, SFD_CLOEXEC);
  (void)std::printf("listening\n");
  (void)std::fflush(stdout);
  std::array<std::byte, 2048> buffer{};
  std::array<pollfd, 2> waited{{{listener.fd(), POLLIN, 0}, {signals, POLLIN, 0}}};
  while (waited[1].revents == 0) {
    (void)poll(waited.data(), waited.size(), -1);
    for (std::ptrdiff_t size = listener.receive(buffer); size >= 0; size = listener.receive(buffer)) {
      file.send(std::span(buffer).first(static_cast<std::size_t>(size)));
    }
  }
  if (!file.commit()) throw std::runtime_error(file.status());
  return 0;
}

/// Those about pairs; a status is of its moment and in no replay.
Messages read(const char* path) {
  Messages messages;
  each_datagram(path, [&](const telemetry::Datagram& datagram, std::span<const std::byte> bytes) {
    if (datagram.status) return;
    Message& message = messages[datagram.header.sequence];
    message.bytes.insert(message.bytes.end(), bytes.begin(), bytes.end());
    message.targets += datagram.targets.size();
  });
  return messages;
}

int compare(const char* live_path, const char* replayed_path) {
  const Messages live = read(live_path);
  const Messages replayed = read(replayed_path);
  std::size_t targets = 0;
  std::size_t wrong = 0;
  for (const auto& [sequence, message] : replayed) {
    targets += message.targets > 0 ? 1 : 0;
    const auto sent = live.find(sequence);
    if (sent != live.end() && sent->second.bytes == message.bytes) continue;
    if (wrong++ < 5) {
      (void)std::printf("message %llu %s\n", static_cast<unsigned long long>(sequence),
                        sent == live.end() ? "was not heard" : "differs");
    }
  }
  (void)std::printf("messages %zu with_targets %zu different %zu\n", replayed.size(), targets, wrong);
  return wrong == 0 && !replayed.empty() ? 0 : 1;
}

struct Session {
  std::uint64_t number = 0;
  std::uint64_t first = 0;
  std::uint64_t last = 0;
  std::uint64_t messages = 0;
  std::uint64_t predicted = 0;
  std::uint64_t statuses = 0;
  std::uint32_t health = 0;
};

int sessions(const char* path) {
  std::vector<Session> sessions;
  each_datagram(path, [&](const telemetry::Datagram& datagram, std::span<const std::byte>) {
    if (sessions.empty() || sessions.back().number != datagram.header.session) {
      sessions.push_back({.number = datagram.header.session});
    }
    Session& session = sessions.back();
    if (datagram.live) session.health |= datagram.live->health;
    if (datagram.status) {
      session.health |= datagram.status->health;
      ++session.statuses;
    } else if (datagram.header.part == 1) {
      if (session.messages++ == 0) session.first = datagram.header.sequence;
      session.last = datagram.header.sequence;
      session.predicted += (datagram.header.flags & (64U | 128U)) != 0 ? 1 : 0;
    }
  });
  for (const Session& session : sessions) {
    (void)std::printf(
        "session %llu first %llu last %llu messages %llu predicted %llu statuses %llu "
        "health %u\n",
        static_cast<unsigned long long>(session.number), static_cast<unsigned long long>(session.first),
        static_cast<unsigned long long>(session.last), static_cast<unsigned long long>(session.messages),
        static_cast<unsigned long long>(session.predicted), static_cast<unsigned long long>(session.statuses),
        session.health);
  }
  return sessions.empty() ? 1 : 0;
}

int offsets(const char* path) {
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  std::int64_t last = 0;
  each_datagram(path, [&](const telemetry::Datagram& datagram, std::span<const std::byte>) {
    if (!datagram.live) return;
    const std::int64_t now = datagram.live->tai_offset.count();
    if (std::abs(now - last) > kSecond_ns) (void)std::printf("%lld\n", static_cast<long long>(now / kSecond_ns));
    last = now;
  });
  return last != 0 ? 0 : 1;
}

}  // namespace
}  // namespace stereotrack

int main(int count, char** words) {
  const std::string_view verb = count > 1 ? words[1] : "";
  try {
    if (verb == "listen" && count == 4) return stereotrack::listen(words[2], words[3]);
    if (verb == "compare" && count == 4) return stereotrack::compare(words[2], words[3]);
    if (verb == "offsets" && count == 3) return stereotrack::offsets(words[2]);
    if (verb == "sessions" && count == 3) return stereotrack::sessions(words[2]);
  } catch (const std::exception& error) {
    (void)std::fprintf(stderr, "keep_telemetry: %s\n", error.what());
    return 1;
  }
  (void)std::fprintf(
      stderr, "usage: keep_telemetry listen ADDR:PORT FILE | compare LIVE REPLAYED | sessions FILE | offsets FILE\n");
  return 2;
}
