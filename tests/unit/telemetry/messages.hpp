#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

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
