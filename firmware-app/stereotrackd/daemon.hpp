#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "config/configuration.hpp"
#include "drivers/capture/frame_pool.hpp"
#include "drivers/capture/live_source.hpp"
#include "drivers/gpio/line.hpp"
#include "drivers/record/black_box.hpp"
#include "drivers/telemetry/authentication.hpp"
#include "drivers/trigger/pulse_train.hpp"
#include "drivers/trigger/pwm.hpp"
#include "firmware-app/runtime/large_pages.hpp"
#include "firmware-app/runtime/real_time.hpp"
#include "firmware-app/stereotrackd/capture_rt.hpp"
#include "firmware-app/stereotrackd/frames_rt.hpp"
#include "firmware-app/stereotrackd/inputs.hpp"
#include "firmware-app/stereotrackd/line_care.hpp"
#include "firmware-app/stereotrackd/publisher_rt.hpp"
#include "firmware-app/stereotrackd/target_notes.hpp"
#include "firmware-app/stereotrackd/vitals.hpp"
#include "pipeline/core/arena.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack::daemon {

/// Three threads around one source, one pipeline, one publisher, one that writes recordings, and one that gives the
/// cameras' pulses where there are any to give:
///
///     capture:    LiveSource -> PairOutlet -> FramePool
///     frames:         -> Pipeline -> OutcomeMailbox
///     publisher:          -> OutputSchedule -> lines, sink        and notices, straight from capture
///
/// It does not know where its parts come from: programs and tests make them. One owner, whose thread calls all of it.
class Daemon {
 public:
  struct Parts {
    const config::Configuration* configuration = nullptr;  ///< read in the constructor alone
    const StereoCalibration* calibration = nullptr;        ///< null: mono; the same
    double unit_m = 0;                                     ///< 0: not known
    std::unique_ptr<capture::LiveSource> source;
    std::unique_ptr<Plan> plan;
    std::unique_ptr<trigger::PulseTrain> train;  ///< null: there is no trigger thread
    std::unique_ptr<trigger::Pwm> pwm;           ///< null: none
    gpio::OutputLines lines;
    Inputs inputs;
    std::uint64_t session = 0;
    std::string recordings;                     ///< folder for them, where record.directory names none
    std::unique_ptr<telemetry::Signer> signer;  ///< null: nothing is signed
    StageObserver also;                         ///< told of each stage's end, in the frame loop
    std::size_t pool_slots = 4;
    std::string program;  ///< name and version, for recordings
  };

  /// Takes all memory. Throws std::runtime_error or config::Error, one line.
  explicit Daemon(Parts parts);
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;
  ~Daemon();

  /// Begins, pulses last; the caller's thread is the service thread from now on. Throws std::runtime_error where PWM
  /// refuses to. What the threads were not granted; with
  /// RealTimeMode::kOff nothing is asked for, with kEnforce nothing has begun if anything is missing. If anything is,
  /// here or before (`missing_before`), the health of all that leaves says so.
  [[nodiscard]] std::vector<runtime::Missing> start(const config::RealTimeConfig& real_time, bool missing_before);

  /// Ends the threads; the trigger's line is inactive, and the lines are in their safe states then, a chip that is gone
  /// aside. Takes up to 0.1 s, or latency.lead_ms. A recording that is being written is given up. False: the recorder
  /// hangs in a write to its disk and still runs: the destructor would wait for it.
  bool stop() noexcept;

  /// The source has ended or failed, and all that it gave has left.
  [[nodiscard]] bool is_over() const noexcept;
  /// Why the source failed; empty: it did not.
  [[nodiscard]] std::string failure() const;

  /// The publisher goes on with another plan.
  void exchange(std::unique_ptr<Plan> plan) { publisher_->exchange(std::move(plan)); }

  /// Of the fault handler alone: drives the lines while the publisher may still do so. False: a chip refused.
  [[nodiscard]] bool make_lines_safe() noexcept;
  [[nodiscard]] const LastStates& last_states() const noexcept { return publisher_->last_states(); }

