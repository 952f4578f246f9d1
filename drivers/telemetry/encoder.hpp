#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "drivers/telemetry/datagram.hpp"
#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/time.hpp"
#include "pipeline/track/track_report.hpp"

namespace stereotrack::telemetry {

class Signer;

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
  std::optional<Live> live;  ///< none: a replay
};

/// Turns a frame's tracks into 1..4 datagrams of at most kMaxDatagramBytes.
///     extent = (box.width z / fx, box.height z / fy)      pinhole, lens distortion of the box neglected
/// Order: nearest first; targets without depth last; equal ones by id. The farthest beyond kMaxTargets are
/// left out and counted in `targets_dropped`; a target with a value that is not finite (in float32) or a
/// negative variance is left out and counted in `targets_refused`. No NaN or infinity ever leaves.
/// Same messages in, same bytes out, on every machine. No heap, no clock, no system call; O(tracks).
/// With a Signer every datagram ends with its trailer, which lies behind the payload and changes nothing in it.
/// Values of Live that do not fit are held at the largest that does: a skew or send error at +-2147483647 ns, the
/// error of TAI at 4294967295 ns.
/// One instance a session and thread.
class Encoder {
 public:
  struct Config {
    std::uint32_t rig = 0;
    std::uint64_t session = 0;
    const Signer* signer = nullptr;  ///< must outlive the encoder; null: datagrams are not signed
    std::uint64_t sequence = 0;      ///< of the message before the first: a replay goes on where its recording began
  };
  using Parts = FixedVector<std::span<const std::byte>, kMaxParts>;

  explicit Encoder(const Config& config) noexcept : config_(config), sequence_(config.sequence) {}

  /// The datagrams, as views of `out`, in the order to send them. A message without targets is one part.
  [[nodiscard]] Parts encode(const Message& message, std::span<std::byte, kMaxMessageBytes> out) noexcept;

  /// One datagram with the status and no targets, to be sent every second whether pairs come or not. It takes no
  /// number of the messages, whose gaps are losses: its own sequence is Status.sequence. `now` is on the clock of
  /// Message::send_time. An empty span never comes: the size is bounded by the schema.
  [[nodiscard]] std::span<const std::byte> encode_status(const Status& status, const std::optional<Live>& live,
                                                         CaptureTime now,
                                                         std::span<std::byte, kMaxDatagramBytes> out) noexcept;

  /// The next message has the number after this one: a replay of messages of which some are missing.
  void go_on_after(std::uint64_t sequence) noexcept { sequence_ = sequence; }

  /// Number of the last message; 0 before the first.
  [[nodiscard]] std::uint64_t sequence() const noexcept { return sequence_; }
  /// Number of the last status; 0 before the first.
  [[nodiscard]] std::uint64_t status_sequence() const noexcept { return status_sequence_; }

 private:
  Config config_;
  std::uint64_t sequence_;
  std::uint64_t status_sequence_ = 0;
};

}  // namespace stereotrack::telemetry
