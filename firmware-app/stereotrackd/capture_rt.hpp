#pragma once

#include <atomic>

#include "drivers/capture/live_source.hpp"
#include "firmware-app/stereotrackd/vitals.hpp"

namespace stereotrack::daemon {

/// How capturing ended, if it did.
struct CaptureEnd {
  std::atomic<bool> ended{false};   ///< there will be no more pairs, as was asked for
  std::atomic<bool> failed{false};  ///< nor here, for a reason: LiveSource::failure()
};

/// The capture thread's body: lets the source deliver until `stop`, or until it has ended; then closes the pool.
void capture(capture::LiveSource& source, capture::PairOutlet& outlet, capture::FramePool& pool, Vitals& vitals,
             CaptureEnd& end, const std::atomic<bool>& stop) noexcept;

}  // namespace stereotrack::daemon
