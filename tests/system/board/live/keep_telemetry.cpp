// What a live rig sends, kept and compared byte by byte.
//
//     keep_telemetry listen ADDR:PORT FILE
//         until SIGTERM; says "listening" first. FILE has the form of a replay's telemetry.bin
//     keep_telemetry compare LIVE REPLAYED
//         each message in REPLAYED has to be in LIVE, with the same bytes. Says how many there are, how many of them
//         have targets, and the first that differ
#include <poll.h>
#include <sys/signalfd.h>

#include <array>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/telemetry/file_sink.hpp"
#include "drivers/telemetry/receiver.hpp"
#include "drivers/telemetry/udp_listener.hpp"

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
  std::ifstream in(path, std::ios::binary);
  if (!in) throw std::runtime_error(std::string(path) + ": cannot be read");
  const std::string file((std::istreambuf_iterator<char>(in)), {});
  Messages messages;
  for (std::size_t at = 0; at + 4 <= file.size();) {
    std::uint32_t size = 0;
    std::memcpy(&size, file.data() + at, 4);
    if (at + 4 + size > file.size()) throw std::runtime_error(std::string(path) + ": is cut");
    const auto* const bytes = reinterpret_cast<const std::byte*>(file.data() + at + 4);
    const auto datagram = telemetry::decode({bytes, size});
    if (!datagram.has_value()) throw std::runtime_error(std::string(path) + ": holds what is no datagram of ours");
    if (!datagram->status) {
      Message& message = messages[datagram->header.sequence];
      message.bytes.insert(message.bytes.end(), bytes, bytes + size);
      message.targets += datagram->targets.size();
    }
    at += 4 + size;
  }
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

}  // namespace
}  // namespace stereotrack

int main(int count, char** words) {
  const std::string_view verb = count == 4 ? words[1] : "";
  try {
    if (verb == "listen") return stereotrack::listen(words[2], words[3]);
    if (verb == "compare") return stereotrack::compare(words[2], words[3]);
  } catch (const std::exception& error) {
    (void)std::fprintf(stderr, "keep_telemetry: %s\n", error.what());
    return 1;
  }
  (void)std::fprintf(stderr, "usage: keep_telemetry listen ADDR:PORT FILE | compare LIVE REPLAYED\n");
  return 2;
}
