#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/telemetry/datagram.hpp"
#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/time.hpp"
#include "pipeline/track/track_report.hpp"

namespace stereotrack::telemetry {

/// What is told about one frame pair.
struct Message {
  std::span<const TrackReport> tracks;  ///< any number, any order
  std::uint64_t ordinal = 0;            ///< FramePair::ordinal
  CaptureTime capture_time{};           ///< FramePair::capture_time
  CaptureTime send_time{};              ///< when it leaves, on the same clock; simulated: capture + L
  std::chrono::nanoseconds latency{0};  ///< from capture to sending; negative counts as 0
  std::uint32_t flags = 0;              ///< sum of Flag
  std::uint32_t frames_skipped = 0;     ///< since the session began
  std::uint32_t tracks_dropped = 0;     ///< since the session began
  double unit_m = 0;                    ///< calibration.unit_m; 0 = not known
  double focal_x_px = 0;                ///< of the left camera, for Target.extent; 0 = not known
  double focal_y_px = 0;
};

/// Turns a frame's tracks into 1..4 datagrams of at most kMaxDatagramBytes.
///     extent = (box.width z / fx, box.height z / fy)      pinhole, lens distortion of the box neglected
/// Order: nearest first; targets without depth last; equal ones by id. The farthest beyond kMaxTargets are
/// left out and counted in `targets_dropped`; a target with a value that is not finite (in float32) or a
/// negative variance is left out and counted in `targets_refused`. No NaN or infinity ever leaves.
/// Same messages in, same bytes out, on every machine. No heap, no clock, no system call; O(tracks).
/// One instance a session and thread.
class Encoder {
 public:
  struct Config {
    std::uint32_t rig = 0;
    std::uint64_t session = 0;
    std::uint64_t sequence = 0;  ///< of the message before the first: a replay goes on where its recording began
  };
  using Parts = FixedVector<std::span<const std::byte>, kMaxParts>;

  explicit Encoder(const Config& config) noexcept : config_(config), sequence_(config.sequence) {}

  /// The datagrams, as views of `out`, in the order to send them. A message without targets is one part.
  [[nodiscard]] Parts encode(const Message& message, std::span<std::byte, kMaxMessageBytes> out) noexcept;

  /// Number of the last message; 0 before the first.
  [[nodiscard]] std::uint64_t sequence() const noexcept { return sequence_; }

 private:
  Config config_;
  std::uint64_t sequence_;
};

}  // namespace stereotrack::telemetry
