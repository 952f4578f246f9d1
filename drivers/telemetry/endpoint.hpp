#pragma once

#include <sys/socket.h>

#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace stereotrack::telemetry {

inline constexpr std::uint16_t kDefaultPort = 47800;  ///< of `stereotrack monitor`, on 127.0.0.1

/// What the user wrote is not ADDR:PORT; the line says what is wrong. Bad usage: exit code 2.
class EndpointError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A numeric UDP address: `192.168.1.9:47800`, `[2001:db8::9]:47800`, multicast too. A network interface
/// may follow the address after a percent sign: `239.1.2.3%eth0:47800`, `[fe80::1%eth0]:47800`. Names are
/// not looked up: a resolver that does not answer must not hold up a rig.
struct Endpoint {
  sockaddr_storage address{};
  socklen_t size = 0;
  unsigned interface = 0;  ///< index of the interface, 0 = the system chooses

  [[nodiscard]] int family() const noexcept { return address.ss_family; }
  [[nodiscard]] const sockaddr* get() const noexcept { return reinterpret_cast<const sockaddr*>(&address); }
  [[nodiscard]] bool is_multicast() const noexcept;
  [[nodiscard]] std::uint16_t port() const noexcept;
};

/// Throws EndpointError. Port 0 is refused unless `allow_port_0` (listeners: the system chooses).
[[nodiscard]] Endpoint parse_endpoint(std::string_view text, bool allow_port_0 = false);
/// Each of `texts`; throws EndpointError for the first that is none.
[[nodiscard]] std::vector<Endpoint> parse_endpoints(std::span<const std::string> texts);
[[nodiscard]] std::string to_string(const Endpoint& endpoint);

/// Owns a file descriptor.
class Socket {
 public:
  Socket() noexcept = default;
  explicit Socket(int fd) noexcept : fd_(fd) {}
  Socket(Socket&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Socket& operator=(Socket&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~Socket();
  [[nodiscard]] int fd() const noexcept { return fd_; }

 private:
  int fd_ = -1;
};

}  // namespace stereotrack::telemetry
