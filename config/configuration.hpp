#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/pipeline_config.hpp"

namespace stereotrack::config {

/// What the daemon does at the end of a film: recordings and scenes are played from memory.
enum class Repeat : unsigned char {
  kBounce,  ///< backwards, and so to and fro: nothing jumps
  kLoop,    ///< from the beginning
  kOnce,    ///< the daemon ends
};

/// Where pictures come from and how they are to be understood: a property of the rig or recording, not of the tracker.
struct SourceConfig {
  std::string name;                 ///< synthetic:NAME; stereotrackd alone, stereotrack is told on the command line
  Repeat repeat = Repeat::kBounce;  ///< stereotrackd alone
  int memory_mb = 2048;             ///< most that a film may take [MB]; stereotrackd alone
  double fps = 30.0;                ///< pairs per second, used only where the source itself has no times [1/s]
  bool flip = false;                ///< both views stand on their head: turn them top to bottom
  bool swap = false;                ///< what the source calls left is the right view
  int shift_rows = 0;               ///< rows the right picture is moved down, negative: up [px]
};

/// Whose cameras they are.
enum class CameraDriver : unsigned char { kV4l2, kLibcamera };

/// Whose memory frames lie in.
enum class CameraMemory : unsigned char {
  kMmap,    ///< the driver's, mapped
  kDmabuf,  ///< dma-bufs: the driver's, or of camera.heap
};

struct CameraDeviceConfig {
  std::string device;  ///< as the driver names it
  std::string sensor;  ///< empty: the one that is connected, or the nearest
};

/// The cameras of source.name = "cameras"; no other source looks at it. See drivers/capture/stereo_cameras.
struct CameraConfig {
  CameraDriver driver = CameraDriver::kV4l2;
  CameraDeviceConfig left;
  CameraDeviceConfig right;     ///< empty: one camera, mono
  bool side_by_side = false;    ///< the left camera's picture holds both views
  int width = 640;              ///< [px]
  int height = 480;             ///< [px]
  std::string format = "auto";  ///< a name of the driver's
  double fps = 30.0;            ///< [1/s]
  int buffers = 8;              ///< a camera
  CameraMemory memory = CameraMemory::kMmap;
  std::string heap;                   ///< kDmabuf: a device that gives memory; empty: the driver gives it
  double exposure_us = 0;             ///< [us]; 0: automatic
  double gain = 0;                    ///< 1 = none; 0: automatic
  int black_level = -1;               ///< in the driver's own unit; -1: as the driver has it
  int control_delay_frames = 2;       ///< from a change of a control to the first frame exposed with it; V4L2 alone
  double readout_us = 0;              ///< [us]; 0: as the driver tells
  double timeout_ms = 500;            ///< [ms]
  double tolerance = 0.25;            ///< of the period
  bool steer = true;                  ///< the right one's rate follows the left one's; TriggerMode::kFreeRun alone
  double skew_limit_ms = 5;           ///< alarm [ms]; 0: none
  double exposure_limit_percent = 5;  ///< alarm; 0: none
};

enum class ActiveLevel : unsigned char { kHigh, kLow };
enum class InputEdge : unsigned char { kRising, kFalling, kBoth };
enum class InputBias : unsigned char { kAsIs, kNone, kPullUp, kPullDown };

/// Who asks the cameras for exposures. With all but the first, silence of both cameras is no fault of theirs.
enum class TriggerMode : unsigned char {
  kFreeRun,   ///< nobody: each sensor runs by itself
  kUnseen,    ///< somebody who does not tell us: wires between the cameras, a generator of its own
  kGpio,      ///< we, by a line that a real-time thread sets: see drivers/trigger/pulse_train.hpp
  kPwm,       ///< we, by hardware PWM: see drivers/trigger/pwm.hpp
  kExternal,  ///< somebody whose edges we see: see drivers/trigger/edges.hpp
};

/// The trigger of source.name = "cameras"; no other source looks at it. camera.fps is its rate.
struct TriggerConfig {
  TriggerMode mode = TriggerMode::kFreeRun;
  std::string line;                         ///< CHIP:LINE, see drivers/gpio/line.hpp; kGpio: driven, kExternal: read
  ActiveLevel active = ActiveLevel::kHigh;  ///< level of the line, or of the PWM output, when it is active
  InputEdge edge = InputEdge::kRising;      ///< that begins an exposure: becoming active, or inactive
  InputBias bias = InputBias::kAsIs;        ///< kExternal
  double pulse_us = 1000;                   ///< the line is active for so long [us]; kGpio, kPwm
  double delay_us = 0;                      ///< from the edge to the beginning of the exposure [us]; kGpio, kExternal
  double late_us = 1000;                    ///< a pulse that would begin later than this is skipped [us]; kGpio
  std::string pwm_chip;                     ///< pwmchip0, 0, its path, or its device's name
  int pwm_channel = 0;
};

/// What `synthetic:NAME` draws; no other source looks at it.
struct SyntheticConfig {
  std::uint32_t seed = 1;
  int frames = 600;
  int width = 640;   ///< [px]
  int height = 480;  ///< [px]
};

/// The latency contract: a result leaves at capture time + output_ms, neither earlier nor later.
/// See firmware-app/runtime/output_schedule.hpp.
struct LatencyConfig {
  double output_ms = 50.0;  ///< [ms]
  double lead_ms = 0.8;     ///< [ms]
  double awake_ms = 0.05;   ///< [ms]
  double late_ms = 1.0;     ///< [ms]
  double grace_ms = 2.0;    ///< [ms]
  double stale_ms = 500.0;  ///< over output_ms [ms]
  int missing_limit = 30;
};

/// How one thread of the daemon runs.
struct ThreadConfig {
  int priority = 0;  ///< 1..99: SCHED_FIFO; 0: the ordinary scheduler
  int core = -1;     ///< -1: any
};

/// What to do where the system does not grant what real time needs.
enum class RealTimeMode : unsigned char {
  kEnforce,  ///< refuse to start
  kTry,      ///< go on and say what is missing
  kOff,      ///< ask for nothing: a PC that replays
};

struct RealTimeConfig {
  RealTimeMode mode = RealTimeMode::kTry;
  bool deep_sleep = false;
  ThreadConfig trigger{.priority = 83};
  ThreadConfig publisher{.priority = 82};
  ThreadConfig capture{.priority = 81};
  ThreadConfig frames{.priority = 80};
  ThreadConfig service{.priority = 0};
};

/// What is left out when the time runs out. See firmware-app/runtime/effort.hpp.
struct ShedConfig {
  std::vector<std::string> order{"level_set", "background_disparity", "corners", "dense_map"};
  double above = 0.9;
  double below = 0.6;
  int after_frames = 3;
  int restore_frames = 60;
};

struct MetricsConfig {
  std::string listen;  ///< ADDR:PORT of the Prometheus endpoint; empty: none
  std::string file;    ///< rewritten every second; empty: none
};

struct ServiceConfig {
  std::string state_directory;  ///< empty: $STATE_DIRECTORY, else ~/.local/state/stereotrack
  bool log_targets = true;      ///< a line of the log for each target that comes or goes
};

struct CalibrationConfig {
  std::string file;     ///< of the rig; stereotrackd alone
  double unit_m = 0.0;  ///< metres in one unit of the calibration's T; 0 = unset, the calibration's own if it has one
};

struct TelemetryConfig {
  std::vector<std::string> destinations;  ///< ADDR:PORT or [ADDR6]:PORT; empty: nothing is sent
  std::uint32_t rig_id = 1;               ///< stands in every datagram, tells rigs apart
  std::string key_file;                   ///< of the key to sign with; empty: datagrams are not signed
  int multicast_ttl = 1;                  ///< hops that multicast may take
};

/// Which point of a target has to lie in a zone of the picture.
enum class ZoneAnchor : unsigned char { kCentre, kBottom };
enum class ZoneTargets : unsigned char { kAll, kNoneBegin, kIgnore };

/// [[zone]]: a place, for signals, and what is tracked there. Either a box in space or a polygon in the picture. See
/// pipeline/track/zone.hpp and pipeline/track/zone_rules.hpp.
struct ZoneConfig {
  std::string name;
  std::array<double, 2> x_m{};  ///< [m]; 0, 0: anywhere
  std::array<double, 2> y_m{};
  std::array<double, 2> z_m{};
  std::vector<std::array<double, 2>> picture;  ///< corners [px]; empty: a box in space
  ZoneAnchor anchor = ZoneAnchor::kCentre;
  ZoneTargets targets = ZoneTargets::kAll;
  double min_size_m = 0;  ///< [m]; 0: that of pipeline.zones
  double max_size_m = 0;
  friend bool operator==(const ZoneConfig&, const ZoneConfig&) = default;
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
  friend bool operator==(const SignalConfig&, const SignalConfig&) = default;
};

/// [[input]]: a line whose edges something follows from. See drivers/gpio/input_lines.hpp.
struct InputConfig {
  std::string name;
  std::string line;  ///< CHIP:LINE, see drivers/gpio/line.hpp
  InputEdge edge = InputEdge::kRising;
  ActiveLevel active = ActiveLevel::kHigh;
  InputBias bias = InputBias::kAsIs;
  double debounce_ms = 0;  ///< [ms]
  double apart_ms = 1000;  ///< [ms]
  friend bool operator==(const InputConfig&, const InputConfig&) = default;
};

/// The black box and what it writes: docs/RECORDING.md.
struct RecordConfig {
  bool on = false;
  double seconds = 10;       ///< kept before a trigger [s]
  double seconds_after = 2;  ///< and after it [s]
  int reduce = 1;            ///< pictures so many times smaller; over 1: luma alone, replays are not exact
  int every = 1;             ///< every n-th frame; over 1: replays are not exact
  std::string directory;
  int max_mb = 2000;        ///< of all recordings in it [MB = 2^20 bytes]
  bool on_deadline = true;  ///< triggers
  bool on_zone = false;
  bool on_signal = true;
  bool on_input = true;
};

/// What of [objects] is not the stages' own.
struct ObjectsConfig {
  std::string volume;  ///< name of the zone in space in which objects are; empty: everywhere
};

/// What of [track] is not the stage's own.
struct TrackConfig {
  std::array<double, 3> gravity_m_s2{};  ///< left rectified camera [m/s^2]; 0, 0, 0: nothing is expected to fall
};

/// Everything the user can say, with its defaults. Plain values: read it anywhere, once loaded it does
/// not change. What each key does, its range and its unit stand in schema.cpp, one line a key.
struct Configuration {
  std::string preset = "robust";  ///< where the values not given by the user came from
  SourceConfig source;
  CameraConfig camera;
  TriggerConfig trigger;
  SyntheticConfig synthetic;
  LatencyConfig latency;
  RealTimeConfig realtime;
  ShedConfig shed;
  MetricsConfig metrics;
  ServiceConfig service;
  CalibrationConfig calibration;
  TelemetryConfig telemetry;
  std::vector<ZoneConfig> zones;
  std::vector<SignalConfig> signals;
  std::vector<InputConfig> inputs;
  RecordConfig record;
  ObjectsConfig objects;
  TrackConfig track;
  /// The stages' own Configs, see pipeline/pipeline_config.hpp; without zones and unit, which pipeline_of() adds.
  PipelineConfig pipeline;
};

}  // namespace stereotrack::config
