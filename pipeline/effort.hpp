#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace stereotrack {

/// What the pipeline can leave out of a frame and still track.
enum class Effort : std::uint8_t {
  kLevelSet,  ///< blobs keep what was found, not refined (thesis preset)
  kCorners,   ///< targets move by their boxes and depths alone: corner features are dropped, found anew later
  kBackgroundDisparity,  ///< the background's disparity keeps its age: no strip of rows is matched this frame
  kDenseMap,             ///< disparity where something moves, instead of everywhere
};
inline constexpr std::size_t kEfforts = 4;

[[nodiscard]] constexpr const char* to_string(Effort effort) noexcept {
  constexpr std::array<const char*, kEfforts> kNames{"level_set", "corners", "background_disparity", "dense_map"};
  return kNames[static_cast<std::size_t>(effort)];
}

/// A set of efforts, one bit each: what a frame is to leave out, what telemetry says was left out, and what a recording
/// keeps as a decision.
using EffortBits = std::uint8_t;
[[nodiscard]] constexpr EffortBits bit_of(Effort effort) noexcept {
  return static_cast<EffortBits>(1U << static_cast<unsigned>(effort));
}
[[nodiscard]] constexpr bool leaves_out(EffortBits bits, Effort effort) noexcept {
  return (bits & bit_of(effort)) != 0;
}

}  // namespace stereotrack
