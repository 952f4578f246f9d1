#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace stereotrack::telemetry {

struct SinkCounters {
  std::uint64_t sent = 0;     ///< datagrams handed over whole, times destinations
  std::uint64_t dropped = 0;  ///< no room at the moment: a full socket
  std::uint64_t failed = 0;   ///< refused for another reason: no route, disk full
};

/// Where datagrams go. send() never blocks the sender for a slow receiver and never fails loudly: what
/// could not be handed over is counted. One thread.
class Sink {
 public:
  Sink() = default;
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;
  virtual ~Sink() = default;

  virtual void send(std::span<const std::byte> datagram) noexcept = 0;
  [[nodiscard]] const SinkCounters& counters() const noexcept { return counters_; }

 protected:
  SinkCounters counters_;
};

}  // namespace stereotrack::telemetry
