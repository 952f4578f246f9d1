#include "drivers/telemetry/encoder.hpp"

#include <pb_encode.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "drivers/telemetry/authentication.hpp"
#include "drivers/telemetry/covariance_code.hpp"
#include "stereotrack.pb.h"

namespace stereotrack::telemetry {
namespace {

// Targets and status never stand in one datagram: each kind's largest fits, its trailer included.
constexpr std::size_t kFieldOfTarget = 1 + 1 + stereotrack_Target_size;  // number, length, content
constexpr std::size_t kFieldOfStatus = 2 + 2 + stereotrack_Status_size;
static_assert(stereotrack_Target_size < 128 && stereotrack_Status_size >= 128);
static_assert(stereotrack_Datagram_size - kFieldOfStatus + kTrailerBytes <= kMaxDatagramBytes);
static_assert(stereotrack_Datagram_size - kTargetsPerPart * kFieldOfTarget + kTrailerBytes <= kMaxDatagramBytes);
static_assert(sizeof(stereotrack_Datagram::targets) / sizeof(stereotrack_Target) == kTargetsPerPart);
static_assert(sizeof(stereotrack_Target_covariance_t::bytes) == kCovarianceBytes);
constexpr bool same(std::uint32_t schema, Flag ours) noexcept { return schema == ours; }
static_assert(same(stereotrack_Flag_FLAG_MONO, kMono) && same(stereotrack_Flag_FLAG_NO_COLOUR, kNoColour) &&
              same(stereotrack_Flag_FLAG_BACKGROUND_LEARNING, kBackgroundLearning) &&
              same(stereotrack_Flag_FLAG_LIGHT_CHANGE, kLightChange) &&
              same(stereotrack_Flag_FLAG_FRAMES_SKIPPED_BEFORE, kFramesSkippedBefore) &&
              same(stereotrack_Flag_FLAG_LATE, kLate) && same(stereotrack_Flag_FLAG_PAIR_MISSING, kPairMissing) &&
              same(stereotrack_Flag_FLAG_PREDICTED, kPredicted) &&
              same(stereotrack_Flag_FLAG_EFFORT_SHED, kEffortShed) &&
              same(stereotrack_Flag_FLAG_CLOCK_STEPPED, kClockStepped) &&
              same(stereotrack_Flag_FLAG_STATE_AT_OUTPUT, kStateAtOutput) &&
              same(stereotrack_Flag_FLAG_WRONG_PAIR, kWrongPair));
constexpr bool same(std::uint32_t schema, Health ours) noexcept { return schema == ours; }
static_assert(same(stereotrack_Health_HEALTH_NO_PAIRS, kHealthNoPairs) &&
              same(stereotrack_Health_HEALTH_LEFT_SILENT, kHealthLeftSilent) &&
              same(stereotrack_Health_HEALTH_RIGHT_SILENT, kHealthRightSilent) &&
              same(stereotrack_Health_HEALTH_SKEW, kHealthSkew) &&
              same(stereotrack_Health_HEALTH_EXPOSURES_DIFFER, kHealthExposuresDiffer) &&
              same(stereotrack_Health_HEALTH_CLOCK_UNSYNCHRONISED, kHealthClockUnsynchronised) &&
              same(stereotrack_Health_HEALTH_DEADLINES_MISSED, kHealthDeadlinesMissed) &&
              same(stereotrack_Health_HEALTH_EFFORT_SHED, kHealthEffortShed) &&
              same(stereotrack_Health_HEALTH_RECORDING_DROPS, kHealthRecordingDrops) &&
              same(stereotrack_Health_HEALTH_LINE_FAILED, kHealthLineFailed) &&
              same(stereotrack_Health_HEALTH_TELEMETRY_DROPS, kHealthTelemetryDrops) &&
              same(stereotrack_Health_HEALTH_NOT_REAL_TIME, kHealthNotRealTime) &&
              same(stereotrack_Health_HEALTH_TRIGGER_FAILED, kHealthTriggerFailed) &&
              same(stereotrack_Health_HEALTH_ALLOCATED, kHealthAllocated) &&
              same(stereotrack_Health_HEALTH_HOT, kHealthHot) &&
              same(stereotrack_Health_HEALTH_LEFT_ASTRAY, kHealthLeftAstray) &&
              same(stereotrack_Health_HEALTH_RIGHT_ASTRAY, kHealthRightAstray) &&
              same(stereotrack_Health_HEALTH_WRONG_PAIRS, kHealthWrongPairs));

/// Writes `value` as float32; false if that is not finite.
bool put(double value, float& out) noexcept {
  out = static_cast<float>(value);
  return std::isfinite(out);
}

std::uint16_t clamp_px(int value) noexcept { return static_cast<std::uint16_t>(std::clamp(value, 0, 0xFFFF)); }

std::uint16_t clamp_count(std::size_t count) noexcept {
  return static_cast<std::uint16_t>(std::min<std::size_t>(count, 0xFFFF));
}

stereotrack_State wire_state(TrackState state) noexcept {
  switch (state) {
    case TrackState::kTentative: return stereotrack_State_STATE_TENTATIVE;
    case TrackState::kConfirmed: return stereotrack_State_STATE_CONFIRMED;
    case TrackState::kCoasting: return stereotrack_State_STATE_COASTING;
  }
  return stereotrack_State_STATE_UNSPECIFIED;
}

/// False if the target must not be sent.
bool describe(const TrackReport& track, const Message& message, stereotrack_Target& out) noexcept {
  out = stereotrack_Target_init_zero;
  out.id = track.id;
  out.state = wire_state(track.state);
  out.measured = track.measured;
  out.box_count = 4;
  out.box[0] = clamp_px(track.box.left);
  out.box[1] = clamp_px(track.box.top);
  out.box[2] = clamp_px(track.box.width);
  out.box[3] = clamp_px(track.box.height);
  // isfinite before clamping: std::clamp would pass a NaN on, and an infinity would look like a value.
  if (!std::isfinite(track.age_s) || !std::isfinite(track.confidence)) return false;
  if (!put(std::max(track.age_s, 0.0), out.age_s)) return false;
  out.confidence = static_cast<float>(std::clamp(track.confidence, 0.0, 1.0));
  if (!track.has_depth) return true;

  out.position_count = 3;
  out.velocity_count = 3;
  for (int i = 0; i < 3; ++i) {
    if (!put(track.position[i], out.position[i]) || !put(track.velocity[i], out.velocity[i])) return false;
  }
  if (!put(std::sqrt(track.position[0] * track.position[0] + track.position[1] * track.position[1] +
                     track.position[2] * track.position[2]),
           out.distance)) {
    return false;
  }
  const auto covariance = pack_covariance(track.covariance);
  if (!covariance) return false;
  out.covariance.size = kCovarianceBytes;
  std::memcpy(out.covariance.bytes, covariance->data(), kCovarianceBytes);
  if (message.focal_x_px > 0 && message.focal_y_px > 0) {
    out.extent_count = 2;
    if (!put(out.box[2] * track.position[2] / message.focal_x_px, out.extent[0])) return false;
    if (!put(out.box[3] * track.position[2] / message.focal_y_px, out.extent[1])) return false;
  }
  return true;
}

/// Held to +-(2^31 - 1).
std::int32_t clamp_ns(std::chrono::nanoseconds value) noexcept {
  constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
  return static_cast<std::int32_t>(std::clamp<std::int64_t>(value.count(), -kMost, kMost));
}

/// Held to least..2^32 - 1.
std::uint32_t clamp_unsigned_ns(std::chrono::nanoseconds value, std::int64_t least) noexcept {
  return static_cast<std::uint32_t>(
      std::clamp<std::int64_t>(value.count(), least, std::numeric_limits<std::uint32_t>::max()));
}

void describe(const Live& live, stereotrack_Datagram& datagram) noexcept {
  datagram.has_live = true;
  stereotrack_Live& out = datagram.live;
  out.tai_offset_ns = live.tai_offset.count();
  if (live.tai_error) out.tai_error_ns = clamp_unsigned_ns(*live.tai_error, 1);
  out.has_pair_skew_ns = live.pair_skew.has_value();
  if (live.pair_skew) out.pair_skew_ns = clamp_ns(*live.pair_skew);
  out.exposure_left_us = live.exposure_left_us;
  out.exposure_right_us = live.exposure_right_us;
  out.has_send_error_ns = live.send_error.has_value();
  if (live.send_error) out.send_error_ns = clamp_ns(*live.send_error);
  out.efforts_shed = live.efforts_shed;
  out.health = live.health;
}

void describe(const Status& status, stereotrack_Status& out) noexcept {
  out.uptime_ms = status.uptime_ms;
  out.health = status.health;
  out.efforts_shed = status.efforts_shed;
  out.latency_us = status.latency_us;
  out.period_us = status.period_us;
  out.pairs_captured = status.pairs_captured;
  out.pairs_evicted = status.pairs_evicted;
  out.pairs_skipped = status.pairs_skipped;
  out.pairs_starved = status.pairs_starved;
  out.unpaired_left = status.unpaired_left;
  out.unpaired_right = status.unpaired_right;
  out.outputs_on_time = status.outputs_on_time;
  out.outputs_predicted = status.outputs_predicted;
  out.outputs_missing = status.outputs_missing;
  out.outputs_overslept = status.outputs_overslept;
  out.late_results = status.late_results;
  out.deadline_misses = status.deadline_misses;
  out.allocations = status.allocations;
  out.telemetry_sent = status.telemetry_sent;
  out.telemetry_dropped = status.telemetry_dropped;
  out.telemetry_failed = status.telemetry_failed;
  out.recordings_dropped = status.recordings_dropped;
  out.lines_failed = status.lines_failed;
  out.clock_steps = status.clock_steps;
  out.efforts_shed_count = status.efforts_shed_count;
  out.pair_buffers = status.pair_buffers;
  out.pair_buffers_free_low = status.pair_buffers_free_low;
  out.pairs_waiting_high = status.pairs_waiting_high;
  out.recorder_slots = status.recorder_slots;
  out.recorder_slots_free_low = status.recorder_slots_free_low;
  out.compute_p50_us = status.compute_p50_us;
  out.compute_p99_us = status.compute_p99_us;
  out.compute_max_us = status.compute_max_us;
  out.send_error_p50_us = status.send_error_p50_us;
  out.send_error_p99_us = status.send_error_p99_us;
  out.send_error_max_us = status.send_error_max_us;
  out.skew_max_us = status.skew_max_us;
  out.trigger_pulses = status.trigger_pulses;
  out.trigger_skipped = status.trigger_skipped;
  out.trigger_failed = status.trigger_failed;
  out.exposures_missed_left = status.exposures_missed_left;
  out.exposures_missed_right = status.exposures_missed_right;
  out.exposures_doubled_left = status.exposures_doubled_left;
  out.exposures_doubled_right = status.exposures_doubled_right;
  out.exposures_stray_left = status.exposures_stray_left;
  out.exposures_stray_right = status.exposures_stray_right;
}

/// Its bytes, signed if there is a signer; none if it does not fit, which the static_asserts exclude.
std::span<const std::byte> write(stereotrack_Datagram& datagram, const Signer* signer,
                                 std::span<std::byte, kMaxDatagramBytes> room) noexcept {
  // `size` is a fixed32: any value but 0 takes the same room, so that the size can count itself.
  datagram.size = 1;
  std::size_t size = 0;
  if (!pb_get_encoded_size(&size, stereotrack_Datagram_fields, &datagram)) return {};
  datagram.size = static_cast<std::uint32_t>(size);
  pb_ostream_t stream = pb_ostream_from_buffer(reinterpret_cast<pb_byte_t*>(room.data()), room.size());
  if (!pb_encode(&stream, stereotrack_Datagram_fields, &datagram)) return {};
  return room.first(signer == nullptr ? stream.bytes_written : signer->sign(room, stream.bytes_written));
}

struct Candidate {
  float distance;
  std::uint32_t id;
  const TrackReport* track;

