#include "tests/bench/opencv_pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace stereotrack::bench {

namespace {

constexpr int kPatch = 9;                // side [px]
constexpr int kSearch = 24;              // the window never reaches further [px]
constexpr std::size_t kFeatures = 4;     // a target
constexpr double kMostDifference = 14;   // root mean square, above which a feature is lost [grey levels]
constexpr float kFeatureNoise = 0.5F;    // [px]
constexpr float kCentreNoise = 1.5F;     // [px]
constexpr float kAcceleration = 300.0F;  // [px/s^2]
constexpr int kMostMisses = 45;          // frames
constexpr int kTentativeMisses = 2;      // frames
constexpr std::size_t kMostTargets = 64;
constexpr float kSmoothing = 1.0F;  // of the contour [px]

// Constant velocity of `n` coordinates: state (p, v), measured p.
cv::KalmanFilter constant_velocity(int n, const float* start, float noise) {
  cv::KalmanFilter filter(2 * n, n, 0, CV_32F);
  cv::setIdentity(filter.measurementMatrix);
  cv::setIdentity(filter.measurementNoiseCov, noise * noise);
  cv::setIdentity(filter.errorCovPost, 1e4);
  for (int i = 0; i < n; ++i) {
    filter.statePost.at<float>(i) = start[i];
    filter.errorCovPost.at<float>(i, i) = noise * noise;
  }
  return filter;
}

void predict(cv::KalmanFilter& filter, float dt) {
  const int n = filter.measurementMatrix.rows;
  const float q = kAcceleration * kAcceleration;
  for (int i = 0; i < n; ++i) {
    filter.transitionMatrix.at<float>(i, n + i) = dt;
    filter.processNoiseCov.at<float>(i, i) = q * dt * dt * dt * dt / 4;
    filter.processNoiseCov.at<float>(i, n + i) = q * dt * dt * dt / 2;
    filter.processNoiseCov.at<float>(n + i, i) = q * dt * dt * dt / 2;
    filter.processNoiseCov.at<float>(n + i, n + i) = q * dt * dt;
  }
  filter.predict();
}

cv::Point2f centre(const cv::Rect& box) {
  return {static_cast<float>(box.x) + static_cast<float>(box.width) / 2,
          static_cast<float>(box.y) + static_cast<float>(box.height) / 2};
}

cv::Rect around(cv::Point2f middle, int side) {
  return {cvRound(middle.x) - side / 2, cvRound(middle.y) - side / 2, side, side};
}

cv::Rect grown(const cv::Rect& box, int by) {
  return {box.x - by, box.y - by, box.width + 2 * by, box.height + 2 * by};
}

}  // namespace

const char* to_string(CvStep step) noexcept {
  constexpr std::array<const char*, kCvSteps> kNames{"colour",   "equalise",    "rectify", "background",
                                                     "edges",    "contours",    "opening", "level_set",
                                                     "matching", "chroma_test", "depth",   "tracking"};
  return kNames[static_cast<std::size_t>(step)];
}

OpenCvPipeline::OpenCvPipeline(const Config& config, const Rig& rig, const CvObserver& observer)
    : config_(config), observer_(observer), picture_({0, 0}, rig.size), K1_(rig.K1), D1_(rig.D1) {
  cv::Mat R2;
  cv::Mat P2;
  cv::Mat Q;
  cv::stereoRectify(rig.K1, rig.D1, rig.K2, rig.D2, rig.size, rig.R, rig.T, R1_, R2, P1_, P2, Q,
                    cv::CALIB_ZERO_DISPARITY);
  focal_baseline_ = -P2.at<double>(0, 3);
  // Measured: with maps of floats remap takes two thirds of what it takes with its fixed-point ones.
  cv::initUndistortRectifyMap(rig.K1, rig.D1, R1_, P1_, rig.size, CV_32FC1, left_maps_[0], left_maps_[1]);
  cv::initUndistortRectifyMap(rig.K2, rig.D2, R2, P2, rig.size, CV_32FC1, right_maps_[0], right_maps_[1]);
  matcher_ = cv::StereoBM::create(config.disparities, config.block);
  kernel_ = cv::getStructuringElement(cv::MORPH_RECT, {3, 3});
  for (std::size_t i = 0; i < 3; ++i) {
    sums_[i] = cv::Mat::zeros(rig.size, CV_32F);
    means_[i] = cv::Mat::zeros(rig.size, CV_8U);
  }
  region_buffer_.create(rig.size, CV_8U);
  phi_buffer_.create(rig.size, CV_32F);
  feature_buffer_.create(rig.size, CV_32F);
}

