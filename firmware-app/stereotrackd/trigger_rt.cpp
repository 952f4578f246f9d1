#include "firmware-app/stereotrackd/trigger_rt.hpp"

#include <algorithm>

#include "firmware-app/runtime/allocation_count.hpp"
#include "firmware-app/runtime/clock.hpp"

namespace stereotrack::daemon {

namespace {

constexpr std::chrono::milliseconds kLongestWait{100};  // so that the beat goes on between slow pulses
constexpr std::uint64_t kWarmUpRounds = 10;

}  // namespace

void give_pulses(trigger::PulseTrain& train, Vitals& vitals, std::chrono::nanoseconds awake,
                 const std::atomic<bool>& stop) noexcept {
  std::uint64_t heap_before = allocations_of_this_thread();
  while (!stop.load(std::memory_order_relaxed)) {
    vitals.trigger_beats.add();
    const std::uint64_t heap_calls = allocations_of_this_thread() - heap_before;
    heap_before += heap_calls;
    if (vitals.trigger_beats.get() > kWarmUpRounds) vitals.trigger_allocations.add(heap_calls);
    const MonotonicTime woken = runtime::monotonic_now();
    const MonotonicTime next = train.step(woken);
    if (train.rose()) {
      vitals.trigger_wake_up.record((woken - train.due()).count());
      vitals.trigger_set.record((runtime::monotonic_now() - train.due()).count());
    }
    const MonotonicTime longest = woken + kLongestWait;
    const bool is_pulse = !train.is_active() && next <= longest;
    runtime::sleep_until(std::min(next, longest), is_pulse ? awake : std::chrono::nanoseconds(0));
  }
  train.end(runtime::monotonic_now());
}

}  // namespace stereotrack::daemon