  /// Takes edges of inputs, asks for chips that went and tells the log: again and again, at least every 0.1 s and when
  /// inputs().descriptor() is readable. May wait for a chip.
  void tend(MonotonicTime now);
  [[nodiscard]] Inputs& inputs() noexcept { return inputs_; }
  [[nodiscard]] const Inputs& inputs() const noexcept { return inputs_; }

  /// The black box; null: record.on is false.
  [[nodiscard]] record::BlackBox* black_box() noexcept { return box_.get(); }
  [[nodiscard]] const record::BlackBox* black_box() const noexcept { return box_.get(); }

  /// Between start() and stop(), about every 0.1 s: the source's work that may wait (LiveSource::tend()). What the log
  /// is to say.
  [[nodiscard]] std::vector<capture::SourceNote> tend_source() {
    std::vector<capture::SourceNote> notes;
    source_->tend(notes);
    return notes;
  }

  /// Targets that came or went, for the log; the service thread's.
  [[nodiscard]] TargetNotes& target_notes() noexcept { return target_notes_; }

  /// SIGHUP's file was wrong.
  void count_refused_reload() noexcept { vitals_->reloads_refused.add(); }

  [[nodiscard]] const Vitals& vitals() const noexcept { return *vitals_; }
  [[nodiscard]] capture::FramePool::Counters pool() const noexcept { return pool_.counters(); }
  [[nodiscard]] const gpio::OutputLines& lines() const noexcept { return lines_; }
  [[nodiscard]] const capture::SourceInfo& source() const noexcept { return source_->info(); }
  /// Null: there is no trigger thread.
  [[nodiscard]] const trigger::PulseTrain* train() const noexcept { return train_.get(); }
  [[nodiscard]] capture::SourceFigures figures() const noexcept { return source_->figures(); }
  [[nodiscard]] const MemoryUse& memory() const noexcept { return pipeline_->memory(); }
  [[nodiscard]] std::uint64_t lost_notices() const noexcept { return notices_.refused(); }

 private:
  void record();
  static void look_after(gpio::OutputLines& lines, LineCare& care, MonotonicTime now);

  std::unique_ptr<Vitals> vitals_;
  std::unique_ptr<capture::LiveSource> source_;
  std::unique_ptr<trigger::PulseTrain> train_;
  std::unique_ptr<trigger::Pwm> pwm_;
  gpio::OutputLines lines_;
  Inputs inputs_;
  LineCare outputs_care_{"GPIO outputs"};
  LineCare train_care_{"GPIO output of the trigger"};
  std::unique_ptr<telemetry::Signer> signer_;
  capture::FramePool pool_;
  capture::PairOutlet::Notices notices_;
  capture::Doorbell bell_;
  capture::PairOutlet outlet_;
  std::unique_ptr<OutcomeMailbox> mailbox_;
  TargetNotes target_notes_;
  Arena arena_{runtime::advise_large_pages};
  std::unique_ptr<FrameLoop> frames_;
  std::unique_ptr<Pipeline> pipeline_;
  std::unique_ptr<Publisher> publisher_;
  std::unique_ptr<record::BlackBox> box_;

  CaptureEnd capture_end_;
  std::chrono::nanoseconds awake_{0};
  std::atomic<bool> stop_capture_{false};
  std::atomic<bool> stop_trigger_{false};
  std::atomic<bool> stop_publisher_{false};
  std::atomic<bool> stop_recorder_{false};
  std::vector<std::unique_ptr<runtime::Thread>> threads_;
  std::unique_ptr<runtime::Thread> recorder_;
};

/// Effort names of shed.order, which config's rules have checked, as the controller wants them.
[[nodiscard]] runtime::EffortController::Config effort_config(const config::ShedConfig& shed);

}  // namespace stereotrack::daemon
