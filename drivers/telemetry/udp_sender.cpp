#include "drivers/telemetry/udp_sender.hpp"

#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <string>

namespace stereotrack::telemetry {
namespace {

[[noreturn]] void fail_to_open(const Endpoint& destination, const char* what) {
  const int error = errno;
  throw std::runtime_error("telemetry to " + to_string(destination) + ": " + what + ": " + std::strerror(error) +
                           "; check the address and the network interface");
}

template <class T>
void set(int fd, int level, int option, const T& value, const Endpoint& destination, const char* what) {
  if (setsockopt(fd, level, option, &value, sizeof value) != 0) fail_to_open(destination, what);
}

Socket open_to(const Endpoint& destination, const UdpSender::Config& config) {
  const bool v6 = destination.family() == AF_INET6;
  Socket socket(::socket(destination.family(), SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const int fd = socket.fd();
  if (fd < 0) fail_to_open(destination, "no socket");
  if (destination.is_multicast()) {
    set(fd, v6 ? IPPROTO_IPV6 : IPPROTO_IP, v6 ? IPV6_MULTICAST_HOPS : IP_MULTICAST_TTL, config.multicast_hops,
        destination, "cannot set the multicast hops");
    if (destination.interface != 0 && v6) {
      set(fd, IPPROTO_IPV6, IPV6_MULTICAST_IF, static_cast<int>(destination.interface), destination,
          "cannot send over this interface");
    } else if (destination.interface != 0) {
      ip_mreqn request{};
      request.imr_ifindex = static_cast<int>(destination.interface);
      set(fd, IPPROTO_IP, IP_MULTICAST_IF, request, destination, "cannot send over this interface");
    }
  }
  return socket;
}

}  // namespace

UdpSender::UdpSender(std::span<const Endpoint> destinations, const Config& config) {
  for (const Endpoint& destination : destinations) channels_.push_back({open_to(destination, config), destination});
}

UdpSender::UdpSender(std::vector<Socket> connected) {
  for (Socket& socket : connected) channels_.push_back({std::move(socket), {}});
}

void UdpSender::send(std::span<const std::byte> datagram) noexcept {
  for (const Channel& channel : channels_) {
    // Not connected: a connected socket keeps the source address of its first day, which a rig that gets
    // another one by DHCP could not use any more.
    const ssize_t sent = ::sendto(channel.socket.fd(), datagram.data(), datagram.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                                  channel.to.size == 0 ? nullptr : channel.to.get(), channel.to.size);
    if (sent == static_cast<ssize_t>(datagram.size())) {
      ++counters_.sent;
    } else if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS)) {
      ++counters_.dropped;
    } else {
      last_error_ = sent < 0 ? errno : EMSGSIZE;
      ++counters_.failed;
    }
  }
}

}  // namespace stereotrack::telemetry
