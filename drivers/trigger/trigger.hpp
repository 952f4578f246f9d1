#pragma once

#include <cstdint>
#include <string>
#include <vector>

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

  /// A line for the log: of a change, once.
  struct Note {
    bool good = false;  ///< else a warning
    std::string text;
  };

  Trigger() = default;
  Trigger(const Trigger&) = delete;
  Trigger& operator=(const Trigger&) = delete;
  virtual ~Trigger() = default;

  /// Readable, for poll(2), while take() has something; -1: none, it is asked whenever a frame comes.
  [[nodiscard]] virtual int descriptor() const noexcept = 0;

  /// The oldest pulse that was not told yet; false: none. Does not wait; no lock, no heap.
  [[nodiscard]] virtual bool take(Pulse& pulse) noexcept = 0;

  /// Service thread, about every 0.1 s: what waits or takes memory, such as asking for a chip anew. Throws nothing but
  /// std::bad_alloc.
  virtual void tend(MonotonicTime now, std::vector<Note>& notes) {
    (void)now;
    (void)notes;
  }

  /// Any thread. Pulses that are known to have been and were not told.
  [[nodiscard]] virtual std::uint64_t lost() const noexcept { return 0; }
};

}  // namespace stereotrack::trigger
