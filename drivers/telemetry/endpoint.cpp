#include "drivers/telemetry/endpoint.hpp"

#include <arpa/inet.h>
#include <net/if.h>
#include <netinet/in.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <cstring>

namespace stereotrack::telemetry {
namespace {

[[noreturn]] void refuse(std::string_view text, const std::string& why) {
  throw EndpointError("'" + std::string(text) + "' is not ADDR:PORT: " + why +
                      "; write for example 127.0.0.1:47800 or [::1]:47800");
}

}  // namespace

bool Endpoint::is_multicast() const noexcept {
  if (family() == AF_INET) {
    return IN_MULTICAST(ntohl(reinterpret_cast<const sockaddr_in*>(&address)->sin_addr.s_addr));
  }
  return IN6_IS_ADDR_MULTICAST(&reinterpret_cast<const sockaddr_in6*>(&address)->sin6_addr);
}

std::uint16_t Endpoint::port() const noexcept {
  return ntohs(family() == AF_INET ? reinterpret_cast<const sockaddr_in*>(&address)->sin_port
                                   : reinterpret_cast<const sockaddr_in6*>(&address)->sin6_port);
}

Endpoint parse_endpoint(std::string_view text, bool allow_port_0) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) refuse(text, "no port");
  std::string_view host = text.substr(0, colon);
  const std::string_view digits = text.substr(colon + 1);
  const bool v6 = host.starts_with('[');
  if (v6) {
    if (!host.ends_with(']')) refuse(text, "no port after the bracket, or the bracket is not closed");
    host = host.substr(1, host.size() - 2);
  } else if (host.find(':') != std::string_view::npos) {
    refuse(text, "an IPv6 address stands in brackets");
  }

  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  if (error != std::errc{} || end != digits.data() + digits.size() || (port == 0 && !allow_port_0)) {
    refuse(text, "the port must be a number from 1 to 65535");
  }

  Endpoint endpoint;
  if (const std::size_t percent = host.find('%'); percent != std::string_view::npos) {
    const std::string name(host.substr(percent + 1));
    endpoint.interface = if_nametoindex(name.c_str());
    if (endpoint.interface == 0) refuse(text, "there is no network interface '" + name + "' (see 'ip link')");
    host = host.substr(0, percent);
  }
  const std::string address(host);
  if (v6) {
    auto* in6 = reinterpret_cast<sockaddr_in6*>(&endpoint.address);
    in6->sin6_family = AF_INET6;
    in6->sin6_port = htons(port);
    in6->sin6_scope_id = endpoint.interface;
    endpoint.size = sizeof(sockaddr_in6);
    if (inet_pton(AF_INET6, address.c_str(), &in6->sin6_addr) != 1) {
      refuse(text, "'" + address + "' is no numeric IPv6 address");
    }
  } else {
    auto* in = reinterpret_cast<sockaddr_in*>(&endpoint.address);
    in->sin_family = AF_INET;
    in->sin_port = htons(port);
    endpoint.size = sizeof(sockaddr_in);
    if (inet_pton(AF_INET, address.c_str(), &in->sin_addr) != 1) {
      refuse(text, "'" + address + "' is no numeric IPv4 address");
    }
  }
  return endpoint;
}

std::vector<Endpoint> parse_endpoints(std::span<const std::string> texts) {
  std::vector<Endpoint> endpoints;
  for (const std::string& text : texts) endpoints.push_back(parse_endpoint(text));
  return endpoints;
}

std::string to_string(const Endpoint& endpoint) {
  const bool v6 = endpoint.family() == AF_INET6;
  const void* number = v6 ? static_cast<const void*>(&reinterpret_cast<const sockaddr_in6*>(endpoint.get())->sin6_addr)
                          : &reinterpret_cast<const sockaddr_in*>(endpoint.get())->sin_addr;
  std::array<char, INET6_ADDRSTRLEN> address{};
  inet_ntop(endpoint.family(), number, address.data(), address.size());
  std::string text(v6 ? "[" : "");
  text += address.data();
  std::array<char, IF_NAMESIZE> name{};
  if (endpoint.interface != 0 && if_indextoname(endpoint.interface, name.data()) != nullptr) {
    text += '%';
    text += name.data();
  }
  text += v6 ? "]:" : ":";
  text += std::to_string(endpoint.port());
  return text;
}

Socket::~Socket() {
  if (fd_ >= 0) ::close(fd_);
}

}  // namespace stereotrack::telemetry
