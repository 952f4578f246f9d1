#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace stereotrack {

/// The latest value of one writer thread for one reader thread, values of any size, in the mailbox's own memory.
///
/// Three slots: the writer fills one, the reader reads one, the third waits between them. Publishing and taking
/// exchange one's own slot for the waiting one, in one atomic step; so nobody ever writes where somebody reads, and
/// what was taken stays whole until the next take that finds something. A slot that waits and is newer than the
/// reader's carries kFresh. What the reader takes is therefore never torn and never older than what it took before.
/// Wait-free on both sides: one exchange.
///
/// Proven as EvictingRing is: every schedule of two small threads, and a stress test under ThreadSanitizer.
template <class T, template <class> class Atomic = std::atomic>
class Mailbox {
  static_assert(Atomic<std::uint8_t>::is_always_lock_free);

 public:
  Mailbox() = default;
  Mailbox(const Mailbox&) = delete;
  Mailbox& operator=(const Mailbox&) = delete;
  ~Mailbox() = default;

  /// Writer. The slot to fill, the writer's until publish(). Holds an old value: fill all of it.
  [[nodiscard]] T& draft() noexcept { return slots_[back_]; }

  /// Writer. Makes the draft the latest value; draft() is then another slot.
  void publish() noexcept {
    // Release: the reader that takes the slot sees what was filled in. Acquire: the slot that comes back was read by
    // the reader before it gave it away.
    const std::uint8_t waiting =
        waiting_.exchange(static_cast<std::uint8_t>(back_ | kFresh), std::memory_order_acq_rel);
    back_ = waiting & kSlot;
    if ((waiting & kFresh) != 0) {
      unread_.store(unread_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    }
  }

  /// Reader. The latest value, valid until the next take() that answers one; null: nothing new since the last.
  [[nodiscard]] const T* take() noexcept {
    // Relaxed: a look, so that nothing is exchanged in vain. Only this thread clears kFresh, so it stays until below.
    if ((waiting_.load(std::memory_order_relaxed) & kFresh) == 0) return nullptr;
    // Acquire: what the writer filled in. Release: this thread's reading of the slot it gives away.
    front_ = waiting_.exchange(front_, std::memory_order_acq_rel) & kSlot;
    return &slots_[front_];
  }

  /// Any thread. Values that a newer one replaced before they were taken.
  [[nodiscard]] std::uint64_t unread() const noexcept { return unread_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::uint8_t kSlot = 3;
  static constexpr std::uint8_t kFresh = 4;
  static constexpr std::size_t kCacheLine = 64;

  std::array<T, 3> slots_{};
  alignas(kCacheLine) Atomic<std::uint8_t> waiting_{1};
  alignas(kCacheLine) std::uint8_t back_ = 0;   // writer's
  std::atomic<std::uint64_t> unread_{0};        // the writer writes it
  alignas(kCacheLine) std::uint8_t front_ = 2;  // reader's
};

}  // namespace stereotrack
