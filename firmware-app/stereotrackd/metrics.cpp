#include "firmware-app/stereotrackd/metrics.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

#include "firmware-app/formatted.hpp"
#include "firmware-app/stereotrackd/daemon.hpp"

namespace stereotrack::daemon {

namespace {

/// Families of metrics, one after the other.
class Text {
 public:
  void family(const char* name, const char* type, const char* help) {
    text_ += formatted("# HELP stereotrack_%s %s\n# TYPE stereotrack_%s %s\n", name, help, name, type);
    name_ = name;
  }
  void value(const char* labels, std::uint64_t value) {
    text_ += formatted("stereotrack_%s%s %llu\n", name_, labels, static_cast<unsigned long long>(value));
  }
  void number(const char* labels, double value) { text_ += formatted("stereotrack_%s%s %.9g\n", name_, labels, value); }
  void counter(const char* name, const char* help, std::uint64_t value_now) {
    family(name, "counter", help);
    value("", value_now);
  }
  void gauge(const char* name, const char* help, std::uint64_t value_now) {
    family(name, "gauge", help);
    value("", value_now);
  }
  void summary(const char* name, const char* help, const runtime::Histogram& histogram) {
    family(name, "summary", help);
    quantiles("", histogram);
  }
  /// `label`: NAME="VALUE",
  void quantiles(const std::string& label, const runtime::Histogram& histogram) {
    for (const double part : {0.5, 0.99, 0.999, 1.0}) {
      const std::uint64_t ns = part < 1 ? histogram.percentile_ns(part) : histogram.max_ns();
      text_ += formatted("stereotrack_%s{%squantile=\"%g\"} %.9f\n", name_, label.c_str(), part,
                         static_cast<double>(ns) * 1e-9);
    }
    const std::string only = label.empty() ? "" : '{' + label.substr(0, label.size() - 1) + '}';
    text_ +=
        formatted("stereotrack_%s_sum%s %.9f\n", name_, only.c_str(), static_cast<double>(histogram.sum_ns()) * 1e-9);
    text_ += formatted("stereotrack_%s_count%s %llu\n", name_, only.c_str(),
                       static_cast<unsigned long long>(histogram.count()));
  }
  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  std::string text_;
  const char* name_ = "";
};

void inputs_text(const Inputs& inputs, Text& text) {
  if (inputs.size() == 0) return;
  const auto each = [&](const char* name, const char* type, const char* help, const auto& value_of) {
    text.family(name, type, help);
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const std::string label = "{input=\"" + inputs.name(i) + "\",line=\"" + gpio::to_string(inputs.line(i)) + "\"}";
      text.value(label.c_str(), value_of(i));
    }
  };
  each("input_there", "gauge", "0: the chip of the line is gone.",
       [&](std::size_t i) { return std::uint64_t{inputs.is_gone(i) ? 0U : 1U}; });
  each("input_edges_total", "counter", "Edges that came.", [&](std::size_t i) { return inputs.events(i); });
  each("input_edges_lost_total", "counter", "Edges that came too fast to be read, as far as that shows.",
       [&](std::size_t i) { return inputs.lost(i); });
  each("input_triggers_total", "counter", "Edges for which the black box was to write.",
       [&](std::size_t i) { return inputs.triggers(i); });
}

void add_cameras(Text& text, const capture::SourceFigures& figures) {
  using Member = std::uint64_t capture::CameraFigures::*;
  const auto of_each = [&](const char* labels, Member member) {
    for (std::size_t i = 0; i < figures.cameras.size(); ++i) {
      const std::string label = std::string("{camera=\"") + (i == 0 ? "left" : "right") + '"' + labels + '}';
      text.value(label.c_str(), figures.cameras[i].*member);
    }
  };
  using F = capture::CameraFigures;
  text.family("camera_frames_total", "counter", "Frames of each camera; damaged ones are among those taken.");
  of_each(",fate=\"taken\"", &F::frames);
  of_each(",fate=\"damaged\"", &F::damaged);
  of_each(",fate=\"lost\"", &F::lost);
  of_each(",fate=\"late\"", &F::late);
  text.family("camera_silent", "gauge", "1: it gives no frames, or is gone.");
  text.value("{camera=\"left\"}", figures.cameras[0].silent ? 1 : 0);
  text.value("{camera=\"right\"}", figures.cameras[1].silent ? 1 : 0);
  text.family("camera_losses_total", "counter", "Times that it was gone, or silent alone.");
  of_each("", &F::losses);
  text.family("camera_reopened_total", "counter", "Times that it was opened anew.");
  of_each("", &F::reopened);
  text.family("camera_open_failures_total", "counter", "Times that it could not be.");
  of_each("", &F::open_failures);
  text.family("camera_back_off_milliseconds", "gauge", "Time between two attempts to open it; 0: none is needed.");
  of_each("", &F::back_off_ms);

  if (figures.has_trigger) {
    text.counter("trigger_pulses_total", "Number of the last pulse that was told.", figures.pulses);
    text.counter("trigger_pulses_lost_total", "Pulses that are known to have been, and were not told.",
                 figures.pulses_lost);
    text.gauge("trigger_silent", "1: frames come, and no pulses.", figures.trigger_silent ? 1 : 0);
    text.gauge("trigger_unanswered", "1: frames come, and neither camera's answer a pulse.",
               figures.trigger_unanswered ? 1 : 0);
    text.family("camera_astray", "gauge", "1: its frames come, and answer no pulse.");
    text.value("{camera=\"left\"}", figures.cameras[0].astray ? 1 : 0);
    text.value("{camera=\"right\"}", figures.cameras[1].astray ? 1 : 0);
    text.family("camera_strayings_total", "counter", "Times that its frames answered no pulse, and the other's did.");
    of_each("", &F::strayings);
    text.family("camera_exposures_total", "counter", "Exposures that do not fit the pulses, by reason.");
    of_each(",fault=\"missed\"", &F::missed);
    of_each(",fault=\"doubled\"", &F::doubled);
    of_each(",fault=\"stray\"", &F::stray);
  }

  text.family("pairing_total", "counter", "Pairs formed, and frames that are part of none, by reason.");
  text.value("{verdict=\"paired\"}", figures.paired);
  text.value("{verdict=\"missing_left\"}", figures.missing_left);
  text.value("{verdict=\"missing_right\"}", figures.missing_right);
  text.value("{verdict=\"late\"}", figures.late);
  text.value("{verdict=\"out_of_order\"}", figures.out_of_order);
  text.value("{verdict=\"duplicate\"}", figures.duplicate);
  text.value("{verdict=\"disagreed\"}", figures.disagreed);
  text.counter("sensor_clock_steps_total", "Times that the clock of the stamps went back.", figures.clock_steps);
  text.gauge("frames_waiting_high", "Most frames that waited for a partner.", figures.waiting_high);
  text.counter("mono_pairs_total", "Left pictures that went on without a right one.", figures.mono_pairs);
  text.counter("source_notes_lost_total", "Changes of state that the log lacks.", figures.notes_lost);
  if (figures.phase) {
    text.family("camera_phase_seconds", "gauge", "How much later the right camera exposes, within half a period.");
    text.number("", std::chrono::duration<double>(*figures.phase).count());
  }
  if (figures.drift) {
    text.family("camera_drift_ratio", "gauge",
                "Drift of the phase in seconds a second: 0 where they are synchronised.");
    text.number("", *figures.drift);
  }
  if (figures.steering != capture::Steering::kOff) {
    text.family("camera_steering", "gauge", "1: whether the right camera's rate follows the left one's.");
    using S = capture::Steering;
    constexpr std::pair<S, const char*> kStates[] = {{S::kCannot, "{state=\"cannot\"}"},
                                                     {S::kMeasuring, "{state=\"measuring\"}"},
                                                     {S::kApproaching, "{state=\"approaching\"}"},
                                                     {S::kLocked, "{state=\"locked\"}"},
                                                     {S::kGivenUp, "{state=\"given_up\"}"}};
    for (const auto& [state, label] : kStates) text.value(label, figures.steering == state ? 1 : 0);
  }
  if (figures.steered_period) {
    text.family("camera_steered_period_seconds", "gauge", "Time between frames that the right camera is set to.");
    text.number("", std::chrono::duration<double>(*figures.steered_period).count());
  }
}

}  // namespace

