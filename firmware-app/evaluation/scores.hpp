#pragma once

#include <cstddef>

#include "firmware-app/evaluation/mot_file.hpp"

namespace stereotrack::evaluation {

/// How far a track's x y z lies from the truth's, over the pairs of CLEAR where both are known.
/// Percentiles interpolate linearly between the two nearest pairs.
struct PositionError {
  std::size_t pairs = 0;    ///< pairs with both positions known; 0: the values below are 0 and mean nothing
  std::size_t missing = 0;  ///< pairs where the truth has a position and the track has none
  double median = 0;        ///< Euclidean distance [unit of the files]
  double p95 = 0;
  std::size_t relative_pairs = 0;  ///< of those, pairs whose true z is over 0
  double relative_median = 0;      ///< the distance as a fraction of the true z
  double relative_p95 = 0;
  std::size_t geometry_pairs = 0;  ///< pairs with a true z over 0, where Options::focal_baseline is known
  /// Of the distance over what a quarter of a pixel of disparity is worth there, z^2 / (f b) 0.25.
  double geometry_median = 0;
};

/// How far a track's velocity lies from the truth's, as a fraction of the true speed. Velocities are those of the
/// written places: from ten frames before to now, over the time between. Over pairs of CLEAR that were the same pair
/// ten frames before, whose places are known in both, and whose true speed is at least Options::min_speed.
struct VelocityError {
  std::size_t pairs = 0;  ///< 0: the values below are 0 and mean nothing
  double median = 0;
  double p95 = 0;
};

/// What a tracker got right. Rates are 0..1 (MOTA may be negative). Definitions are those of TrackEval
/// (github.com/JonathonLuiten/TrackEval), the MOTChallenge's own scorer; similarity is the IoU of boxes.
struct Scores {
  std::size_t frames = 0;         ///< frames in which either file has a row
  std::size_t truth_boxes = 0;    ///< scored ones
  std::size_t truth_ids = 0;      ///< objects with at least one scored box
  std::size_t ignored_boxes = 0;  ///< ground truth with confidence 0
  std::size_t track_boxes = 0;    ///< scored ones
  std::size_t track_ids = 0;
  std::size_t dropped_boxes = 0;  ///< track boxes on ignored truth: neither right nor wrong

  // HOTA (Luiten et al., "HOTA: A Higher Order Metric for Evaluating Multi-Object Tracking", 2021):
  // means over the localisation thresholds 0.05, 0.10 ... 0.95 of sqrt(DetA AssA) and its parts.
  double hota = 0;
  double det_a = 0;
  double ass_a = 0;
  double loc_a = 0;
  double det_re = 0;
  double det_pr = 0;
  double ass_re = 0;
  double ass_pr = 0;

  // CLEAR (Bernardin and Stiefelhagen, "Evaluating Multiple Object Tracking Performance", 2008).
  double mota = 0;  ///< (TP - FP - IDSW) / (TP + FN)
  double motp = 0;  ///< mean IoU of the pairs
  double recall = 0;
  double precision = 0;
  std::size_t true_positives = 0;
  std::size_t false_positives = 0;
  std::size_t false_negatives = 0;
  std::size_t identity_switches = 0;
  std::size_t fragmentations = 0;
  std::size_t mostly_tracked = 0;  ///< objects tracked in over 80 % of their boxes
  std::size_t partly_tracked = 0;
  std::size_t mostly_lost = 0;  ///< under 20 %

  // Identity (Ristani et al., "Performance Measures and a Data Set for Multi-Target, Multi-Camera
  // Tracking", 2016): one track for each object over the whole sequence.
  double idf1 = 0;
  double idp = 0;
  double idr = 0;
  std::size_t id_true_positives = 0;
  std::size_t id_false_positives = 0;
  std::size_t id_false_negatives = 0;

  PositionError position;
  VelocityError velocity;

  /// Tracks of which less than half of the boxes lie on an object: half of the box's area or more within one box of the
  /// truth, scored or not. A part of an object is no false track, a ghost or a shadow is one.
  std::size_t false_tracks = 0;
  double false_tracks_a_minute = 0;
};

struct Options {
  double min_overlap = 0.5;   ///< IoU from which two boxes may be the same (CLEAR, identity, ignored truth)
  double fps = 30;            ///< frames a second, for what goes by time
  std::int64_t frames = 0;    ///< how many the sequence has; 0: up to the last that either file names
  double focal_baseline = 0;  ///< f b of the rectified pair [px times the files' unit]; 0: not known
  double min_speed = 0.3;     ///< under that a velocity is not compared [the files' unit a second]
};

/// Scores `tracks` against `truth`. Pure; any thread; neither list needs an order. In short:
/// * Ignored truth (confidence 0): in each frame all boxes are assigned by largest total IoU; a track
///   box that falls to an ignored one, at min_overlap or more, is removed. Then the ignored are.
/// * HOTA: one assignment a frame, by IoU weighted with how well the two identities agree over the whole
///   sequence; a pair counts for every threshold that its IoU reaches.
/// * CLEAR: pairs of the previous frame stay together while their IoU allows; the rest by largest total IoU.
///   A switch is an object whose track differs from its last one, however long ago that was.
/// * False tracks: see Scores::false_tracks.
/// * Identity: tracks and objects are assigned once, by the number of frames with IoU >= min_overlap.
[[nodiscard]] Scores evaluate(const Truth& truth, const Tracks& tracks, const Options& options = {});

}  // namespace stereotrack::evaluation
