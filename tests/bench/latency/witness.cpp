#include "tests/bench/latency/witness.hpp"

#include <algorithm>
#include <string>

#include "firmware-app/runtime/clock.hpp"

namespace stereotrack::bench {

Witness::Witness(int core) {
  oversleeps_.reserve(1'000'000);
  thread_ = std::make_unique<runtime::Thread>(runtime::ThreadPlan{"witness-" + std::to_string(core), kPriority, core},
                                              runtime::RealTimeMode::kTry, [this] { run(); });
  thread_->begin();
}

void Witness::stop() noexcept {
  stop_.store(true);
  thread_->join();
}

void Witness::run() noexcept {
  MonotonicTime due = runtime::monotonic_now() + kPeriod;
  while (!stop_.load(std::memory_order_relaxed)) {
    runtime::sleep_until(due);
    const MonotonicTime woke = runtime::monotonic_now();
    lateness_.record((woke - due).count());
    if (woke - due > kPeriod / 2 && oversleeps_.size() < oversleeps_.capacity()) oversleeps_.push_back({due, woke});
    due += kPeriod;
    while (due <= woke) due += kPeriod;
  }
}

std::chrono::nanoseconds Witness::overslept(MonotonicTime from, MonotonicTime to) const noexcept {
  std::chrono::nanoseconds sum{0};
  for (const Oversleep& one : oversleeps_) {
    const MonotonicTime begin = std::max(one.due, from);
    const MonotonicTime end = std::min(one.woke, to);
    if (end > begin) sum += end - begin;
  }
  return sum;
}

}  // namespace stereotrack::bench
