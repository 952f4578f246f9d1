#include "drivers/record/output_note.hpp"

namespace stereotrack::record {

OutputNote note_of(const telemetry::Message& message, std::uint64_t sequence) noexcept {
  OutputNote note;
  note.ordinal = message.ordinal;
  note.sequence = sequence;
  note.capture_ns = message.capture_time.time_since_epoch().count();
  note.send_ns = message.send_time.time_since_epoch().count();
  note.latency_ns = message.latency.count();
  note.flags = message.flags;
  note.frames_skipped = message.frames_skipped;
  note.tracks_dropped = message.tracks_dropped;
  if (!message.live) return note;
  const telemetry::Live& live = *message.live;
  note.has = OutputNote::kHasLive;
  note.tai_offset_ns = live.tai_offset.count();
  note.exposure_left_us = live.exposure_left_us;
  note.exposure_right_us = live.exposure_right_us;
  note.health = live.health;
  note.shed = live.efforts_shed;
  const auto keep = [&note](const std::optional<std::chrono::nanoseconds>& from, std::int64_t& to, std::uint32_t bit) {
    if (!from) return;
    to = from->count();
    note.has |= bit;
  };
  keep(live.tai_error, note.tai_error_ns, OutputNote::kHasTaiError);
  keep(live.pair_skew, note.skew_ns, OutputNote::kHasSkew);
  keep(live.send_error, note.send_error_ns, OutputNote::kHasSendError);
  return note;
}

telemetry::Message message_of(const OutputNote& note) noexcept {
  using std::chrono::nanoseconds;
  telemetry::Message message;
  message.ordinal = note.ordinal;
  message.capture_time = CaptureTime(nanoseconds(note.capture_ns));
  message.send_time = CaptureTime(nanoseconds(note.send_ns));
  message.latency = nanoseconds(note.latency_ns);
  message.flags = note.flags;
  message.frames_skipped = note.frames_skipped;
  message.tracks_dropped = note.tracks_dropped;
  if ((note.has & OutputNote::kHasLive) == 0) return message;
  const auto value = [&note](std::int64_t ns, std::uint32_t bit) {
    return (note.has & bit) != 0 ? std::optional(nanoseconds(ns)) : std::nullopt;
  };
  telemetry::Live& live = message.live.emplace();
  live.tai_offset = nanoseconds(note.tai_offset_ns);
  live.tai_error = value(note.tai_error_ns, OutputNote::kHasTaiError);
  live.pair_skew = value(note.skew_ns, OutputNote::kHasSkew);
  live.send_error = value(note.send_error_ns, OutputNote::kHasSendError);
  live.exposure_left_us = note.exposure_left_us;
  live.exposure_right_us = note.exposure_right_us;
  live.health = note.health;
  live.efforts_shed = static_cast<std::uint8_t>(note.shed);
  return message;
}

}  // namespace stereotrack::record
