#pragma once

#include <array>
#include <bit>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>

#include "pipeline/core/time.hpp"
#include "pipeline/frame.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack::record {

/// A recording, NAME.strec, little-endian:
///
///     FileHeader
///     records, each a RecordHeader and its payload
///         kAbout           text: About, a line a value
///         kCalibration     text: calibration_text.hpp; not for mono
///         kConfiguration   text: the TOML of all keys
///         kKeyframe        KeyframeMeta, then a block of state (pipeline/core/state_block.hpp); not in a reduced one
///         kFrame           FrameMeta, TrackNote x kMostTrackNotes, left picture, right picture; in order
///         kOutput          OutputNote
///         kEnd             EndMeta: a file without it was cut
///
/// The first three come first, in this order; a keyframe before the frames that follow it. Outputs may stand anywhere
/// behind. A kind that a reader does not know is passed over.
inline constexpr std::uint32_t kFormatVersion = 1;

struct FileHeader {
  std::array<char, 8> magic{'S', 'T', 'R', 'E', 'C', 'O', 'R', 'D'};
  std::uint32_t version = kFormatVersion;
  std::uint32_t reserved = 0;
};

enum class RecordKind : std::uint32_t { kAbout = 1, kCalibration, kConfiguration, kKeyframe, kFrame, kOutput, kEnd };

struct RecordHeader {
  RecordKind kind = RecordKind::kEnd;
  std::uint32_t number = 0;      ///< of the record in its file, from 1
  std::uint64_t bytes = 0;       ///< of the payload
  std::uint64_t sum = 0;         ///< checksum() of the payload
  std::uint64_t header_sum = 0;  ///< checksum() of the fields before
};

/// What was decided for a frame by clocks, queues and budgets, and not by the pipeline: inputs of a replay.
struct FrameDecisions {
  std::uint8_t shed = 0;                          ///< EffortBits in force while it ran
  std::array<std::uint32_t, kStages> stage_us{};  ///< how long the stages took, by Stage [us]; replays do not care
  friend bool operator==(const FrameDecisions&, const FrameDecisions&) = default;
};

struct FrameMeta {
  std::uint64_t ordinal = 0;
  std::int64_t capture_ns = 0;
  std::int64_t skew_ns = 0;
  std::uint32_t has_skew = 0;
  std::uint32_t flags = 0;   ///< FrameResult::flags, so that a reduced recording has them; kFlagMono: no right picture
  std::uint32_t shed = 0;    ///< FrameDecisions
  std::uint32_t tracks = 0;  ///< targets that the frame had; the first kMostTrackNotes are noted
  std::array<std::uint32_t, kStages> stage_us{};
  std::uint32_t reserved = 0;
};

/// A target of a frame, in short: what the run said, for who reads a recording without running it.
struct TrackNote {
  std::uint32_t id = 0;
  std::uint8_t state = 0;  ///< TrackState
  std::uint8_t measured = 0;
  std::uint8_t has_depth = 0;
  std::uint8_t reserved = 0;
  std::array<std::int16_t, 4> box{};  ///< left top width height [px]
  std::array<float, 3> position{};    ///< [calibration unit]
};
inline constexpr std::size_t kMostTrackNotes = 32;

/// One message that left: the publisher's decisions, and what it had measured. Conversions: output_note.hpp.
struct OutputNote {
  static constexpr std::uint32_t kHasLive = 1;  ///< bits of `has`: the fields below mean something
  static constexpr std::uint32_t kHasTaiError = 2;
  static constexpr std::uint32_t kHasSkew = 4;
  static constexpr std::uint32_t kHasSendError = 8;

  std::uint64_t ordinal = 0;         ///< of the pair whose slot it was; 0: no pair came
  std::uint64_t state_ordinal = 0;   ///< of the pair whose state went out; 0: none did
  std::uint64_t sequence = 0;        ///< of the message, from 1
  std::int64_t capture_ns = 0;       ///< Message::capture_time
  std::int64_t send_ns = 0;          ///< Message::send_time, capture clock
  std::int64_t latency_ns = 0;       ///< Message::latency
  std::int64_t ahead_ns = 0;         ///< so far the state was predicted beyond its own capture time
  std::uint32_t kind = 0;            ///< runtime::OutputSchedule::Kind
  std::uint32_t flags = 0;           ///< Message::flags
  std::uint32_t frames_skipped = 0;  ///< Message::frames_skipped
  std::uint32_t tracks_dropped = 0;  ///< Message::tracks_dropped
  std::int64_t tai_offset_ns = 0;    ///< telemetry::Live, from here on
  std::int64_t tai_error_ns = 0;
  std::int64_t skew_ns = 0;
  std::int64_t send_error_ns = 0;
  std::uint32_t exposure_left_us = 0;
  std::uint32_t exposure_right_us = 0;
  std::uint32_t health = 0;
  std::uint32_t shed = 0;
  std::uint32_t has = 0;
  std::uint32_t reserved = 0;
};

struct KeyframeMeta {
  std::uint64_t after = 0;  ///< ordinal of the pair after which the state was so; 0: before the first
  std::uint64_t reserved = 0;
};

struct EndMeta {
  std::uint64_t frames = 0;
  std::uint64_t outputs = 0;
};

static_assert(std::endian::native == std::endian::little);
static_assert(sizeof(FileHeader) == 16 && sizeof(RecordHeader) == 32 && sizeof(FrameMeta) == 72 &&
              sizeof(TrackNote) == 28 && sizeof(OutputNote) == 128 && sizeof(KeyframeMeta) == 16 &&
              sizeof(EndMeta) == 16);
static_assert(std::is_trivially_copyable_v<FrameMeta> && std::is_trivially_copyable_v<OutputNote>);

/// Where the pictures of a kFrame begin: a cache line's multiple.
inline constexpr std::size_t kFrameHead = 1024;
static_assert(sizeof(FrameMeta) + kMostTrackNotes * sizeof(TrackNote) <= kFrameHead);

/// Why a recording was written. Bits, since several may come together.
enum Cause : std::uint32_t {
  kDeadlineMiss = 1,
  kTargetInZone = 2,
  kSignal = 4,
  kGpioInput = 8,
  kDemand = 16,
};
/// "deadline", "zone-gpio", ...: part of a file name.
[[nodiscard]] std::string cause_text(std::uint32_t causes);

/// What a recording says of the run that it is of.
struct About {
  std::string source;   ///< SourceInfo::name
  std::string program;  ///< name and version
  std::string cause;    ///< cause_text()
  int width = 0;        ///< of the recorded pictures [px]
  int height = 0;       ///< [px]
  PixelFormat format = PixelFormat::kGrey8;
  bool stereo = true;
  std::int64_t period_ns = 0;  ///< nominal
  std::uint32_t rig = 0;       ///< telemetry's ids
  std::uint64_t session = 0;
  double unit_m = 0;   ///< metres in one unit of the calibration, 0 = not known
  int reduce = 1;      ///< recorded pictures are so many times smaller, along rows and columns
  int every = 1;       ///< every n-th frame
  bool exact = false;  ///< has a keyframe and each frame behind it: a replay gives the run's bytes
};
[[nodiscard]] std::string to_text(const About& about);
/// Throws std::runtime_error, one line that begins with `name`.
[[nodiscard]] About about_from_text(const std::string& text, const std::string& name);

}  // namespace stereotrack::record
