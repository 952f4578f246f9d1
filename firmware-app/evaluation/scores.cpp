#include "firmware-app/evaluation/scores.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "firmware-app/evaluation/assignment.hpp"

namespace stereotrack::evaluation {
namespace {

// TrackEval compares with this slack, so that an IoU of exactly 0.5 counts.
constexpr double kSlack = std::numeric_limits<double>::epsilon();
constexpr int kThresholds = 19;  // 0.05, 0.10 ... 0.95

struct Pair {
  int truth = 0;  // index of the box in its frame
  int track = 0;
};

/// One frame after the ignored truth is gone. Identities are dense: 0 .. Sequence::truth_ids - 1.
struct Frame {
  std::vector<const MotRow*> truth;
  std::vector<const MotRow*> tracks;
  std::vector<int> truth_id;
  std::vector<int> track_id;
  Eigen::MatrixXd similarity;  // truth x tracks
};

struct Sequence {
  std::vector<Frame> frames;
  Eigen::VectorXd truth_length;  // boxes of each identity
  Eigen::VectorXd track_length;
};

double ratio(double part, double whole) { return whole > 0 ? part / whole : 0.0; }
double ratio(std::size_t part, std::size_t whole) {
  return ratio(static_cast<double>(part), static_cast<double>(whole));
}

Eigen::MatrixXd similarities(const Frame& frame) {
  Eigen::MatrixXd similarity(frame.truth.size(), frame.tracks.size());
  for (Eigen::Index i = 0; i < similarity.rows(); ++i) {
    for (Eigen::Index j = 0; j < similarity.cols(); ++j) {
      similarity(i, j) = overlap(frame.truth[i]->box, frame.tracks[j]->box);
    }
  }
  return similarity;
}

/// The best assignment without the pairs that score nothing.
std::vector<Pair> best_pairs(const Eigen::MatrixXd& score) {
  std::vector<Pair> pairs;
  const std::vector<int> column = assign_best(score);
  for (int row = 0; row < static_cast<int>(column.size()); ++row) {
    if (column[row] != kUnassigned && score(row, column[row]) > kSlack) pairs.push_back({row, column[row]});
  }
  return pairs;
}

bool is_ignored(const MotRow* truth) { return truth->confidence == 0; }

void remove_ignored(Frame& frame, double min_overlap, Scores& scores) {
  if (std::none_of(frame.truth.begin(), frame.truth.end(), is_ignored)) return;
  const Eigen::MatrixXd similarity = similarities(frame);
  const Eigen::MatrixXd score = (similarity.array() < min_overlap - kSlack).select(0.0, similarity);
  for (const Pair& pair : best_pairs(score)) {
    if (!is_ignored(frame.truth[pair.truth])) continue;
    frame.tracks[pair.track] = nullptr;
    ++scores.dropped_boxes;
  }
  std::erase(frame.tracks, nullptr);
  scores.ignored_boxes += std::erase_if(frame.truth, is_ignored);
}

/// Dense identities, in the order in which they appear.
class Identities {
 public:
  int of(std::int64_t id) { return index_.try_emplace(id, static_cast<int>(index_.size())).first->second; }
  [[nodiscard]] std::size_t size() const { return index_.size(); }