  [[nodiscard]] bool before(const Candidate& other) const noexcept {
    return distance != other.distance ? distance < other.distance : id < other.id;
  }
};

struct Choice {
  FixedVector<Candidate, kMaxTargets> nearest;  ///< in the order to send
  std::size_t dropped = 0;
  std::size_t refused = 0;
};

Choice choose(const Message& message) noexcept {
  Choice choice;
  stereotrack_Target target;
  for (const TrackReport& track : message.tracks) {
    if (!describe(track, message, target)) {
      ++choice.refused;
      continue;
    }
    const float distance = track.has_depth ? target.distance : std::numeric_limits<float>::infinity();
    Candidate candidate{distance, track.id, &track};
    for (Candidate& kept : choice.nearest) {
      if (candidate.before(kept)) std::swap(candidate, kept);
    }
    if (!choice.nearest.push(candidate)) ++choice.dropped;
  }
  return choice;
}

}  // namespace

Encoder::Parts Encoder::encode(const Message& message, std::span<std::byte, kMaxMessageBytes> out) noexcept {
  const Choice choice = choose(message);
  const std::size_t parts = std::max<std::size_t>((choice.nearest.size() + kTargetsPerPart - 1) / kTargetsPerPart, 1);
  ++sequence_;

  stereotrack_Datagram datagram = stereotrack_Datagram_init_zero;
  datagram.schema = kSchemaVersion;
  datagram.rig = config_.rig;
  datagram.session = config_.session;
  datagram.sequence = sequence_;
  datagram.parts = static_cast<std::uint8_t>(parts);
  datagram.ordinal = message.ordinal;
  datagram.capture_time_ns = message.capture_time.time_since_epoch().count();
  datagram.send_time_ns = message.send_time.time_since_epoch().count();
  datagram.latency_ns = clamp_unsigned_ns(message.latency, 0);
  datagram.flags = message.flags;
  datagram.frames_skipped = message.frames_skipped;
  datagram.tracks_dropped = message.tracks_dropped;
  datagram.targets_dropped = clamp_count(choice.dropped);
  datagram.targets_refused = clamp_count(choice.refused);
  if (!(message.unit_m > 0) || !put(message.unit_m, datagram.unit_m)) datagram.unit_m = 0;
  if (message.live) describe(*message.live, datagram);

  Parts sent;
  for (std::size_t part = 0; part < parts; ++part) {
    datagram.part = static_cast<std::uint8_t>(part + 1);
    datagram.targets_count = 0;
    const std::size_t begin = part * kTargetsPerPart;
    const std::size_t end = std::min(begin + kTargetsPerPart, choice.nearest.size());
    for (std::size_t i = begin; i < end; ++i) {
      if (describe(*choice.nearest[i].track, message, datagram.targets[datagram.targets_count])) {
        ++datagram.targets_count;
      }
    }
    const auto bytes =
        write(datagram, config_.signer, out.subspan(part * kMaxDatagramBytes).first<kMaxDatagramBytes>());
    if (bytes.empty()) continue;
    if (!sent.push(bytes)) break;
  }
  return sent;
}

std::span<const std::byte> Encoder::encode_status(const Status& status, const std::optional<Live>& live,
                                                  CaptureTime now,
                                                  std::span<std::byte, kMaxDatagramBytes> out) noexcept {
  stereotrack_Datagram datagram = stereotrack_Datagram_init_zero;
  datagram.schema = kSchemaVersion;
  datagram.rig = config_.rig;
  datagram.session = config_.session;
  datagram.part = datagram.parts = 1;
  datagram.send_time_ns = now.time_since_epoch().count();
  if (live) describe(*live, datagram);
  datagram.has_status = true;
  datagram.status.sequence = ++status_sequence_;
  describe(status, datagram.status);
  return write(datagram, config_.signer, out);
}

}  // namespace stereotrack::telemetry
