#pragma once

#include <time.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "drivers/capture/live_source.hpp"

namespace stereotrack::test {

inline void sleep_for(std::chrono::nanoseconds span) noexcept {
  const timespec whole{static_cast<time_t>(span.count() / 1'000'000'000),
                       static_cast<long>(span.count() % 1'000'000'000)};
  (void)clock_nanosleep(CLOCK_MONOTONIC, 0, &whole, nullptr);
}

/// A live source behind a wire that misbehaves when it is told to: pairs are lost or come twice, capturing stands
/// still, the clock of the stamps steps. Any thread tells it; each demand is carried out once, as soon as there is a
/// pair.
class FaultySource final : public capture::LiveSource {
 public:
  explicit FaultySource(std::unique_ptr<capture::LiveSource> source)
      : source_(std::move(source)), inner_(inner_pool_, inner_notices_, bell_) {}

  void lose(int pairs) noexcept { lose_.fetch_add(pairs); }
  void repeat(int pairs) noexcept { repeat_.fetch_add(pairs); }
  void stand_still(std::chrono::nanoseconds span) noexcept { still_ns_.store(span.count()); }
  /// Adds to how far capture times lie beyond the monotonic clock.
  void step_clock(std::chrono::nanoseconds by) noexcept { ahead_ns_.fetch_add(by.count()); }

  [[nodiscard]] const capture::SourceInfo& info() const noexcept override { return source_->info(); }
  [[nodiscard]] const std::string& failure() const noexcept override { return source_->failure(); }
  [[nodiscard]] ClockMap clock_map() const noexcept override {
    return {CaptureTime(std::chrono::nanoseconds(ahead_ns_.load())), MonotonicTime(source_->clock_map().offset())};
  }

  [[nodiscard]] Step step(capture::PairOutlet& outlet, MonotonicTime until) noexcept override {
    if (const std::int64_t ns = still_ns_.exchange(0); ns > 0) sleep_for(std::chrono::nanoseconds(ns));
    const Step step = source_->step(inner_, until);
    capture::PairNotice notice;
    while (inner_notices_.pop(notice)) {
    }
    // This thread leases, too: the pixels are the film's, which never change.
    while (capture::PairLease lease = inner_pool_.take_oldest()) {
      FramePair pair = *lease;
      pair.capture_time += std::chrono::nanoseconds(ahead_ns_.load());
      lease.release();
      if (take_one(lose_)) continue;
      (void)outlet.put(pair);
      if (take_one(repeat_)) (void)outlet.put(pair);
    }
    std::uint32_t slot = 0;
    while (outlet.take_back(slot)) {  // so that what is free is counted as free
    }
    return step;
  }

 private:
  static bool take_one(std::atomic<int>& left) noexcept {
    if (left.load() <= 0) return false;
    (void)left.fetch_sub(1);
    return true;
  }

  std::unique_ptr<capture::LiveSource> source_;
  capture::FramePool inner_pool_{capture::FramePool::kMinSlots};
  capture::PairOutlet::Notices inner_notices_;
  capture::Doorbell bell_;
  capture::PairOutlet inner_;
  std::atomic<int> lose_{0};
  std::atomic<int> repeat_{0};
  std::atomic<std::int64_t> still_ns_{0};
  std::atomic<std::int64_t> ahead_ns_{0};
};

}  // namespace stereotrack::test
