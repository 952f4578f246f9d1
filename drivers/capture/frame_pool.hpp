#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "drivers/capture/doorbell.hpp"
#include "pipeline/core/ring.hpp"
#include "pipeline/core/time.hpp"
#include "pipeline/frame.hpp"

namespace stereotrack::capture {

class FramePool;

/// The right to read one pair. Single owner, move-only; gives the pair back when it goes. The frame loop's thread only,
/// and never longer than the pool lives.
class PairLease {
 public:
  PairLease() noexcept = default;
  PairLease(const PairLease&) = delete;
  PairLease& operator=(const PairLease&) = delete;
  PairLease(PairLease&& other) noexcept : pool_(std::exchange(other.pool_, nullptr)), slot_(other.slot_) {}
  PairLease& operator=(PairLease&& other) noexcept {
    if (this != &other) {
      release();
      pool_ = std::exchange(other.pool_, nullptr);
      slot_ = other.slot_;
    }
    return *this;
  }
  ~PairLease() { release(); }

  /// Whether there is a pair.
  explicit operator bool() const noexcept { return pool_ != nullptr; }
  /// Only if there is one.
  [[nodiscard]] const FramePair& operator*() const noexcept;
  [[nodiscard]] const FramePair* operator->() const noexcept { return &**this; }

  /// Gives the pair back now: its pixels may change at once.
  void release() noexcept;

 private:
  friend class FramePool;
  PairLease(FramePool* pool, std::uint32_t slot) noexcept : pool_(pool), slot_(slot) {}

  FramePool* pool_ = nullptr;
  std::uint32_t slot_ = 0;
};

/// Pairs on their way from the capture thread to the frame loop and back. The pixels stay where the driver has them; a
/// slot holds their description, and the driver keeps a table of which buffers each slot names.
///
///     free ──claim──> being filled ──publish──> waiting ──take──> leased ──release──> returned ──claim, take_back──>
///     free
///                                                  └──────────claim, nothing free: evicted──────────┘
///
/// One thread captures, one thread leases; no lock, no memory taken after the constructor, no system call but the ring
/// of the doorbell where the frame loop sleeps. With N slots at most N pairs are out, so a driver has N + 2 buffers a
/// side: one that is being written, one that comes next.
class FramePool {
 public:
  static constexpr std::size_t kMinSlots = 2;  ///< one leased, one that takes turns
  static constexpr std::size_t kMaxSlots = 16;

  /// Throws std::invalid_argument unless kMinSlots <= slots <= kMaxSlots.
  explicit FramePool(std::size_t slots);
  FramePool(const FramePool&) = delete;
  FramePool& operator=(const FramePool&) = delete;
  ~FramePool() = default;

  // ---- Capture thread

  enum class Claim : std::uint8_t {
    kFree,     ///< a slot that nobody wanted
    kEvicted,  ///< the oldest waiting pair's: the frame loop will not see that pair
    kStarved,  ///< none: all are leased; the new pair must be dropped
  };
  struct Claimed {
    Claim how = Claim::kStarved;
    std::uint32_t slot = 0;
    FramePair* pair = nullptr;  ///< to fill, until publish(); as it was left, so fill all of it. Null: starved
  };
  /// A slot for a new pair. The buffers that it named before are the capture thread's again, to requeue unless
  /// take_back() has told it so already. One slot is filled at a time: publish() or give_up() before the next claim.
  [[nodiscard]] Claimed claim() noexcept;

  /// The claimed slot's pair waits for the frame loop, which is woken.
  void publish() noexcept;

  /// The claimed slot is free again: filling failed.
  void give_up() noexcept;

  /// A slot that the frame loop gave back and whose buffers can be requeued now rather than at a later claim; false:
  /// none.
  [[nodiscard]] bool take_back(std::uint32_t& slot) noexcept;

  /// Any thread. Wakes the frame loop for good: there will be no more pairs. What waits can still be taken.
  void close() noexcept;

  // ---- Frame loop

  enum class Wait : std::uint8_t { kPair, kDeadline, kClosed };
  /// Sleeps until a pair waits, the deadline has passed or the pool is closed. What waits comes first.
  /// kPair is a promise for a moment: the capture thread may evict the pair, and publishes a newer one then.
  [[nodiscard]] Wait wait(MonotonicTime deadline) noexcept;

  /// Empty: none waits.
  [[nodiscard]] PairLease take_oldest() noexcept;
  /// Gives back, and counts as skipped, what is older.
  [[nodiscard]] PairLease take_newest() noexcept;

  // ---- Any thread

  struct Counters {
    std::uint64_t captured = 0;      ///< pairs published
    std::uint64_t evicted = 0;       ///< of these, taken out by the capture thread for want of a free slot
    std::uint64_t skipped = 0;       ///< of these, passed over by take_newest
    std::uint64_t starved = 0;       ///< claims without a slot
    std::uint64_t free_low = 0;      ///< fewest slots free after a claim
    std::uint64_t waiting_high = 0;  ///< most pairs that waited
  };
  /// Each figure is right by itself; together they may be one pair apart.
  [[nodiscard]] Counters counters() const noexcept;
  [[nodiscard]] std::size_t slots() const noexcept { return slots_; }

 private:
  friend class PairLease;
  using Ring = EvictingRing<std::uint32_t, kMaxSlots>;

  void count_free_low() noexcept;

  std::size_t slots_;
  std::array<FramePair, kMaxSlots> pairs_{};

  // The capture thread's own.
  std::array<std::uint32_t, kMaxSlots> free_{};
  std::size_t free_count_ = 0;
  std::uint32_t claimed_ = 0;

  Ring waiting_;   // capture -> frame loop
  Ring returned_;  // frame loop -> capture; has room for all slots, so nothing is evicted from it
  Doorbell doorbell_;
  std::atomic<bool> closed_{false};

  // One writer each.
  std::atomic<std::uint64_t> captured_{0};
  std::atomic<std::uint64_t> starved_{0};
  std::atomic<std::uint64_t> free_low_;
  std::atomic<std::uint64_t> skipped_{0};
};

}  // namespace stereotrack::capture
