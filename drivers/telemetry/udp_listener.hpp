#pragma once

#include <cstddef>
#include <span>

#include "drivers/telemetry/endpoint.hpp"

namespace stereotrack::telemetry {

/// The receiving end: a bound UDP socket. A multicast address is joined and may have several listeners on
/// one machine; any other port has one. Making one throws std::runtime_error with one line that says
/// when the port is in use.
class UdpListener {
 public:
  explicit UdpListener(const Endpoint& local);

  /// Takes the next waiting datagram. Its true size, which may be more than fits into `buffer`; -1 if none waits.
  [[nodiscard]] std::ptrdiff_t receive(std::span<std::byte> buffer) noexcept;

  [[nodiscard]] int fd() const noexcept { return socket_.fd(); }           ///< to poll
  [[nodiscard]] const Endpoint& local() const noexcept { return local_; }  ///< with the port that it got

 private:
  Socket socket_;
  Endpoint local_;
};

}  // namespace stereotrack::telemetry
