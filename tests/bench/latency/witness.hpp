#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <vector>

#include "firmware-app/runtime/histogram.hpp"
#include "firmware-app/runtime/real_time.hpp"
#include "pipeline/core/time.hpp"

namespace stereotrack::bench {

/// A thread that does nothing but sleep, at a higher priority than all of ours, on a core of its own choice: whatever
/// keeps it from waking in time keeps everybody else there from running, and is not theirs to answer for (the host of a
/// virtual machine, an interrupt, a core that is throttled).
class Witness {
 public:
  static constexpr std::chrono::microseconds kPeriod{250};
  static constexpr int kPriority = 98;

  explicit Witness(int core);
  Witness(const Witness&) = delete;
  Witness& operator=(const Witness&) = delete;
  ~Witness() { stop(); }
  void stop() noexcept;

  /// How long it overslept, all in all, between the two moments. Only after stop().
  [[nodiscard]] std::chrono::nanoseconds overslept(MonotonicTime from, MonotonicTime to) const noexcept;
  [[nodiscard]] const runtime::Histogram& lateness() const noexcept { return lateness_; }
  [[nodiscard]] const std::vector<runtime::Missing>& missing() const noexcept { return thread_->missing(); }

 private:
  struct Oversleep {
    MonotonicTime due;
    MonotonicTime woke;
  };
  void run() noexcept;

  runtime::Histogram lateness_;
  std::vector<Oversleep> oversleeps_;  ///< those longer than half a period; has room from the start
  std::atomic<bool> stop_{false};
  std::unique_ptr<runtime::Thread> thread_;
};

}  // namespace stereotrack::bench
