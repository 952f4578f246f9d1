#include "drivers/telemetry/receiver.hpp"

#include <pb_decode.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "drivers/telemetry/covariance_code.hpp"
#include "stereotrack.pb.h"

namespace stereotrack::telemetry {
namespace {

constexpr std::uint64_t kRestartDistance = 1024;  // no network delivers that late

TargetState known_state(const stereotrack_State& state) noexcept {
  // A newer sender's state is a number that the C enumeration has no room for: it must not be read as one.
  std::uint32_t number = 0;
  static_assert(sizeof number == sizeof state);
  std::memcpy(&number, &state, sizeof number);
  switch (number) {
    case stereotrack_State_STATE_TENTATIVE: return TargetState::kTentative;
    case stereotrack_State_STATE_CONFIRMED: return TargetState::kConfirmed;
    case stereotrack_State_STATE_COASTING: return TargetState::kCoasting;
    default: return TargetState::kUnknown;
  }
}

tl::expected<Target, Refusal> read(const stereotrack_Target& in) noexcept {
  const bool has_depth = in.position_count != 0;
  const auto wanted = [&](std::size_t count) { return has_depth ? count : 0; };
  if (in.position_count != wanted(3) || in.velocity_count != wanted(3) ||
      in.covariance.size != wanted(kCovarianceBytes) || in.box_count != 4 ||
      (in.extent_count != 0 && in.extent_count != wanted(2))) {
    return tl::unexpected(Refusal::kInconsistent);
  }
  Target out;
  out.id = in.id;
  out.state = known_state(in.state);
  out.measured = in.measured;
  out.has_depth = has_depth;
  out.age_s = in.age_s;
  out.distance = in.distance;
  out.confidence = in.confidence;
  out.box = {in.box[0], in.box[1], in.box[2], in.box[3]};
  if (has_depth) {
    out.position = {in.position[0], in.position[1], in.position[2]};
    out.velocity = {in.velocity[0], in.velocity[1], in.velocity[2]};
    const auto covariance = unpack_covariance(std::span<const std::uint8_t, kCovarianceBytes>(in.covariance.bytes));
    if (!covariance) return tl::unexpected(Refusal::kNotFinite);
    out.covariance = *covariance;
  }
  if (in.extent_count != 0) {
    out.has_extent = true;
    out.width = in.extent[0];
    out.height = in.extent[1];
  }
  const bool finite = out.position.allFinite() && out.velocity.allFinite() && std::isfinite(out.age_s) &&
                      std::isfinite(out.distance) && std::isfinite(out.confidence) && std::isfinite(out.width) &&
                      std::isfinite(out.height);
  if (!finite) return tl::unexpected(Refusal::kNotFinite);
  return out;
}

Live read(const stereotrack_Live& in) noexcept {
  using std::chrono::nanoseconds;
  Live out;
  out.tai_offset = nanoseconds(in.tai_offset_ns);
  if (in.tai_error_ns != 0) out.tai_error = nanoseconds(in.tai_error_ns);
  if (in.has_pair_skew_ns) out.pair_skew = nanoseconds(in.pair_skew_ns);
  out.exposure_left_us = in.exposure_left_us;
  out.exposure_right_us = in.exposure_right_us;
  if (in.has_send_error_ns) out.send_error = nanoseconds(in.send_error_ns);
  out.efforts_shed = in.efforts_shed;
  out.health = in.health;
  return out;
}

Status read(const stereotrack_Status& in) noexcept {
  Status out;
  out.uptime_ms = in.uptime_ms;
  out.health = in.health;
  out.efforts_shed = in.efforts_shed;
  out.latency_us = in.latency_us;
  out.period_us = in.period_us;
  out.pairs_captured = in.pairs_captured;
  out.pairs_evicted = in.pairs_evicted;
  out.pairs_skipped = in.pairs_skipped;
  out.pairs_starved = in.pairs_starved;
  out.unpaired_left = in.unpaired_left;
  out.unpaired_right = in.unpaired_right;
  out.outputs_on_time = in.outputs_on_time;
  out.outputs_predicted = in.outputs_predicted;
  out.outputs_missing = in.outputs_missing;
  out.outputs_overslept = in.outputs_overslept;
  out.late_results = in.late_results;
  out.deadline_misses = in.deadline_misses;
  out.allocations = in.allocations;
  out.telemetry_sent = in.telemetry_sent;
  out.telemetry_dropped = in.telemetry_dropped;
  out.telemetry_failed = in.telemetry_failed;
  out.recordings_dropped = in.recordings_dropped;
  out.lines_failed = in.lines_failed;
  out.clock_steps = in.clock_steps;
  out.efforts_shed_count = in.efforts_shed_count;
  out.pair_buffers = in.pair_buffers;
  out.pair_buffers_free_low = in.pair_buffers_free_low;
  out.pairs_waiting_high = in.pairs_waiting_high;
  out.recorder_slots = in.recorder_slots;
  out.recorder_slots_free_low = in.recorder_slots_free_low;
  out.compute_p50_us = in.compute_p50_us;
  out.compute_p99_us = in.compute_p99_us;
  out.compute_max_us = in.compute_max_us;
  out.send_error_p50_us = in.send_error_p50_us;
  out.send_error_p99_us = in.send_error_p99_us;
  out.send_error_max_us = in.send_error_max_us;
  out.skew_max_us = in.skew_max_us;
  out.trigger_pulses = in.trigger_pulses;
  out.trigger_skipped = in.trigger_skipped;
  out.trigger_failed = in.trigger_failed;
  out.exposures_missed_left = in.exposures_missed_left;
  out.exposures_missed_right = in.exposures_missed_right;
  out.exposures_doubled_left = in.exposures_doubled_left;
  out.exposures_doubled_right = in.exposures_doubled_right;
  out.exposures_stray_left = in.exposures_stray_left;
  out.exposures_stray_right = in.exposures_stray_right;
  return out;
}

/// What lies behind the payload is the beginning of a trailer.
bool is_cut_trailer(std::span<const std::byte> rest) noexcept {
  constexpr std::array kBegin{std::byte{0xF5}, std::byte{0x7F}};
  return !rest.empty() && rest.size() < kTrailerBytes &&
         std::equal(rest.begin(), rest.begin() + std::min(rest.size(), kBegin.size()), kBegin.begin());
}

}  // namespace

tl::expected<Datagram, Refusal> decode(std::span<const std::byte> bytes) noexcept {
  if (bytes.empty()) return tl::unexpected(Refusal::kEmpty);
  if (bytes.size() > kMaxDatagramBytes) return tl::unexpected(Refusal::kOversized);
  stereotrack_Datagram in = stereotrack_Datagram_init_zero;
  pb_istream_t stream = pb_istream_from_buffer(reinterpret_cast<const pb_byte_t*>(bytes.data()), bytes.size());
  const bool decoded = pb_decode(&stream, stereotrack_Datagram_fields, &in);
  // A cut or newer datagram is told as such where its first fields could still be read.
  if (in.schema != 0 && in.schema != kSchemaVersion) return tl::unexpected(Refusal::kUnknownSchema);
  if (in.schema == kSchemaVersion && (in.size > bytes.size() || is_cut_trailer(bytes.subspan(in.size)))) {
    return tl::unexpected(Refusal::kTruncated);
  }
  if (!decoded) return tl::unexpected(Refusal::kMalformed);
  if (in.schema == 0) return tl::unexpected(Refusal::kUnknownSchema);
  if (in.size == 0 || in.part == 0 || in.part > in.parts || in.parts > kMaxParts ||
      (in.has_status ? in.sequence != 0 || in.status.sequence == 0 || in.parts != 1 || in.targets_count != 0
                     : in.sequence == 0)) {
    return tl::unexpected(Refusal::kInconsistent);
  }
  if (!std::isfinite(in.unit_m) || in.unit_m < 0) return tl::unexpected(Refusal::kNotFinite);

  Datagram out;
  out.header = {in.rig,
                in.session,
                in.sequence,
                in.part,
                in.parts,
                in.ordinal,
                in.capture_time_ns,
                in.send_time_ns,
                in.latency_ns,
                in.flags,
                in.frames_skipped,
                in.tracks_dropped,
                in.targets_dropped,
                in.targets_refused,
                in.unit_m,
                in.size};
  if (in.has_live) out.live = read(in.live);
  if (in.has_status) {
    out.status = read(in.status);
    out.status_sequence = in.status.sequence;
  }
  for (std::size_t i = 0; i < in.targets_count; ++i) {
    const auto target = read(in.targets[i]);
    if (!target) return tl::unexpected(target.error());
    if (!out.targets.push(*target)) return tl::unexpected(Refusal::kMalformed);
  }
  return out;
}

std::uint64_t Receiver::Stream::lost() const noexcept {
  if (last_used == 0) return 0;
  const Slot& newest = slots[highest % kWindow];
  return highest - first + 1 - complete - (newest.complete() ? 0 : 1);
}

void Receiver::Stream::begin(const Header& header) noexcept {
  rig = header.rig;
  session = header.session;
  first = header.sequence;
  highest = header.sequence;
  complete = 0;
  for (Slot& slot : slots) slot.sequence = 0;
}

Receiver::Receiver(std::vector<Key> keys) : keys_(std::move(keys)), streams_(kStreams) {}

std::uint64_t Receiver::lost() const noexcept {
  std::uint64_t sum = lost_before_;
  for (const Stream& stream : streams_) sum += stream.lost();
  return sum;
}

std::uint64_t Receiver::lost(std::uint32_t rig, std::uint64_t session) const noexcept {
  for (const Stream& stream : streams_) {
    if (stream.last_used != 0 && stream.rig == rig && stream.session == session) return stream.lost();
  }
  return 0;
}

Outcome Receiver::refuse(Refusal refusal) noexcept {
  refusal_ = refusal;
  ++counters_.refused[static_cast<std::size_t>(refusal)];
  return Outcome::kRefused;
}

Receiver::Stream& Receiver::stream_of(const Header& header) noexcept {
  Stream* oldest = &streams_.front();
  for (Stream& stream : streams_) {
    if (stream.last_used != 0 && stream.rig == header.rig && stream.session == header.session) return stream;
    if (stream.last_used < oldest->last_used) oldest = &stream;
  }
  lost_before_ += oldest->lost();
  oldest->begin(header);
  return *oldest;
}

tl::expected<Datagram, Refusal> Receiver::authenticate(std::span<const std::byte> bytes) noexcept {
  if (bytes.size() > kMaxDatagramBytes) return tl::unexpected(Refusal::kOversized);
  switch (check_seal(bytes, keys_)) {
    case Seal::kGood: break;
    case Seal::kUnknownKey: return tl::unexpected(Refusal::kUnknownKey);
    case Seal::kWrong: return tl::unexpected(Refusal::kForged);
    case Seal::kNone: {
      // Refused in any case: only the reason is looked for. Behind a whole payload something else than a trailer
      // stands.
      const auto unsigned_one = decode(bytes);
      if (!unsigned_one) return unsigned_one;
      return tl::unexpected(unsigned_one->header.size == bytes.size() ? Refusal::kUnsigned : Refusal::kForged);
    }
  }
  auto decoded = decode(bytes);
  if (!decoded) return decoded;
  switch (guard_.admit(*decoded)) {
    case ReplayGuard::Verdict::kFresh: break;
    case ReplayGuard::Verdict::kReplayed: return tl::unexpected(Refusal::kReplayed);
    case ReplayGuard::Verdict::kOldSession: return tl::unexpected(Refusal::kOldSession);
    case ReplayGuard::Verdict::kTooManyRigs: return tl::unexpected(Refusal::kTooManyRigs);
  }
  return decoded;
}

Outcome Receiver::accept(std::span<const std::byte> bytes) noexcept {
  ++counters_.datagrams;
  const auto decoded = keys_.empty() ? decode(bytes) : authenticate(bytes);
  if (!decoded) return refuse(decoded.error());
  const Header& header = decoded->header;
  if (decoded->status) {
    last_ = *decoded;
    ++counters_.statuses;
    return Outcome::kStatus;
  }
  Stream& stream = stream_of(header);
  stream.last_used = counters_.datagrams;

  const std::uint64_t back = header.sequence < stream.highest ? stream.highest - header.sequence : 0;
  if (back >= kWindow && (header.sequence == 1 || back > kRestartDistance)) {
    lost_before_ += stream.lost();
    ++counters_.restarts;
    stream.begin(header);
  } else if (back >= kWindow) {
    last_ = *decoded;
    ++counters_.stale;
    return Outcome::kStale;
  }

  Slot& slot = stream.slots[header.sequence % kWindow];
  if (slot.sequence == header.sequence && slot.parts != header.parts) return refuse(Refusal::kInconsistent);
  const std::uint32_t bit = 1U << (header.part - 1);
  if (slot.sequence == header.sequence && (slot.have & bit) != 0) {
    last_ = *decoded;
    ++counters_.duplicates;
    return Outcome::kDuplicate;
  }
  if (slot.sequence != header.sequence) {
    slot.sequence = header.sequence;
    slot.parts = header.parts;
    slot.have = 0;
    slot.header = header;
    slot.live = decoded->live;
  }
  if (header.sequence < stream.highest || slot.have > bit) ++counters_.reordered;
  slot.have |= bit;
  slot.targets[header.part - 1] = decoded->targets;
  stream.first = std::min(stream.first, header.sequence);
  stream.highest = std::max(stream.highest, header.sequence);
  last_ = *decoded;
  if (!slot.complete()) return Outcome::kPart;

  ++stream.complete;
  ++counters_.pairs;
  pair_.header = slot.header;
  pair_.live = slot.live;
  pair_.targets.clear();
  for (std::uint32_t part = 0; part < slot.parts; ++part) {
    for (const Target& target : slot.targets[part]) {
      if (!pair_.targets.push(target)) return refuse(Refusal::kInconsistent);
    }
  }
  return Outcome::kPair;
}

}  // namespace stereotrack::telemetry
