#pragma once

#include <Eigen/Core>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/rect.hpp"

namespace stereotrack::telemetry {

/// The vocabulary that both ends share. What each field means, its unit, its frame and when it is
/// absent: stereotrack.proto.
inline constexpr std::uint32_t kSchemaVersion = 1;
inline constexpr std::size_t kMaxDatagramBytes = 1200;  ///< under every network's largest unfragmented UDP payload
inline constexpr std::size_t kTargetsPerPart = 8;
inline constexpr std::size_t kMaxParts = 4;
inline constexpr std::size_t kMaxTargets = kTargetsPerPart * kMaxParts;
inline constexpr std::size_t kMaxMessageBytes = kMaxDatagramBytes * kMaxParts;

/// Bits of Header::flags.
enum Flag : std::uint32_t {
  kMono = 1,
  kNoColour = 2,
  kBackgroundLearning = 4,
  kLightChange = 8,
  kFramesSkippedBefore = 16,
  kLate = 32,
  kPairMissing = 64,    ///< no pair came, the slot is the period's
  kPredicted = 128,     ///< its result was not there in time: an older state, predicted
  kEffortShed = 256,    ///< see Live::efforts_shed
  kClockStepped = 512,  ///< of the capture clock, since the message before
  kStateAtOutput =
      1024,           ///< positions, velocities, covariances are predicted to when the message is due, not of capture
  kWrongPair = 2048,  ///< both pictures are not of one instant, told by what moves: no depth was measured
};

/// Bits of Live::health and Status::health: what is wrong now.
enum Health : std::uint32_t {
  kHealthNoPairs = 1,
  kHealthLeftSilent = 2,
  kHealthRightSilent = 4,
  kHealthSkew = 8,
  kHealthExposuresDiffer = 16,
  kHealthClockUnsynchronised = 32,
  kHealthDeadlinesMissed = 64,
  kHealthEffortShed = 128,
  kHealthRecordingDrops = 256,
  kHealthLineFailed = 512,
  kHealthTelemetryDrops = 1024,
  kHealthNotRealTime = 2048,
  kHealthTriggerFailed = 4096,
  kHealthAllocated = 8192,
  kHealthHot = 16384,
  kHealthLeftAstray = 32768,
  kHealthRightAstray = 65536,
  kHealthWrongPairs = 131072,
};

/// What only a live rig knows about a pair; a replay has none. With a status: about now, without skew and exposures.
struct Live {
  std::chrono::nanoseconds tai_offset{0};  ///< TAI minus the clock of capture_time and send_time
  /// Estimated error of tai_offset, at least 1 ns is sent; none: not synchronised, the offset is only believed.
  std::optional<std::chrono::nanoseconds> tai_error;
  /// Middle of the right exposure - middle of the left one; none: not known, or one camera alone.
  std::optional<std::chrono::nanoseconds> pair_skew;
  std::uint32_t exposure_left_us = 0;  ///< [us]; 0 = not known
  std::uint32_t exposure_right_us = 0;
  std::optional<std::chrono::nanoseconds> send_error;  ///< of the message before: sent - due
  std::uint8_t efforts_shed = 0;                       ///< EffortBits
  std::uint32_t health = 0;                            ///< sum of Health

  [[nodiscard]] bool operator==(const Live&) const noexcept = default;
};

/// Every second. Counts are since the session began; low and high are extremes since then. Each field's full meaning:
/// message Status of stereotrack.proto, which has the same names.
struct Status {
  std::uint64_t uptime_ms = 0;
  std::uint32_t health = 0;       ///< sum of Health
  std::uint8_t efforts_shed = 0;  ///< now, EffortBits
  std::uint32_t latency_us = 0;   ///< configured
  std::uint32_t period_us = 0;

  std::uint64_t pairs_captured = 0;  ///< FramePool::Counters
  std::uint64_t pairs_evicted = 0;
  std::uint64_t pairs_skipped = 0;
  std::uint64_t pairs_starved = 0;
  std::uint64_t unpaired_left = 0;
  std::uint64_t unpaired_right = 0;

  std::uint64_t outputs_on_time = 0;  ///< OutputSchedule::Counters
  std::uint64_t outputs_predicted = 0;
  std::uint64_t outputs_missing = 0;
  std::uint64_t outputs_overslept = 0;
  std::uint64_t late_results = 0;
  std::uint64_t deadline_misses = 0;
  std::uint64_t allocations = 0;

