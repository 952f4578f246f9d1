#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>

#include "drivers/capture/doorbell.hpp"
#include "drivers/capture/live_source.hpp"
#include "drivers/gpio/line.hpp"
#include "drivers/record/black_box.hpp"
#include "drivers/telemetry/encoder.hpp"
#include "drivers/telemetry/sink.hpp"
#include "drivers/trigger/pulse_train.hpp"
#include "firmware-app/runtime/clock.hpp"
#include "firmware-app/runtime/output_schedule.hpp"
#include "firmware-app/signals/signal_rules.hpp"
#include "firmware-app/stereotrackd/last_states.hpp"
#include "firmware-app/stereotrackd/outcome.hpp"
#include "firmware-app/stereotrackd/vitals.hpp"
#include "pipeline/track/extrapolate.hpp"

namespace stereotrack::daemon {

/// What may be exchanged while the daemon runs.
struct Plan {
  std::unique_ptr<telemetry::Sink> sink;
  std::optional<signals::SignalRules> rules;  ///< none: those of the plan before go on; the first plan has some
  gpio::LineBits zones = 0;  ///< lines that tell of a zone: their rise is a trigger of recordings; with rules alone
};

/// The publisher: every slot of the schedule leaves at its moment. It wakes a lead before, decides what leaves,
/// predicts the targets to the moment, asks the rules, encodes and signs; then sleeps to the moment, sets the lines,
/// sends. Between slots: a status every second, pulses that end, the heartbeat. No heap, no lock, no log; it sleeps for
/// the moment alone, or for news.
class Publisher {
 public:
  struct Config {
    runtime::OutputSchedule::Config schedule;
    telemetry::Encoder::Config encoder;
    Extrapolation extrapolation;
    double unit_m = 0;  ///< 0: not known
    double focal_x_px = 0;
    double focal_y_px = 0;
    std::chrono::nanoseconds heart_after{0};  ///< healthy: a result of its own left no longer ago
    std::chrono::nanoseconds late_after{0};   ///< what leaves later than due by more has missed its deadline
    std::chrono::nanoseconds awake{0};        ///< before a slot leaves, not asleep: runtime::sleep_until()
    std::size_t pool_slots = 0;
    const trigger::PulseTrain::Counters* train = nullptr;  ///< of pulses that we give; null: none
    std::chrono::nanoseconds skew_limit{0};                ///< of a pair; 0: none
    double exposure_limit = 0;  ///< of the longer exposure, by which the shorter may differ; 0: none
  };

  /// The plan, lines and all that is referred to outlive it. Faults of the schedule: kBadConfig.
  [[nodiscard]] static Result<std::unique_ptr<Publisher>> create(const Config& config, std::unique_ptr<Plan> plan,
                                                                 gpio::OutputLines& lines, capture::FramePool& pool,
                                                                 capture::PairOutlet::Notices& notices,
                                                                 OutcomeMailbox& mailbox, capture::Doorbell& bell,
                                                                 const capture::LiveSource& source, Vitals& vitals);
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;
  ~Publisher();

  /// Tells the black box what left, and when something happens of `causes` (record::Cause bits); before run().
  void keep_in(record::BlackBox* box, std::uint32_t causes) noexcept {
    box_ = box;
    causes_ = causes;
  }

  /// Until `stop`, or until all has left of which there was notice after `no_more` pairs come; then the lines are in
  /// their safe states. The thread's body.
  void run(const std::atomic<bool>& no_more, const std::atomic<bool>& stop) noexcept;

  /// Any thread: telemetry::Health bits that hold from now on.
  void say_always(std::uint32_t health) noexcept { standing_health_.fetch_or(health, std::memory_order_relaxed); }

  [[nodiscard]] const LastStates& last_states() const noexcept { return last_states_; }

  /// Any thread: run() has returned.
  [[nodiscard]] bool has_finished() const noexcept { return finished_.load(std::memory_order_acquire); }

  /// Another thread: the plan to go on with, soon; the one it replaces is freed by the next call or the destructor.
  void exchange(std::unique_ptr<Plan> plan);

 private:
  using Output = runtime::OutputSchedule::Output;

