#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/queue.hpp"
#include "pipeline/track/track_report.hpp"
#include "pipeline/track/tracker.hpp"

namespace stereotrack::daemon {

/// What the log is told of a target's life.
struct TargetNote {
  std::uint32_t id = 0;
  bool is_there = false;  ///< confirmed just now; false: given up, or ended by the tracker
  bool has_depth = false;
  double distance = 0;  ///< along the optical axis, when it was seen last [calibration unit]; 0 without depth
  double age_s = 0;     ///< since its first detection, when it was seen last [s]
};

/// "target 12 is there, at 4.20 m", or "... is gone after 3.4 s, last at ..."; unit_m: metres in the calibration's
/// unit, 0 where that is not known.
[[nodiscard]] std::string text_of(const TargetNote& note, double unit_m);

/// From the frame loop, which sees which targets come and go, to the service thread, which may write. A target counts
/// from its confirmation. What the service does not fetch in time is left out of the log, and counted.
class TargetNotes {
 public:
  /// Frame loop: all tracks of a frame, in the order of their ids, as FrameResult has them. O(tracks); no heap, no
  /// wait.
  void update(std::span<const TrackReport> tracks) noexcept;

  /// Service thread. False: there is none, `note` is untouched.
  [[nodiscard]] bool take(TargetNote& note) noexcept { return queue_.pop(note); }

  /// Any thread: notes that found no room.
  [[nodiscard]] std::uint64_t left_out() const noexcept { return queue_.refused(); }

 private:
  HandoverQueue<TargetNote, 256> queue_;
  FixedVector<TargetNote, Tracker::kMaxTracks> there_;  // in the order of their ids
};

}  // namespace stereotrack::daemon