  std::uint64_t telemetry_sent = 0;  ///< SinkCounters
  std::uint64_t telemetry_dropped = 0;
  std::uint64_t telemetry_failed = 0;
  std::uint64_t recordings_dropped = 0;
  std::uint64_t lines_failed = 0;
  std::uint64_t clock_steps = 0;
  std::uint64_t efforts_shed_count = 0;

  std::uint32_t pair_buffers = 0;
  std::uint32_t pair_buffers_free_low = 0;
  std::uint32_t pairs_waiting_high = 0;
  std::uint32_t recorder_slots = 0;
  std::uint32_t recorder_slots_free_low = 0;

  std::uint32_t compute_p50_us = 0;
  std::uint32_t compute_p99_us = 0;
  std::uint32_t compute_max_us = 0;
  std::uint32_t send_error_p50_us = 0;
  std::uint32_t send_error_p99_us = 0;
  std::uint32_t send_error_max_us = 0;
  std::uint32_t skew_max_us = 0;

  std::uint64_t trigger_pulses = 0;  ///< trigger::PulseTrain::Counters, or pulses that were seen
  std::uint64_t trigger_skipped = 0;
  std::uint64_t trigger_failed = 0;
  std::uint64_t exposures_missed_left = 0;  ///< trigger::PulseMatcher::Counters, these six
  std::uint64_t exposures_missed_right = 0;
  std::uint64_t exposures_doubled_left = 0;
  std::uint64_t exposures_doubled_right = 0;
  std::uint64_t exposures_stray_left = 0;
  std::uint64_t exposures_stray_right = 0;

  [[nodiscard]] bool operator==(const Status&) const noexcept = default;
};

enum class TargetState : std::uint8_t {
  kUnknown,  ///< a state that this reader is too old for
  kTentative,
  kConfirmed,
  kCoasting,
};

[[nodiscard]] constexpr const char* to_string(TargetState state) noexcept {
  switch (state) {
    case TargetState::kTentative: return "tentative";
    case TargetState::kConfirmed: return "confirmed";
    case TargetState::kCoasting: return "coasting";
    case TargetState::kUnknown: break;
  }
  return "unknown";
}

/// One target as it was received.
struct Target {
  std::uint32_t id = 0;
  TargetState state = TargetState::kUnknown;
  bool measured = false;
  bool has_depth = false;                                                      ///< position..distance are known
  bool has_extent = false;                                                     ///< width and height are known
  float age_s = 0;                                                             ///< [s]
  Eigen::Vector3f position = Eigen::Vector3f::Zero();                          ///< camera frame [u]
  Eigen::Vector3f velocity = Eigen::Vector3f::Zero();                          ///< camera frame [u/s]
  Eigen::Matrix<float, 6, 6> covariance = Eigen::Matrix<float, 6, 6>::Zero();  ///< of (position, velocity)
  float distance = 0;                                                          ///< |position| [u]
  Rect box;                                                                    ///< raw left picture [px]
  float width = 0;                                                             ///< [u]
  float height = 0;                                                            ///< [u]
  float confidence = 0;                                                        ///< 0..1
};

/// What a datagram says besides its targets.
struct Header {
  std::uint32_t rig = 0;
  std::uint64_t session = 0;
  std::uint64_t sequence = 0;  ///< from 1; 0 with a status
  std::uint32_t part = 0;      ///< 1..parts
  std::uint32_t parts = 0;     ///< 1..kMaxParts
  std::uint64_t ordinal = 0;
  std::int64_t capture_time_ns = 0;
  std::int64_t send_time_ns = 0;
  std::uint32_t latency_ns = 0;
  std::uint32_t flags = 0;
  std::uint32_t frames_skipped = 0;
  std::uint32_t tracks_dropped = 0;
  std::uint32_t targets_dropped = 0;
  std::uint32_t targets_refused = 0;
  float unit_m = 0;        ///< 0 = not known
  std::uint32_t size = 0;  ///< bytes of the payload, that is of the datagram without its trailer
};

struct Datagram {
  Header header;
  std::optional<Live> live;
  std::optional<Status> status;       ///< then it is about no pair: header.sequence = 0, no targets
  std::uint64_t status_sequence = 0;  ///< from 1, with status
  FixedVector<Target, kTargetsPerPart> targets;
};

/// All parts of one message put together; `header` is that of the part that came first.
struct Pair {
  Header header;
  std::optional<Live> live;  ///< likewise
  FixedVector<Target, kMaxTargets> targets;
};

}  // namespace stereotrack::telemetry