  Publisher(const Config& config, const runtime::OutputSchedule& schedule, std::unique_ptr<Plan> plan,
            gpio::OutputLines& lines, capture::FramePool& pool, capture::PairOutlet::Notices& notices,
            OutcomeMailbox& mailbox, capture::Doorbell& bell, const capture::LiveSource& source, Vitals& vitals);

  void take_news() noexcept;
  void judge_exposure(const capture::PairNotice& notice) noexcept;
  void take_plan() noexcept;
  void look_at_clocks(MonotonicTime now) noexcept;
  [[nodiscard]] std::uint64_t deadline_misses() const noexcept;
  [[nodiscard]] std::uint64_t unused_pairs() const noexcept;
  [[nodiscard]] const capture::PairNotice* notice_of(const Output& output) const noexcept;
  void between_slots(MonotonicTime now) noexcept;
  void publish(const Output& output) noexcept;
  void judge(const Output& output, std::chrono::nanoseconds late) noexcept;
  void keep(const Output& output, const telemetry::Message& message) noexcept;
  void trigger(record::Cause cause) noexcept;
  void predict(const Output& output) noexcept;
  void send(std::span<const std::byte> datagram) noexcept;
  void send_status(MonotonicTime now) noexcept;
  void judge_health() noexcept;
  [[nodiscard]] bool trigger_fails() noexcept;
  [[nodiscard]] bool pairs_are_not_believed() noexcept;
  void drive(gpio::LineBits lines, MonotonicTime now) noexcept;
  void tell() noexcept;
  [[nodiscard]] telemetry::Live live_of(const Output* output) const noexcept;
  [[nodiscard]] MonotonicTime next_wake(MonotonicTime now) const noexcept;

  Config config_;
  runtime::OutputSchedule schedule_;
  telemetry::Encoder encoder_;
  std::unique_ptr<Plan> plan_;
  gpio::OutputLines& lines_;
  capture::FramePool& pool_;
  capture::PairOutlet::Notices& notices_;
  OutcomeMailbox& mailbox_;
  capture::Doorbell& bell_;
  const capture::LiveSource& source_;
  Vitals& vitals_;
  record::BlackBox* box_ = nullptr;  ///< null: nothing is kept
  std::uint32_t causes_ = 0;
  gpio::LineBits lines_told_ = 0;
  std::uint64_t misses_triggered_ = 0;
  std::atomic<Plan*> incoming_{nullptr};
  std::atomic<Plan*> retired_{nullptr};
  std::atomic<bool> finished_{false};
  bool rules_are_new_ = false;  ///< they have decided nothing yet: the lines stay as they are until then
  std::atomic<std::uint32_t> standing_health_{0};
  LastStates last_states_;

  std::array<Outcome, runtime::OutputSchedule::kKeeps> kept_{};
  Outcome leaving_;  ///< of the slot that leaves next, predicted
  std::array<std::byte, telemetry::kMaxMessageBytes> buffer_{};
  std::array<std::optional<capture::PairNotice>, runtime::OutputSchedule::kMaxInFlight> noticed_{};

  MonotonicTime started_{};
  MonotonicTime next_status_{};
  MonotonicTime last_on_time_{};
  ClockMap map_;
  bool clock_stepped_ = false;  ///< to be told with the next message
  runtime::TaiReading tai_;
  std::optional<std::chrono::nanoseconds> send_error_;
  std::uint32_t health_ = 0;
  std::uint64_t misses_seen_ = 0;  ///< at the last judgement
  std::uint64_t refused_seen_ = 0;
  std::uint64_t had_a_slot_seen_ = 0;
  std::uint64_t drops_seen_ = 0;
  std::uint64_t unused_told_ = 0;
  std::uint64_t recordings_seen_ = 0;
  std::uint64_t skew_over_seen_ = 0;
  std::uint64_t trigger_failures_seen_ = 0;
  std::uint64_t exposures_differ_seen_ = 0;
  std::uint64_t wrong_pairs_seen_ = 0;
  capture::SourceFigures cameras_;  ///< at the last judgement
  std::uint64_t lines_failed_seen_ = 0;
  telemetry::SinkCounters before_;  ///< of plans that were replaced
};

}  // namespace stereotrack::daemon
