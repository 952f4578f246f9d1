#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/track/assignment.hpp"
#include "pipeline/track/decision.hpp"
#include "pipeline/track/detection.hpp"
#include "pipeline/track/features.hpp"
#include "pipeline/track/interacting_models.hpp"
#include "pipeline/track/kalman.hpp"
#include "pipeline/track/track_report.hpp"

namespace stereotrack {

/// From detections to targets with an identity (3.24-3.32).
///
/// A target is followed by filters of nearly constant velocity: one of its box centre in the raw left picture, which
/// always runs, and two of its position in space, which run while stereo sees it. The first two say where it may be
/// found, so they expect it to turn at any time and are wide. The third says where it is and how fast: it weighs how
/// steadily the target goes (interacting_models.hpp), and is what is reported. Times come from the frames' capture
/// times.
///
/// Place: a detection smaller than the target shows a part of it, a larger one has something added to it; the centre is
/// then known up to half the difference of sizes, and within that it is where it was expected. At the border of the
/// picture the edge that is seen tells. Sizes grow quickly and shrink slowly, hardly at all while half is hidden.
///
/// Association: squared Mahalanobis distance in the picture, in disparity, and of size and looks (Appearance), added
/// and solved as one assignment problem; confirmed targets first, tentative ones among what is left. The gate has room
/// for one missing frame: the distance covered in one step counts as uncertainty along the motion.
///
/// Recovery: a confirmed target without detection takes a detection without target near where it was last seen, if
/// depth, size and looks agree: it has bounced, or comes out from behind something. Its motion starts anew.
///
/// Large: so near the camera that a target fills a tenth of the picture, depth and outline change from frame to frame
/// (a person who walks under it). There, what covers the place of a target that has just been seen is that target.
///
/// Parts: what begins inside another target's region (Detection::region) is on trial: not confirmed before it was
/// seen apart from it, or for 15 frames. If meanwhile the other loses its detection, it takes over that part in its
/// place.
///
/// Features: each target carries corners of its surface, searched in the window that their own filters predict
/// (features.hpp). Those found vote for the detection in whose box they lie.
///
/// Life: a detection without a target starts a tentative one, if it may (Detection::may_begin). It is confirmed by
/// confirm_hits detections whose strengths add up to confirm_evidence, if it has got somewhere meanwhile: at least
/// travel_px in the picture and straight_part of the path it took (flicker jumps to and fro), or a twentieth of its
/// distance. tentative_misses frames in a row without detection remove it. A confirmed target without detection coasts
/// on its prediction for coast_s, but no longer than 0.2 s and half the time for which it was seen, or until it left
/// the picture.
///
/// Twins: an object that came into view in pieces has a target for each. Two that stay close together, at one depth and
/// without a change of their places, while they move by a size (10 frames; 30 for what stands still) are one object:
/// the smaller goes.
///
/// One thread. O(tracks x detections), no allocation after create().
class Tracker {
 public:
  static constexpr int kMaxTracks = 64;
  static constexpr int kMaxDetections = 64;

  struct Config {
    int confirm_hits = 3;           ///< detections that confirm a target, 1..20
    double confirm_evidence = 1.5;  ///< and the sum of their strengths (Detection::strength, 0..1), 0..20
    int tentative_misses = 2;       ///< frames without detection that remove a tentative target, 1..10
    double coast_s = 1.5;           ///< how long a confirmed target lives without detections [s], 0..60
    double gate = 4.0;              ///< association gate [standard deviations], 1..10
    double acceleration = 1.5;      ///< of who turns: process noise as a fraction of the distance [1/s^2], 0.001..100
    double steady_acceleration = 0.1;                   ///< likewise of who goes on as he went, 0.001..100
    Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< [unit/s^2], left rectified camera; 0: nothing falls
    double initial_speed = 2.0;       ///< uncertainty of a new target's speed as a fraction of its distance [1/s]
    double centre_noise_px = 0.7;     ///< noise of a box centre [px], 0.05..20
    double centre_noise_size = 0.05;  ///< and what it grows by with the box's size [1], 0..1
    double travel_px = 3.0;           ///< way in the picture that tells a target from flicker [px], 0..100
    double straight_part = 0.4;       ///< part of its path that this way must be, 0..1
  };

