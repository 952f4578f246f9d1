#pragma once

#include <cstdint>

#include "drivers/telemetry/datagram.hpp"
#include "pipeline/pipeline.hpp"

namespace stereotrack::telemetry {

/// What of a frame's FrameFlag bits stands in Header::flags, as Flag bits; who sends adds what it knows of the frame
/// itself. Any thread.
[[nodiscard]] constexpr std::uint32_t flags_of_frame(std::uint32_t frame_flags) noexcept {
  std::uint32_t out = 0;
  if ((frame_flags & kFlagMono) != 0) out |= kMono;
  if ((frame_flags & kFlagNoColour) != 0) out |= kNoColour;
  if ((frame_flags & kFlagLearning) != 0) out |= kBackgroundLearning;
  if ((frame_flags & kFlagLightChange) != 0) out |= kLightChange;
  if ((frame_flags & kFlagWrongPair) != 0) out |= kWrongPair;
  return out;
}

}  // namespace stereotrack::telemetry
