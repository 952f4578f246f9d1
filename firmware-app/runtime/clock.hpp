#pragma once

#include <chrono>
#include <optional>

#include "pipeline/core/time.hpp"

namespace stereotrack::runtime {

/// CLOCK_MONOTONIC, read. Who decides by time is told it; who tells it reads it here. No system call on Linux (vDSO).
[[nodiscard]] MonotonicTime monotonic_now() noexcept;

/// Sleeps until a moment of CLOCK_MONOTONIC; signals do not end it. Returns at once if it is over.
void sleep_until(MonotonicTime moment) noexcept;

/// The same, but awake for the last `awake` of it: what the kernel takes to wake a thread, tens of microseconds and
/// never the same, is over by then. Costs that much of a core.
void sleep_until(MonotonicTime moment, std::chrono::nanoseconds awake) noexcept;

/// Where TAI lies, as the kernel knows it.
struct TaiReading {
  std::chrono::nanoseconds offset{0};             ///< TAI - CLOCK_MONOTONIC
  std::optional<std::chrono::nanoseconds> error;  ///< the kernel's estimate; none: no one keeps the clock, or no one
                                                  ///< has told the kernel by how much TAI and UTC differ
};

/// Two vDSO reads around each other, and one system call (adjtimex, which needs no right to read).
[[nodiscard]] TaiReading read_tai() noexcept;

}  // namespace stereotrack::runtime
