#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace stereotrack {

/// Values of any size from one producer thread to one consumer thread, in order, none lost: a push on a full queue is
/// refused and counted. For what must not be evicted (an EvictingRing does that) nor replaced (a Mailbox does).
///
/// Lamport's queue: each position has one writer, and a slot belongs to the producer from the moment at which the
/// consumer has moved read_ past it until the producer moves write_ past it. Wait-free on both sides.
///
/// Proven as EvictingRing is: every schedule of two small threads, and a stress test under ThreadSanitizer.
template <class T, std::size_t kCapacity, template <class> class Atomic = std::atomic>
class HandoverQueue {
  static_assert(std::has_single_bit(kCapacity), "a power of two, so that a position's slot is a mask");
  static_assert(Atomic<std::uint64_t>::is_always_lock_free);

 public:
  HandoverQueue() = default;
  HandoverQueue(const HandoverQueue&) = delete;
  HandoverQueue& operator=(const HandoverQueue&) = delete;
  ~HandoverQueue() = default;

  /// Producer. False: full, nothing was put in.
  [[nodiscard]] bool push(const T& value) noexcept {
    static_assert(std::is_nothrow_copy_assignable_v<T>);
    // Acquire: the consumer has read the slot that is written below.
    if (next_write_ - read_.load(std::memory_order_acquire) == kCapacity) {
      refused_.store(refused_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
      return false;
    }
    slots_[next_write_ & kMask] = value;
    // Release: who sees the position sees the value.
    write_.store(++next_write_, std::memory_order_release);
    return true;
  }

  /// Consumer. False: empty, `out` is untouched.
  [[nodiscard]] bool pop(T& out) noexcept {
    // Acquire: the value that this position publishes.
    if (next_read_ == write_.load(std::memory_order_acquire)) return false;
    out = slots_[next_read_ & kMask];
    // Release: the slot was read before the producer may write it again.
    read_.store(++next_read_, std::memory_order_release);
    return true;
  }

  [[nodiscard]] static constexpr std::size_t capacity() noexcept { return kCapacity; }

  /// Any thread.
  [[nodiscard]] std::uint64_t refused() const noexcept { return refused_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::uint64_t kMask = kCapacity - 1;
  static constexpr std::size_t kCacheLine = 64;

  alignas(kCacheLine) Atomic<std::uint64_t> read_{0};
  std::uint64_t next_read_ = 0;  // read_, as the consumer knows it
  alignas(kCacheLine) Atomic<std::uint64_t> write_{0};
  std::uint64_t next_write_ = 0;  // write_, as the producer knows it
  std::atomic<std::uint64_t> refused_{0};
  alignas(kCacheLine) std::array<T, kCapacity> slots_{};
};

}  // namespace stereotrack
