#pragma once

#include <fcntl.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "firmware-app/runtime/allocation_count.hpp"

namespace stereotrack::test {

/// Heap calls of this thread since the watch was made.
class HeapWatch {
 public:
  [[nodiscard]] std::uint64_t allocations() const noexcept { return allocations_of_this_thread() - allocations_; }
  [[nodiscard]] std::uint64_t frees() const noexcept { return frees_of_this_thread() - frees_; }
  [[nodiscard]] std::uint64_t calls() const noexcept { return allocations() + frees(); }

 private:
  std::uint64_t allocations_ = allocations_of_this_thread();
  std::uint64_t frees_ = frees_of_this_thread();
};

/// What the whole process holds at the moment.
struct ProcessMemory {
  std::size_t heap = 0;       ///< in use, as malloc itself counts, mapped blocks included [bytes]
  std::size_t anonymous = 0;  ///< resident pages that are no file's: heap, stacks, data [bytes]

  /// Without a heap call of its own: what looking leaves in malloc's caches would count as in use.
  [[nodiscard]] static ProcessMemory now() noexcept {
    ProcessMemory memory;
    std::array<char, 4096> text{};
    const int file = ::open("/proc/self/smaps_rollup", O_RDONLY | O_CLOEXEC);
    const auto size = static_cast<std::size_t>(std::max<ssize_t>(::read(file, text.data(), text.size()), 0));
    (void)::close(file);
    constexpr std::string_view kKey = "\nAnonymous:";
    const std::string_view all(text.data(), size);
    if (const std::size_t at = all.find(kKey); at != std::string_view::npos) {
      const std::size_t number = all.find_first_not_of(' ', at + kKey.size());
      (void)std::from_chars(text.data() + number, text.data() + size, memory.anonymous);
      memory.anonymous *= 1024;
    }
    const struct mallinfo2 heap = mallinfo2();
    memory.heap = heap.uordblks + heap.hblkhd;
    return memory;
  }
};

}  // namespace stereotrack::test
