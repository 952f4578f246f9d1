#pragma once

#include <atomic>
#include <chrono>

#include "drivers/capture/frame_pool.hpp"
#include "drivers/capture/live_source.hpp"
#include "drivers/record/black_box.hpp"
#include "firmware-app/runtime/effort.hpp"
#include "firmware-app/stereotrackd/outcome.hpp"
#include "firmware-app/stereotrackd/target_notes.hpp"
#include "firmware-app/stereotrackd/vitals.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack::daemon {

/// The frame loop: waits for a pair, runs the pipeline, hands the result over. The newest pair wins. Its lease ends
/// with ingest. Between two pairs it decides what the next one leaves out:
///     budget = min(period, due - lead - begin)
/// No heap, no lock, no log; it sleeps in FramePool::wait() alone.
class FrameLoop {
 public:
  static constexpr std::uint64_t kWarmUpFrames = 10;  ///< heap calls count from then on

  struct Config {
    std::chrono::nanoseconds latency{0};
    std::chrono::nanoseconds lead{0};
    std::chrono::nanoseconds period{0};
    StageObserver also;  ///< told of each stage's end before its time is taken
  };

  FrameLoop(const Config& config, const runtime::EffortController& effort, capture::FramePool& pool,
            OutcomeMailbox& mailbox, capture::Doorbell& bell, const capture::LiveSource& source,
            Vitals& vitals) noexcept
      : config_(config),
        effort_(effort),
        pool_(pool),
        mailbox_(mailbox),
        bell_(bell),
        source_(source),
        vitals_(vitals) {}
  FrameLoop(const FrameLoop&) = delete;
  FrameLoop& operator=(const FrameLoop&) = delete;
  ~FrameLoop() = default;

  /// Keeps what it does from now on; before run().
  void keep_in(record::BlackBox* box) noexcept { box_ = box; }

  /// Told of each result; before run().
  void tell(TargetNotes* notes) noexcept { notes_ = notes; }

  /// For Pipeline::create(): ends the lease, measures the stages.
  [[nodiscard]] StageObserver observer() noexcept { return {&FrameLoop::stage_ended, this}; }

  /// Until `stop` and the pool is closed, or the pool is closed and empty. The thread's body.
  void run(Pipeline& pipeline, const std::atomic<bool>& stop) noexcept;

 private:
  static void stage_ended(void* self, Stage stage) noexcept;
  void process(Pipeline& pipeline, capture::PairLease lease) noexcept;
  void count_frames_that_did_not_come() noexcept;

  Config config_;
  runtime::EffortController effort_;
  capture::FramePool& pool_;
  OutcomeMailbox& mailbox_;
  capture::Doorbell& bell_;
  const capture::LiveSource& source_;
  Vitals& vitals_;
  record::BlackBox* box_ = nullptr;  ///< null: nothing is kept
  TargetNotes* notes_ = nullptr;     ///< null: nobody is told
  record::FrameDecisions decisions_;
  capture::PairLease lease_;
  MonotonicTime stage_began_{};
  MonotonicTime last_frame_{};
  EffortBits leave_out_ = 0;
};

}  // namespace stereotrack::daemon