  /// What the tracker must know of the camera. focal in px; focal_baseline = f b, 0 for mono.
  struct View {
    int width = 0;
    int height = 0;
    double focal = 0;
    double focal_baseline = 0;
  };

  /// Faults: kBadConfig, kBadSize, kOutOfMemory.
  [[nodiscard]] static Result<Tracker> create(const Config& config, const Features::Config& features, const View& view,
                                              Arena& arena) noexcept;

  /// Moves all targets on by dt seconds (>= 0), searches their features in `luma` (raw left picture; empty: drops
  /// them) and says where they are expected.
  [[nodiscard]] std::span<const Prediction> predict(double dt, ImageView<const std::uint8_t> luma = {}) noexcept;

  /// Takes the detections of this frame in. More than kMaxDetections: the rest is not looked at. New features
  /// are taken from `luma` where labels == i + 1 for detection i; empty: none.
  void update(std::span<const Detection> detections, ImageView<const std::uint8_t> luma = {},
              ImageView<const std::uint16_t> labels = {}) noexcept;

  /// All targets, confirmed, coasting and tentative, in the order of their ids.
  [[nodiscard]] std::span<const TrackReport> reports() const noexcept { return reports_.view(); }

  /// Who is told of each decision from now on.
  void observe(const DecisionObserver& observer) noexcept { observer_ = observer; }

  /// Detections that found no room for a new target, since the start.
  [[nodiscard]] std::uint64_t refused() const noexcept { return refused_; }

  /// Detections of the last update() that are no target's and with which none may begin.
  [[nodiscard]] std::uint32_t held_back() const noexcept { return held_back_; }

