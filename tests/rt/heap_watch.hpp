#pragma once

#include <malloc.h>

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>

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

  [[nodiscard]] static ProcessMemory now() {
    ProcessMemory memory;
    std::ifstream lines("/proc/self/smaps_rollup");
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with("Anonymous:")) memory.anonymous = 1024 * std::stoul(line.substr(line.find(':') + 1));
    }
    lines.close();
    const struct mallinfo2 heap = mallinfo2();
    memory.heap = heap.uordblks + heap.hblkhd;
    return memory;
  }
};

}  // namespace stereotrack::test
