#pragma once

#include "pipeline/core/time.hpp"

namespace stereotrack::runtime {

/// CLOCK_MONOTONIC, read. Who decides by time is told it; who tells it reads it here. No system call on Linux (vDSO).
[[nodiscard]] MonotonicTime monotonic_now() noexcept;

}  // namespace stereotrack::runtime
