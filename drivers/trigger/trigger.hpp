#pragma once

#include <cstdint>

#include "pipeline/core/time.hpp"

namespace stereotrack::trigger {

/// What asks both sensors for an exposure at a time, and tells when it did: pulses that we give, or edges of somebody
/// else's that we see. One owner; the capture thread's, once made.
class Trigger {
 public:
  struct Pulse {
    std::uint64_t number = 0;  ///< from 1, rises; a gap: pulses that are known to have been and not when
    MonotonicTime time{};      ///< of the edge that begins an exposure
  };

  Trigger() = default;
  Trigger(const Trigger&) = delete;
  Trigger& operator=(const Trigger&) = delete;
  virtual ~Trigger() = default;

  /// Readable, for poll(2), while take() has something; -1: none, it is asked whenever a frame comes.
  [[nodiscard]] virtual int descriptor() const noexcept = 0;

  /// The oldest pulse that was not told yet; false: none. Does not wait; no lock, no heap.
  [[nodiscard]] virtual bool take(Pulse& pulse) noexcept = 0;
};

}  // namespace stereotrack::trigger
