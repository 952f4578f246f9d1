#include "firmware-app/stereotrack/explain.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>
#include <utility>

#include "config/error.hpp"
#include "firmware-app/formatted.hpp"

namespace stereotrack {

namespace {

// Two rounds of association of all targets and detections, and what follows: no frame has more.
constexpr std::size_t kMostDecisions = 2 * Tracker::kMaxTracks * Tracker::kMaxDetections + 8 * Tracker::kMaxTracks;
constexpr std::size_t kMostRejected = 1024;
// A detection that is this many gates away is not worth a line.
constexpr double kFarGates = 4;

std::string text_of(const Rect& box) { return formatted("%d,%d %dx%d", box.left, box.top, box.width, box.height); }

std::string text_of(const PairCost& cost, double limit) {
  return formatted("picture %.1f + depth %.1f + size %.1f + corners %.1f + looks %.1f = %.1f of %.1f", cost.picture,
                   cost.depth, cost.size, cost.corners, cost.looks, cost.sum(), limit);
}

const char* text_of(TrackState state) {
  switch (state) {
    case TrackState::kTentative: return "tentative";
    case TrackState::kConfirmed: return "confirmed";
    case TrackState::kCoasting: return "coasting";
  }
  return "";
}

// What the configuration asked for and the candidate did not have.
const char* reason(Rejection why) {
  switch (why) {
    case Rejection::kSmall: return "small: fewer pixels than objects.min_area_px or min_area_ppm";
    case Rejection::kNoTexture: return "no texture: nothing in it could be matched in the right view";
    case Rejection::kInconsistent: return "inconsistent depth: scatters more than objects.most_scatter";
    case Rejection::kShadow: return "shadow: the shadow test left too little of it";
    case Rejection::kOwnSurface: return "background's own surface: light, a mark, or the place of what has left";
    case Rejection::kNoRoom: return "no room: more candidates than the detector holds";
    case Rejection::kOutside: return "outside of objects.volume";
    case Rejection::kIgnored: return "in a zone whose targets are ignored";
    case Rejection::kUnderSize: return "under min_size_m of [objects] or of its zone";
    case Rejection::kOverSize: return "over max_size_m of [objects] or of its zone";
    case Rejection::kNoneBegin:
      return "no target begins in its zone, or in a wrong pair";  // of a detection: told as its fate
  }
  return "";
}

}  // namespace

ExplainRequest parse_explain(const std::string& text) {
  ExplainRequest request;
  if (text.find(':') != std::string::npos) {
    request.frames = parse_frames(text, "--explain");
    return request;
  }
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), request.id);
  if (error != std::errc() || end != text.data() + text.size() || request.id == 0) {
    throw config::Error("--explain " + text + ": want the id of a target, as in --explain 7, or frames, as in 100:120");
  }
  return request;
}

Explanation::Explanation(const ExplainRequest& request, const PipelineConfig& config, double unit_m)
    : request_(request), config_(config), unit_m_(unit_m) {
  decisions_.reserve(kMostDecisions);
  rejected_.reserve(kMostRejected);
}

void Explanation::decided(void* self, const Decision& decision) noexcept {
  auto& own = *static_cast<Explanation*>(self);
  if (own.decisions_.size() == own.decisions_.capacity()) {
    ++own.left_out_;
  } else {
    own.decisions_.push_back(decision);
  }
}

void Explanation::rejected(void* self, const RejectedCandidate& candidate) noexcept {
  auto& own = *static_cast<Explanation*>(self);
  if (own.rejected_.size() == own.rejected_.capacity()) {
    ++own.left_out_;
  } else {
    own.rejected_.push_back(candidate);
  }
}

void Explanation::mispaired(void* self, const WrongPair& pair) noexcept {
  static_cast<Explanation*>(self)->wrong_pair_ = pair;
}

void Explanation::frame_begins() noexcept {
  decisions_.clear();
  rejected_.clear();
  wrong_pair_.reset();
  left_out_ = 0;
}

