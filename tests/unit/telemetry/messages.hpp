#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "drivers/telemetry/authentication.hpp"
#include "drivers/telemetry/encoder.hpp"

namespace stereotrack::telemetry {

using Bytes = std::vector<std::byte>;

/// A target `z` units ahead, with everything set.
inline TrackReport track_at(std::uint32_t id, double z) {
  TrackReport track;
  track.id = id;
  track.state = TrackState::kConfirmed;
  track.measured = true;
  track.has_depth = true;
  track.box = {100, 50, 40, 80};
  track.position = {3, 4, z};
  track.velocity = {0.5, -0.25, 2};
  track.covariance.setIdentity();
  track.confidence = 0.75;
  track.age_s = 1.5;
  return track;
}

inline std::vector<TrackReport> tracks(std::uint32_t count) {
  std::vector<TrackReport> list;
  for (std::uint32_t i = 1; i <= count; ++i) list.push_back(track_at(i, i));
  return list;
}

/// Encodes and keeps the datagrams apart from the encoder's memory.
inline std::vector<Bytes> encode(Encoder& encoder, const Message& message) {
  std::array<std::byte, kMaxMessageBytes> room{};
  std::vector<Bytes> datagrams;
  for (const auto part : encoder.encode(message, room)) datagrams.emplace_back(part.begin(), part.end());
  return datagrams;
}

/// What datagrams_v1.hex was made from: one target with everything, one without depth.
inline std::vector<TrackReport> golden_tracks() {
  std::vector<TrackReport> list{track_at(7, 12), track_at(300, 0)};
  list[0].covariance(0, 0) = 4;
  list[0].covariance(2, 2) = 9;
  list[0].covariance(2, 0) = list[0].covariance(0, 2) = 3;
  list[1].has_depth = false;
  list[1].state = TrackState::kCoasting;
  list[1].measured = false;
  return list;
}

inline Message golden_message(const std::vector<TrackReport>& list) {
  Message message;
  message.tracks = list;
  message.ordinal = 42;
  message.capture_time = CaptureTime{std::chrono::nanoseconds{1'700'000'000'123'456'789}};
  message.send_time = message.capture_time + std::chrono::milliseconds(50);
  message.latency = std::chrono::milliseconds(50);
  message.flags = kNoColour | kFramesSkippedBefore;
  message.frames_skipped = 3;
  message.tracks_dropped = 2;
  message.unit_m = 0.5;
  message.focal_x_px = 400;
  message.focal_y_px = 480;
  return message;
}

inline constexpr Encoder::Config kGoldenConfig{.rig = 9, .session = 0x0123'4567'89AB'CDEF};

/// What stored live datagrams are signed with.
inline constexpr Key kGoldenKey{.id = 3, .secret = {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11, 12, 13, 14, 15,
                                                    16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31}};

inline Live golden_live() {
  using namespace std::chrono_literals;
  Live live;
  live.tai_offset = 1'700'000'037'000'000'001ns;
  live.tai_error = 1500ns;
  live.pair_skew = -12'000ns;
  live.exposure_left_us = 8000;
  live.exposure_right_us = 8100;
  live.send_error = 35'000ns;
  live.efforts_shed = 2 | 8;
  live.health = kHealthSkew | kHealthEffortShed;
  return live;
}

/// As a status carries it.
inline Live golden_live_without_pair() {
  Live live = golden_live();
  live.pair_skew.reset();
  live.exposure_left_us = live.exposure_right_us = 0;
  return live;
}

inline Message golden_live_message(const std::vector<TrackReport>& list) {
  Message message = golden_message(list);
  message.flags |= kPairMissing | kPredicted | kEffortShed | kClockStepped;
  message.live = golden_live();
  return message;
}

/// Every field of the first schema another value: what is stored of it must stay readable.
inline Status golden_status() {
  Status s;
  s.uptime_ms = 86'400'000;
  s.health = kHealthNotRealTime | kHealthDeadlinesMissed;
  s.efforts_shed = 1;
  s.latency_us = 50'000;
  s.period_us = 33'333;
  s.pairs_captured = 2'592'000;
  s.pairs_evicted = 11;
  s.pairs_skipped = 12;
  s.pairs_starved = 13;
  s.unpaired_left = 14;
  s.unpaired_right = 15;
  s.outputs_on_time = 5'000'000'000;
  s.outputs_predicted = 16;
  s.outputs_missing = 17;
  s.outputs_overslept = 18;
  s.late_results = 19;
  s.deadline_misses = 20;
  s.allocations = 21;
  s.telemetry_sent = 22;
  s.telemetry_dropped = 23;
  s.telemetry_failed = 24;
  s.recordings_dropped = 25;
  s.lines_failed = 26;
  s.clock_steps = 27;
  s.efforts_shed_count = 28;
  s.pair_buffers = 8;
  s.pair_buffers_free_low = 5;
  s.pairs_waiting_high = 2;
  s.recorder_slots = 64;
  s.recorder_slots_free_low = 60;
  s.compute_p50_us = 9000;
  s.compute_p99_us = 11'000;
  s.compute_max_us = 19'000;
  s.send_error_p50_us = 6;
  s.send_error_p99_us = 30;
  s.send_error_max_us = 120;
  s.skew_max_us = 40;
  return s;
}

inline Bytes encode_status(Encoder& encoder, const Status& status, const std::optional<Live>& live = std::nullopt,
                           CaptureTime now = {}) {
  std::array<std::byte, kMaxDatagramBytes> room{};
  const auto datagram = encoder.encode_status(status, live, now, room);
  return {datagram.begin(), datagram.end()};
}

inline std::string to_hex(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes) {
    constexpr const char* kDigits = "0123456789abcdef";
    text += kDigits[static_cast<unsigned>(byte) >> 4U];
    text += kDigits[static_cast<unsigned>(byte) & 15U];
  }
  return text;
}

/// One datagram a line, in hexadecimal; lines with # are comments.
inline std::vector<Bytes> read_hex(const std::string& path) {
  std::vector<Bytes> datagrams;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    Bytes bytes;
    for (std::size_t i = 0; i + 1 < line.size(); i += 2) {
      bytes.push_back(static_cast<std::byte>(std::stoi(line.substr(i, 2), nullptr, 16)));
    }
    datagrams.push_back(bytes);
  }
  return datagrams;
}

}  // namespace stereotrack::telemetry
