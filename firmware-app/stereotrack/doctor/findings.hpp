#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/configuration.hpp"
#include "drivers/capture/v4l2/v4l2.hpp"
#include "drivers/gpio/gpiod.hpp"
#include "drivers/trigger/pwm.hpp"
#include "firmware-app/runtime/real_time.hpp"

/// `stereotrack doctor`: what a board has, what it can keep, and what to do about what it lacks.
///
///     probe_*.cpp, measure_*.cpp  ->  Findings  ->  judge.cpp: Items  ->  report.cpp, json.cpp: for people, for
///     scripts
///                                               ->  suggest.cpp: a configuration
///
/// Probes and measurements find out and judge nothing; what follows from it stands in judge.cpp alone.
namespace stereotrack::doctor {

/// How a distribution of times looked [us]. Exact values, not buckets: there are at most some thousands.
struct Tail {
  std::size_t count = 0;
  double p50_us = 0;
  double p99_us = 0;
  double p999_us = 0;  ///< of fewer than 1000 values the maximum
  double max_us = 0;
};
/// Of values in nanoseconds, which may be negative.
[[nodiscard]] Tail tail_of(std::vector<std::int64_t> values_ns);

/// How readily the kernel lets go of a core for a thread of higher priority.
enum class Preemption : std::uint8_t { kUnknown, kNone, kVoluntary, kFull, kRealTime };
[[nodiscard]] const char* to_string(Preemption preemption) noexcept;

struct KernelFacts {
  std::string board;         ///< what the firmware calls it; empty: it does not
  std::string release;       ///< 6.12.20-rt-arm64
  std::string version;       ///< #1 SMP PREEMPT_RT ...
  std::string architecture;  ///< aarch64
  Preemption preemption = Preemption::kUnknown;
  std::optional<std::int64_t> rt_runtime_us;  ///< of each second that real-time threads may have; -1: all of it
};

struct CpuFacts {
  int cores = 0;                       ///< that are on
  std::vector<std::string> governors;  ///< of its frequency, each once; empty: nothing changes it
  int max_mhz = 0;                     ///< of the fastest; 0: not told
  std::string isolated;                ///< cores that the scheduler leaves alone, as the kernel writes it: 2-3
  int sleep_states = 0;                ///< that an idle core may fall into
  std::optional<double> hottest_c;     ///< of all thermal zones
  std::optional<bool> throttled;       ///< since power-on, by heat or low voltage; only a Raspberry Pi tells
};

struct MemoryFacts {
  std::int64_t total_mb = 0;
  std::int64_t available_mb = 0;
  std::int64_t swap_mb = 0;
  std::int64_t cma_mb = 0;             ///< reserved for cameras and their like
  std::vector<std::string> dma_heaps;  ///< names in /dev/dma_heap
};

/// What this process may ask for; a service has its unit's.
struct LimitFacts {
  std::string user;
  std::optional<std::int64_t> locked_kb;  ///< memory; none: as much as it likes
  int priority = 0;                       ///< highest real-time priority; 0: none
};

struct ClockFacts {
  std::string source;  ///< arch_sys_counter, tsc
  std::vector<std::string> available;
  std::vector<std::string> ptp;        ///< /dev/ptp*: clocks of network cards
  std::optional<double> tai_error_us;  ///< by the kernel's own estimate; none: nobody keeps the clock, or nobody told
                                       ///< the kernel TAI - UTC
};

/// A camera of any driver, in the words of the kernel's. Of libcamera's: path is its id, card its model, bus where it
/// looks to, driver "libcamera"; rates are its fastest and its slowest.
struct CameraFound {
  config::CameraDriver driver = config::CameraDriver::kV4l2;
  capture::v4l2::CameraFacts facts;
};
struct CamerasFound {
  std::vector<CameraFound> cameras;
  std::string libcamera;                        ///< its version and module; empty: there is none
  std::vector<std::string> libcamera_problems;  ///< why there is none, or why a newer one is not taken
};

/// A line of the configuration, looked up and not requested.
struct LineFound {
  std::string key;       ///< "signal NAME", "input NAME"
  std::string line;      ///< CHIP:LINE
  bool output = true;    ///< false: an input
  std::string consumer;  ///< who holds it now; empty: nobody
  std::string problem;   ///< one line; empty: it is there
};

/// One camera, streaming for some seconds as the daemon would have it.
struct CaptureMeasure {
  std::string side;      ///< "left", "right"
  std::string name;      ///< CameraInfo's
  std::string delivers;  ///< 640x480 grey8
  bool colour = true;
  double period_ms = 0;                   ///< nominal
  std::optional<double> readout_us = {};  ///< CameraInfo's
  bool readout_is_guessed = false;
  std::uint64_t frames = 0;
  std::uint64_t damaged = 0;
  std::uint64_t lost = 0;
  std::uint64_t late = 0;  ///< of the lost, those whose driver had no buffer
  Tail jitter;             ///< distances between frames, by how much they differ from the period
  Tail delay;  ///< from the middle of the exposure to the arrival in the program; negative: the stamps are wrong
  double delay_min_us = 0;
  std::vector<std::string> notes;  ///< what the driver made of the wish
  std::string failure;             ///< one line; empty: frames came
};

struct PairMeasure {
  std::optional<double> phase_ms;   ///< by how much the right camera exposes later, within half a period
  std::optional<double> drift_ppm;  ///< of it; told after PhaseEstimator::kLeast seconds
};

struct WakeUpMeasure {
  std::string thread;
  int priority = 0;  ///< that it had; 0: none was granted
  bool beside_pipeline = false;
  Tail latency;  ///< asked to wake at t, ran at t + this
};

struct LineMeasure {
  std::string line;
  std::uint64_t failures = 0;
  Tail latency;         ///< of one set()
  std::string problem;  ///< one line; empty: it was measured
};

struct PipelineMeasure {
  int width = 0;
  int height = 0;
  bool colour = false;
  bool stereo = true;
  double period_ms = 0;
  int drawn = 0;  ///< pairs of the scene that were played to and fro
  Tail compute;
  double memory_mb = 0;
  std::string problem;
};

/// What the latency contract can promise here. See latency.cpp.
struct LatencyVerdict {
  double arrival_ms = 0;  ///< p99.9 of the slower camera, from mid-exposure
  bool arrival_is_assumed = false;
  double compute_ms = 0;     ///< p99.9
  double wake_ms = 0;        ///< p99.9, twice: frame loop and publisher
  double lead_ms = 0;        ///< latency.lead_ms
  double spare_ms = 0;       ///< scenes with more in them than synthetic:eleven
  double achievable_ms = 0;  ///< the sum, rounded up
  double configured_ms = 0;  ///< latency.output_ms
  double period_ms = 0;
};

struct Findings {
  std::string program;  ///< stereotrack 0.1.0
  std::string host;
  std::string config;                               ///< the file; empty: defaults, on the cameras that there are
  double seconds = 0;                               ///< that each measurement took; 0: none
  bool cameras_wanted = true;                       ///< false: the configuration plays a scene or a recording
  config::Configuration configuration;              ///< the file's, or the suggested one
  std::vector<std::string> configuration_problems;  ///< calibration, sizes, keys: one line each
  std::string trigger;                              ///< what the configuration's will do; empty: nobody asked

  KernelFacts kernel;
  CpuFacts cpu;
  MemoryFacts memory;
  LimitFacts limits;
  std::vector<runtime::Missing> missing;  ///< of what the daemon would ask for
  std::string gpio_interface;             ///< of libgpiod: "1", "2", "none"
  std::vector<gpio::gpiod::ChipListing> chips;
  std::vector<trigger::PwmChip> pwm;
  ClockFacts clocks;
  CamerasFound found;
  std::vector<LineFound> lines;
  bool suggestion = false;  ///< configuration's cameras were chosen here: suggest()
  bool has_calibration = false;

  std::vector<CaptureMeasure> capture;
  std::optional<PairMeasure> pair;
  std::optional<WakeUpMeasure> wake_up;
  std::optional<LineMeasure> line;
  std::optional<PipelineMeasure> pipeline;
  std::optional<LatencyVerdict> latency;
};

}  // namespace stereotrack::doctor
