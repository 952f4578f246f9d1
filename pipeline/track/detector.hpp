#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/geometry/rectify.hpp"
#include "pipeline/shape/blob_extractor.hpp"
#include "pipeline/shape/convex_hull.hpp"
#include "pipeline/track/decision.hpp"
#include "pipeline/track/depth_segments.hpp"
#include "pipeline/track/detection.hpp"
#include "pipeline/track/zone_rules.hpp"

namespace stereotrack {

/// Blobs and depth -> detections: candidates are split, merged and rejected.
///
/// Split: a blob falls into segments of continuous depth (DepthSegments). Where two or more confirmed targets at one
/// depth, each seen on its own before, are expected in one segment, each pixel goes to the target that explains it
/// best,
///     cost = ((x - x_t) / w_t)^2 + ((y - y_t) / h_t)^2 + min(((d - d_t) / s_t)^2, 16) + 4 q / (p_t(colour) + q),
/// p_t the part that the pixel's colour has in the target's Appearance, q = 0.02.
/// Claim: a piece belongs to the confirmed target in whose expected box it lies, if depth and looks allow: a piece may
/// be somewhat nearer or farther than the target or look somewhat different, not both. Merge: pieces that are close in
/// the picture (merge_gap; twice that, of the whole target's size, for pieces that one confirmed target claims and that
/// together do not outgrow it) and in depth (merge_depth; split_depth for pieces of one blob that no target claims),
/// and not claimed by different targets, are one object. So are two confirmed targets one above the other, at one depth
/// and of one motion, that were never far apart: an object that had come apart. Depth of a piece: median of its
/// disparities; its scatter is the median absolute deviation; its position the mean of its pixels' points (pixels
/// without disparity take the median).
///
/// Raw left picture throughout; `disparity` is given there too. One instance a thread.
/// O(pixels of the blobs x claims).
class Detector {
 public:
  static constexpr int kMaxCandidates = 256;
  static constexpr int kMaxDetections = 64;

  struct Config {
    int min_area_px = 24;          ///< 1..1e6
    double min_area_ppm = 100;     ///< and this part of the picture, 0..1e5 [1e-6]: blur grows with the resolution
    double merge_gap = 0.15;       ///< gap between boxes, as a fraction of the larger one's longer side, 0..2
    double merge_depth = 0.08;     ///< difference of disparity, as a fraction of the larger, 0..1
    double split_depth = 0.20;     ///< gap between layers, as a fraction of the disparity, 0.01..1
    double split_min_px = 2.0;     ///< and at least this much [px], 0.5..50
    double split_jump = 0.05;      ///< step between neighbours that is an edge in depth, as a fraction, 0.005..1
    double split_part = 0.02;      ///< a layer is at least this part of its blob, 0.001..0.5
    double most_scatter = 0.15;    ///< median absolute deviation of an object's disparities, as a fraction, 0.01..1
    double match_noise_px = 0.25;  ///< standard deviation of a disparity [px], 0.02..5
  };

  struct Input {
    std::span<const Blob> blobs;
    ImageView<std::uint16_t> labels;           ///< of the blobs; receives label i + 1 for detection i, 0 elsewhere
    ImageView<const std::uint16_t> disparity;  ///< 1/16 px in the raw left picture, empty for mono
    ImageView<const std::uint8_t> y;
    ImageView<const std::uint8_t> cb;  ///< empty for grey
    ImageView<const std::uint8_t> cr;
    ImageView<const std::uint8_t> strength;  ///< distance to the background, any unit
    std::span<const Prediction> predictions;
    const Rectifier* rectifier = nullptr;  ///< null for mono
    const ZoneRules* rules = nullptr;      ///< what is tracked where; null: everything everywhere
    DecisionObserver observer;             ///< of what is rejected
  };

