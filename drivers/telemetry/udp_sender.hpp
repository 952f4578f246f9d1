#pragma once

#include <span>
#include <vector>

#include "drivers/telemetry/endpoint.hpp"
#include "drivers/telemetry/sink.hpp"

namespace stereotrack::telemetry {

/// Sends every datagram to every destination. Each has a socket of its own, so that one that is full does
/// not starve the others. Never blocks: a full socket drops the datagram and counts it. Whether somebody
/// listens, or whether the network is up yet, is not its business: what finds no way counts as failed, and
/// goes through again when there is one. Multicast stays in the local network (hops = 1) unless told otherwise, and
/// is heard on this machine too.
/// Making one may throw std::runtime_error with one line naming the destination; send() does not.
class UdpSender final : public Sink {
 public:
  struct Config {
    int multicast_hops = 1;  ///< 1..255, IP TTL or hop limit of multicast
  };

  explicit UdpSender(std::span<const Endpoint> destinations) : UdpSender(destinations, Config{}) {}
  UdpSender(std::span<const Endpoint> destinations, const Config& config);

  /// Sends over datagram sockets that are connected already; takes them over.
  explicit UdpSender(std::vector<Socket> connected);

  void send(std::span<const std::byte> datagram) noexcept override;

  /// errno of the last datagram that failed; 0 = none did.
  [[nodiscard]] int last_error() const noexcept { return last_error_; }

 private:
  struct Channel {
    Socket socket;
    Endpoint to;  ///< size 0: the socket is connected
  };
  std::vector<Channel> channels_;
  int last_error_ = 0;
};

}  // namespace stereotrack::telemetry