const render::Annotation& Explanation::frame_ends(const FrameResult& result, double seconds) {
  annotation_.clear();
  const bool wanted = result.ordinal >= request_.frames.first && result.ordinal <= request_.frames.last;
  std::set<std::uint32_t> ids;
  for (const Decision& decision : decisions_) {
    const bool of_it = request_.id == 0 || decision.id == request_.id || decision.other == request_.id;
    if (wanted && of_it && decision.id != 0) ids.insert(decision.id);
  }
  if (ids.empty() && (request_.id != 0 || !wanted)) return annotation_;
  say(formatted("frame %llu, %.3f s", static_cast<unsigned long long>(result.ordinal), seconds));
  if (wrong_pair_) {
    say(formatted(
        "  wrong pair: the right picture is %.0f ms %s than the left one, told by %d target%s; no depth is taken",
        1000 * std::abs(wrong_pair_->lag_s), wrong_pair_->lag_s > 0 ? "later" : "earlier", wrong_pair_->witnesses,
        wrong_pair_->witnesses == 1 ? "" : "s"));
  }
  if (request_.id == 0) explain_detections(result);
  for (const std::uint32_t id : ids) explain_target(result, id);
  explain_rejected();
  if (left_out_ > 0) say(formatted("  %zu more decisions are left out", left_out_));
  return annotation_;
}

void Explanation::explain_detections(const FrameResult& result) {
  for (std::size_t j = 0; j < result.detections.size(); ++j) {
    const Detection& one = result.detections[j];
    std::string line =
        formatted("  detection %zu: %s, %d px, strength %.2f", j + 1, text_of(one.box).c_str(), one.area, one.strength);
    if (one.has_depth) {
      line += formatted(", disparity %.2f +- %.2f px, z ", one.disparity, one.disparity_sd) + length(one.position.z());
    } else {
      line += ", no depth";
    }
    say(line + ", " + fate(static_cast<std::uint16_t>(j + 1)));
  }
}

// What became of a detection.
std::string Explanation::fate(std::uint16_t detection) const {
  for (const Decision& decision : decisions_) {
    if (decision.detection != detection) continue;
    if (decision.kind == Decision::Kind::kTook) return formatted("taken by #%u", decision.id);
    if (decision.kind == Decision::Kind::kBorn) return formatted("new: #%u", decision.id);
    if (decision.kind == Decision::Kind::kNoneBegin) {
      return wrong_pair_ ? "no target's: none begins in a wrong pair" : "no target's: none begins in its zone";
    }
    if (decision.kind == Decision::Kind::kNoRoom) return formatted("lost: %d targets are there", Tracker::kMaxTracks);
  }
  return "no target's";
}

void Explanation::explain_target(const FrameResult& result, std::uint32_t id) {
  const auto report = std::find_if(result.tracks.begin(), result.tracks.end(),
                                   [id](const TrackReport& track) { return track.id == id; });
  std::string head = formatted("  #%u ", id);
  if (report == result.tracks.end()) {
    head += "is no more";
  } else {
    head += formatted("%s, age %.2f s, box %s, %+.0f %+.0f px/s", text_of(report->state), report->age_s,
                      text_of(report->box).c_str(), report->image_vx, report->image_vy);
    if (report->has_depth) head += ", z " + length(report->position.z());
    if (id == request_.id) last_box_ = report->box;
    if (!report->measured)
      annotation_.marks.push_back({report->box, formatted("#%u expected", id), render::Annotation::Kind::kExpected});
  }
  say(std::move(head));
  std::uint16_t taken = 0;
  for (const Decision& decision : decisions_) {
    if (decision.id == id && decision.kind == Decision::Kind::kTook) taken = decision.detection;
  }
  for (const Decision& decision : decisions_) {
    if (decision.id == id && decision.kind != Decision::Kind::kWeighed) say("    " + sentence(decision));
  }
  explain_others(result, id, taken);
}

// Detections that were compared with it and not taken.
void Explanation::explain_others(const FrameResult& result, std::uint32_t id, std::uint16_t taken) {
  const double gate = config_.track.gate * config_.track.gate;
  int far = 0;
  for (const Decision& decision : decisions_) {
    if (decision.id != id || decision.kind != Decision::Kind::kWeighed || decision.detection == taken) continue;
    if (decision.cost.picture > kFarGates * gate) {
      ++far;
      continue;
    }
    std::string why;
    switch (decision.cost.gate) {
      case PairCost::Gate::kOpen: why = text_of(decision.cost, decision.limit); break;
      case PairCost::Gate::kPicture:
        why = formatted("%+.1f %+.1f px from where it was expected to +- %.1f %.1f: %.1f, gate %.1f", decision.offset_x,
                        decision.offset_y, decision.sd_x, decision.sd_y, decision.cost.picture, gate);
        break;
      case PairCost::Gate::kDepth:
        why = formatted("%+.2f px of disparity from what was expected: %.1f, gate %.1f", decision.offset_disparity,
                        decision.cost.depth, gate);
        break;
    }
    say(formatted("    not detection %u: ", decision.detection) + why + "; " + fate(decision.detection));
    if (decision.detection <= result.detections.size()) {
      annotation_.marks.push_back({result.detections[decision.detection - 1U].box, std::to_string(decision.detection),
                                   render::Annotation::Kind::kDetection});
    }
  }
  if (far > 0) say(formatted("    %d more %s farther away", far, far == 1 ? "is" : "are"));
}