 private:
  std::map<std::int64_t, int> index_;
};

Sequence prepare(const Truth& truth, const Tracks& tracks, const Options& options, Scores& scores) {
  std::map<std::int64_t, Frame> frames;
  for (const MotRow& row : truth.rows) frames[row.frame].truth.push_back(&row);
  for (const MotRow& row : tracks.rows) frames[row.frame].tracks.push_back(&row);

  Sequence sequence;
  Identities truth_ids;
  Identities track_ids;
  for (auto& [number, frame] : frames) {
    remove_ignored(frame, options.min_overlap, scores);
    for (const MotRow* row : frame.truth) frame.truth_id.push_back(truth_ids.of(row->id));
    for (const MotRow* row : frame.tracks) frame.track_id.push_back(track_ids.of(row->id));
    frame.similarity = similarities(frame);
    scores.truth_boxes += frame.truth.size();
    scores.track_boxes += frame.tracks.size();
    sequence.frames.push_back(std::move(frame));
  }
  scores.frames = sequence.frames.size();
  scores.truth_ids = truth_ids.size();
  scores.track_ids = track_ids.size();

  sequence.truth_length.setZero(static_cast<Eigen::Index>(truth_ids.size()));
  sequence.track_length.setZero(static_cast<Eigen::Index>(track_ids.size()));
  for (const Frame& frame : sequence.frames) {
    for (const int id : frame.truth_id) sequence.truth_length(id) += 1;
    for (const int id : frame.track_id) sequence.track_length(id) += 1;
  }
  return sequence;
}

/// How well each object and track agree over the sequence, before anything is matched: a Jaccard index
/// in which an overlap shared with others in the same frame counts less.
Eigen::MatrixXd alignment(const Sequence& sequence) {
  Eigen::MatrixXd shared = Eigen::MatrixXd::Zero(sequence.truth_length.size(), sequence.track_length.size());
  for (const Frame& frame : sequence.frames) {
    const Eigen::MatrixXd& similarity = frame.similarity;
    if (similarity.size() == 0) continue;
    const Eigen::RowVectorXd of_track = similarity.colwise().sum();
    const Eigen::VectorXd of_truth = similarity.rowwise().sum();
    for (Eigen::Index i = 0; i < similarity.rows(); ++i) {
      for (Eigen::Index j = 0; j < similarity.cols(); ++j) {
        const double all = of_track(j) + of_truth(i) - similarity(i, j);
        if (all > kSlack) shared(frame.truth_id[i], frame.track_id[j]) += similarity(i, j) / all;
      }
    }
  }
  for (Eigen::Index i = 0; i < shared.rows(); ++i) {
    for (Eigen::Index j = 0; j < shared.cols(); ++j) {
      shared(i, j) /= sequence.truth_length(i) + sequence.track_length(j) - shared(i, j);
    }
  }
  return shared;
}

void score_hota(const Sequence& sequence, Scores& scores) {
  struct Match {
    int truth_id;
    int track_id;
    double similarity;
  };
  const Eigen::MatrixXd global = alignment(sequence);
  std::vector<Match> matches;
  for (const Frame& frame : sequence.frames) {
    Eigen::MatrixXd score = frame.similarity;
    for (Eigen::Index i = 0; i < score.rows(); ++i) {
      for (Eigen::Index j = 0; j < score.cols(); ++j) score(i, j) *= global(frame.truth_id[i], frame.track_id[j]);
    }
    const std::vector<int> column = assign_best(score);
    for (std::size_t row = 0; row < column.size(); ++row) {
      if (column[row] == kUnassigned) continue;
      matches.push_back({frame.truth_id[row], frame.track_id[column[row]],
                         frame.similarity(static_cast<Eigen::Index>(row), column[row])});
    }
  }

  const auto truth_boxes = static_cast<double>(scores.truth_boxes);
  const auto track_boxes = static_cast<double>(scores.track_boxes);
  for (int k = 1; k <= kThresholds; ++k) {
    const double alpha = 0.05 * k;
    std::map<std::pair<int, int>, double> count;
    double true_positives = 0;
    double similarity = 0;
    for (const Match& match : matches) {
      if (match.similarity < alpha - kSlack) continue;
      count[{match.truth_id, match.track_id}] += 1;
      true_positives += 1;
      similarity += match.similarity;
    }
    double ass_a = 0;
    double ass_re = 0;
    double ass_pr = 0;
    for (const auto& [ids, n] : count) {
      const double truth_length = sequence.truth_length(ids.first);
      const double track_length = sequence.track_length(ids.second);
      ass_a += n * n / (truth_length + track_length - n);
      ass_re += n * n / truth_length;
      ass_pr += n * n / track_length;
    }
    const double det_a = ratio(true_positives, truth_boxes + track_boxes - true_positives);
    scores.hota += std::sqrt(det_a * ratio(ass_a, true_positives));
    scores.det_a += det_a;
    scores.det_re += ratio(true_positives, truth_boxes);
    scores.det_pr += ratio(true_positives, track_boxes);
    scores.ass_a += ratio(ass_a, true_positives);
    scores.ass_re += ratio(ass_re, true_positives);
    scores.ass_pr += ratio(ass_pr, true_positives);
    scores.loc_a += true_positives > 0 ? similarity / true_positives : 1.0;
  }
  for (double* mean : {&scores.hota, &scores.det_a, &scores.ass_a, &scores.loc_a, &scores.det_re, &scores.det_pr,
                       &scores.ass_re, &scores.ass_pr}) {
    *mean /= kThresholds;
  }
}

/// Linear interpolation between order statistics; `sorted` is not empty.
double percentile(const std::vector<double>& sorted, double fraction) {
  const double place = fraction * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (place - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

class PositionErrors {
 public:
  explicit PositionErrors(double focal_baseline) : focal_baseline_(focal_baseline) {}

  void add(const MotRow& truth, const MotRow& track) {
    if (!truth.has_position) return;
    if (!track.has_position) {
      ++missing_;
      return;
    }
    constexpr double kQuarterPixel = 0.25;
    const double z = truth.position.z();
    absolute_.push_back((track.position - truth.position).norm());
    if (z > 0) relative_.push_back(absolute_.back() / z);
    if (z > 0 && focal_baseline_ > 0) {
      geometry_.push_back(absolute_.back() / (z * z / focal_baseline_ * kQuarterPixel));
    }
  }

  [[nodiscard]] PositionError summary() {
    PositionError error;
    error.pairs = absolute_.size();
    error.missing = missing_;
    error.relative_pairs = relative_.size();
    error.geometry_pairs = geometry_.size();
    std::sort(absolute_.begin(), absolute_.end());
    std::sort(relative_.begin(), relative_.end());
    std::sort(geometry_.begin(), geometry_.end());
    if (!absolute_.empty()) {
      error.median = percentile(absolute_, 0.5);
      error.p95 = percentile(absolute_, 0.95);
    }
    if (!relative_.empty()) {
      error.relative_median = percentile(relative_, 0.5);
      error.relative_p95 = percentile(relative_, 0.95);
    }
    if (!geometry_.empty()) error.geometry_median = percentile(geometry_, 0.5);
    return error;
  }

 private:
  double focal_baseline_;
  std::vector<double> absolute_;
  std::vector<double> relative_;
  std::vector<double> geometry_;
  std::size_t missing_ = 0;
};

class VelocityErrors {
 public:
  explicit VelocityErrors(const Options& options) : options_(options) {}

  void add(const MotRow& truth, const MotRow& track) {
    if (!truth.has_position || !track.has_position) return;
    constexpr std::int64_t kFrames = 10;
    auto& places = places_[{truth.id, track.id}];
    places[truth.frame] = {truth.position, track.position};
    const auto before = places.find(truth.frame - kFrames);
    if (before == places.end()) return;
    const double passed_s = kFrames / options_.fps;
    const Eigen::Vector3d true_way = truth.position - before->second.truth;
    if (true_way.norm() < options_.min_speed * passed_s) return;
    const Eigen::Vector3d way = track.position - before->second.track;
    errors_.push_back((way - true_way).norm() / true_way.norm());
  }

  [[nodiscard]] VelocityError summary() {
    if (errors_.empty()) return {};
    std::sort(errors_.begin(), errors_.end());
    return {errors_.size(), percentile(errors_, 0.5), percentile(errors_, 0.95)};
  }

 private:
  struct Places {
    Eigen::Vector3d truth;
    Eigen::Vector3d track;
  };
  Options options_;
  std::map<std::pair<std::int64_t, std::int64_t>, std::map<std::int64_t, Places>> places_;
  std::vector<double> errors_;
};

/// What CLEAR remembers of one object.
struct ObjectHistory {
  int last_track = kUnassigned;      // whenever that was: a change is a switch
  int previous_track = kUnassigned;  // in the previous frame only: such a pair is kept
  std::size_t matched = 0;
  std::size_t begun = 0;  // times it went from lost to tracked
};

void score_clear(const Sequence& sequence, const Options& options, Scores& scores) {
  // Any IoU is at most 1, so one kept pair outweighs every other wish as long as a frame has fewer boxes.
  constexpr double kKeepPair = 1000;
  std::vector<ObjectHistory> objects(scores.truth_ids);
  PositionErrors errors(options.focal_baseline);
  VelocityErrors velocities(options);
  double similarity_sum = 0;
  for (const Frame& frame : sequence.frames) {
    // As TrackEval: a frame without truth or without tracks leaves the memory of the previous one as it is.
    if (frame.similarity.size() == 0) continue;
    Eigen::MatrixXd score = frame.similarity;
    for (Eigen::Index i = 0; i < score.rows(); ++i) {
      for (Eigen::Index j = 0; j < score.cols(); ++j) {
        if (score(i, j) < options.min_overlap - kSlack) {
          score(i, j) = 0;
        } else if (objects[frame.truth_id[i]].previous_track == frame.track_id[j]) {
          score(i, j) += kKeepPair;
        }
      }
    }
    const std::vector<Pair> pairs = best_pairs(score);

    std::vector<int> tracked_by(objects.size(), kUnassigned);
    for (const Pair& pair : pairs) {
      const int track = frame.track_id[pair.track];
      ObjectHistory& object = objects[frame.truth_id[pair.truth]];
      tracked_by[frame.truth_id[pair.truth]] = track;
      if (object.last_track != kUnassigned && object.last_track != track) ++scores.identity_switches;
      if (object.previous_track == kUnassigned) ++object.begun;
      object.last_track = track;
      ++object.matched;
      similarity_sum += frame.similarity(pair.truth, pair.track);
      errors.add(*frame.truth[pair.truth], *frame.tracks[pair.track]);
      velocities.add(*frame.truth[pair.truth], *frame.tracks[pair.track]);
    }
    for (std::size_t i = 0; i < objects.size(); ++i) objects[i].previous_track = tracked_by[i];
    scores.true_positives += pairs.size();
  }

  scores.false_positives = scores.track_boxes - scores.true_positives;
  scores.false_negatives = scores.truth_boxes - scores.true_positives;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const double tracked =
        static_cast<double>(objects[i].matched) / sequence.truth_length(static_cast<Eigen::Index>(i));
    ++(tracked > 0.8 ? scores.mostly_tracked : tracked >= 0.2 ? scores.partly_tracked : scores.mostly_lost);
    if (objects[i].begun > 0) scores.fragmentations += objects[i].begun - 1;
  }
  scores.mota = ratio(static_cast<double>(scores.true_positives) - static_cast<double>(scores.false_positives) -
                          static_cast<double>(scores.identity_switches),
                      static_cast<double>(scores.truth_boxes));
  scores.motp = ratio(similarity_sum, static_cast<double>(scores.true_positives));
  scores.recall = ratio(scores.true_positives, scores.truth_boxes);
  scores.precision = ratio(scores.true_positives, scores.track_boxes);
  scores.position = errors.summary();
  scores.velocity = velocities.summary();
}

void score_identity(const Sequence& sequence, const Options& options, Scores& scores) {
  Eigen::MatrixXd together = Eigen::MatrixXd::Zero(sequence.truth_length.size(), sequence.track_length.size());
  for (const Frame& frame : sequence.frames) {
    for (Eigen::Index i = 0; i < frame.similarity.rows(); ++i) {
      for (Eigen::Index j = 0; j < frame.similarity.cols(); ++j) {
        if (frame.similarity(i, j) >= options.min_overlap) together(frame.truth_id[i], frame.track_id[j]) += 1;
      }
    }
  }
  // Fewest false positives and negatives together = most frames together: each such frame removes one of each.
  double true_positives = 0;
  for (const Pair& pair : best_pairs(together)) true_positives += together(pair.truth, pair.track);
  scores.id_true_positives = static_cast<std::size_t>(true_positives);
  scores.id_false_positives = scores.track_boxes - scores.id_true_positives;
  scores.id_false_negatives = scores.truth_boxes - scores.id_true_positives;
  scores.idr = ratio(scores.id_true_positives, scores.truth_boxes);
  scores.idp = ratio(scores.id_true_positives, scores.track_boxes);
  scores.idf1 = ratio(2 * scores.id_true_positives, scores.truth_boxes + scores.track_boxes);
}

/// The part of a box that lies within another one.
double covered(const Box& box, const Box& by) {
  const double width = std::min(box.left + box.width, by.left + by.width) - std::max(box.left, by.left);
  const double height = std::min(box.top + box.height, by.top + by.height) - std::max(box.top, by.top);
  if (width <= 0 || height <= 0) return 0.0;
  return width * height / (box.width * box.height);
}

void count_false_tracks(const Truth& truth, const Tracks& tracks, const Options& options, Scores& scores) {
  std::map<std::int64_t, std::vector<const MotRow*>> objects;
  std::int64_t last = options.frames;
  for (const MotRow& row : truth.rows) {
    objects[row.frame].push_back(&row);
    if (options.frames == 0) last = std::max(last, row.frame);
  }
  struct Rows {
    std::size_t all = 0;
    std::size_t on_object = 0;
  };
  std::map<std::int64_t, Rows> ids;
  for (const MotRow& row : tracks.rows) {
    if (options.frames == 0) last = std::max(last, row.frame);
    Rows& rows = ids[row.id];
    ++rows.all;
    const auto there = objects.find(row.frame);
    if (there == objects.end()) continue;
    rows.on_object += std::any_of(there->second.begin(), there->second.end(),
                                  [&](const MotRow* object) { return covered(row.box, object->box) >= 0.5; })
                          ? 1U
                          : 0U;
  }
  for (const auto& [id, rows] : ids) scores.false_tracks += 2 * rows.on_object < rows.all ? 1U : 0U;
  scores.false_tracks_a_minute =
      ratio(static_cast<double>(scores.false_tracks), static_cast<double>(last) / options.fps / 60);
}

}  // namespace

Scores evaluate(const Truth& truth, const Tracks& tracks, const Options& options) {
  Scores scores;
  const Sequence sequence = prepare(truth, tracks, options, scores);
  score_hota(sequence, scores);
  score_clear(sequence, options, scores);
  score_identity(sequence, options, scores);
  count_false_tracks(truth, tracks, options, scores);
  return scores;
}

}  // namespace stereotrack::evaluation
