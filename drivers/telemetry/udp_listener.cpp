#include "drivers/telemetry/udp_listener.hpp"

#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <string>

namespace stereotrack::telemetry {
namespace {

[[noreturn]] void fail_to_open(const Endpoint& local, const char* way_out) {
  const int error = errno;
  throw std::runtime_error("cannot listen on " + to_string(local) + ": " + std::strerror(error) + "; " + way_out);
}

}  // namespace

UdpListener::UdpListener(const Endpoint& local)
    : socket_(::socket(local.family(), SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)), local_(local) {
  const int fd = socket_.fd();
  const int on = 1;
  if (fd < 0) fail_to_open(local, "check that the system speaks this version of IP");
  // A burst of pairs must not be lost while the terminal is slow; the kernel caps what it does not grant.
  const int buffer_bytes = 1 << 20;
  (void)setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &buffer_bytes, sizeof buffer_bytes);
  if (local.is_multicast() && setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0) {
    fail_to_open(local, "the port cannot be shared");
  }
  if (::bind(fd, local.get(), local.size) != 0) {
    fail_to_open(local, errno == EADDRINUSE ? "another program has this port: stop it or listen on another one"
                                            : "take an address of this machine, or 0.0.0.0 for all of them");
  }
  if (local.is_multicast()) {
    int joined = 0;
    if (local.family() == AF_INET) {
      ip_mreqn request{};
      request.imr_multiaddr = reinterpret_cast<const sockaddr_in*>(local.get())->sin_addr;
      request.imr_ifindex = static_cast<int>(local.interface);
      joined = setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof request);
    } else {
      ipv6_mreq request{};
      request.ipv6mr_multiaddr = reinterpret_cast<const sockaddr_in6*>(local.get())->sin6_addr;
      request.ipv6mr_interface = local.interface;
      joined = setsockopt(fd, IPPROTO_IPV6, IPV6_JOIN_GROUP, &request, sizeof request);
    }
    if (joined != 0) fail_to_open(local, "name the network interface, for example 239.1.2.3%eth0:47800");
  }
  socklen_t size = sizeof local_.address;
  if (::getsockname(fd, reinterpret_cast<sockaddr*>(&local_.address), &size) == 0) local_.size = size;
}

std::ptrdiff_t UdpListener::receive(std::span<std::byte> buffer) noexcept {
  // MSG_TRUNC: the size of the datagram, not of what fitted, so that an oversized one is seen as such.
  return ::recv(socket_.fd(), buffer.data(), buffer.size(), MSG_DONTWAIT | MSG_TRUNC);
}

}  // namespace stereotrack::telemetry