void OpenCvPipeline::run(const cv::Mat& left_bgr, const cv::Mat& right_bgr, double dt) {
  cv::cvtColor(left_bgr, ycrcb_, cv::COLOR_BGR2YCrCb);  // its Y is the gray picture, too
  cv::split(ycrcb_, planes_.data());
  cv::cvtColor(right_bgr, right_gray_, cv::COLOR_BGR2GRAY);
  ended(CvStep::kColour);
  cv::equalizeHist(planes_[0], planes_[0]);
  cv::equalizeHist(right_gray_, right_gray_);
  ended(CvStep::kEqualise);
  cv::remap(planes_[0], left_canvas_, left_maps_[0], left_maps_[1], cv::INTER_LINEAR);
  cv::remap(right_gray_, right_canvas_, right_maps_[0], right_maps_[1], cv::INTER_LINEAR);
  ended(CvStep::kRectify);
  learn_background();
  ended(CvStep::kBackground);
  find_edges();
  ended(CvStep::kEdges);
  fill_contours();
  ended(CvStep::kContours);
  cv::morphologyEx(filled_, opened_, cv::MORPH_OPEN, kernel_);
  label(opened_);
  ended(CvStep::kOpening);
  refine_blobs();
  ended(CvStep::kLevelSet);
  matcher_->compute(left_canvas_, right_canvas_, disparity_);
  ended(CvStep::kMatching);
  test_chroma();
  ended(CvStep::kChromaTest);
  measure_depth();
  ended(CvStep::kDepth);
  track(dt);
  ended(CvStep::kTracking);
}

void OpenCvPipeline::learn_background() {
  if (learnt_ >= config_.background_frames) return;
  ++learnt_;
  for (std::size_t i = 0; i < 3; ++i) {
    cv::accumulate(planes_[i], sums_[i]);
    sums_[i].convertTo(means_[i], CV_8U, 1.0 / learnt_);
  }
}

void OpenCvPipeline::find_edges() {
  cv::absdiff(planes_[0], means_[0], difference_);
  cv::Sobel(difference_, gradient_x_, CV_32F, 1, 0, 3, 1, 0, cv::BORDER_REPLICATE);
  cv::Sobel(difference_, gradient_y_, CV_32F, 0, 1, 3, 1, 0, cv::BORDER_REPLICATE);
  cv::magnitude(gradient_x_, gradient_y_, magnitude_);
  cv::compare(magnitude_, static_cast<double>(config_.edge_threshold), edges_, cv::CMP_GE);
}

void OpenCvPipeline::fill_contours() {
  cv::findContours(edges_, contours_, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_SIMPLE);
  filled_.create(edges_.size(), CV_8U);
  filled_.setTo(0);
  cv::drawContours(filled_, contours_, -1, 255, cv::FILLED);
}

void OpenCvPipeline::label(const cv::Mat& mask) {
  // Measured: a third of what the default algorithm takes.
  (void)cv::connectedComponentsWithStats(mask, labels_, stats_, centroids_, 8, CV_32S, cv::CCL_BBDT);
}

void OpenCvPipeline::refine_blobs() {
  objects_.create(opened_.size(), CV_8U);
  objects_.setTo(0);
  int blobs = 0;
  for (int i = 1; i < stats_.rows && blobs < config_.max_blobs; ++i) {
    const int* s = stats_.ptr<int>(i);
    if (s[cv::CC_STAT_AREA] < config_.min_blob_px) continue;
    ++blobs;
    const cv::Rect box(s[cv::CC_STAT_LEFT], s[cv::CC_STAT_TOP], s[cv::CC_STAT_WIDTH], s[cv::CC_STAT_HEIGHT]);
    const cv::Rect roi = grown(box, config_.level_set_margin_px) & picture_;
    cv::Mat region = region_buffer_(cv::Rect({0, 0}, roi.size()));
    cv::compare(labels_(roi), i, region, cv::CMP_EQ);
    cv::findContours(region, contours_, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_SIMPLE);
    points_.clear();
    for (const auto& contour : contours_) points_.insert(points_.end(), contour.begin(), contour.end());
    cv::convexHull(points_, hull_);
    region.setTo(0);
    cv::fillConvexPoly(region, hull_, 255);
    evolve(roi);
    cv::bitwise_or(objects_(roi), region, objects_(roi));
  }
}

