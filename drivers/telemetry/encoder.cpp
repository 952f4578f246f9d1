#include "drivers/telemetry/encoder.hpp"

#include <pb_encode.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "drivers/telemetry/covariance_code.hpp"
#include "stereotrack.pb.h"

namespace stereotrack::telemetry {
namespace {

// The largest datagram that the schema allows fits, and leaves what later fields will take: key id and
// 16 byte hash 26, TAI time and its quality 14, pair skew, two exposures and send error 24, sheds 7.
constexpr std::size_t kKeptForLater = 71;
static_assert(stereotrack_Datagram_size + kKeptForLater <= kMaxDatagramBytes);
static_assert(sizeof(stereotrack_Datagram::targets) / sizeof(stereotrack_Target) == kTargetsPerPart);
static_assert(sizeof(stereotrack_Target_covariance_t::bytes) == kCovarianceBytes);
constexpr bool same(std::uint32_t schema, Flag ours) noexcept { return schema == ours; }
static_assert(same(stereotrack_Flag_FLAG_MONO, kMono) && same(stereotrack_Flag_FLAG_NO_COLOUR, kNoColour) &&
              same(stereotrack_Flag_FLAG_BACKGROUND_LEARNING, kBackgroundLearning) &&
              same(stereotrack_Flag_FLAG_LIGHT_CHANGE, kLightChange) &&
              same(stereotrack_Flag_FLAG_FRAMES_SKIPPED_BEFORE, kFramesSkippedBefore) &&
              same(stereotrack_Flag_FLAG_LATE, kLate));

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
  datagram.latency_ns = static_cast<std::uint32_t>(
      std::clamp<std::int64_t>(message.latency.count(), 0, std::numeric_limits<std::uint32_t>::max()));
  datagram.flags = message.flags;
  datagram.frames_skipped = message.frames_skipped;
  datagram.tracks_dropped = message.tracks_dropped;
  datagram.targets_dropped = clamp_count(choice.dropped);
  datagram.targets_refused = clamp_count(choice.refused);
  if (!(message.unit_m > 0) || !put(message.unit_m, datagram.unit_m)) datagram.unit_m = 0;

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
    // `size` is a fixed32: any value but 0 takes the same room, so that the size can count itself.
    datagram.size = 1;
    std::size_t size = 0;
    if (!pb_get_encoded_size(&size, stereotrack_Datagram_fields, &datagram)) continue;
    datagram.size = static_cast<std::uint32_t>(size);
    const auto room = out.subspan(part * kMaxDatagramBytes, kMaxDatagramBytes);
    pb_ostream_t stream = pb_ostream_from_buffer(reinterpret_cast<pb_byte_t*>(room.data()), room.size());
    if (!pb_encode(&stream, stereotrack_Datagram_fields, &datagram)) continue;
    if (!sent.push(room.first(stream.bytes_written))) break;
  }
  return sent;
}

}  // namespace stereotrack::telemetry
