#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <type_traits>

namespace stereotrack {

/// A ring of small values between one producer thread and one consumer thread, in which the newest wins: a push on a
/// full ring takes the oldest element out and hands it back.
///
///     read_                      oldest element, counted since the ring was made; moved on by whoever takes it out
///     write_                     one behind the newest; moved by the producer alone
///     slot of element i          i mod kCapacity
///
/// Who takes the oldest out is decided by one compare-exchange of read_, from i to i + 1. Both sides may try it for the
/// same i (the consumer to pop, the producer to evict); one succeeds and owns the element. The positions have 64 bits
/// and never come back to an old value.
///
/// push and evict are wait-free: no loop, and at most kCapacity rounds. pop repeats only when the producer evicted what
/// it was about to take, so it is lock-free; with a producer that pushes once a frame it goes round twice at most.
///
/// Proven by tests/unit/core/interleave_test.cpp, which runs this very code through every schedule of two small threads
/// (Atomic is then tests/support/interleave.hpp's), and by a stress test under ThreadSanitizer.
template <class T, std::size_t kCapacity, template <class> class Atomic = std::atomic>
class EvictingRing {
  static_assert(std::has_single_bit(kCapacity), "a power of two, so that a position's slot is a mask");
  static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= 8, "what an atomic holds without a lock");
  static_assert(Atomic<T>::is_always_lock_free && Atomic<std::uint64_t>::is_always_lock_free);

 public:
  EvictingRing() noexcept = default;
  EvictingRing(const EvictingRing&) = delete;
  EvictingRing& operator=(const EvictingRing&) = delete;
  ~EvictingRing() = default;

  /// Producer. What had to leave for it, or nothing.
  std::optional<T> push(T value) noexcept {
    std::optional<T> oldest;
    // Acquire: the slot is written below. The consumer's release of read_ after it read the slot makes that reading
    // come before.
    std::uint64_t read = read_.load(std::memory_order_acquire);
    std::uint64_t fill = next_ - read;
    if (fill == kCapacity) {
      // Relaxed: this thread itself wrote the slot.
      const T candidate = slots_[read & kMask].load(std::memory_order_relaxed);
      // Release: a consumer that sees the new position also sees the write_ that made the ring full, so that it never
      // finds read_ beyond write_. Acquire on failure: then the consumer has taken it, as above.
      if (read_.compare_exchange_strong(read, read + 1, std::memory_order_acq_rel, std::memory_order_acquire)) {
        oldest = candidate;
        count(evicted_);
      }
      fill = kCapacity - 1;
    }
    // Relaxed: write_ below publishes it. A consumer that still looks at the element that was here before cannot keep
    // what it reads: its compare-exchange fails, for read_ has moved on.
    slots_[next_ & kMask].store(value, std::memory_order_relaxed);
    ++next_;
    // Release: who sees the position sees the element.
    write_.store(next_, std::memory_order_release);
    if (fill + 1 > high_water_.load(std::memory_order_relaxed)) high_water_.store(fill + 1, std::memory_order_relaxed);
    return oldest;
  }

  /// Producer. Takes the oldest out without putting anything in; nothing: the ring is empty.
  [[nodiscard]] std::optional<T> evict() noexcept {
    // Orders as in push. A failure says that the consumer took this one; nothing is added meanwhile, so this ends.
    std::uint64_t read = read_.load(std::memory_order_acquire);
    while (read != next_) {
      const T candidate = slots_[read & kMask].load(std::memory_order_relaxed);
      if (read_.compare_exchange_strong(read, read + 1, std::memory_order_acq_rel, std::memory_order_acquire)) {
        count(evicted_);
        return candidate;
      }
    }
    return std::nullopt;
  }

  /// Consumer. The oldest; nothing: the ring is empty.
  [[nodiscard]] std::optional<T> pop() noexcept {
    // Acquire: with the producer's release on eviction, write_ is read as new as this position or newer.
    std::uint64_t read = read_.load(std::memory_order_acquire);
    for (;;) {
      // Acquire: the element that this position publishes.
      const std::uint64_t write = write_.load(std::memory_order_acquire);
      if (read == write) return std::nullopt;
      // Relaxed: may be the successor's, if the producer evicts now; the compare-exchange then fails.
      const T value = slots_[read & kMask].load(std::memory_order_relaxed);
      // Release: the slot was read before the producer, which acquires read_, may write it again. Acquire on failure:
      // as at the top.
      if (read_.compare_exchange_strong(read, read + 1, std::memory_order_acq_rel, std::memory_order_acquire)) {
        const std::uint64_t left = write - read - 1;
        if (left < low_water_.load(std::memory_order_relaxed)) low_water_.store(left, std::memory_order_relaxed);
        return value;
      }
    }
  }

  /// Consumer. False: a pop will find something, unless the producer evicts it first.
  [[nodiscard]] bool empty() const noexcept {
    // Acquire, in this order: as in pop.
    const std::uint64_t read = read_.load(std::memory_order_acquire);
    return read == write_.load(std::memory_order_acquire);
  }

  [[nodiscard]] static constexpr std::size_t capacity() noexcept { return kCapacity; }

  /// Any thread. Figures for telemetry: each has one writer and decides nothing, hence relaxed.
  [[nodiscard]] std::uint64_t evicted() const noexcept { return evicted_.load(std::memory_order_relaxed); }
  /// Most elements that were in the ring after a push; one too high where the consumer took one in that moment.
  [[nodiscard]] std::uint64_t high_water() const noexcept { return high_water_.load(std::memory_order_relaxed); }
  /// Fewest elements that a pop left behind; kCapacity before the first.
  [[nodiscard]] std::uint64_t low_water() const noexcept { return low_water_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::uint64_t kMask = kCapacity - 1;
  static constexpr std::size_t kCacheLine = 64;

  static void count(std::atomic<std::uint64_t>& counter) noexcept {
    counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  }

  // Each side writes to lines of its own.
  alignas(kCacheLine) Atomic<std::uint64_t> read_{0};
  std::atomic<std::uint64_t> low_water_{kCapacity};  // consumer's
  alignas(kCacheLine) Atomic<std::uint64_t> write_{0};
  std::uint64_t next_ = 0;  // write_, as the producer knows it
  std::atomic<std::uint64_t> evicted_{0};
  std::atomic<std::uint64_t> high_water_{0};
  alignas(kCacheLine) std::array<Atomic<T>, kCapacity> slots_{};
};

}  // namespace stereotrack
