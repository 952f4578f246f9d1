#pragma once

#include <cstdint>

namespace stereotrack {

/// Heap calls (malloc, calloc, realloc, aligned ones, and operator new, which ends there) of the calling thread
/// since it began. Linking this file replaces malloc's entry points by counting ones.
[[nodiscard]] std::uint64_t allocations_of_this_thread() noexcept;

/// Calls of free, and of operator delete, which ends there.
[[nodiscard]] std::uint64_t frees_of_this_thread() noexcept;

/// False under a sanitizer, whose own malloc must stay: the count is then always 0, as is that of frees.
[[nodiscard]] bool allocations_are_counted() noexcept;

}  // namespace stereotrack
