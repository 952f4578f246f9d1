#include "firmware-app/stereotrack/info.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <ostream>
#include <span>
#include <stdexcept>
#include <vector>

#include "drivers/capture/pixel_format_names.hpp"
#include "drivers/record/recording_source.hpp"
#include "firmware-app/formatted.hpp"
#include "firmware-app/runtime/output_schedule.hpp"
#include "firmware-app/stereotrack/summary.hpp"
#include "pipeline/effort.hpp"
#include "pipeline/track/track_report.hpp"

namespace stereotrack {
namespace {

using PrintedU64 = unsigned long long;  // what %llu takes

struct Seen {
  std::uint64_t first = 0;
  std::uint64_t last = 0;
  std::uint64_t frames = 0;
};

/// What the frames of a recording add up to.
struct Frames {
  std::uint64_t whole = 0;
  std::vector<std::string> damaged;  ///< why
  std::uint64_t first = 0;
  std::uint64_t last = 0;
  std::uint64_t missing = 0;  ///< ordinals between two frames that are not there, beyond what `every` leaves out
  CaptureTime begin{};
  CaptureTime end{};
  std::vector<double> skews_ms;
  std::map<std::uint32_t, Seen> targets;  ///< confirmed, by id
  std::size_t most_targets = 0;
  std::uint64_t shedding = 0;
  EffortBits shed = 0;
  std::uint64_t slowest = 0;  ///< ordinal
  std::uint32_t slowest_us = 0;
  Stage slowest_stage = Stage::kIngest;
  std::uint32_t slowest_stage_us = 0;

  void add(const FramePair& pair, const record::RecordingSource& recording);

