#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "config/configuration.hpp"
#include "drivers/capture/stereo_cameras/stereo_cameras.hpp"
#include "firmware-app/stereotrack/doctor/findings.hpp"

namespace stereotrack::doctor {

/// How threads are asked for: mode, priorities and cores of the daemon's. Where they are not granted, what is measured
/// is what the daemon would get, too.
using RealTime = config::RealTimeConfig;

struct CaptureMeasures {
  std::vector<CaptureMeasure> cameras;  ///< left, right
  std::optional<PairMeasure> pair;
};
/// Opens one camera or two by `open`, lets them stream together for `time` and gives every frame back at once, in a
/// thread with the priority of the daemon's capture thread. One that cannot be opened, or is silent, says so in
/// `failure`; the other is measured nevertheless. Throws nothing but std::bad_alloc.
[[nodiscard]] CaptureMeasures measure_capture(const capture::StereoCameras::Open& open, bool stereo,
                                              const RealTime& realtime, std::chrono::nanoseconds time);

struct ComputeMeasures {
  PipelineMeasure pipeline;
  WakeUpMeasure wake_up;
};
/// Plays synthetic:eleven, in the size and colour that the configuration's cameras deliver, to the pipeline for `time`:
/// a pair a period, in a thread like the daemon's frame loop. Beside it a thread like its publisher sleeps as that
/// does, a millisecond at a time, and tells how late it woke. Drawing the scene comes before and may take a minute on a
/// small board.
[[nodiscard]] ComputeMeasures measure_compute(const config::Configuration& configuration, bool colour,
                                              std::chrono::nanoseconds time);

/// Sets the line to and fro, a thousand times at most, a millisecond apart, in a thread like the publisher. It is left
/// inactive and let go. CHIP:LINE, which the user has named himself: whatever hangs on it sees it.
[[nodiscard]] LineMeasure measure_line(const std::string& line, const RealTime& realtime,
                                       std::chrono::nanoseconds time);

/// What the latency contract can promise, from what was measured before. None without a pipeline measurement.
[[nodiscard]] std::optional<LatencyVerdict> latency_of(const Findings& findings);

}  // namespace stereotrack::doctor
