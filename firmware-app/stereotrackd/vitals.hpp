#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware-app/runtime/histogram.hpp"
#include "firmware-app/runtime/output_schedule.hpp"
#include "pipeline/core/counter.hpp"
#include "pipeline/effort.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack::daemon {

/// The schedule's counters by name, for metrics and logs.
struct ScheduleCounter {
  const char* name;
  std::uint64_t runtime::OutputSchedule::Counters::*member;
};
inline constexpr std::array<ScheduleCounter, 16> kScheduleCounters{
    {{"on_time", &runtime::OutputSchedule::Counters::on_time},
     {"predicted_late", &runtime::OutputSchedule::Counters::predicted_late},
     {"predicted_superseded", &runtime::OutputSchedule::Counters::predicted_superseded},
     {"missing", &runtime::OutputSchedule::Counters::missing},
     {"overslept_pairs", &runtime::OutputSchedule::Counters::overslept_pairs},
     {"overslept_missing", &runtime::OutputSchedule::Counters::overslept_missing},
     {"after_due", &runtime::OutputSchedule::Counters::after_due},
     {"without_state", &runtime::OutputSchedule::Counters::without_state},
     {"outages", &runtime::OutputSchedule::Counters::outages},
     {"late_results", &runtime::OutputSchedule::Counters::late_results},
     {"stale_results", &runtime::OutputSchedule::Counters::stale_results},
     {"late_notices", &runtime::OutputSchedule::Counters::late_notices},
     {"notices_out_of_order", &runtime::OutputSchedule::Counters::notices_out_of_order},
     {"from_future", &runtime::OutputSchedule::Counters::from_future},
     {"from_past", &runtime::OutputSchedule::Counters::from_past},
     {"refused", &runtime::OutputSchedule::Counters::refused}}};
static_assert(sizeof(runtime::OutputSchedule::Counters) == kScheduleCounters.size() * sizeof(std::uint64_t),
              "each counter has its name");

/// What the threads tell of themselves, since the start. Each member has one writer, named above it, and any number of
/// readers. `beats` rise while a thread runs, with work and without.
struct Vitals {
  // ---- Capture thread
  Counter capture_beats;
  Counter capture_allocations;  ///< heap calls after warm-up

  // ---- Trigger thread, with trigger.mode = gpio; what it gave: trigger::PulseTrain::Counters
  Counter trigger_beats;
  Counter trigger_allocations;         ///< heap calls after warm-up
  runtime::Histogram trigger_wake_up;  ///< how late it woke for a pulse
  runtime::Histogram trigger_set;      ///< from when a pulse was due to its line's being set

  // ---- Frame loop
  Counter frame_beats;
  Counter frames;                        ///< pairs that went through the pipeline
  Counter frames_left;                   ///< pairs that waited when the loop ended
  Counter frames_refused;                ///< pairs that the pipeline had a fault with
  Counter wrong_pairs;                   ///< pairs of two instants, told by what moves: kFlagWrongPair
  Counter frame_allocations;             ///< heap calls after warm-up
  Counter efforts_left_out;              ///< now: EffortBits
  Counter efforts_shed;                  ///< times that an effort was given up
  Counter effort_overruns;               ///< frames over their budget
  Counter effort_helpless;               ///< of these, with nothing left to give up
  runtime::Histogram compute;            ///< Pipeline::run
  runtime::Histogram frame_wake_up;      ///< from the capture of a pair to the beginning of its run
  runtime::Histogram capture_to_result;  ///< from the capture of a pair to the hand-over of its result
  std::array<runtime::Histogram, kStages> stages;

  // ---- Publisher
  Counter publisher_beats;
  std::array<Counter, kScheduleCounters.size()> schedule;
  Counter outputs;                ///< messages that left
  Counter sent_late;              ///< of these, more than latency.late_ms after their moment
  Counter deadline_misses_left;   ///< of these, not with a result of their own, or late
  Counter deadline_misses;        ///< the same, and pairs whose slots were slept over
  Counter publisher_allocations;  ///< heap calls after warm-up
  Counter telemetry_sent;         ///< datagrams, times destinations
  Counter telemetry_dropped;
  Counter telemetry_failed;
  Counter lines_failed;                  ///< drives of lines that were refused
  Counter clock_steps;                   ///< times that capture times moved against the monotonic clock
  Counter health;                        ///< now: sum of telemetry::Health
  Counter reloads;                       ///< plans taken over
  Counter targets;                       ///< of the last message
  Counter skew_over;                     ///< pairs whose skew was over camera.skew_limit_ms
  Counter skew_max_us;                   ///< largest skew of a pair
  Counter exposures_differ;              ///< pairs whose exposures were over camera.exposure_limit_percent apart
  runtime::Histogram publisher_wake_up;  ///< how late it woke for a slot's decision
  runtime::Histogram send_error;         ///< |sent - due|
  runtime::Histogram capture_to_send;
  runtime::Histogram line_set;  ///< from due to the lines' being set

  // ---- Service
  Counter reloads_refused;  ///< SIGHUPs whose file was wrong
  Counter inputs_gone;      ///< now: lines of inputs whose chip is gone

  /// Of all real-time threads.
  [[nodiscard]] std::uint64_t allocations() const noexcept {
    return capture_allocations.get() + frame_allocations.get() + publisher_allocations.get() +
           trigger_allocations.get();
  }
};

}  // namespace stereotrack::daemon