 private:
  void add_targets(std::uint64_t ordinal, std::span<const record::TrackNote> notes);
  void add_decisions(std::uint64_t ordinal, const record::FrameDecisions& decisions);
};

void Frames::add(const FramePair& pair, const record::RecordingSource& recording) {
  if (whole == 0) {
    first = pair.ordinal;
    begin = pair.capture_time;
  } else {
    const auto every = static_cast<std::uint64_t>(recording.about().every);
    missing += (pair.ordinal - last - 1) / every;
  }
  ++whole;
  last = pair.ordinal;
  end = pair.capture_time;
  if (pair.skew) skews_ms.push_back(std::abs(std::chrono::duration<double, std::milli>(*pair.skew).count()));
  add_targets(pair.ordinal, recording.track_notes());
  add_decisions(pair.ordinal, recording.decisions());
}

void Frames::add_targets(std::uint64_t ordinal, std::span<const record::TrackNote> notes) {
  std::size_t there = 0;
  for (const record::TrackNote& note : notes) {
    if (static_cast<TrackState>(note.state) == TrackState::kTentative) continue;
    ++there;
    Seen& seen = targets.try_emplace(note.id, Seen{.first = ordinal}).first->second;
    seen.last = ordinal;
    ++seen.frames;
  }
  most_targets = std::max(most_targets, there);
}

void Frames::add_decisions(std::uint64_t ordinal, const record::FrameDecisions& decisions) {
  if (decisions.shed != 0) {
    ++shedding;
    shed = static_cast<EffortBits>(shed | decisions.shed);
  }
  const auto& stages = decisions.stage_us;
  const std::uint32_t all = std::accumulate(stages.begin(), stages.end(), std::uint32_t{0});
  if (all <= slowest_us) return;
  slowest_us = all;
  slowest = ordinal;
  const auto longest = std::max_element(stages.begin(), stages.end());
  slowest_stage = static_cast<Stage>(longest - stages.begin());
  slowest_stage_us = *longest;
}

Frames read_frames(record::RecordingSource& recording) {
  Frames frames;
  FramePair pair;
  for (capture::Next next = recording.next(pair); next != capture::Next::kEnd; next = recording.next(pair)) {
    if (next == capture::Next::kPair) {
      frames.add(pair, recording);
    } else {
      frames.damaged.push_back(recording.skip_reason());
    }
  }
  return frames;
}

void print_run(const record::About& about, std::ostream& out) {
  out << "  written    by " << about.program << ", cause " << about.cause << '\n';
  out << formatted("  run        rig %u, session %llu, source ", about.rig, static_cast<PrintedU64>(about.session))
      << about.source << '\n';
  out << formatted("  pictures   %dx%d ", about.width, about.height) << capture::name_of(about.format)
      << (about.stereo ? ", stereo" : ", mono");
  if (about.reduce > 1) out << formatted(", reduced %d times", about.reduce);
  if (about.every > 1) out << formatted(", every %d. pair", about.every);
  out << '\n';
}

void print_frames(const Frames& frames, std::ostream& out) {
  const double span_s = std::chrono::duration<double>(frames.end - frames.begin).count();
  out << formatted("  frames     %llu, pairs %llu to %llu, %.2f s", static_cast<PrintedU64>(frames.whole),
                   static_cast<PrintedU64>(frames.first), static_cast<PrintedU64>(frames.last), span_s);
  if (frames.whole > 1 && span_s > 0)
    out << formatted(", %.1f a second", static_cast<double>(frames.whole - 1) / span_s);
  out << formatted("; %llu missing between them, %zu damaged\n", static_cast<PrintedU64>(frames.missing),
                   frames.damaged.size());
  if (!frames.skews_ms.empty()) {
    const Percentiles skew_ms = percentiles(frames.skews_ms);
    out << formatted("  skew       median %.3f ms, largest %.3f ms\n", skew_ms.p50, skew_ms.max);
  }
  if (frames.slowest_us > 0) {
    out << formatted("  slowest    pair %llu, %.2f ms in the pipeline, of which %s %.2f ms\n",
                     static_cast<PrintedU64>(frames.slowest), frames.slowest_us / 1e3, to_string(frames.slowest_stage),
                     frames.slowest_stage_us / 1e3);
  }
  if (frames.shedding > 0) {
    out << formatted("  shed       in %llu frames:", static_cast<PrintedU64>(frames.shedding));
    for (std::size_t i = 0; i < kEfforts; ++i) {
      const auto effort = static_cast<Effort>(i);
      if (leaves_out(frames.shed, effort)) out << ' ' << to_string(effort);
    }
    out << '\n';
  }
}

void print_targets(const Frames& frames, std::ostream& out) {
  out << formatted("  targets    %zu, at most %zu at once\n", frames.targets.size(), frames.most_targets);
  for (const auto& [id, seen] : frames.targets) {
    out << formatted("             %u in pairs %llu to %llu, in %llu of them\n", id,
                     static_cast<PrintedU64>(seen.first), static_cast<PrintedU64>(seen.last),
                     static_cast<PrintedU64>(seen.frames));
  }
}

void print_messages(std::span<const record::OutputNote> notes, std::ostream& out) {
  if (notes.empty()) {
    out << "  messages   not recorded\n";
    return;
  }
  std::uint64_t predicted = 0;
  std::uint64_t missing = 0;
  for (const record::OutputNote& note : notes) {
    predicted += note.kind == static_cast<std::uint32_t>(runtime::OutputSchedule::Kind::kPredicted) ? 1 : 0;
    missing += note.kind == static_cast<std::uint32_t>(runtime::OutputSchedule::Kind::kMissing) ? 1 : 0;
  }
  out << formatted("  messages   %zu, of which %llu predicted because the result was late, %llu without a pair\n",
                   notes.size(), static_cast<PrintedU64>(predicted), static_cast<PrintedU64>(missing));
}

}  // namespace

int run_info(const InfoArguments& arguments, std::ostream& out) {
  if (!record::is_recording(arguments.recording)) {
    throw std::runtime_error(arguments.recording + ": is not a recording of a run (FILE.strec)");
  }
  record::RecordingSource recording(arguments.recording);
  const bool goes_on = !recording.keyframe().empty();
  const record::About& about = recording.about();
  out << arguments.recording << '\n';
  print_run(about, out);
  const Frames frames = read_frames(recording);
  print_frames(frames, out);
  print_targets(frames, out);
  print_messages(recording.outputs(), out);
  out << "  replay     "
      << (about.exact && goes_on && frames.damaged.empty() ? "gives the run's bytes"
          : goes_on ? "goes on from the run's state, with other frames than it had"
                    : "tracks begin anew: no keyframe")
      << '\n';
  for (const std::string& why : frames.damaged) out << "  damaged    " << why << '\n';
  if (!recording.warning().empty()) out << "  cut        " << recording.warning() << '\n';
  if (!out.flush()) throw std::runtime_error("info: could not be written; is the disk full?");
  return frames.damaged.empty() && recording.warning().empty() ? 0 : 1;
}

}  // namespace stereotrack
