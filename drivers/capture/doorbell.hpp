#pragma once

#include <atomic>
#include <cstdint>

#include "pipeline/core/time.hpp"

namespace stereotrack::capture {

/// Lets one thread sleep until another has something for it, or until a moment.
///
///     waiter:  seen = rings();  is there work?  else  wait(seen, deadline)
///     ringer:  make the work visible, then  ring()
///
/// Work that came between the look and the sleep has moved the count, so the sleep does not begin: no ring is lost.
///
/// A futex, because FUTEX_WAIT_BITSET takes an absolute time of CLOCK_MONOTONIC, in one system call; because a ring
/// costs no system call while nobody sleeps; and because it needs no descriptor. An eventfd would have to be read, and
/// poll() beside it knows relative times alone; std::atomic::wait spins first and has no time-out; a condition variable
/// has a lock, which a thread of lower priority may hold.
/// One waiter at a time; any number of ringers.
class Doorbell {
 public:
  using Count = std::uint32_t;

  /// Rings so far. Comes round after 2^32: a waiter would have to miss exactly that many between two lines.
  [[nodiscard]] Count rings() const noexcept;

  /// Never blocks: one atomic addition, and one system call if the waiter sleeps.
  void ring() noexcept;

  /// Returns at once if there were rings since `seen`. True: there were; false: the deadline has passed without one.
  /// Signals do not end it.
  [[nodiscard]] bool wait(Count seen, MonotonicTime deadline) noexcept;

 private:
  std::atomic<Count> rings_{0};
  std::atomic<std::uint32_t> sleepers_{0};
};

}  // namespace stereotrack::capture
