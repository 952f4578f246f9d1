#include "firmware-app/stereotrackd/capture_rt.hpp"

#include "firmware-app/runtime/allocation_count.hpp"
#include "firmware-app/runtime/clock.hpp"

namespace stereotrack::daemon {

namespace {

constexpr std::chrono::milliseconds kLongestWait{100};  // so that the beat goes on without pairs
constexpr std::uint64_t kWarmUpRounds = 10;

}  // namespace

void capture(capture::LiveSource& source, capture::PairOutlet& outlet, capture::FramePool& pool, Vitals& vitals,
             CaptureEnd& end, const std::atomic<bool>& stop) noexcept {
  using Step = capture::LiveSource::Step;
  Step step = Step::kGoing;
  std::uint64_t heap_before = allocations_of_this_thread();
  while (step == Step::kGoing && !stop.load(std::memory_order_relaxed)) {
    vitals.capture_beats.add();
    const std::uint64_t heap_calls = allocations_of_this_thread() - heap_before;
    heap_before += heap_calls;
    if (vitals.capture_beats.get() > kWarmUpRounds) vitals.capture_allocations.add(heap_calls);
    step = source.step(outlet, runtime::monotonic_now() + kLongestWait);
  }
  // Release: all pairs and notices, and what the source has to say of its failure.
  if (step == Step::kEnded) end.ended.store(true, std::memory_order_release);
  if (step == Step::kFailed) end.failed.store(true, std::memory_order_release);
  pool.close();
}

}  // namespace stereotrack::daemon