// Chan and Vese's model with the selective binary and Gaussian regularised level set of Zhang and others (2010), the
// cheapest composition of it: phi is +-1, takes a step along the force, is smoothed, and its sign is the new region.
void OpenCvPipeline::evolve(const cv::Rect& roi) {
  const cv::Rect part({0, 0}, roi.size());
  cv::Mat region = region_buffer_(part);
  cv::Mat phi = phi_buffer_(part);
  cv::Mat feature = feature_buffer_(part);
  const cv::Mat difference = difference_(roi);
  difference.convertTo(feature, CV_32F);
  const double total = cv::sum(difference)[0];
  const int all = roi.area();
  for (int i = 0; i < config_.level_set_iterations; ++i) {
    const int inside = cv::countNonZero(region);
    if (inside == 0 || inside == all) return;
    const double mean_in = cv::mean(difference, region)[0];
    const double mean_out = (total - mean_in * inside) / (all - inside);
    // (I - out)^2 - (I - in)^2 = 2 (in - out) (I - (in + out) / 2), scaled to about +-1.
    const double contrast = mean_in - mean_out;
    const double scale = contrast / std::max(contrast * contrast, 1.0);
    region.convertTo(phi, CV_32F, 2.0 / 255, -1.0);
    cv::addWeighted(feature, 2 * scale, phi, 1.0, -scale * (mean_in + mean_out), phi);
    cv::GaussianBlur(phi, phi, {5, 5}, kSmoothing, kSmoothing, cv::BORDER_REPLICATE | cv::BORDER_ISOLATED);
    cv::compare(phi, 0.0, region, cv::CMP_GT);
  }
}

void OpenCvPipeline::test_chroma() {
  cv::Scalar mean;
  cv::Scalar sigma;
  const auto looks_alike = [&](std::size_t plane, cv::Mat& same) {
    cv::meanStdDev(planes_[plane], mean, sigma, objects_);
    cv::absdiff(planes_[plane], means_[plane], chroma_difference_);
    cv::compare(chroma_difference_, sigma[0], same, cv::CMP_LT);
  };
  looks_alike(2, same_blue_);
  looks_alike(1, same_red_);
  cv::bitwise_and(same_blue_, same_red_, same_blue_);
  objects_.setTo(0, same_blue_);
  cv::morphologyEx(objects_, objects_, cv::MORPH_OPEN, kernel_);
  label(objects_);
}

void OpenCvPipeline::measure_depth() {
  detections_.clear();
  for (int i = 1; i < stats_.rows && detections_.size() < kMostTargets; ++i) {
    const int* s = stats_.ptr<int>(i);
    if (s[cv::CC_STAT_AREA] < config_.min_blob_px) continue;
    Detection detection;
    detection.box = {s[cv::CC_STAT_LEFT], s[cv::CC_STAT_TOP], s[cv::CC_STAT_WIDTH], s[cv::CC_STAT_HEIGHT]};
    // The inner half of the box, where it lies on the canvas.
    const cv::Point2f middle = centre(detection.box);
    const cv::Point2f quarter(static_cast<float>(detection.box.width) / 4,
                              static_cast<float>(detection.box.height) / 4);
    corners_ = {middle - quarter, middle + quarter};
    cv::undistortPoints(corners_, rectified_, K1_, D1_, R1_, P1_);
    const cv::Rect inner = cv::Rect(cv::Point(rectified_[0]), cv::Point(rectified_[1]) + cv::Point(1, 1)) & picture_;
    depths_.clear();
    for (int y = inner.y; y < inner.y + inner.height; ++y) {
      const auto* row = disparity_.ptr<std::int16_t>(y);
      for (int x = inner.x; x < inner.x + inner.width; ++x) {
        if (row[x] > 0) depths_.push_back(row[x]);
      }
    }
    if (!depths_.empty()) {
      const auto half = depths_.begin() + static_cast<std::ptrdiff_t>(depths_.size() / 2);
      std::nth_element(depths_.begin(), half, depths_.end());
      detection.disparity = static_cast<float>(*half) / float{cv::StereoMatcher::DISP_SCALE};
    }
    detections_.push_back(detection);
  }
}

void OpenCvPipeline::track(double dt) {
  for (Target& target : targets_) {
    predict(target.filter, static_cast<float>(dt));
    follow_features(target, dt);
  }
  associate();
  std::erase_if(targets_, [](const Target& target) {
    return target.misses > (target.hits >= kConfirmHits ? kMostMisses : kTentativeMisses);
  });
  for (Target& target : targets_) {
    if (target.misses == 0 && target.features.size() < kFeatures) refill_features(target);
    const float d = target.filter.statePost.at<float>(2);
    if (d <= 0) continue;
    const auto z = static_cast<float>(focal_baseline_ / d);
    const auto f = static_cast<float>(P1_.at<double>(0, 0));
    target.position = {(target.filter.statePost.at<float>(0) - static_cast<float>(P1_.at<double>(0, 2))) * z / f,
                       (target.filter.statePost.at<float>(1) - static_cast<float>(P1_.at<double>(1, 2))) * z / f, z};
  }
}

