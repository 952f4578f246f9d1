#include "pipeline/track/tracker.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/core/square.hpp"
#include "pipeline/shape/region.hpp"

namespace stereotrack {

namespace {

using Matrix2 = ConstantVelocityFilter<2>::Matrix;
using Vector2 = ConstantVelocityFilter<2>::Vector;

// Squared Mahalanobis distance that one in a hundred measurements in space has (chi-squared, 3 degrees of freedom).
constexpr double kDoubtful = 11.345;
// How long a target goes on steadily, and turns, on average [s].
constexpr double kSteadyLasts = 5.0;
constexpr double kTurnLasts = 0.2;

// Size and colour tell targets apart, but may not outweigh where they are: each adds at most this.
constexpr double kMostSoftCost = 16.0;
constexpr double kMostColourCost = 25.0;
// One standard deviation of the size between two frames, as a ratio of areas.
constexpr double kAreaRatioSd = 1.5;
// Part of a detection's colours that its target usually does not explain, and one standard deviation of it.
constexpr double kUsualStrange = 0.2;
constexpr double kStrangeSd = 0.12;
// Features that a target needs for their votes to count, and what their vote weighs.
constexpr std::size_t kVoters = 3;
constexpr double kFeatureCost = 6.0;
// How much a new feature's speed may differ from its target's, as a fraction of the distance [1/s].
constexpr double kFeatureSpeed = 0.1;
// What is left beyond the gate for looks: above, a target rather stays alone.
constexpr double kStranger = 2.0;
// A target coasts this long [s], and this part of the time for which it was seen, but never over coast_s.
constexpr double kCoastAnyway = 0.2;
constexpr double kCoastPart = 0.5;
// A distance is known for so long after it was measured [s].
constexpr double kDepthLasts = 2.0;
// A target of which less than this part would still be in the picture has left.
constexpr double kVisiblePart = 0.5;
// Twins: frames, difference of distance as a fraction, drift of their places, way together and gaps [sizes].
constexpr int kTwinFrames = 10;
constexpr double kTwinDepth = 0.04;
constexpr double kTwinDrift = 0.25;
constexpr double kTwinWay = 1.0;
constexpr double kLimbPart = 0.15;  // so small a part may swing
constexpr int kTwinStill = 30;
constexpr int kTrialFrames = 15;  // a part of another target's region is not confirmed for so long
constexpr double kTwinStacked = 0.4;
constexpr double kTwinBeside = 0.1;
// Two that were this far from each other, in sizes or in depth, are not pieces of one object.
constexpr double kApartGap = 0.5;
constexpr double kApartDepth = 0.2;
// A target may claim part of a region if it was seen on its own so often, and lately [s].
constexpr int kIndependentHits = 8;
constexpr double kClaimsFor = 0.7;
// Recovery of a target that was seen kIndependentHits times: how much its area and its looks may differ, and its
// disparity as a part; how far from where it was last seen it may be, in sizes; uncertainty of its new speed.
constexpr double kRecoverArea = 1.6;
constexpr double kRecoverStrange = 0.25;
constexpr double kRecoverDepth = 0.06;
constexpr double kRecoverReach = 1.5;
constexpr double kRecoverSpeed = 0.2;
constexpr double kRecoverAlone = 2.0;
// And what takes the place of one that was seen at most so many frames ago: overlap of the boxes.
constexpr int kOverlapMisses = 1;
constexpr double kOverlapPart = 0.4;
constexpr double kLargePart = 0.1;  // of the picture
// A part takes its region's target over if their boxes have this much of the smaller in common.
constexpr double kInPlacePart = 0.5;
// Smoothing of size and colour: a partly hidden target must not be learnt at once.
constexpr double kAppearanceRate = 0.2;
constexpr double kShrinkRate = 0.05;
constexpr double kHiddenPart = 0.6;
constexpr double kHiddenRate = 0.01;
constexpr double kLooksRate = 0.05;
constexpr double kMostLooksRate = 0.3;
constexpr double kItself = 0.6;  // part of the looks that must be known already
// A target that comes straight on hardly moves in the picture: this change of distance shows it.
constexpr double kApproachPart = 0.05;

Matrix2 centre_noise(const Tracker::Config& config, const Rect& box) noexcept {
  Matrix2 R = Matrix2::Zero();
  R(0, 0) = square(config.centre_noise_px + config.centre_noise_size * box.width);
  R(1, 1) = square(config.centre_noise_px + config.centre_noise_size * box.height);
  return R;
}

}  // namespace

Result<Tracker> Tracker::create(const Config& config, const Features::Config& features, const View& view,
                                Arena& arena) noexcept {
  if (config.confirm_hits < 1 || config.confirm_hits > 20 || config.tentative_misses < 1 || !(config.coast_s >= 0) ||
      !(config.confirm_evidence >= 0) || !(config.gate > 0) || !(config.acceleration > 0) ||
      !(config.steady_acceleration > 0) || !config.gravity.allFinite() || !(config.initial_speed > 0) ||
      !(config.centre_noise_px > 0) || !(config.centre_noise_size >= 0)) {
    return fail(Fault::kBadConfig);
  }
  if (view.width < 1 || view.height < 1 || !(view.focal > 0) || !(view.focal_baseline >= 0)) {
    return fail(Fault::kBadSize);
  }
  const Result<Features> made = Features::create(features, view.width, view.height, arena);
  if (!made) return fail(made.error());
  Tracker self(*made);
  self.config_ = config;
  self.view_ = view;
  Result<Assignment> assignment = Assignment::create(kMaxTracks, kMaxDetections, arena);
  if (!assignment) return fail(assignment.error());
  self.assignment_ = *assignment;
  self.targets_ = BoundedVector<Target>(arena.array<Target>(kMaxTracks));
  self.predictions_ = BoundedVector<Prediction>(arena.array<Prediction>(kMaxTracks));
  self.reports_ = BoundedVector<TrackReport>(arena.array<TrackReport>(kMaxTracks));
  self.costs_ = arena.array<double>(static_cast<std::size_t>(kMaxTracks) * kMaxDetections);
  self.detection_of_row_ = arena.array<int>(kMaxTracks);
  self.target_of_row_ = arena.array<int>(kMaxTracks);
  self.detection_of_column_ = arena.array<int>(kMaxDetections);
  self.detection_used_ = arena.array<unsigned char>(kMaxDetections);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

std::array<InteractingModels<3>::Model, 3> Tracker::models(double distance) const noexcept {
  return {{{.acceleration_sd = config_.steady_acceleration * distance, .lasts_s = kSteadyLasts},
           {.acceleration_sd = config_.acceleration * distance, .lasts_s = kTurnLasts},
           {.acceleration_sd = config_.steady_acceleration * distance,
            .lasts_s = kSteadyLasts,
            .acceleration = config_.gravity}}};
}

Rect Tracker::expected_box(const Target& target) noexcept {
  const Vector2 centre = target.image.position();
  return {static_cast<int>(std::floor(centre.x() - (target.width - 1) * 0.5 + 0.5)),
          static_cast<int>(std::floor(centre.y() - (target.height - 1) * 0.5 + 0.5)),
          static_cast<int>(target.width + 0.5), static_cast<int>(target.height + 0.5)};
}

std::span<const Prediction> Tracker::predict(double dt, ImageView<const std::uint8_t> luma) noexcept {
  dt_ = dt;
  predictions_.clear();
  for (Target& target : targets_) {
    target.image.predict(dt, config_.acceleration * view_.focal);
    const double distance = std::max(target.space.position().z(), 0.0);
    if (target.has_depth) {
      target.space.predict(dt, config_.acceleration * distance);
      target.motion.predict(models(distance), dt);
    }
    if (luma.empty()) {
      target.features.clear();  // a frame later they are not where their filters say
    } else {
      features_.follow(luma, dt, config_.acceleration * view_.focal, target.features);
    }
    Prediction prediction;
    prediction.id = target.id;
    prediction.confirmed = target.state != TrackState::kTentative;
    prediction.area = target.area;
    prediction.vx = target.image.velocity().x();
    prediction.vy = target.image.velocity().y();
    prediction.apart = target.apart;
    prediction.independent = target.whole_hits >= kIndependentHits && target.unseen_s <= kClaimsFor;
    prediction.box = expected_box(target);
    const Matrix2 P = target.image.position_covariance();
    prediction.image_sd = std::sqrt(std::max(P(0, 0), P(1, 1)));
    const double z = target.space.position().z();
    prediction.has_depth = target.has_depth && z > 0 && view_.focal_baseline > 0;
    if (prediction.has_depth) {
      prediction.disparity = view_.focal_baseline / z;
      prediction.disparity_sd = prediction.disparity / z * std::sqrt(target.space.position_covariance()(2, 2));
      prediction.disparity_rate = -prediction.disparity / z * target.space.velocity().z();
    }
    prediction.appearance = &target.appearance;
    prediction.disparity_reach = target.disparity_reach;
    (void)predictions_.push(prediction);
  }
  return predictions_.view();
}

// Where the target's centre is, seen through this detection, along one axis. A detection that ends inside the picture
// on one side only shows that edge; the other lies outside. Else one that is smaller than the target shows a part of
// it, and one that is larger has something added to it: the centre is known up to half the difference, and within that
// it is where it was expected.
double Tracker::centre_along(double expected, double size, int from, int to, int end) noexcept {
  const double extent = std::max<double>(size, to - from);
  const bool cut_before = from <= 0;
  const bool cut_after = to >= end;
  if (cut_before != cut_after) return (cut_before ? to - 0.5 * extent : from + 0.5 * extent) - 0.5;
  const double off = 0.5 * (from + to - 1) - expected;
  const double slack = 0.5 * std::abs(size - (to - from));
  return expected + off - std::clamp(off, -slack, slack);
}

Vector2 Tracker::centre(const Target& target, const Detection& detection) const noexcept {
  const Vector2 expected = target.image.position();
  const Rect& box = detection.box;
  return {centre_along(expected.x(), target.width, box.left, box.right(), view_.width),
          centre_along(expected.y(), target.height, box.top, box.bottom(), view_.height)};
}

bool Tracker::sees_depth(const Target& target, const Detection& detection) const noexcept {
  if (!detection.has_depth) return false;
  const double z = target.space.position().z();
  return !target.has_depth || !(z > 0) || !is_blind(detection.box, view_.focal_baseline / z);
}

Tracker::Weighed Tracker::weigh(const Target& target, const Detection& detection) const noexcept {
  Weighed pair;
  const auto innovation = target.image.innovation(centre(target, detection), centre_noise(config_, detection.box));
  // Half the step again as standard deviation along the motion: a frame may be missing without a trace.
  const Vector2 step = target.image.velocity() * (dt_ * 0.5);
  const Matrix2 S = innovation.S + step * step.transpose();
  const double determinant = S(0, 0) * S(1, 1) - S(0, 1) * S(1, 0);
  const Vector2& y = innovation.y;
  pair.offset = y;
  pair.offset_sd = {std::sqrt(std::max(S(0, 0), 0.0)), std::sqrt(std::max(S(1, 1), 0.0))};
  pair.cost.gate = PairCost::Gate::kPicture;
  if (!(determinant > 0)) return pair;
  pair.cost.picture = (S(1, 1) * y.x() * y.x() - 2 * S(0, 1) * y.x() * y.y() + S(0, 0) * y.y() * y.y()) / determinant;
  const double limit = square(config_.gate);
  if (!(pair.cost.picture <= limit)) return pair;

  const double z_predicted = target.space.position().z();
  if (target.has_depth && sees_depth(target, detection) && z_predicted > 0) {
    const double expected = view_.focal_baseline / z_predicted;
    const double expected_variance = square(expected / z_predicted) * target.space.position_covariance()(2, 2);
    const double step_d = expected / z_predicted * target.space.velocity().z() * dt_ * 0.5;
    pair.offset_disparity = detection.disparity - expected;
    pair.cost.depth =
        square(detection.disparity - expected) / (expected_variance + square(detection.disparity_sd) + square(step_d) +
                                                  square(0.5 * detection.disparity_reach) + 0.25);
    pair.cost.gate = PairCost::Gate::kDepth;
    if (!(pair.cost.depth <= limit)) return pair;
  }
  pair.cost.gate = PairCost::Gate::kOpen;
  const double ratio = detection.area > target.area ? detection.area / target.area : target.area / detection.area;
  pair.cost.size = std::min(square((ratio - 1) / kAreaRatioSd), kMostSoftCost);
  const double part = detection.area / std::max(target.area, 1.0);
  const double strange = std::max(1 - target.appearance.explains(detection.appearance, part) - kUsualStrange, 0.0);
  pair.cost.looks = std::min(square(strange / kStrangeSd), kMostColourCost);
  if (target.features.size() >= kVoters) {
    int inside = 0;
    for (const Features::Feature& feature : target.features) {
      const auto at = feature.filter.position();
      inside += at.x() >= detection.box.left && at.x() < detection.box.right() && at.y() >= detection.box.top &&
                        at.y() < detection.box.bottom()
                    ? 1
                    : 0;
    }
    pair.cost.corners = kFeatureCost * (1 - inside / static_cast<double>(target.features.size()));
  }
  return pair;
}

void Tracker::tell_pair(Decision::Kind kind, const Target& target, std::size_t detection,
                        const Weighed& pair) const noexcept {
  if (observer_.decided == nullptr) return;
  Decision said;
  said.kind = kind;
  said.id = target.id;
  said.detection = static_cast<std::uint16_t>(detection + 1);
  said.cost = pair.cost;
  said.offset_x = pair.offset.x();
  said.offset_y = pair.offset.y();
  said.sd_x = pair.offset_sd.x();
  said.sd_y = pair.offset_sd.y();
  said.offset_disparity = pair.offset_disparity;
  said.limit = cost_limit();
  observer_.tell(said);
}

void Tracker::tell(Decision::Kind kind, const Target& target, std::uint32_t other) const noexcept {
  if (observer_.decided == nullptr) return;
  Decision said;
  said.kind = kind;
  said.id = target.id;
  said.other = other;
  said.detection = target.label;
  said.unseen_s = target.unseen_s;
  said.limit_s = coast_limit_s(target);
  said.hits = target.hits;
  said.evidence = target.evidence;
  said.way_px = target.way_px;
  said.path_px = target.path_px;
  observer_.tell(said);
}

void Tracker::tell_took(const Target& target, Taken how) const noexcept {
  if (observer_.decided == nullptr) return;
  Decision said;
  said.kind = Decision::Kind::kTook;
  said.id = target.id;
  said.detection = target.label;
  said.taken = how;
  observer_.tell(said);
}

void Tracker::tell_removed(const Target& target, Removal why, std::uint32_t other) const noexcept {
  if (observer_.decided == nullptr) return;
  Decision said;
  said.kind = Decision::Kind::kRemoved;
  said.id = target.id;
  said.other = other;
  said.removal = why;
  said.unseen_s = target.unseen_s;
  said.limit_s = coast_limit_s(target);
  observer_.tell(said);
}

// Solves targets against detections that both are still free, and hands the pairs on.
template <class Wanted, class Cost, class Take>
void Tracker::assign(std::span<const Detection> detections, double alone, Wanted&& wanted, Cost&& cost,
                     Take&& take) noexcept {
  int rows = 0;
  int columns = 0;
  for (std::size_t j = 0; j < detections.size(); ++j) {
    if (detection_used_[j] == 0) detection_of_column_[static_cast<std::size_t>(columns++)] = static_cast<int>(j);
  }
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    if (!targets_[i].measured && wanted(targets_[i]))
      target_of_row_[static_cast<std::size_t>(rows++)] = static_cast<int>(i);
  }
  for (int row = 0; row < rows; ++row) {
    const Target& target = targets_[static_cast<std::size_t>(target_of_row_[static_cast<std::size_t>(row)])];
    for (int column = 0; column < columns; ++column) {
      const int j = detection_of_column_[static_cast<std::size_t>(column)];
      costs_[static_cast<std::size_t>(row * columns + column)] = cost(target, detections[static_cast<std::size_t>(j)]);
    }
  }
  assignment_.solve(costs_, rows, columns, alone, detection_of_row_);
  for (int row = 0; row < rows; ++row) {
    const int column = detection_of_row_[static_cast<std::size_t>(row)];
    if (column == Assignment::kNone) continue;
    const auto i = static_cast<std::size_t>(target_of_row_[static_cast<std::size_t>(row)]);
    const auto j = static_cast<std::size_t>(detection_of_column_[static_cast<std::size_t>(column)]);
    take(targets_[i], detections[j], static_cast<std::uint16_t>(j + 1));
    detection_used_[j] = 1;
  }
}

void Tracker::associate(std::span<const Detection> detections, bool confirmed) noexcept {
  // A pair may be as far apart as the gate, or look somewhat different, but not both.
  assign(
      detections, cost_limit(),
      [=](const Target& target) { return (target.state != TrackState::kTentative) == confirmed; },
      [this, detections](const Target& target, const Detection& detection) {
        const Weighed pair = weigh(target, detection);
        tell_pair(Decision::Kind::kWeighed, target, static_cast<std::size_t>(&detection - detections.data()), pair);
        return pair.cost.sum();
      },
      [this](Target& target, const Detection& detection, std::uint16_t label) {
        measure(target, detection, label, Taken::kAssociated);
      });
}

// Whether it was measured where the target cannot be.
bool Tracker::is_at_other_depth(const Target& target, const Detection& detection) const noexcept {
  const double z = target.space.position().z();
  if (!target.has_depth || !sees_depth(target, detection) || !(z > 0)) return false;
  const double expected = view_.focal_baseline / z;
  const double sd = expected / z * std::sqrt(target.space.position_covariance()(2, 2));
  return std::abs(detection.disparity - expected) > 3 * (sd + detection.disparity_sd) + kRecoverDepth * expected;
}

// A target that turned at once, or comes out from behind something, is where its motion did not lead: near where it was
// last seen, at its depth, of its size, and it looks the same.
double Tracker::recovery_cost(const Target& target, const Detection& detection) const noexcept {
  if (target.hits < kIndependentHits) return Assignment::kForbidden;
  const double part = detection.area / std::max(target.area, 1.0);
  if (part > kRecoverArea || part * kRecoverArea < 1) return Assignment::kForbidden;
  const double strange = 1 - target.appearance.explains(detection.appearance, part);
  if (strange > kRecoverStrange) return Assignment::kForbidden;
  if (is_at_other_depth(target, detection)) return Assignment::kForbidden;
  const double step =
      std::sqrt(square(detection.centre_x() - target.last_x) + square(detection.centre_y() - target.last_y));
  const double reach = kRecoverReach * std::max(target.width, target.height) +
                       target.image.velocity().norm() * std::min(target.unseen_s, kClaimsFor);
  return step <= reach ? step / reach + strange / kRecoverStrange : Assignment::kForbidden;
}

// What covers the place where a target was seen a moment ago, and belongs to no other, is that target, whatever it
// looks like by now: a person who walks under the camera changes depth and outline from frame to frame.
double Tracker::overlap_cost(const Target& target, const Detection& detection) const noexcept {
  if (target.misses_in_a_row > kOverlapMisses) return Assignment::kForbidden;
  if (!is_large(detection.box)) return Assignment::kForbidden;
  const double common = overlap(target.box, detection.box);
  return common >= kOverlapPart ? 1 - common : Assignment::kForbidden;
}

void Tracker::restart(Target& target, const Detection& detection, std::uint16_t label, Taken how) noexcept {
  const Vector2 now(detection.centre_x(), detection.centre_y());
  const Vector2 way = now - Vector2(target.last_x, target.last_y);
  target.image.start(now, centre_noise(config_, detection.box), config_.initial_speed * view_.focal * kRecoverSpeed,
                     way / std::max(target.unseen_s, 1e-3));
  measure(target, detection, label, how);
}

void Tracker::recover(std::span<const Detection> detections) noexcept {
  assign(
      detections, kRecoverAlone, [](const Target& target) { return target.state != TrackState::kTentative; },
      [this](const Target& target, const Detection& detection) {
        return std::min(recovery_cost(target, detection), overlap_cost(target, detection));
      },
      [this](Target& target, const Detection& detection, std::uint16_t label) {
        const bool near = recovery_cost(target, detection) <= overlap_cost(target, detection);
        restart(target, detection, label, near ? Taken::kRecovered : Taken::kOverlapped);
      });
}

bool Tracker::is_large(const Rect& box) const noexcept {
  return static_cast<double>(box.area()) >= kLargePart * view_.width * view_.height;
}

bool Tracker::is_leaving(const Target& target) const noexcept {
  const Vector2 v = target.image.velocity();
  return (target.box.left <= 0 && v.x() < 0) || (target.box.right() >= view_.width && v.x() > 0) ||
         (target.box.top <= 0 && v.y() < 0) || (target.box.bottom() >= view_.height && v.y() > 0);
}

// Where a target has lost its own detection, the largest part of its region that was taken for something new so far is
// the target.
void Tracker::take_over(std::span<const Detection> detections) noexcept {
  for (Target& target : targets_) {
    if (target.measured || target.state == TrackState::kTentative) continue;
    Target* heir = nullptr;
    for (Target& child : targets_) {
      if (child.parent != target.id || child.state != TrackState::kTentative || !child.measured) continue;
      const auto common = static_cast<double>(intersect(child.box, target.box).area());
      if (common < kInPlacePart * static_cast<double>(std::min(child.box.area(), target.box.area()))) continue;
      // What is not large has one depth: a part at another is something else, which passes before or behind.
      const bool other = is_leaving(target) || is_at_other_depth(target, detections[child.label - 1U]);
      if (other && !is_large(child.box)) continue;
      if (heir == nullptr || child.area > heir->area) heir = &child;
    }
    if (heir == nullptr) continue;
    target.width = heir->width;
    target.height = heir->height;
    target.area = heir->area;
    target.appearance = heir->appearance;
    target.disparity_reach = heir->disparity_reach;
    target.has_depth = heir->has_depth;
    target.space = heir->space;
    target.motion = heir->motion;
    target.features = heir->features;
    restart(target, detections[heir->label - 1U], heir->label, Taken::kInherited);
    tell_removed(*heir, Removal::kInherited, target.id);
    heir->hits = 0;
  }
  keep_targets([](const Target& target) { return target.hits > 0; });
}

// A target that began as a part of another's region is on trial until it is seen apart from it.
void Tracker::follow_parent(Target& target) noexcept {
  if (target.parent == 0) return;
  const auto is_parent = [&](const Target& other) { return other.id == target.parent; };
  const auto parent = std::find_if(targets_.begin(), targets_.end(), is_parent);
  if (parent == targets_.end()) {
    target.parent = 0;
    return;
  }
  if (!target.measured || !parent->measured) return;
  ++target.attached_frames;
  const double size = std::max({target.width, target.height, parent->width, parent->height});
  const bool apart = target.region != parent->region && gap(target.box, parent->box) > kTwinBeside * size;
  if (apart || target.attached_frames > kTrialFrames) target.parent = 0;
}

void Tracker::start_in_space(Target& target, const Detection& detection) const noexcept {
  const double speed = config_.initial_speed * detection.position.z();
  target.space.start(detection.position, detection.position_covariance, speed);
  const std::size_t models = config_.gravity.isZero() ? 2 : 3;
  target.motion.start(models, detection.position, detection.position_covariance, speed);
  target.has_depth = true;
}

void Tracker::measure_in_space(Target& target, const Detection& detection) const noexcept {
  const Eigen::Vector3d& z = detection.position;
  const Eigen::Matrix3d& R = detection.position_covariance;
  (void)target.space.update(z, R);
  // Half of something else, or a false match: what lies that far off is believed that much less. What is large changes
  // its depth from frame to frame.
  const double far = is_large(detection.box) ? 0 : target.motion.innovation(z, R).squared_distance();
  (void)target.motion.update(z, R * std::max(far / kDoubtful, 1.0));
}

void Tracker::measure(Target& target, const Detection& detection, std::uint16_t label, Taken how) noexcept {
  target.label = label;
  tell_took(target, how);
  const Vector2 z = centre(target, detection);
  (void)target.image.update(z, centre_noise(config_, detection.box));
  if (sees_depth(target, detection)) {
    target.depth_unseen_s = 0;
    if (target.has_depth) {
      measure_in_space(target, detection);
    } else {
      start_in_space(target, detection);
    }
  }
  target.measured = true;
  target.misses_in_a_row = 0;
  target.unseen_s = 0;
  ++target.hits;
  target.whole = detection.whole;
  target.region = detection.region;
  if (detection.whole) ++target.whole_hits;
  const double rate = target.hits < 5 ? 1.0 / target.hits : kAppearanceRate;
  // An object gets smaller little by little; one that lost half at once is partly hidden.
  const bool hidden = detection.area < kHiddenPart * target.area;
  const double shrink = target.hits < 5 ? rate : hidden ? kHiddenRate : kShrinkRate;
  target.width += (detection.box.width - target.width) * (detection.box.width > target.width ? rate : shrink);
  target.height += (detection.box.height - target.height) * (detection.box.height > target.height ? rate : shrink);
  const double known_area = target.area;
  target.area += (detection.area - target.area) * (detection.area > target.area ? rate : shrink);
  target.disparity_reach +=
      (detection.disparity_reach - target.disparity_reach) * (target.hits < 5 ? rate : kLooksRate);
  // What comes into view is learnt as it comes; what leaves is not forgotten.
  const bool cut = sides_touched(detection.box, view_.width, view_.height) != 0;
  const double grown = (detection.area - known_area) / std::max(detection.area, 1);
  const bool itself =
      target.appearance.explains(detection.appearance, detection.area / std::max(known_area, 1.0)) >= kItself;
  if (target.hits < 5) {
    target.appearance.learn(detection.appearance, rate);
  } else if (detection.whole && itself && (!cut || grown > kLooksRate)) {
    target.appearance.learn(detection.appearance, std::clamp(grown, kLooksRate, kMostLooksRate));
  }
  target.evidence += detection.strength;
  target.quality += (0.5 + 0.5 * detection.strength - target.quality) * 0.2;
  target.path_px += std::sqrt(square(z.x() - target.last_x) + square(z.y() - target.last_y));
  target.way_px = std::sqrt(square(z.x() - target.first_x) + square(z.y() - target.first_y));
  target.last_x = z.x();
  target.last_y = z.y();
  target.box = detection.box;
  target.hull = detection.hull;
  if (target.state == TrackState::kTentative && target.hits >= config_.confirm_hits &&
      target.evidence >= config_.confirm_evidence && target.parent == 0 && got_somewhere(target)) {
    target.state = TrackState::kConfirmed;
    tell(Decision::Kind::kConfirmed, target);
  } else if (target.state == TrackState::kCoasting) {
    target.state = TrackState::kConfirmed;
  } else if (target.state == TrackState::kTentative) {
    tell(Decision::Kind::kWaits, target, target.parent);
  }
}

void Tracker::renew_features(Target& target, ImageView<const std::uint8_t> luma,
                             ImageView<const std::uint16_t> labels) noexcept {
  if (target.label == 0 || luma.empty() || labels.empty()) return;
  // Features that are no longer on the object belong to something else.
  Features::Set kept;
  for (const Features::Feature& feature : target.features) {
    const int x = static_cast<int>(std::floor(feature.filter.position().x() + 0.5));
    const int y = static_cast<int>(std::floor(feature.filter.position().y() + 0.5));
    if (labels.contains(x, y) && labels.at(x, y) == target.label) (void)kept.push(feature);
  }
  target.features = kept;
  if (target.features.size() * 2 > Features::kMost) return;
  features_.refill(luma, labels, target.label, target.box, target.image.velocity(), kFeatureSpeed * view_.focal,
                   target.features);
}

void Tracker::miss(Target& target) noexcept {
  target.label = 0;
  target.whole = false;
  target.measured = false;
  ++target.misses_in_a_row;
  target.quality *= 0.9;
  if (target.state == TrackState::kConfirmed) target.state = TrackState::kCoasting;
  target.box = intersect(expected_box(target), {0, 0, view_.width, view_.height});
  target.hull.clear();
  tell(Decision::Kind::kMissed, target);
}

void Tracker::start(const Detection& detection, std::uint16_t label) noexcept {
  Target target{};
  target.label = label;
  target.id = next_id_;
  target.state = TrackState::kTentative;
  target.width = detection.box.width;
  target.height = detection.box.height;
  target.area = detection.area;
  target.first_x = detection.centre_x();
  target.first_y = detection.centre_y();
  target.last_x = target.first_x;
  target.last_y = target.first_y;
  target.first_distance = detection.has_depth ? detection.position.z() : 0;
  target.evidence = detection.strength;
  target.quality = 0.25 + 0.25 * detection.strength;
  target.appearance.learn(detection.appearance, 1);
  target.disparity_reach = detection.disparity_reach;
  target.box = detection.box;
  target.hull = detection.hull;
  target.hits = 1;
  target.whole = detection.whole;
  target.whole_hits = detection.whole ? 1 : 0;
  target.region = detection.region;
  for (const Target& other : targets_) {
    const bool shared = detection.region != 0 && other.region == detection.region;
    if (other.measured && shared && target.parent == 0) target.parent = other.id;
  }
  target.measured = true;
  target.image.start(Vector2(target.first_x, target.first_y), centre_noise(config_, detection.box),
                     config_.initial_speed * view_.focal);
  if (detection.has_depth) start_in_space(target, detection);
  if (config_.confirm_hits == 1 && config_.travel_px <= 0 && target.evidence >= config_.confirm_evidence)
    target.state = TrackState::kConfirmed;
  if (targets_.push(target)) {
    ++next_id_;
    tell(Decision::Kind::kBorn, target, target.parent);
  } else {
    ++refused_;
    tell(Decision::Kind::kNoRoom, target);
  }
}

// What begins elsewhere goes on here, confirmed or not.
void Tracker::hold_back(std::uint16_t label) noexcept {
  ++held_back_;
  if (observer_.decided == nullptr) return;
  Decision said;
  said.kind = Decision::Kind::kNoneBegin;
  said.detection = label;
  observer_.tell(said);
}

bool Tracker::close_together(const Target& a, const Target& b) const noexcept {
  const double size = std::max({a.width, a.height, b.width, b.height});
  const int shared_columns = std::min(a.box.right(), b.box.right()) - std::max(a.box.left, b.box.left);
  const bool shared = !a.whole && !b.whole;
  const bool stacked = shared_columns * 2 >= std::min(a.box.width, b.box.width);
  if (gap(a.box, b.box) > (shared ? 2.0 : (stacked ? kTwinStacked : kTwinBeside) * size)) return false;
  if (!a.has_depth || !b.has_depth) return true;
  const double za = a.space.position().z();
  const double zb = b.space.position().z();
  return std::abs(za - zb) <= kTwinDepth * std::min(za, zb);
}

// How long the target has gone along with a larger one, without a change of their places.
void Tracker::follow_twin(Target& target) noexcept {
  if (!target.measured) return;
  const Target* partner = nullptr;
  for (const Target& other : targets_) {
    const bool greater = other.area > target.area || (other.area == target.area && other.id < target.id);
    if (!greater || !other.measured || !close_together(other, target)) continue;
    if (partner == nullptr || other.id == target.twin) partner = &other;
  }
  if (partner == nullptr) {
    target.twin_frames = std::max(target.twin_frames - 1, 0);
    if (target.twin_frames == 0) target.twin = 0;
    return;
  }
  const Vector2 own = target.image.position();
  const Vector2 offset = partner->image.position() - own;
  const double size = std::max({target.width, target.height, partner->width, partner->height});
  const double drift = (offset - Vector2(target.twin_dx, target.twin_dy)).norm();
  const bool limb = target.area < kLimbPart * partner->area;
  if (target.twin != partner->id || (drift > kTwinDrift * size && !limb)) {
    target.twin = partner->id;
    target.twin_frames = 0;
    target.twin_dx = offset.x();
    target.twin_dy = offset.y();
    target.twin_from_x = own.x();
    target.twin_from_y = own.y();
  }
  ++target.twin_frames;
}

void Tracker::drop_twins() noexcept {
  for (Target& target : targets_) follow_twin(target);
  keep_targets([this](const Target& target) {
    const double way = (target.image.position() - Vector2(target.twin_from_x, target.twin_from_y)).norm();
    const bool together = way >= kTwinWay * std::max(target.width, target.height);
    const bool apart = target.twin_frames < (together ? kTwinFrames : kTwinStill);
    if (!apart) tell_removed(target, Removal::kTwin, target.twin);
    return apart;
  });
}

bool Tracker::got_somewhere(const Target& target) const noexcept {
  if (target.way_px >= config_.travel_px && target.way_px >= config_.straight_part * target.path_px) return true;
  if (!target.has_depth || target.first_distance <= 0) return false;
  return std::abs(target.space.position().z() - target.first_distance) >= kApproachPart * target.first_distance;
}

double Tracker::cost_limit() const noexcept { return square(config_.gate) + kStranger; }

// Nothing is predicted for much longer than it was seen.
double Tracker::coast_limit_s(const Target& target) const noexcept {
  return std::min(config_.coast_s, kCoastAnyway + kCoastPart * target.hits * dt_);
}

std::optional<Removal> Tracker::expired(const Target& target) const noexcept {
  if (target.measured) return std::nullopt;
  if (target.state == TrackState::kTentative) {
    if (target.misses_in_a_row < config_.tentative_misses) return std::nullopt;
    return Removal::kUnconfirmed;
  }
  if (target.unseen_s > coast_limit_s(target)) return Removal::kUnseen;
  if (static_cast<double>(target.box.area()) < kVisiblePart * target.width * target.height) return Removal::kLeft;
  return std::nullopt;
}

void Tracker::update(std::span<const Detection> detections, ImageView<const std::uint8_t> luma,
                     ImageView<const std::uint16_t> labels) noexcept {
  detections = detections.first(std::min<std::size_t>(detections.size(), kMaxDetections));
  std::fill(detection_used_.begin(), detection_used_.end(), static_cast<unsigned char>(0));
  held_back_ = 0;
  for (Target& target : targets_) {
    target.measured = false;
    target.age_s += dt_;
    target.unseen_s += dt_;
    target.depth_unseen_s += dt_;
    if (target.depth_unseen_s > kDepthLasts) target.has_depth = false;
    ++target.frames;
  }
  // Which targets are confirmed is decided before either round: a target confirmed now waits for the next frame.
  associate(detections, true);
  associate(detections, false);
  recover(detections);
  take_over(detections);
  for (Target& target : targets_) {
    if (!target.measured) miss(target);
  }
  keep_targets([this](const Target& target) {
    const std::optional<Removal> why = expired(target);
    if (why) tell_removed(target, *why);
    return !why;
  });
  for (std::size_t j = 0; j < detections.size(); ++j) {
    if (detection_used_[j] != 0) continue;
    const auto label = static_cast<std::uint16_t>(j + 1);
    if (detections[j].may_begin) {
      start(detections[j], label);
    } else {
      hold_back(label);
    }
  }
  for (Target& target : targets_) follow_parent(target);
  drop_twins();
  for (Target& target : targets_) renew_features(target, luma, labels);
  note_apart();
  report();
}

// Pieces of one object lie close together and at one depth.
void Tracker::note_apart() noexcept {
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    for (std::size_t j = 0; j < targets_.size(); ++j) {
      Target& a = targets_[i];
      const Target& b = targets_[j];
      if (i == j || !a.whole || !b.whole) continue;
      const double size = std::max({a.width, a.height, b.width, b.height});
      bool apart = gap(a.box, b.box) > kApartGap * size;
      if (a.has_depth && b.has_depth) {
        const double za = a.space.position().z();
        const double zb = b.space.position().z();
        apart = apart || std::abs(za - zb) > kApartDepth * std::min(za, zb);
      }
      if (apart) a.apart |= Prediction::bit(b.id);
    }
  }
}

void Tracker::report() noexcept {
  reports_.clear();
  for (const Target& target : targets_) {
    TrackReport out;
    out.id = target.id;
    out.state = target.state;
    out.measured = target.measured;
    out.has_depth = target.has_depth && target.motion.position().z() > 0;
    out.box = target.box;
    out.hull = target.hull;
    out.image_x = target.image.position().x();
    out.image_y = target.image.position().y();
    out.image_vx = target.image.velocity().x();
    out.image_vy = target.image.velocity().y();
    if (out.has_depth) {
      out.position = target.motion.position();
      out.velocity = target.motion.velocity();
      out.covariance = target.motion.covariance();
      const auto motion = target.motion.expected_motion(models(out.position.z()));
      out.acceleration = motion.acceleration;
      out.acceleration_sd = motion.acceleration_sd;
    }
    out.confidence = target.quality;
    out.age_s = target.age_s;
    (void)reports_.push(out);
  }
}

}  // namespace stereotrack
