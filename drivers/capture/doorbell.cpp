#include "drivers/capture/doorbell.hpp"

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>

namespace stereotrack::capture {

namespace {

// The kernel's own 64-bit times also where a long has 32 bits (ARMv7), in the form that the call of that name takes.
#ifdef SYS_futex_time64
constexpr long kFutexCall = SYS_futex_time64;
#else
constexpr long kFutexCall = SYS_futex;
#endif
struct KernelTime {
  std::int64_t seconds;
  std::int64_t nanoseconds;
};

}  // namespace

Doorbell::Count Doorbell::rings() const noexcept {
  // Acquire: what was made visible before the ring.
  return rings_.load(std::memory_order_acquire);
}

void Doorbell::ring() noexcept {
  // Sequentially consistent, here and in wait(): either the waiter sees this count, or this thread sees the waiter.
  rings_.fetch_add(1, std::memory_order_seq_cst);
  if (sleepers_.load(std::memory_order_seq_cst) != 0) {
    syscall(SYS_futex, &rings_, FUTEX_WAKE_PRIVATE, 1, nullptr, nullptr, 0);
  }
}

bool Doorbell::wait(Count seen, MonotonicTime deadline) noexcept {
  static_assert(sizeof(rings_) == sizeof(Count) && std::atomic<Count>::is_always_lock_free, "the kernel reads it");
  if (rings_.load(std::memory_order_acquire) != seen) return true;
  std::int64_t end = deadline.time_since_epoch().count();
  if (end < 0) end = 0;  // before the clock began: the kernel wants no negative time
  const KernelTime until{end / 1'000'000'000, end % 1'000'000'000};
  sleepers_.store(1, std::memory_order_seq_cst);
  bool rung = false;
  for (;;) {
    rung = rings_.load(std::memory_order_seq_cst) != seen;
    if (rung) break;
    // The kernel looks at the count once more, under its own lock. EINTR and EAGAIN: look again.
    if (syscall(kFutexCall, &rings_, FUTEX_WAIT_BITSET_PRIVATE, seen, &until, nullptr, FUTEX_BITSET_MATCH_ANY) != 0 &&
        errno == ETIMEDOUT) {
      rung = rings_.load(std::memory_order_acquire) != seen;
      break;
    }
  }
  sleepers_.store(0, std::memory_order_relaxed);
  return rung;
}

}  // namespace stereotrack::capture