// Each feature's patch is searched in the window that its filter predicts.
void OpenCvPipeline::follow_features(Target& target, double dt) {
  std::erase_if(target.features, [&](Feature& feature) {
    predict(feature.filter, static_cast<float>(dt));
    const cv::Point2f expected(feature.filter.statePre.at<float>(0), feature.filter.statePre.at<float>(1));
    const float sd = std::sqrt(feature.filter.errorCovPre.at<float>(0, 0) + kFeatureNoise * kFeatureNoise);
    const int reach = std::min(cvCeil(3 * sd), kSearch);
    const cv::Rect window = around(expected, kPatch + 2 * reach) & picture_;
    if (window.width < kPatch || window.height < kPatch) return true;
    cv::matchTemplate(planes_[0](window), feature.patch, score_, cv::TM_SQDIFF);
    double least = 0;
    cv::Point place;
    cv::minMaxLoc(score_, &least, nullptr, &place, nullptr);
    if (least > kMostDifference * kMostDifference * kPatch * kPatch) return true;
    const cv::Point middle = window.tl() + place + cv::Point(kPatch / 2, kPatch / 2);
    const cv::Matx21f found(static_cast<float>(middle.x), static_cast<float>(middle.y));
    feature.filter.correct(cv::Mat(found, false));
    return false;
  });
}

void OpenCvPipeline::refill_features(Target& target) {
  const cv::Rect box = target.box & picture_;
  const int wanted = static_cast<int>(kFeatures - target.features.size());
  cv::goodFeaturesToTrack(planes_[0](box), corners_, wanted, 0.05, kPatch, objects_(box));
  for (const cv::Point2f& corner : corners_) {
    const cv::Point2f place = corner + cv::Point2f(box.tl());
    const cv::Rect patch = around(place, kPatch);
    if ((patch & picture_) != patch) continue;
    const std::array<float, 2> start{place.x, place.y};
    target.features.push_back({constant_velocity(2, start.data(), kFeatureNoise), planes_[0](patch).clone()});
  }
}

// Each target, the oldest first, takes the free detection nearest to where it is expected, within its own size.
void OpenCvPipeline::associate() {
  std::array<bool, kMostTargets> taken{};
  for (Target& target : targets_) {
    const cv::Point2f expected(target.filter.statePre.at<float>(0), target.filter.statePre.at<float>(1));
    const auto gate = static_cast<float>(std::max(std::max(target.box.width, target.box.height), 16));
    std::size_t best = detections_.size();
    float best_distance = gate;
    for (std::size_t i = 0; i < detections_.size(); ++i) {
      const auto distance = static_cast<float>(cv::norm(centre(detections_[i].box) - expected));
      if (taken[i] || distance >= best_distance) continue;
      best = i;
      best_distance = distance;
    }
    cv::Matx31f measured(expected.x, expected.y, target.filter.statePre.at<float>(2));
    if (best < detections_.size()) {
      taken[best] = true;
      const Detection& detection = detections_[best];
      target.box = detection.box;
      measured(0) = centre(detection.box).x;
      measured(1) = centre(detection.box).y;
      if (detection.disparity > 0) measured(2) = detection.disparity;
      ++target.hits;
      target.misses = 0;
    } else {
      ++target.misses;
      if (target.features.empty()) continue;
      // Without a detection its features say how it moves on.
      cv::Point2f speed;
      for (const Feature& feature : target.features) {
        speed += cv::Point2f(feature.filter.statePost.at<float>(2), feature.filter.statePost.at<float>(3));
      }
      const float dt = target.filter.transitionMatrix.at<float>(0, 3);
      const cv::Point2f moved = speed * (dt / static_cast<float>(target.features.size()));
      measured(0) = centre(target.box).x + moved.x;
      measured(1) = centre(target.box).y + moved.y;
      target.box += cv::Point(moved);
    }
    target.filter.correct(cv::Mat(measured, false));
  }
  for (std::size_t i = 0; i < detections_.size() && targets_.size() < kMostTargets; ++i) {
    if (taken[i]) continue;
    const cv::Point2f middle = centre(detections_[i].box);
    const std::array<float, 3> start{middle.x, middle.y, detections_[i].disparity};
    Target target;
    target.id = next_id_++;
    target.hits = 1;
    target.box = detections_[i].box;
    target.filter = constant_velocity(3, start.data(), kCentreNoise);
    targets_.push_back(std::move(target));
  }
}

}  // namespace stereotrack::bench
