#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/pipeline_config.hpp"

namespace stereotrack::config {

/// How the source's pictures are to be understood: a property of the recording, not of the tracker.
struct SourceConfig {
  double fps = 30.0;   ///< pairs per second, used only where the source itself has no times [1/s]
  bool flip = false;   ///< both views stand on their head: turn them top to bottom
  bool swap = false;   ///< what the source calls left is the right view
  int shift_rows = 0;  ///< rows the right picture is moved down, negative: up [px]
};

/// What `synthetic:NAME` draws; no other source looks at it.
struct SyntheticConfig {
  std::uint32_t seed = 1;
  int frames = 600;
  int width = 640;   ///< [px]
  int height = 480;  ///< [px]
};

/// The latency contract: a result leaves at capture time + output_ms, neither earlier nor later.
struct LatencyConfig {
  double output_ms = 50.0;  ///< [ms]
};

struct CalibrationConfig {
  double unit_m = 0.0;  ///< metres in one unit of the calibration's T; 0 = unset, the calibration's own if it has one
};

struct TelemetryConfig {
  std::vector<std::string> destinations;  ///< ADDR:PORT or [ADDR6]:PORT; empty: nothing is sent
  std::uint32_t rig_id = 1;               ///< stands in every datagram, tells rigs apart
};

/// The black box and what it writes: docs/RECORDING.md.
struct RecordConfig {
  bool on = false;
  double seconds = 10;       ///< kept before a trigger [s]
  double seconds_after = 2;  ///< and after it [s]
  int reduce = 1;            ///< pictures so many times smaller; over 1: luma alone, replays are not exact
  int every = 1;             ///< every n-th frame; over 1: replays are not exact
  std::string directory = "/var/lib/stereotrack/recordings";
  int max_mb = 2000;        ///< of all recordings in it [MB = 2^20 bytes]
  bool on_deadline = true;  ///< triggers
  bool on_zone = false;
  bool on_signal = true;
  bool on_input = false;
};

/// Everything the user can say, with its defaults. Plain values: read it anywhere, once loaded it does
/// not change. What each key does, its range and its unit stand in schema.cpp, one line a key.
struct Configuration {
  std::string preset = "robust";  ///< where the values not given by the user came from
  SourceConfig source;
  SyntheticConfig synthetic;
  LatencyConfig latency;
  CalibrationConfig calibration;
  TelemetryConfig telemetry;
  RecordConfig record;
  PipelineConfig pipeline;  ///< the stages' own Configs, see pipeline/pipeline_config.hpp
};

}  // namespace stereotrack::config
