#include "tests/bench/latency/arrivals.hpp"

#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <cstring>
#include <ctime>
#include <stdexcept>

#include "drivers/telemetry/receiver.hpp"

namespace stereotrack::bench {

namespace {

std::chrono::nanoseconds read(clockid_t clock) {
  timespec time{};
  (void)clock_gettime(clock, &time);
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

}  // namespace

Arrivals::Arrivals() : listener_(telemetry::parse_endpoint("127.0.0.1:0", true)) {
  list_.reserve(100'000);
  const int on = 1;
  const int room = 4 << 20;
  (void)setsockopt(listener_.fd(), SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
  if (setsockopt(listener_.fd(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) != 0) {
    throw std::runtime_error("the kernel does not stamp datagrams (SO_TIMESTAMPNS)");
  }
  thread_ = std::thread([this] { run(); });
}

void Arrivals::stop() {
  if (!thread_.joinable()) return;
  stop_ = true;
  thread_.join();
}

void Arrivals::run() {
  std::array<std::byte, 2048> bytes{};
  std::array<char, 256> control{};
  while (!stop_) {
    pollfd ready{listener_.fd(), POLLIN, 0};
    if (poll(&ready, 1, 50) <= 0) continue;
    iovec part{bytes.data(), bytes.size()};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t size = recvmsg(listener_.fd(), &message, MSG_DONTWAIT);
    if (size <= 0) continue;
    timespec stamp{};
    for (cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr; header = CMSG_NXTHDR(&message, header)) {
      if (header->cmsg_type == SCM_TIMESTAMPNS) std::memcpy(&stamp, CMSG_DATA(header), sizeof stamp);
    }
    // The stamp is of CLOCK_REALTIME; how the two clocks lie, is asked anew each time: it may be slewed.
    const auto offset = read(CLOCK_REALTIME) - read(CLOCK_MONOTONIC);
    const auto came = std::chrono::seconds(stamp.tv_sec) + std::chrono::nanoseconds(stamp.tv_nsec) - offset;
    const auto datagram = telemetry::decode(std::span(bytes).first(static_cast<std::size_t>(size)));
    if (!datagram.has_value() || datagram->status || datagram->header.part != 1) continue;
    const telemetry::Header& header = datagram->header;
    list_.push_back({header.ordinal, header.flags, MonotonicTime(std::chrono::nanoseconds(header.capture_time_ns)),
                     MonotonicTime(std::chrono::nanoseconds(header.send_time_ns)), MonotonicTime(came)});
  }
}

}  // namespace stereotrack::bench