  /// An object in the making: what is left of the blobs after splitting and merging.
  struct Candidate {
    std::uint16_t label;  ///< of its pixels in Input::labels
    std::uint16_t blob;   ///< label of the blob it was cut from
    Rect box;             ///< [px]
    int area;             ///< [px]
    bool whole;           ///< no target shares its segment of depth
    int claim;            ///< index of the confirmed prediction that explains it, -1 = none
    int valid;            ///< pixels with a disparity of their own
    bool has_depth;       ///< disparity and disparity_sd are known
    double disparity;     ///< median [px]
    double disparity_sd;  ///< [px]
    bool own_surface;     ///< set by the caller: known to be part of the background's surface
    double scatter;       ///< median absolute deviation [px]
    double reach;         ///< nine tenths of its pixels are this near the median [px]
    Appearance appearance;
    std::uint16_t root;  ///< used while merging: index of the candidate that this one goes to
    Rect united;         ///< and the box of all that go to this one
    bool grown;          ///< and whether any does
  };

  /// Faults: kBadConfig, kBadSize, kOutOfMemory.
  [[nodiscard]] static Result<Detector> create(const Config& config, int width, int height, Arena& arena) noexcept;

  /// Splits and merges. The caller may then give candidates a disparity from elsewhere (small or blurred
  /// objects, where single pixels have none) before conclude(). Valid until the next segment().
  [[nodiscard]] std::span<Candidate> segment(const Input& in) noexcept;

  /// Rejects, by in.rules last, and makes detections of the rest, largest first. Valid until the next conclude().
  [[nodiscard]] std::span<const Detection> conclude(const Input& in) noexcept;

  /// The right picture was of another instant: the detections of the last conclude() are left without depth, and none
  /// may begin a target, for they were cut and judged by it.
  void distrust_depth() noexcept;

  /// Rejected candidates of the last run.
  [[nodiscard]] const RejectionCounts& rejections() const noexcept { return rejections_; }
  [[nodiscard]] std::uint64_t hulls_reduced() const noexcept { return hull_.reduced(); }  ///< see ConvexHull

  /// What crosses frames: pipeline/core/state.hpp.
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.hull_);
  }

 private:
  struct Layer {
    double x, y, half_width, half_height;
    double disparity, disparity_sd;
    const Appearance* appearance;
    double fit;
    bool has_depth;
    int claim;
  };

  Detector(const ConvexHull& hull, const DepthSegments& segments) noexcept : hull_(hull), segments_(segments) {}
  void split(const Input& in, const Blob& blob) noexcept;
  void split_by_claims(const Input& in, const Blob& segment, std::uint16_t blob) noexcept;
  void layers_from_claims(const Input& in, const Blob& blob) noexcept;
  void drop_weak_claims(const Input& in, const Blob& blob) noexcept;
  [[nodiscard]] Candidate& whole_of(const Input& in, const Blob& blob) noexcept;
  [[nodiscard]] std::size_t choose(const Input& in, int x, int y) const noexcept;
  void add_candidate(const Input& in, std::uint16_t label, const Rect& box, int claim, std::uint16_t blob) noexcept;
  void measure(const Input& in, Candidate& candidate) noexcept;
  void merge(const Input& in) noexcept;
  [[nodiscard]] double depth_apart(const Prediction& target, const Candidate& candidate,
                                   double likeness) const noexcept;
  [[nodiscard]] bool resembles(const Prediction& target, const Candidate& candidate) const noexcept;
  [[nodiscard]] int claim_of(const Input& in, const Candidate& candidate) const noexcept;
  [[nodiscard]] bool belong_together(const Input& in, const Candidate& a, const Candidate& b,
                                     const Rect& united) const noexcept;
  [[nodiscard]] bool describe(const Input& in, const Candidate& candidate, Detection& out) noexcept;
  void reject(Rejection why) noexcept { ++rejections_[static_cast<std::size_t>(why)]; }
  void reject(const Input& in, const Candidate& candidate, Rejection why, double size_m = 0) noexcept;

  Config config_;
  int width_ = 0;
  int height_ = 0;
  int min_area_ = 0;
  std::uint16_t next_label_ = 1;
  ConvexHull hull_;
  DepthSegments segments_;
  RejectionCounts rejections_{};
  BoundedVector<Candidate> candidates_;
  BoundedVector<Detection> detections_;
  std::span<std::uint32_t> histogram_;  ///< of one candidate while it is measured, else all 0; two tables
  FixedVector<Layer, 8> layers_;
  Candidate whole_{};                ///< the segment that is being split, where area > 0
  ImageView<std::uint16_t> choice_;  ///< layer of each of its pixels
};
static_assert(RealTimeStage<Detector, &Detector::segment, &Detector::conclude>);

}  // namespace stereotrack
