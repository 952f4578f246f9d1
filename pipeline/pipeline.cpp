#include "pipeline/pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "pipeline/motion/chroma_test.hpp"
#include "pipeline/motion/difference.hpp"
#include "pipeline/motion/ghost_test.hpp"
#include "pipeline/photometry/smooth.hpp"
#include "pipeline/shape/bits_kernel.hpp"
#include "pipeline/shape/region.hpp"
#include "pipeline/shape/threshold.hpp"

namespace stereotrack {

namespace {

constexpr int kMaxRuns = 65536;
// A blob of which the shadow test leaves less than this part was a shadow.
constexpr int kShadowRestPercent = 25;
// A region is a ghost, light or a mark if at least this part of its known disparities says so, and those are at
// least kEvidencePercent of its pixels.
constexpr int kVerdictPercent = 70;
constexpr int kEvidencePercent = 30;
// A region's match counts if the second best place is at least this much worse.
constexpr double kUnique = 1.5;
constexpr double kLeastCost = 9;    // of a region's match, by noise alone [grey levels squared]
constexpr double kSurePart = 0.10;  // a match less certain than this part of its disparity says nothing

// Room around a predicted disparity: standard deviations, and a fraction for targets that accelerate [px].
double room_around(const Prediction& target) noexcept {
  constexpr double kSd = 3;
  constexpr double kFraction = 0.25;
  return kSd * target.disparity_sd + kFraction * target.disparity + 3;
}

// Where a target may be, three standard deviations around what is expected.
Rect reach_of(const Prediction& target) noexcept {
  const int slack = static_cast<int>(3 * target.image_sd + 2);
  return {target.box.left - slack, target.box.top - slack, target.box.width + 2 * slack, target.box.height + 2 * slack};
}

// The nearest whole number, of a half the greater. std::floor() is a call where SSE4.1 is not taken for granted.
int nearest(float value) noexcept {
  const float up = value + 0.5F;
  const int whole = static_cast<int>(up);
  return static_cast<float>(whole) > up ? whole - 1 : whole;
}

void fill(ImageView<std::uint8_t> picture, std::uint8_t value) noexcept {
  for (int y = 0; y < picture.height; ++y) std::fill_n(picture.row(y), picture.width, value);
}

template <class T>
void fill(ImageView<T> picture, const Rect& part, T value) noexcept {
  for (int y = part.top; y < part.bottom(); ++y) std::fill_n(picture.row(y) + part.left, part.width, value);
}

// Takes what create() of a stage gave; remembers the first fault.
template <class T>
bool keep(std::optional<T>& stage, const Result<T>& made, Result<void>& outcome) noexcept {
  if (!made.has_value()) {
    outcome = fail(made.error());
    return false;
  }
  stage.emplace(*made);
  return true;
}

}  // namespace

Result<Pipeline> Pipeline::create(const PipelineConfig& config, const Setup& setup, Arena& arena) noexcept {
  if (setup.width < 16 || setup.height < 16 || setup.width > 8192 || setup.height > 8192) return fail(Fault::kBadSize);
  Pipeline self(config, setup);
  self.memory_ = MemoryUse(arena);
  const auto planes = [&](Planes& view, bool colour) {
    for (ImageView<std::uint8_t>* plane : {&view.y, &view.smooth_y, &view.distance, &view.mask}) {
      *plane = arena.image<std::uint8_t>(setup.width, setup.height);
    }
    if (!colour) return;
    for (ImageView<std::uint8_t>* plane : {&view.cb, &view.cr, &view.smooth_cb, &view.smooth_cr}) {
      *plane = arena.image<std::uint8_t>(setup.width, setup.height);
    }
  };
  planes(self.left_, setup.colour);
  self.scratch_ = arena.image<std::uint8_t>(setup.width, setup.height);
  self.moving_ = arena.image<std::uint8_t>(setup.width, setup.height);
  if (setup.calibration != nullptr) planes(self.right_, false);
  Result<void> outcome;
  if (!keep(self.ingest_, Ingest::create(setup.width, arena), outcome)) return fail(outcome.error());
  if (config.zones.any() &&
      !keep(self.zone_rules_, ZoneRules::create(config.zones, setup.width, setup.height, arena), outcome)) {
    return fail(outcome.error());
  }
  self.memory_.charge(MemoryPart::kPlanes, arena);
  self.equalise_left_ = Equalise({config.equalise});
  self.equalise_right_ = Equalise({config.equalise});
  if (const Result<void> made = self.create_foreground(arena); !made) return fail(made.error());
  if (setup.calibration != nullptr) {
    if (const Result<void> made = self.create_stereo(arena); !made) return fail(made.error());
  }
  Tracker::View view{setup.width, setup.height, static_cast<double>(setup.width), 0};
  if (self.rectifier_) {
    view.focal = self.rectifier_->geometry().f;
    view.focal_baseline = view.focal * self.rectifier_->geometry().baseline;
  }
  if (!keep(self.detector_, Detector::create(config.objects, setup.width, setup.height, arena), outcome)) {
    return fail(outcome.error());
  }
  self.memory_.charge(MemoryPart::kDetector, arena);
  if (!keep(self.tracker_, Tracker::create(config.track, config.features, view, arena), outcome)) {
    return fail(outcome.error());
  }
  self.tracker_->observe(setup.decisions);
  self.memory_.charge(MemoryPart::kTracker, arena);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

Result<void> Pipeline::create_foreground(Arena& arena) noexcept {
  const int width = setup_.width;
  const int height = setup_.height;
  const BackgroundConfig& background = config_.background;
  const ShapeConfig& shape = config_.shape;
  Result<void> outcome;
  const bool edges = background.method == ForegroundMethod::kEdges;
  if (edges) {
    const auto mean = [&] { return MeanBackground::create(background.frames, width, height, arena); };
    if (!keep(mean_y_, mean(), outcome)) return outcome;
    if (setup_.colour && !(keep(mean_cb_, mean(), outcome) && keep(mean_cr_, mean(), outcome))) return outcome;
    memory_.charge(MemoryPart::kBackground, arena);
    if (!keep(sobel_, Sobel::create({}, width, height, arena), outcome)) return outcome;
  } else {
    // Two views confirm a region by its depth, and there a lower threshold adds weak pieces that become tracks.
    AdaptiveBackground::Config adaptive = background.adaptive;
    if (setup_.calibration != nullptr) adaptive.pull = 0;
    if (!keep(background_left_, AdaptiveBackground::create(adaptive, width, height, setup_.colour, arena), outcome)) {
      return outcome;
    }
    memory_.charge(MemoryPart::kBackground, arena);
    if (!keep(foreground_left_, ForegroundMask::create(config_.foreground, width, height, arena, ignored()), outcome) ||
        !keep(closing_, Closing::create({.repeats = shape.closing}, width, height, arena), outcome)) {
      return outcome;
    }
  }
  memory_.charge(MemoryPart::kForeground, arena);
  const std::int64_t hole = edges ? ContourFill::kUnlimited : shape.hole_px;
  if (!keep(contour_fill_, ContourFill::create({.max_hole_px = hole}, width, height, arena), outcome) ||
      !keep(opening_, Opening::create({.repeats = shape.opening}, width, height, arena), outcome) ||
      !keep(
          blob_extractor_,
          BlobExtractor::create({.max_runs = kMaxRuns, .max_blobs = shape.max_blobs, .min_area_px = shape.min_blob_px},
                                width, height, arena),
          outcome)) {
    return outcome;
  }
  memory_.charge(MemoryPart::kShapes, arena);
  if (!keep(shadow_test_, ShadowTest::create(config_.shadow.test, width, height, shape.max_blobs, arena), outcome))
    return outcome;
  if (config_.shadow.method == ShadowMethod::kStereo && config_.shadow.deep && setup_.calibration == nullptr &&
      !edges &&
      !keep(umbra_test_,
            UmbraTest::create({.darkest_percent = config_.shadow.test.darkest_percent}, width, height, arena),
            outcome)) {
    return outcome;
  }
  memory_.charge(MemoryPart::kShadow, arena);
  if (shape.level_set) {
    (void)(keep(level_set_, LevelSet::create(shape.level_set_config, width, height, arena), outcome) &&
           keep(convex_hull_, ConvexHull::create({}, width, height, arena), outcome));
    memory_.charge(MemoryPart::kLevelSet, arena);
  }
  return outcome;
}

Result<void> Pipeline::create_stereo(Arena& arena) noexcept {
  const int width = setup_.width;
  const int height = setup_.height;
  Result<void> outcome;
  if (!keep(rectifier_, Rectifier::create(*setup_.calibration, width, height, arena), outcome)) return outcome;
  memory_.charge(MemoryPart::kRectifier, arena);
  const RectifiedGeometry& canvas = rectifier_->geometry();
  const DisparityConfig& disparity = config_.disparity;
  full_range_ = std::max(static_cast<int>(disparity.reach * width + 0.5), disparity.max);
  const BlockMatcher::Config blocks{.method = disparity.method,
                                    .block = disparity.block,
                                    .max = disparity.max,
                                    .region_disparities = full_range_ + 1};
  if (!keep(matcher_, BlockMatcher::create(blocks, canvas, arena), outcome)) return outcome;
  memory_.charge(MemoryPart::kMatcher, arena);
  if (!keep(region_matcher_,
            RegionMatcher::create({.width = canvas.width_left,
                                   .height = canvas.height,
                                   .right_width = canvas.width_right,
                                   .offset = canvas.offset,
                                   .disparities = full_range_ + 1},
                                  arena),
            outcome)) {
    return outcome;
  }
  memory_.charge(MemoryPart::kRegions, arena);
  const auto canvases = [&]() -> CanvasPair {
    return {LazyCanvas::create(rectifier_->table(View::kLeft), Sampling::kBilinear, arena),
            LazyCanvas::create(rectifier_->table(View::kRight), Sampling::kBilinear, arena)};
  };
  const bool adaptive = config_.background.method == ForegroundMethod::kAdaptive;
  if (adaptive) {
    AdaptiveBackground::Config background = config_.background.adaptive;
    background.pull = 0;  // as on the left
    if (!keep(background_right_, AdaptiveBackground::create(background, width, height, false, arena), outcome)) {
      return outcome;
    }
    memory_.charge(MemoryPart::kBackground, arena);
    if (!keep(foreground_right_, ForegroundMask::create(config_.foreground, width, height, arena), outcome)) {
      return outcome;
    }
    memory_.charge(MemoryPart::kForeground, arena);
    background_canvases_ = canvases();
    right_moving_ = LazyCanvas::create(rectifier_->table(View::kRight), Sampling::kNearest, arena);
  }
  canvases_ = canvases();
  memory_.charge(MemoryPart::kCanvases, arena);
  if (adaptive) {
    if (!keep(background_disparity_,
              BackgroundDisparity::create({.frames = config_.background.frames}, rectifier_->mask(View::kLeft), arena),
              outcome)) {
      return outcome;
    }
    old_disparity_ = arena.image<std::uint16_t>(width, height);
  }
  wanted_ = arena.image<std::uint8_t>(canvas.width_left, canvas.height);
  canvas_disparity_ = arena.image<std::uint16_t>(canvas.width_left, canvas.height);
  disparity_ = arena.image<std::uint16_t>(width, height);
  memory_.charge(MemoryPart::kDisparity, arena);
  return outcome;
}

Result<FrameResult> Pipeline::run(const FramePair& pair, EffortBits leave_out) noexcept {
  const bool stereo = rectifier_.has_value();
  const auto fits = [&](const Picture& picture) {
    return picture.width == setup_.width && picture.height == setup_.height &&
           fits_format(picture.format, picture.width, picture.height);
  };
  const bool both = stereo && !pair.right.empty();
  if (!fits(pair.left) || (both && !fits(pair.right))) return fail(Fault::kBadSize);
  if (setup_.colour && !has_colour(pair.left.format)) return fail(Fault::kBadFormat);
  dt_ = started_ ? std::max(seconds_between(last_time_, pair.capture_time), 0.0) : 0.0;
  last_time_ = pair.capture_time;
  started_ = true;
  left_out_ = leave_out;
  sees_both_ = both;
  rejections_ = {};
  // Without it no corner is followed, and none taken up.
  const auto corners_in = [&]() -> ImageView<const std::uint8_t> {
    return leaves_out(left_out_, Effort::kCorners) ? ImageView<const std::uint8_t>() : left_.y;
  };

  ingest(pair);  // gray 3.1, equalisation 3.2-3.5, chroma 3.17-3.19
  ended(Stage::kIngest);
  predictions_ = tracker_->predict(dt_, corners_in());  // 3.24, 3.26, 3.27: bounds the searches below
  find_foreground();           // background 3.7, difference 3.8, Sobel 3.9-3.11, threshold 3.12,
  ended(Stage::kForeground);   // contours, opening 3.13-3.15, blobs
  refine_blobs();              // convex hull 3.16, level set
  if (both) find_disparity();  // block matching 3.6, where something moves
  ended(Stage::kDisparity);
  remove_shadows();  // sigma test 3.20-3.23, or stereo first
  ended(Stage::kShadow);
  const Detector::Input objects{.blobs = blobs_.blobs,
                                .labels = blobs_.labels,
                                .disparity = disparity_now(),
                                .y = left_.y,
                                .cb = left_.cb,
                                .cr = left_.cr,
                                .strength = left_.distance,
                                .predictions = predictions_,
                                .rectifier = both ? rectifier() : nullptr,
                                .rules = zone_rules_ ? &*zone_rules_ : nullptr,
                                .observer = setup_.decisions};
  for (Detector::Candidate& candidate : detector_->segment(objects)) match_whole(candidate, objects);
  const std::span<const Detection> detections = detector_->conclude(objects);
  check_pair(detections);
  ended(Stage::kObjects);
  tracker_->update(detections, corners_in(), blobs_.labels);  // 3.25, 3.28-3.32
  ended(Stage::kTracking);
  learn_background(detections);
  ended(Stage::kBackground);

  mask_of_labels(blobs_.labels, left_.mask);
  FrameResult result;
  result.ordinal = pair.ordinal;
  result.capture_time = pair.capture_time;
  result.flags = (both ? 0U : kFlagMono) | (setup_.colour ? 0U : kFlagNoColour) |
                 (frames_ <= config_.background.frames ? kFlagLearning : 0U) | (light_change_ ? kFlagLightChange : 0U) |
                 (wrong_pair_ ? kFlagWrongPair : 0U);
  result.left_out = left_out_;
  result.tracks = tracker_->reports();
  result.mask = left_.mask;
  result.labels = blobs_.labels;
  result.detections = detections;
  for (std::size_t i = 0; i < kRejections; ++i) result.rejections[i] = rejections_[i] + detector_->rejections()[i];
  result.rejections[static_cast<std::size_t>(Rejection::kNoneBegin)] += tracker_->held_back();
  result.hulls_reduced = detector_->hulls_reduced() + (convex_hull_ ? convex_hull_->reduced() : 0);
  return result;
}

void Pipeline::ingest(const FramePair& pair) noexcept {
  const auto take = [&](const Picture& picture, const Planes& view, Equalise& equalise, std::uint8_t* copy) {
    Histogram histogram{};
    ingest_->run(picture, {view.y, view.cb, view.cr}, equalise.needs_histogram() ? &histogram : nullptr, copy);
    equalise.run(histogram, view.y);
  };
  take(pair.left, left_, equalise_left_, pair.left_copy);
  if (sees_both_) take(pair.right, right_, equalise_right_, pair.right_copy);
  if (background_left_) {
    smooth3x3(left_.y, left_.smooth_y);
    if (setup_.colour) {
      smooth3x3(left_.cb, left_.smooth_cb);
      smooth3x3(left_.cr, left_.smooth_cr);
    }
  }
  if (!sees_both_) return;
  if (background_right_) smooth3x3(right_.y, right_.smooth_y);
  canvases_.left.show(left_.y);
  canvases_.right.show(right_.y);
}

// Without a right picture nothing is known of this frame's.
ImageView<const std::uint16_t> Pipeline::disparity_now() const noexcept {
  return sees_both_ ? disparity_ : ImageView<std::uint16_t>();
}

AdaptiveBackground::Planes Pipeline::left_planes() const noexcept {
  return {left_.smooth_y, left_.smooth_cb, left_.smooth_cr};
}

void Pipeline::find_foreground() noexcept {
  if (frames_ <= config_.background.frames) ++frames_;  // no further: a rig runs for years
  if (config_.background.method == ForegroundMethod::kEdges) {
    foreground_from_edges();
  } else {
    foreground_from_model();
  }
  find_blobs(left_.mask);
  rejections_[static_cast<std::size_t>(Rejection::kSmall)] += static_cast<std::uint32_t>(blobs_.small);
}

// Closing, filling and the level set grow over what is ignored.
void Pipeline::clear_ignored(ImageView<std::uint8_t> picture) const noexcept {
  const BitMask mask = ignored();
  for (int y = 0; y < mask.height; ++y) clear_where_bits(mask.row(y), mask.width, picture.row(y));
}

// What found no room is counted, whichever part of the frame it was lost in.
void Pipeline::count_no_room(int dropped) noexcept {
  rejections_[static_cast<std::size_t>(Rejection::kNoRoom)] += static_cast<std::uint32_t>(dropped);
}

void Pipeline::find_blobs(ImageView<const std::uint8_t> mask) noexcept {
  if (const auto blobs = blob_extractor_->run(mask); blobs.has_value()) blobs_ = *blobs;
  count_no_room(blobs_.dropped_blobs + blobs_.dropped_runs);
}

void Pipeline::foreground_from_edges() noexcept {
  mean_y_->learn(left_.y);
  if (setup_.colour) {
    mean_cb_->learn(left_.cb);
    mean_cr_->learn(left_.cr);
  }
  difference(mean_y_->mean(), left_.y, left_.distance);
  clear_ignored(left_.distance);  // before edges are found: the contour of what it cuts stays closed
  (void)sobel_->run(left_.distance, scratch_);
  (void)threshold(scratch_, config_.shape.edge_threshold, scratch_);
  (void)contour_fill_->run(scratch_, scratch_);
  (void)opening_->run(scratch_, left_.mask);
  clear_ignored(left_.mask);
}

void Pipeline::foreground_from_model() noexcept {
  background_left_->distance(left_planes(), left_.distance);
  const Result<double> part = foreground_left_->run(left_.distance, moving_);
  count_no_room(foreground_left_->dropped_runs());
  light_change_ = part.has_value() && *part * 100 > config_.background.adaptive.relearn_percent;
  if (light_change_) fill(moving_, 0);
  (void)closing_->run(moving_, scratch_);
  (void)contour_fill_->run(scratch_, left_.mask);
  clear_ignored(left_.mask);
  if (!sees_both_) return;
  background_right_->distance({right_.smooth_y, {}, {}}, right_.distance);
  (void)foreground_right_->run(right_.distance, right_.mask);
  count_no_room(foreground_right_->dropped_runs());
  right_moving_.show(right_.mask);
  background_canvases_.left.show(background_left_->luma());
  background_canvases_.right.show(background_right_->luma());
  if (frames_ > 1 && config_.shadow.method == ShadowMethod::kStereo &&
      !leaves_out(left_out_, Effort::kBackgroundDisparity)) {
    background_disparity_->renew(background_canvases_, *matcher_, {0, full_range_});
  }
}

void Pipeline::refine_blobs() noexcept {
  if (!level_set_ || leaves_out(left_out_, Effort::kLevelSet)) return;
  for (Blob& blob : blobs_.blobs) {
    const Result<Hull> hull = convex_hull_->run(blobs_.labels, blob.box, blob.label);
    if (!hull.has_value()) continue;
    hull_claim(*hull, blobs_.labels, blob.label);
    const auto outcome = level_set_->run(left_.distance, blobs_.labels, blob.box, blob.label);
    if (outcome.has_value()) blob = outcome->blob;
  }
}

DisparityRange Pipeline::range_for(const Blob& blob) const noexcept {
  double low = full_range_;
  double high = 0;
  std::int64_t explained = 0;
  for (const Prediction& target : predictions_) {
    if (!target.confirmed || !target.has_depth) continue;
    const Rect common = intersect(reach_of(target), blob.box);
    if (common.empty()) continue;
    explained = std::max(explained, common.area());
    const double room = room_around(target);
    low = std::min(low, target.disparity - room);
    high = std::max(high, target.disparity + room);
  }
  // What no target explains may be anything: then the nearest distance admitted bounds the search.
  if (explained * 10 < blob.box.area() * 9) return {0, full_range_};
  return {std::max(static_cast<int>(low), 0), std::min(static_cast<int>(high) + 1, full_range_)};
}

// The region that region_matcher_ has taken, inside roi; right_moving may be an empty canvas. found: false where
// matching failed.
RegionMatch Pipeline::match_region(CanvasPair& pair, LazyCanvas& right_moving, const Rect& roi,
                                   const RegionMatcher::Search& search) noexcept {
  const Rect partners =
      grown(partners_of(roi, search.range, rectifier_->geometry().offset), region_matcher_->config().row_tolerance);
  const Result<RegionMatch> found =
      region_matcher_->match_taken(pair.left.with(roi), pair.right.with(partners), search, right_moving.with(partners));
  return found.has_value() ? *found : RegionMatch{};
}

void Pipeline::match_blob(const Blob& blob) noexcept {
  const Rect roi = rectifier_->on_left_canvas(blob.box);
  if (roi.empty()) {
    for_each_pixel(blobs_.labels, blob.box, blob.label, [&](int x, int y) {
      disparity_.at(x, y) = kNoDisparity;
      if (background_right_) old_disparity_.at(x, y) = kNoDisparity;
    });
    return;
  }
  if (disparity_mode() == DisparityMode::kRegions) {
    const ImageView<const Rectifier::Point16> raw = rectifier_->raw_from_rectified(View::kLeft);
    for (int y = roi.top; y < roi.bottom(); ++y) {
      const Rectifier::Point16* from = raw.row(y);
      std::uint8_t* wanted = wanted_.row(y);
      for (int x = roi.left; x < roi.right(); ++x) {
        wanted[x] = from[x].valid() && blobs_.labels.at(from[x].x, from[x].y) == blob.label ? 255 : 0;
      }
    }
    fill(canvas_disparity_, roi, kNoDisparity);
    (void)matcher_->run_region(canvases_, roi, wanted_, range_for(blob), canvas_disparity_);
  }
  const ImageView<const Rectifier::PointF> place = rectifier_->rectified_from_raw();
  for_each_pixel(blobs_.labels, blob.box, blob.label, [&](int x, int y) {
    const Rectifier::PointF p = place.at(x, y);
    const int u = p.valid() ? nearest(p.x) : -1;
    const int v = p.valid() ? nearest(p.y) : -1;
    const bool known = canvas_disparity_.contains(u, v);
    disparity_.at(x, y) = known ? canvas_disparity_.at(u, v) : kNoDisparity;
    if (background_right_) old_disparity_.at(x, y) = known ? background_disparity_->map().at(u, v) : kNoDisparity;
  });
}

DisparityMode Pipeline::disparity_mode() const noexcept {
  return leaves_out(left_out_, Effort::kDenseMap) ? DisparityMode::kRegions : config_.disparity.mode;
}

void Pipeline::find_disparity() noexcept {
  if (disparity_mode() == DisparityMode::kDense) (void)matcher_->run(canvases_, canvas_disparity_);
  if (level_set_ && background_right_) {  // holes that it leaves are filled later, with pixels that nobody matched
    const Rect all{0, 0, setup_.width, setup_.height};
    fill(disparity_, all, kNoDisparity);
    fill(old_disparity_, all, kNoDisparity);
  }
  for (const Blob& blob : blobs_.blobs) {
    if (blob.area > 0) match_blob(blob);
  }
}

ShadowTest::Input Pipeline::shadow_input() const noexcept {
  return {.y = left_.smooth_y,
          .cb = left_.smooth_cb,
          .cr = left_.smooth_cr,
          .y_background = background_left_->luma(),
          .cb_background = background_left_->blue(),
          .cr_background = background_left_->red(),
          .distance = left_.distance,
          .labels = blobs_.labels,
          .disparity = disparity_now(),
          .disparity_background = sees_both_ ? old_disparity_ : ImageView<std::uint16_t>()};
}

// Whether the region lies where a target may be that moves, or is a small part of any: no ghost of its own.
bool Pipeline::is_explained(const Blob& blob) const noexcept {
  constexpr double kSmallPart = 0.25;
  constexpr double kMoving = 0.1;  // of its size, in the time that a ghost needs to be learnt
  return std::any_of(predictions_.begin(), predictions_.end(), [&](const Prediction& target) {
    if (!target.confirmed || intersect(reach_of(target), blob.box).area() * 2 <= blob.box.area()) return false;
    const double way = std::max(std::abs(target.vx), std::abs(target.vy)) * dt_ * AdaptiveBackground::kGhostFrames;
    return way > kMoving * std::max(target.box.width, target.box.height) || blob.area < kSmallPart * target.area;
  });
}

// What was there has left; until its strip is renewed nothing is known of the background's disparity here.
void Pipeline::forget_disparity(const Blob& blob) noexcept {
  const ImageView<const Rectifier::PointF> place = rectifier_->rectified_from_raw();
  for_each_pixel(blobs_.labels, blob.box, blob.label, [&](int x, int y) {
    const Rectifier::PointF p = place.at(x, y);
    if (p.valid()) background_disparity_->forget(nearest(p.x), nearest(p.y));
  });
}

// Regions that are no object, as a whole: light and marks on the background's own surface, by stereo, and ghosts, by
// stereo or by their contour, of which the background is told.
void Pipeline::reject_background() noexcept {
  const ShadowTest::Input in = shadow_input();
  const GhostTest::Input look{.y = in.y,
                              .cb = in.cb,
                              .cr = in.cr,
                              .y_background = in.y_background,
                              .cb_background = in.cb_background,
                              .cr_background = in.cr_background,
                              .labels = in.labels};
  for (Blob& blob : blobs_.blobs) {
    const ShadowTest::Evidence sum = shadow_test_->evidence(in, blob.box, blob.label);
    const int known = sum.near + sum.own + sum.behind;
    const bool enough = known * 100 >= blob.area * kEvidencePercent;
    const bool behind = enough && sum.behind * 100 >= known * kVerdictPercent;
    const bool surface = enough && (sum.own + sum.behind) * 100 >= known * kVerdictPercent;
    const bool nearer = enough && sum.near * 100 >= known * kVerdictPercent;
    const bool ghost =
        !behind && !nearer && !is_explained(blob) && GhostTest::measure(look, blob.box, blob.label).is_ghost();
    if (!behind && !ghost && !(surface && resembles_background(blob.box, blob.label, blob.area))) continue;
    if (behind) forget_disparity(blob);
    for_each_pixel(blobs_.labels, blob.box, blob.label, [&](int x, int y) {
      blobs_.labels.at(x, y) = 0;
      if (behind) moving_.at(x, y) = AdaptiveBackground::kForget;
      if (ghost) moving_.at(x, y) = AdaptiveBackground::kGhost;
    });
    setup_.decisions.tell(RejectedCandidate{Rejection::kOwnSurface, blob.box, blob.area});
    blob.area = 0;
    ++rejections_[static_cast<std::size_t>(Rejection::kOwnSurface)];
  }
}

void Pipeline::remove_shadows() noexcept {
  mask_of_labels(blobs_.labels, left_.mask);
  if (config_.shadow.method == ShadowMethod::kOff) return;
  if (config_.shadow.method == ShadowMethod::kChroma) {
    if (!setup_.colour) return;
    if (mean_cb_) {
      (void)ChromaTest::run(left_.cb, left_.cr, mean_cb_->mean(), mean_cr_->mean(), left_.mask);
    } else {
      (void)ChromaTest::run(left_.smooth_cb, left_.smooth_cr, background_left_->blue(), background_left_->red(),
                            left_.mask);
    }
  } else if (background_left_) {
    (void)shadow_test_->run(shadow_input(), blobs_.blobs, left_.mask);
    if (umbra_test_) (void)umbra_test_->run(left_.smooth_y, background_left_->luma(), left_.mask);
  }
  for (const Blob& blob : blobs_.blobs) {
    std::int32_t rest = 0;
    for_each_run(blobs_.labels, blob.box, blob.label, [&](int y, int begin, int end) {
      const std::uint8_t* mask = left_.mask.row(y);
      int kept = 0;
      for (int x = begin; x < end; ++x) kept += mask[x] != 0 ? 1 : 0;
      rest += kept;
    });
    if (rest * 100 >= blob.area * kShadowRestPercent) continue;
    for_each_run(blobs_.labels, blob.box, blob.label,
                 [&](int y, int begin, int end) { std::fill(left_.mask.row(y) + begin, left_.mask.row(y) + end, 0); });
    if (blob.area <= 0) continue;
    setup_.decisions.tell(RejectedCandidate{Rejection::kShadow, blob.box, blob.area});
    ++rejections_[static_cast<std::size_t>(Rejection::kShadow)];
  }
  (void)opening_->run(left_.mask, scratch_);
  if (background_left_) (void)contour_fill_->run(scratch_, scratch_);
  clear_ignored(scratch_);
  find_blobs(scratch_);
  if (background_left_ && config_.shadow.method == ShadowMethod::kStereo) reject_background();
}

// Where single pixels tell little, because the object is small or blurred, all of its pixels are matched together.
void Pipeline::match_whole(Detector::Candidate& candidate, const Detector::Input& in) noexcept {
  if (!sees_both_) return;
  const bool sparse = !candidate.has_depth || candidate.valid * 4 < candidate.area;
  const bool small = candidate.area <= config_.disparity.small_px;
  const bool judges_surface = background_right_ && config_.shadow.method == ShadowMethod::kStereo;
  if (!sparse && !small && !judges_surface) return;
  const Rect roi = rectifier_->on_left_canvas(candidate.box);
  if (roi.empty()) return;
  LazyCanvas nowhere;
  DisparityRange range{0, full_range_};
  if (candidate.claim >= 0) {
    const Prediction& target = in.predictions[static_cast<std::size_t>(candidate.claim)];
    if (target.has_depth) {
      const double room = room_around(target);
      range.min = std::clamp(static_cast<int>(target.disparity - room), 0, full_range_);
      range.max = std::clamp(static_cast<int>(target.disparity + room) + 1, range.min, full_range_);
    }
  }
  bool taken = false;
  const auto match = [&](CanvasPair& pair, LazyCanvas& right_moving) {
    if (!taken) {
      const ImageView<const Rectifier::Point16> raw = rectifier_->raw_from_rectified(View::kLeft);
      region_matcher_->take(roi, [&](int x, int y) {
        const Rectifier::Point16 p = raw.at(x, y);
        return p.valid() && blobs_.labels.at(p.x, p.y) == candidate.label;
      });
      taken = true;
    }
    return match_region(pair, right_moving, roi, {.range = range, .enough_uniqueness = kUnique});
  };
  // Without a picture of what moves on the right, all of the region is said to fall on it.
  const auto sure = [](const RegionMatch& found) {
    return found.found && found.uniqueness >= kUnique && found.foreground_share >= 0.5;
  };
  double cost = RegionMatcher::kAnyCost;
  if (sparse || small) {
    const RegionMatch now = match(canvases_, right_moving_);
    if (now.found) cost = now.look;  // fits_at() does not ask where it moves
    // What little is known pixel by pixel is better than a vague guess at the whole of a large region.
    const bool vague = now.sigma_px > std::max(kSurePart * now.disparity_px, 1.0);
    if (sure(now) && (small || !vague || !candidate.has_depth)) {
      candidate.has_depth = true;
      candidate.disparity = now.disparity_px;
      candidate.disparity_sd = now.sigma_px;
      candidate.scatter = 0.5;
    }
  }
  if (!candidate.has_depth || !judges_surface) return;
  // What the same place of the background measures: pixel by pixel, or matched as a whole. The questions are put in
  // the order of their price.
  const auto resembles = [&] { return resembles_background(candidate.box, candidate.label, candidate.area); };
  const double limit = surface_limit(candidate.disparity, candidate.disparity_sd);
  if (const auto behind = disparity_behind(candidate.box, candidate.label, candidate.area)) {
    const bool near = candidate.disparity - *behind <= limit;
    candidate.own_surface = (near || (small && fits_at(*behind, roi, cost))) && resembles();
  } else if (resembles()) {
    const RegionMatch whole = match(background_canvases_, nowhere);
    if (!sure(whole)) return;
    const double before = whole.disparity_px;
    candidate.own_surface = candidate.disparity - before <= limit || (small && fits_at(before, roi, cost));
  }
}

// Whether the small region that region_matcher_ has taken matches about as well at this disparity as anywhere: lines
// along the rows do, wherever they are. It is known to match somewhere at `cost` at most.
bool Pipeline::fits_at(double disparity, const Rect& roi, double cost) noexcept {
  const int middle = static_cast<int>(disparity + 0.5);
  const DisparityRange near{std::max(middle - 1, 0), std::min(middle + 1, full_range_)};
  LazyCanvas nowhere;
  const auto match = [&](const RegionMatcher::Search& search) { return match_region(canvases_, nowhere, roi, search); };
  const RegionMatch here =
      match({.range = near, .most_cost = kUnique * std::max(cost, kLeastCost), .enough_uniqueness = 1});
  if (!here.found) return false;
  const RegionMatch anywhere = match({.range = {0, full_range_}, .enough_uniqueness = 1});
  return anywhere.found && here.cost <= kUnique * std::max(anywhere.cost, kLeastCost);
}

// Half of the region's pixels look like the background under another light.
bool Pipeline::resembles_background(const Rect& box, std::uint16_t label, int area) noexcept {
  return shadow_test_->count_resembling(shadow_input(), box, label) * 2 >= area;
}

void Pipeline::check_pair(std::span<const Detection> detections) noexcept {
  wrong_pair_ = false;
  if (!sees_both_) return;
  const PairCheck::Verdict verdict = pair_check_.run(predictions_, detections, dt_);
  if (!verdict.wrong) return;
  wrong_pair_ = true;
  detector_->distrust_depth();
  setup_.decisions.tell(WrongPair{verdict.lag_s, verdict.witnesses});
}

// The disparity that the background is known to have at the labelled pixels: their mean, where a third of them has one.
std::optional<double> Pipeline::disparity_behind(const Rect& box, std::uint16_t label, int area) const noexcept {
  std::int64_t sum = 0;
  int known = 0;
  for_each_run(blobs_.labels, box, label, [&](int y, int begin, int end) {
    const std::uint16_t* old = old_disparity_.row(y);
    std::uint32_t sum_of_run = 0;
    int known_of_run = 0;
    for (int x = begin; x < end; ++x) {
      const bool is_known = old[x] != kNoDisparity;
      sum_of_run += is_known ? old[x] : 0U;
      known_of_run += is_known ? 1 : 0;
    }
    sum += sum_of_run;
    known += known_of_run;
  });
  if (known == 0 || known * 3 < area) return std::nullopt;
  return static_cast<double>(sum) / known / kDisparityScale;
}

// What stands still is absorbed by a background that was seen shorter, for it may have left a wrong one behind. Where
// stereo tells that it stands before the background, that one is right.
void Pipeline::confirm_background(std::span<const Detection> detections) noexcept {
  if (!background_disparity_ || !sees_both_ || wrong_pair_) return;
  for (std::size_t i = 0; i < detections.size(); ++i) {
    const Detection& detection = detections[i];
    if (!detection.has_depth) continue;
    const auto label = static_cast<std::uint16_t>(i + 1);
    const std::optional<double> behind = disparity_behind(detection.box, label, detection.area);
    if (!behind || detection.disparity - *behind <= surface_limit(detection.disparity, detection.disparity_sd))
      continue;
    for_each_pixel(blobs_.labels, detection.box, label, [&](int x, int y) { background_left_->confirm(x, y); });
  }
}

// So much nearer than the background's surface a thing is to be to stand before it [px].
double Pipeline::surface_limit(double disparity, double disparity_sd) const noexcept {
  return std::max(config_.shadow.own_depth_px, std::min(2.5 * disparity_sd, kSurePart * disparity));
}

void Pipeline::learn_background(std::span<const Detection> detections) noexcept {
  if (!background_left_) return;
  if (light_change_) {
    background_left_->restart();
    if (background_right_) background_right_->restart();
    if (background_disparity_) background_disparity_->restart();
  }
  confirm_background(detections);
  background_left_->learn(left_planes(), moving_);
  if (background_right_ && sees_both_) background_right_->learn({right_.smooth_y, {}, {}}, right_.mask);
}

}  // namespace stereotrack
