#pragma once

#include <atomic>
#include <cstdint>

namespace stereotrack {

/// A number that one thread writes and any thread reads: load and store do, without the price of an atomic addition.
/// Each reading is whole; two counters may be read a moment apart.
class Counter {
 public:
  /// Writer.
  void add(std::uint64_t n = 1) noexcept { set(get() + n); }
  void set(std::uint64_t n) noexcept { value_.store(n, std::memory_order_relaxed); }

  /// Any thread.
  [[nodiscard]] std::uint64_t get() const noexcept { return value_.load(std::memory_order_relaxed); }

 private:
  static_assert(std::atomic<std::uint64_t>::is_always_lock_free);
  std::atomic<std::uint64_t> value_{0};
};

}  // namespace stereotrack
