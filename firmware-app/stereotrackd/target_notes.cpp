#include "firmware-app/stereotrackd/target_notes.hpp"

#include <limits>

#include "firmware-app/formatted.hpp"

namespace stereotrack::daemon {

namespace {

TargetNote note_of(const TrackReport& track) {
  return {.id = track.id,
          .is_there = true,
          .has_depth = track.has_depth,
          .distance = track.has_depth ? track.position.z() : 0,
          .age_s = track.age_s};
}

}  // namespace

std::string text_of(const TargetNote& note, double unit_m) {
  std::string text = note.is_there ? formatted("target %u is there", note.id)
                                   : formatted("target %u is gone after %.1f s", note.id, note.age_s);
  if (note.has_depth) {
    text += formatted(", %sat %.2f %s", note.is_there ? "" : "last ",
                      unit_m > 0 ? note.distance * unit_m : note.distance, unit_m > 0 ? "m" : "units");
  }
  return text;
}

void TargetNotes::update(std::span<const TrackReport> tracks) noexcept {
  FixedVector<TargetNote, Tracker::kMaxTracks> now;
  std::size_t before = 0;
  const auto end_those_before = [&](std::uint64_t id) {
    for (; before < there_.size() && there_[before].id < id; ++before) {
      there_[before].is_there = false;
      (void)queue_.push(there_[before]);
    }
  };
  for (const TrackReport& track : tracks) {
    if (track.state == TrackState::kTentative) continue;
    end_those_before(track.id);
    const bool is_new = before == there_.size() || there_[before].id != track.id;
    // While it coasts, what was seen last stands.
    const TargetNote note = is_new || track.measured ? note_of(track) : there_[before];
    if (is_new) {
      (void)queue_.push(note);
    } else {
      ++before;
    }
    (void)now.push(note);
  }
  end_those_before(std::numeric_limits<std::uint64_t>::max());
  there_ = now;
}

}  // namespace stereotrack::daemon
