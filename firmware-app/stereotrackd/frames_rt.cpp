#include "firmware-app/stereotrackd/frames_rt.hpp"

#include <algorithm>
#include <utility>

#include "firmware-app/runtime/allocation_count.hpp"
#include "firmware-app/runtime/clock.hpp"

namespace stereotrack::daemon {

namespace {

constexpr std::chrono::milliseconds kLongestWait{100};  // so that the beat goes on without pairs

}  // namespace

void FrameLoop::stage_ended(void* self, Stage stage) noexcept {
  FrameLoop& loop = *static_cast<FrameLoop*>(self);
  // The pixels are in the pipeline's own planes now: the sensor may have its buffer back.
  if (stage == Stage::kIngest) loop.lease_.release();
  if (loop.config_.also.ended != nullptr) loop.config_.also.ended(loop.config_.also.context, stage);
  const MonotonicTime now = runtime::monotonic_now();
  const std::chrono::nanoseconds took = now - loop.stage_began_;
  loop.vitals_.stages[static_cast<std::size_t>(stage)].record(took.count());
  loop.decisions_.stage_us[static_cast<std::size_t>(stage)] = static_cast<std::uint32_t>(took.count() / 1000);
  loop.stage_began_ = now;
}

void FrameLoop::process(Pipeline& pipeline, capture::PairLease lease) noexcept {
  lease_ = std::move(lease);
  FramePair pair = *lease_;  // views alone; the pixels stay where they are
  if (box_ != nullptr) box_->arm(pair);
  const MonotonicTime began = runtime::monotonic_now();
  const MonotonicTime captured = source_.clock_map().to_monotonic(pair.capture_time);
  vitals_.frame_wake_up.record((began - captured).count());
  stage_began_ = began;
  const Result<FrameResult> result = pipeline.run(pair, leave_out_);
  lease_.release();
  const MonotonicTime done = runtime::monotonic_now();
  if (!result.has_value()) {
    vitals_.frames_refused.add();
    return;
  }
  Outcome& outcome = mailbox_.draft();
  outcome.ordinal = result->ordinal;
  outcome.capture_time = result->capture_time;
  outcome.flags = result->flags;
  outcome.left_out = result->left_out;
  outcome.tracks.clear();
  for (const TrackReport& track : result->tracks) {
    if (!outcome.tracks.push(track)) break;  // there is room for all that the tracker may have
  }
  mailbox_.publish();
  bell_.ring();
  if (notes_ != nullptr) notes_->update(result->tracks);
  // After the result has gone out: what the box takes delays the next pair, and counts against its budget.
  if (box_ != nullptr) {
    decisions_.shed = result->left_out;
    box_->capture(pair, *result, decisions_);
  }

  vitals_.frames.add();
  if ((result->flags & kFlagWrongPair) != 0) vitals_.wrong_pairs.add();
  vitals_.compute.record((done - began).count());
  vitals_.capture_to_result.record((done - captured).count());
  const std::chrono::nanoseconds left = captured + config_.latency - config_.lead - began;
  leave_out_ = effort_.next(runtime::monotonic_now() - began, std::min(config_.period, left));
  vitals_.efforts_left_out.set(leave_out_);
  const runtime::EffortController::Counters& counters = effort_.counters();
  std::uint64_t sheds = 0;
  for (const std::uint64_t of_one : counters.sheds) sheds += of_one;
  vitals_.efforts_shed.set(sheds);
  vitals_.effort_overruns.set(counters.overruns);
  vitals_.effort_helpless.set(counters.helpless);
}

void FrameLoop::run(Pipeline& pipeline, const std::atomic<bool>& stop) noexcept {
  using Wait = capture::FramePool::Wait;
  const auto wait = std::min<std::chrono::nanoseconds>(2 * config_.period, kLongestWait);
  last_frame_ = runtime::monotonic_now();
  std::uint64_t heap_before = allocations_of_this_thread();
  while (!stop.load(std::memory_order_relaxed)) {
    vitals_.frame_beats.add();
    // Of the whole round before: what surrounds the pipeline keeps the rule, too.
    const std::uint64_t heap_calls = allocations_of_this_thread() - heap_before;
    heap_before += heap_calls;
    if (vitals_.frames.get() > kWarmUpFrames) vitals_.frame_allocations.add(heap_calls);
    // A part of a keyframe as long as nothing else is to do.
    while (box_ != nullptr && pool_.wait(MonotonicTime()) == Wait::kDeadline && box_->keyframe_step(pipeline)) {
    }
    const Wait woke = pool_.wait(runtime::monotonic_now() + wait);
    if (woke == Wait::kClosed) break;
    if (woke == Wait::kDeadline) {
      count_frames_that_did_not_come();
      continue;
    }
    if (capture::PairLease lease = pool_.take_newest()) process(pipeline, std::move(lease));
    last_frame_ = runtime::monotonic_now();
  }
  // What still waits will not be seen; it is counted as skipped.
  while (pool_.take_newest()) vitals_.frames_left.add();
}

/// The seconds after a trigger go on without frames: one for each period that has passed.
void FrameLoop::count_frames_that_did_not_come() noexcept {
  if (box_ == nullptr) return;
  const MonotonicTime now = runtime::monotonic_now();
  for (; last_frame_ + 2 * config_.period <= now; last_frame_ += config_.period) box_->no_frame();
}

}  // namespace stereotrack::daemon
