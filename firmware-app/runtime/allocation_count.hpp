#pragma once

#include <cstdint>

namespace stereotrack {

/// Heap calls (malloc, calloc, realloc, aligned ones, and operator new, which ends there) of the calling thread
/// since it began. Linking this file replaces malloc's entry points by counting ones.
[[nodiscard]] std::uint64_t allocations_of_this_thread() noexcept;

/// False under a sanitizer, whose own malloc must stay: the count is then always 0.
[[nodiscard]] bool allocations_are_counted() noexcept;

}  // namespace stereotrack
