#pragma once

#include <cstdint>

#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/mailbox.hpp"
#include "pipeline/core/time.hpp"
#include "pipeline/effort.hpp"
#include "pipeline/track/track_report.hpp"
#include "pipeline/track/tracker.hpp"

namespace stereotrack::daemon {

/// What the frame loop hands to the publisher of one pair: all that may leave.
struct Outcome {
  std::uint64_t ordinal = 0;
  CaptureTime capture_time{};
  std::uint32_t flags = 0;  ///< FrameFlag bits
  EffortBits left_out = 0;
  FixedVector<TrackReport, Tracker::kMaxTracks> tracks;
};
using OutcomeMailbox = Mailbox<Outcome>;

}  // namespace stereotrack::daemon