std::string metrics_text(const Daemon& daemon, std::uint64_t session) {
  const Vitals& vitals = daemon.vitals();
  const capture::FramePool::Counters pool = daemon.pool();
  Text text;
  text.gauge("session", "Number of this run.", session);
  text.family("pairs_total", "counter", "Frame pairs by what became of them.");
  text.value("{fate=\"captured\"}", pool.captured);
  text.value("{fate=\"evicted\"}", pool.evicted);
  text.value("{fate=\"skipped\"}", pool.skipped);
  text.value("{fate=\"starved\"}", pool.starved);
  text.value("{fate=\"refused\"}", vitals.frames_refused.get());
  text.counter("frames_total", "Pairs that went through the pipeline.", vitals.frames.get());
  text.gauge("pair_buffers_free_low", "Fewest free buffers of pairs.", pool.free_low);
  text.gauge("pairs_waiting_high", "Most pairs that waited for the frame loop.", pool.waiting_high);
  text.counter("notices_lost_total", "Pairs of which the publisher was not told.", daemon.lost_notices());

  if (const capture::SourceFigures figures = daemon.figures(); figures.of_cameras) add_cameras(text, figures);
  if (const trigger::PulseTrain* train = daemon.train()) {
    text.family("trigger_train_total", "counter", "Pulses of ours by what became of them; failed: the line refused.");
    text.value("{fate=\"given\"}", train->counters().given.get());
    text.value("{fate=\"skipped\"}", train->counters().skipped.get());
    text.value("{fate=\"failed\"}", train->counters().failed.get());
    text.summary("trigger_wake_up_seconds", "How late the trigger thread woke for a pulse.", vitals.trigger_wake_up);
    text.summary("trigger_set_seconds", "From when a pulse was due to its line's being set.", vitals.trigger_set);
  }
  text.counter("skew_over_total", "Pairs further apart than camera.skew_limit_ms.", vitals.skew_over.get());
  text.gauge("skew_max_microseconds", "Largest distance of the two exposures of a pair.", vitals.skew_max_us.get());
  text.counter("exposures_differ_total", "Pairs exposed differently, over camera.exposure_limit_percent.",
               vitals.exposures_differ.get());
  text.counter("wrong_pairs_total", "Pairs whose pictures are not of one instant, told by what moves; no depth taken.",
               vitals.wrong_pairs.get());

  text.family("outputs_total", "counter", "Slots of the latency contract by how they ended, and what was refused.");
  for (std::size_t i = 0; i < kScheduleCounters.size(); ++i) {
    const std::string label = std::string("{cause=\"") + kScheduleCounters[i].name + "\"}";
    text.value(label.c_str(), vitals.schedule[i].get());
  }
  text.counter("sent_late_total", "Messages that left later than their moment by more than latency.late_ms.",
               vitals.sent_late.get());
  text.counter("deadline_misses_total", "Pairs that left late, not with their own result, or not at all.",
               vitals.deadline_misses.get());
  text.gauge("targets", "Targets of the last message.", vitals.targets.get());
  text.gauge("health", "What is wrong now, sum of telemetry Health bits.", vitals.health.get());
  text.counter("clock_steps_total", "Times that capture times moved against the monotonic clock.",
               vitals.clock_steps.get());
  text.family("allocations_total", "counter", "Heap calls of real-time threads after warm-up.");
  text.value("{thread=\"capture\"}", vitals.capture_allocations.get());
  text.value("{thread=\"frames\"}", vitals.frame_allocations.get());
  text.value("{thread=\"publisher\"}", vitals.publisher_allocations.get());
  text.value("{thread=\"trigger\"}", vitals.trigger_allocations.get());

  text.family("effort_left_out", "gauge", "1: frames do without it now.");
  for (std::size_t i = 0; i < kEfforts; ++i) {
    const auto effort = static_cast<Effort>(i);
    const std::string label = std::string("{effort=\"") + to_string(effort) + "\"}";
    text.value(label.c_str(), leaves_out(static_cast<EffortBits>(vitals.efforts_left_out.get()), effort) ? 1 : 0);
  }
  text.counter("efforts_shed_total", "Times that an effort was given up.", vitals.efforts_shed.get());
  text.counter("effort_overruns_total", "Frames over their budget.", vitals.effort_overruns.get());
  text.counter("effort_helpless_total", "Of these, with nothing left to give up.", vitals.effort_helpless.get());

  text.family("telemetry_total", "counter", "Datagrams, times destinations.");
  text.value("{fate=\"sent\"}", vitals.telemetry_sent.get());
  text.value("{fate=\"dropped\"}", vitals.telemetry_dropped.get());
  text.value("{fate=\"failed\"}", vitals.telemetry_failed.get());
  text.counter("reloads_refused_total", "Configurations that were wrong: the one that ran went on.",
               vitals.reloads_refused.get());
  text.counter("reloads_total", "Configurations taken over while running.", vitals.reloads.get());

  if (daemon.lines().size() > 0) {
    text.family("line_active", "gauge", "1: active.");
    for (std::size_t i = 0; i < daemon.lines().size(); ++i) {
      const std::string label = "{line=\"" + gpio::to_string(daemon.lines().name(i)) + "\"}";
      text.value(label.c_str(), daemon.lines().read(i).active ? 1 : 0);
    }
    text.family("line_transitions_total", "counter", "Changes of the line.");
    for (std::size_t i = 0; i < daemon.lines().size(); ++i) {
      const std::string label = "{line=\"" + gpio::to_string(daemon.lines().name(i)) + "\"}";
      text.value(label.c_str(), daemon.lines().read(i).transitions);
    }
  }
  text.counter("lines_failed_total", "Drives of lines that were refused.", vitals.lines_failed.get());
  text.family("gpio_chips_lost_total", "counter", "Times that a GPIO chip went away.");
  text.value("{lines=\"outputs\"}", daemon.lines().outages());
  text.value("{lines=\"inputs\"}", daemon.inputs().outages());
  if (daemon.train() != nullptr) text.value("{lines=\"trigger\"}", daemon.train()->lines().outages());
  inputs_text(daemon.inputs(), text);

  if (const record::BlackBox* box = daemon.black_box()) {
    const record::BlackBox::Counters& counters = box->counters();
    text.family("recordings_total", "counter", "Recordings by what became of them.");
    text.value("{fate=\"written\"}", counters.recordings.load());
    text.value("{fate=\"failed\"}", counters.recordings_failed.load());
    text.value("{fate=\"dropped\"}", counters.triggers_dropped.load());
    text.value("{fate=\"merged\"}", counters.merged.load());
    text.counter("recorder_frames_dropped_total", "Frames not kept: their memory was still being written.",
                 counters.frames_dropped.load());
    text.counter("recorder_messages_dropped_total", "Messages that recordings lack.", counters.outputs_dropped.load());
    text.family("keyframes_total", "counter", "Keyframes of the pipeline's state.");
    text.value("{fate=\"whole\"}", counters.keyframes.load());
    text.value("{fate=\"given_up\"}", counters.keyframes_given_up.load());
  }

  text.summary("compute_seconds", "Time that the pipeline takes for a pair.", vitals.compute);
  text.summary("frame_wake_up_seconds", "From the capture of a pair to the beginning of its computation.",
               vitals.frame_wake_up);
  text.summary("capture_to_result_seconds", "From the capture of a pair to its result.", vitals.capture_to_result);
  text.summary("publisher_wake_up_seconds", "How late the publisher woke.", vitals.publisher_wake_up);
  text.summary("send_error_seconds", "Distance of sending from capture + latency.output_ms.", vitals.send_error);
  text.summary("line_set_seconds", "From capture + latency.output_ms to the setting of the lines.", vitals.line_set);
  text.summary("capture_to_send_seconds", "From the capture of a pair to sending.", vitals.capture_to_send);
  text.family("stage_seconds", "summary", "Time that each stage takes.");
  for (std::size_t i = 0; i < kStages; ++i) {
    text.quantiles(std::string("stage=\"") + to_string(static_cast<Stage>(i)) + "\",", vitals.stages[i]);
  }
  return text.take();
}

bool write_metrics_file(const std::string& path, const std::string& text) {
  const std::string part = path + ".part";
  const int fd = open(part.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd < 0) return false;
  const bool whole = write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const bool closed = close(fd) == 0;
  if (whole && closed && std::rename(part.c_str(), path.c_str()) == 0) return true;
  (void)unlink(part.c_str());
  return false;
}

}  // namespace stereotrack::daemon
