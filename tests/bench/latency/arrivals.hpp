#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>
#include <vector>

#include "drivers/telemetry/endpoint.hpp"
#include "drivers/telemetry/udp_listener.hpp"
#include "pipeline/core/time.hpp"

namespace stereotrack::bench {

/// What came over a real socket, and when: by the kernel's own stamp of each datagram, so that it does not matter when
/// this listener gets to run.
struct Arrival {
  std::uint64_t ordinal = 0;  ///< 0: no pair
  std::uint32_t flags = 0;
  MonotonicTime captured{};
  MonotonicTime due{};  ///< Datagram::send_time
  MonotonicTime came{};
};

class Arrivals {
 public:
  Arrivals();
  Arrivals(const Arrivals&) = delete;
  Arrivals& operator=(const Arrivals&) = delete;
  ~Arrivals() { stop(); }

  [[nodiscard]] std::vector<telemetry::Endpoint> here() const { return {listener_.local()}; }
  /// After it, the list is whole.
  void stop();
  [[nodiscard]] const std::vector<Arrival>& list() const noexcept { return list_; }

 private:
  void run();

  telemetry::UdpListener listener_;
  std::vector<Arrival> list_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace stereotrack::bench
