#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>

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
  std::uint64_t sequence = 0;  ///< from 1
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
  float unit_m = 0;  ///< 0 = not known
};

struct Datagram {
  Header header;
  FixedVector<Target, kTargetsPerPart> targets;
};

/// All parts of one message put together; `header` is that of the part that came first.
struct Pair {
  Header header;
  FixedVector<Target, kMaxTargets> targets;
};

}  // namespace stereotrack::telemetry