void Explanation::explain_rejected() {
  const Rect near = grown(last_box_, std::max(last_box_.width, last_box_.height) / 2);
  for (const RejectedCandidate& candidate : rejected_) {
    if (request_.id != 0 && intersect(near, candidate.box).empty()) continue;
    std::string line = formatted("  rejected %s, %d px", text_of(candidate.box).c_str(), candidate.area);
    if (candidate.has_depth) line += formatted(", disparity %.2f px", candidate.disparity);
    if (candidate.size_m > 0) line += formatted(", %.2f m long", candidate.size_m);
    say(line + ": " + reason(candidate.why));
    annotation_.marks.push_back({candidate.box, to_string(candidate.why), render::Annotation::Kind::kRejected});
  }
}

std::string Explanation::sentence(const Decision& decision) const {
  const Tracker::Config& track = config_.track;
  switch (decision.kind) {
    case Decision::Kind::kWeighed: break;
    case Decision::Kind::kTook: {
      std::string line = formatted("took detection %u, %s", decision.detection, to_string(decision.taken));
      for (const Decision& pair : decisions_) {
        const bool same = pair.kind == Decision::Kind::kWeighed && pair.id == decision.id;
        if (!same || pair.detection != decision.detection || pair.cost.gate != PairCost::Gate::kOpen) continue;
        line += formatted(": %+.1f %+.1f px from where it was expected to +- %.1f %.1f", pair.offset_x, pair.offset_y,
                          pair.sd_x, pair.sd_y);
        if (pair.cost.depth > 0) line += formatted(", disparity %+.2f px", pair.offset_disparity);
        line += "; " + text_of(pair.cost, pair.limit);
        break;
      }
      return line;
    }
    case Decision::Kind::kMissed:
      return formatted("no detection is its own: unseen for %.2f s, coasts until %.2f s", decision.unseen_s,
                       decision.limit_s);
    case Decision::Kind::kBorn: {
      std::string line = formatted("born of detection %u", decision.detection);
      if (decision.other != 0) line += formatted(", a part of #%u's region: on trial", decision.other);
      return line;
    }
    case Decision::Kind::kNoRoom: return formatted("detection %u found no room", decision.detection);
    case Decision::Kind::kNoneBegin: break;  // of no target
    case Decision::Kind::kConfirmed:
      return formatted("confirmed: %d detections, evidence %.2f, way %.1f of %.1f px", decision.hits, decision.evidence,
                       decision.way_px, decision.path_px);
    case Decision::Kind::kWaits: {
      std::string line = formatted(
          "waits: detections %d of %d, evidence %.2f of %.2f, way %.1f of %.1f px, %.0f%% of its "
          "path, wanted %.0f%%",
          decision.hits, track.confirm_hits, decision.evidence, track.confirm_evidence, decision.way_px,
          track.travel_px, decision.path_px > 0 ? 100 * decision.way_px / decision.path_px : 0.0,
          100 * track.straight_part);
      if (decision.other != 0) line += formatted("; on trial as a part of #%u's region", decision.other);
      return line;
    }
    case Decision::Kind::kRemoved: {
      std::string line = formatted("removed: %s", to_string(decision.removal));
      if (decision.removal == Removal::kUnseen) {
        line += formatted(", %.2f s of %.2f s", decision.unseen_s, decision.limit_s);
      }
      if (decision.other != 0) line += formatted(", #%u", decision.other);
      return line;
    }
  }
  return "";
}

std::string Explanation::length(double value) const {
  return unit_m_ > 0 ? formatted("%.2f m", value * unit_m_) : formatted("%.3f u", value);
}

}  // namespace stereotrack
