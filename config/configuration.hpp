#pragma once

#include <array>
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

/// Which point of a target has to lie in a zone of the picture.
enum class ZoneAnchor : unsigned char { kCentre, kBottom };

/// [[zone]]: where a target may be. Either a box in space or a polygon in the picture. See
/// firmware-app/signals/zone.hpp.
struct ZoneConfig {
  std::string name;
  std::array<double, 2> x_m{};  ///< [m]; 0, 0: anywhere
  std::array<double, 2> y_m{};
  std::array<double, 2> z_m{};
  std::vector<std::array<double, 2>> picture;  ///< corners [px]; empty: a box in space
  ZoneAnchor anchor = ZoneAnchor::kCentre;
};

enum class SignalWhen : unsigned char {
  kConfirmed,
  kInZone,
  kDistanceBelow,
  kTimeToReachBelow,
  kHeartbeat,
  kDeadlineMissed,
};
enum class SignalMode : unsigned char { kLevel, kPulse };
enum class ActiveLevel : unsigned char { kHigh, kLow };
enum class SafeState : unsigned char { kInactive, kActive };

/// [[signal]]: one line and its rule. See firmware-app/signals/signal_rules.hpp.
struct SignalConfig {
  std::string name;
  std::string line;  ///< CHIP:LINE, see drivers/gpio/line.hpp
  SignalWhen when = SignalWhen::kConfirmed;
  std::string zone;        ///< name of a ZoneConfig; empty: everywhere
  double limit_m = 0;      ///< [m]
  double limit_s = 0;      ///< [s]
  double period_ms = 500;  ///< of a heartbeat [ms]
  SignalMode mode = SignalMode::kLevel;
  double pulse_ms = 0;  ///< [ms]
  double hold_ms = 0;   ///< [ms]
  ActiveLevel active = ActiveLevel::kHigh;
  SafeState safe = SafeState::kInactive;
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
  std::vector<ZoneConfig> zones;
  std::vector<SignalConfig> signals;
  PipelineConfig pipeline;  ///< the stages' own Configs, see pipeline/pipeline_config.hpp
};

}  // namespace stereotrack::config