  /// What crosses frames: pipeline/core/state.hpp.
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.next_id_, self.refused_, self.targets_);
  }

 private:
  struct Target {
    std::uint32_t id;
    TrackState state;
    bool measured;
    bool has_depth;
    int hits;
    std::uint64_t apart;   // see Prediction
    bool whole;            // measured in this frame, as a region of its own
    int region;            // of its detection in this frame
    std::uint32_t parent;  // id of the target of whose region it began as a part, 0 = none
    int attached_frames;   // for how long it has been so
    std::uint32_t twin;    // id of the larger target beside it that may be the same object, 0 = none
    int twin_frames;       // for how long
    double twin_dx;        // offset of the centres when that began [px]
    double twin_dy;
    double twin_from_x;  // and where it was
    double twin_from_y;
    int whole_hits;  // detections that were regions of their own
    int misses_in_a_row;
    int frames;
    double age_s;
    double unseen_s;
    double depth_unseen_s;
    double way_px;   // net, from where it began
    double path_px;  // along the way
    double first_distance;
    double last_x;
    double last_y;
    double width;
    double height;
    double area;
    double quality;
    double evidence;  // sum of the detections' strengths
    double first_x;
    double first_y;
    Appearance appearance;
    double disparity_reach;
    ConstantVelocityFilter<2> image;
    ConstantVelocityFilter<3> space;
    InteractingModels<3> motion;
    Rect box;
    FixedVector<Point, 48> hull;
    std::uint16_t label;  // its detection's, 0 = none in this frame
    Features::Set features;

    template <class Self, class Archive>
    static void visit_state(Self& self, Archive& archive) noexcept {
      archive(self.id);
      archive.bounded(self.state, TrackState::kTentative, TrackState::kCoasting);
      archive(self.measured, self.has_depth, self.hits, self.apart, self.whole, self.region, self.parent,
              self.attached_frames, self.twin, self.twin_frames, self.twin_dx, self.twin_dy, self.twin_from_x,
              self.twin_from_y, self.whole_hits, self.misses_in_a_row, self.frames, self.age_s, self.unseen_s,
              self.depth_unseen_s, self.way_px, self.path_px, self.first_distance, self.last_x, self.last_y, self.width,
              self.height, self.area, self.quality, self.evidence, self.first_x, self.first_y, self.appearance,
              self.disparity_reach, self.image, self.space, self.motion, self.box, self.hull, self.label,
              self.features);
    }
  };

  /// How a target at this distance may move: steadily, turning, falling.
  [[nodiscard]] std::array<InteractingModels<3>::Model, 3> models(double distance) const noexcept;
  void start_in_space(Target& target, const Detection& detection) const noexcept;
  void measure_in_space(Target& target, const Detection& detection) const noexcept;
  [[nodiscard]] static Rect expected_box(const Target& target) noexcept;
  [[nodiscard]] static double centre_along(double expected, double size, int from, int to, int end) noexcept;
  [[nodiscard]] bool sees_depth(const Target& target, const Detection& detection) const noexcept;
  [[nodiscard]] Eigen::Vector2d centre(const Target& target, const Detection& detection) const noexcept;
  /// A pair weighed: its cost, and how far the detection is from where the target was expected.
  struct Weighed {
    PairCost cost;
    Eigen::Vector2d offset = Eigen::Vector2d::Zero();     // [px]
    Eigen::Vector2d offset_sd = Eigen::Vector2d::Zero();  // [px]
    double offset_disparity = 0;                          // [px]
  };
  [[nodiscard]] Weighed weigh(const Target& target, const Detection& detection) const noexcept;
  void tell_pair(Decision::Kind kind, const Target& target, std::size_t detection, const Weighed& pair) const noexcept;
  void tell(Decision::Kind kind, const Target& target, std::uint32_t other = 0) const noexcept;
  void tell_took(const Target& target, Taken how) const noexcept;
  void tell_removed(const Target& target, Removal why, std::uint32_t other = 0) const noexcept;
  [[nodiscard]] double cost_limit() const noexcept;
  [[nodiscard]] double coast_limit_s(const Target& target) const noexcept;
  [[nodiscard]] bool is_at_other_depth(const Target& target, const Detection& detection) const noexcept;
  [[nodiscard]] double recovery_cost(const Target& target, const Detection& detection) const noexcept;
  [[nodiscard]] double overlap_cost(const Target& target, const Detection& detection) const noexcept;
  template <class Wanted, class Cost, class Take>
  void assign(std::span<const Detection> detections, double alone, Wanted&& wanted, Cost&& cost, Take&& take) noexcept;
  void restart(Target& target, const Detection& detection, std::uint16_t label, Taken how) noexcept;
  void recover(std::span<const Detection> detections) noexcept;
  [[nodiscard]] bool is_large(const Rect& box) const noexcept;
  [[nodiscard]] bool is_leaving(const Target& target) const noexcept;
  void take_over(std::span<const Detection> detections) noexcept;
  void follow_parent(Target& target) noexcept;
  void associate(std::span<const Detection> detections, bool confirmed) noexcept;
  void measure(Target& target, const Detection& detection, std::uint16_t label, Taken how) noexcept;
  void renew_features(Target& target, ImageView<const std::uint8_t> luma,
                      ImageView<const std::uint16_t> labels) noexcept;
  void miss(Target& target) noexcept;
  void start(const Detection& detection, std::uint16_t label) noexcept;
  void hold_back(std::uint16_t label) noexcept;
  [[nodiscard]] bool close_together(const Target& a, const Target& b) const noexcept;
  void follow_twin(Target& target) noexcept;
  void drop_twins() noexcept;
  void note_apart() noexcept;
  template <class Fn>
  void keep_targets(Fn&& wanted) noexcept {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      if (!wanted(targets_[i])) continue;
      if (kept != i) targets_[kept] = targets_[i];
      ++kept;
    }
    targets_.truncate(kept);
  }
  [[nodiscard]] bool got_somewhere(const Target& target) const noexcept;
  [[nodiscard]] std::optional<Removal> expired(const Target& target) const noexcept;
  void report() noexcept;

  explicit Tracker(const Features& features) noexcept : features_(features) {}

  Config config_;
  View view_;
  double dt_ = 0;
  std::uint32_t next_id_ = 1;
  std::uint64_t refused_ = 0;
  std::uint32_t held_back_ = 0;
  BoundedVector<Target> targets_;
  BoundedVector<Prediction> predictions_;
  BoundedVector<TrackReport> reports_;
  std::span<double> costs_;
  std::span<int> detection_of_row_;
  std::span<int> target_of_row_;
  std::span<int> detection_of_column_;
  std::span<unsigned char> detection_used_;
  Assignment assignment_;
  Features features_;
  DecisionObserver observer_;
};
static_assert(RealTimeStage<Tracker, &Tracker::predict, &Tracker::update, &Tracker::reports>);

}  // namespace stereotrack
