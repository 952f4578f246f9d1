#include "pipeline/track/detector.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <optional>
#include <random>
#include <vector>

#include "pipeline/shape/region.hpp"
#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {
namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 120;
constexpr double kFocal = 200;
constexpr double kBaseline = 0.5;  // f b = 100
constexpr double kCx = 79;
constexpr double kCy = 59;

template <class T>
ImageView<T> view(cv::Mat_<T>& mat) {
  return {mat[0], mat.cols, mat.rows, static_cast<std::ptrdiff_t>(mat.step1())};
}

Detector::Config config() {
  Detector::Config c;
  c.min_area_px = 24;
  c.min_area_ppm = 0;
  c.merge_gap = 0.3;
  c.merge_depth = 0.1;
  c.split_depth = 0.15;
  c.split_min_px = 2;
  c.split_jump = 0.05;
  c.split_part = 0.12;
  c.most_scatter = 0.15;
  c.match_noise_px = 0.25;
  return c;
}

StereoCalibration ideal_rig() {
  StereoCalibration c;
  c.left = {kWidth, kHeight, kFocal, kFocal, kCx, kCy, LensModel::kRadtan, {}};
  c.right = c.left;
  c.t_right_left = {-kBaseline, 0, 0};
  return c;
}

std::uint16_t fixed(double disparity) { return static_cast<std::uint16_t>(disparity * kDisparityScale + 0.5); }

Prediction expected(std::uint32_t id, const Rect& box, double disparity = 0) {
  Prediction out;
  out.id = id;
  out.confirmed = true;
  out.independent = true;
  out.apart = ~std::uint64_t{0};
  out.box = box;
  out.area = static_cast<double>(box.area());
  out.image_sd = 1;
  out.has_depth = disparity > 0;
  out.disparity = disparity;
  out.disparity_sd = 0.3;
  return out;
}

class DetectorOf : public testing::Test {
 protected:
  void SetUp() override { make(config()); }
  void make(const Detector::Config& c) {
    auto created = Detector::create(c, kWidth, kHeight, arena_);
    ASSERT_TRUE(created.has_value());
    detector_.emplace(*created);
    if (rectifier_) return;
    auto rig = Rectifier::create(ideal_rig(), kWidth, kHeight, arena_);
    ASSERT_TRUE(rig.has_value());
    rectifier_.emplace(*rig);
  }

  /// One more rectangle of the mask; those with one label are one blob. disparity < 0: unknown.
  void paint(std::uint16_t label, const Rect& where, double d) {
    const cv::Rect r(where.left, where.top, where.width, where.height);
    labels_(r).setTo(label);
    disparity_(r).setTo(d < 0 ? kNoDisparity : fixed(d));
  }

  Detector::Input input(std::span<const Prediction> predictions = {}, bool stereo = true) {
    blobs_.clear();
    double most = 0;
    cv::minMaxLoc(labels_, nullptr, &most);
    for (std::uint16_t label = 1; label <= static_cast<std::uint16_t>(most); ++label) {
      const Blob blob = measure_region(view(labels_), {0, 0, kWidth, kHeight}, label);
      if (blob.area > 0) blobs_.push_back(blob);
    }
    Detector::Input in;
    in.blobs = blobs_;
    in.labels = view(labels_);
    if (stereo) {
      in.disparity = view(disparity_);
      in.rectifier = &*rectifier_;
    }
    in.y = view(y_);
    in.strength = view(strength_);
    in.predictions = predictions;
    in.rules = rules_ ? &*rules_ : nullptr;
    in.observer = {.rejected = &DetectorOf::told, .context = this};
    return in;
  }
  std::span<const Detection> run(const std::vector<Prediction>& predictions = {}, bool stereo = true) {
    const Detector::Input in = input(predictions, stereo);
    (void)detector_->segment(in);
    return detector_->conclude(in);
  }
  static void told(void* self, const RejectedCandidate& candidate) noexcept {
    static_cast<DetectorOf*>(self)->told_.push_back(candidate);
  }
  std::vector<RejectedCandidate> told_;  ///< by the observer
  [[nodiscard]] std::uint32_t rejected(Rejection why) const {
    return detector_->rejections()[static_cast<std::size_t>(why)];
  }
  [[nodiscard]] std::uint32_t rejected() const {
    std::uint32_t sum = 0;
    for (std::uint32_t count : detector_->rejections()) sum += count;
    return sum;
  }

  cv::Mat_<std::uint16_t> labels_{cv::Size(kWidth, kHeight), std::uint16_t{0}};
  cv::Mat_<std::uint16_t> disparity_{cv::Size(kWidth, kHeight), kNoDisparity};
  cv::Mat_<std::uint8_t> y_{cv::Size(kWidth, kHeight), std::uint8_t{77}};
  cv::Mat_<std::uint8_t> strength_{cv::Size(kWidth, kHeight), std::uint8_t{40}};
  std::vector<Blob> blobs_;
  std::optional<Detector> detector_;
  std::optional<ZoneRules> rules_;

  void rule(const ZoneRules::Config& c) {
    auto created = ZoneRules::create(c, kWidth, kHeight, arena_);
    ASSERT_TRUE(created.has_value());
    rules_.emplace(*created);
  }

 private:
  Arena arena_;
  std::optional<Rectifier> rectifier_;
};

TEST_F(DetectorOf, NoBlobIsNoDetection) {
  EXPECT_TRUE(run().empty());
  EXPECT_EQ(rejected(), 0U);
}

TEST_F(DetectorOf, PositionByHand) {
  // d = 20: Z = 100 / 20 = 5. Columns 100..119, rows 40..55: X = (109.5 - 79) 5 / 200, Y = (47.5 - 59) 5 / 200.
  paint(1, {100, 40, 20, 16}, 20);
  const std::span<const Detection> found = run();
  ASSERT_EQ(found.size(), 1U);
  const Detection& object = found[0];
  EXPECT_EQ(object.box, (Rect{100, 40, 20, 16}));
  EXPECT_EQ(object.area, 320);
  EXPECT_EQ(object.hull.size(), 4U);
  EXPECT_TRUE(object.whole);
  ASSERT_TRUE(object.has_depth);
  EXPECT_NEAR(object.disparity, 20, 0.3);
  EXPECT_LT((object.position - Eigen::Vector3d(0.7625, -0.2875, 5)).norm(), 0.08);
  // s_Z = Z^2 / (f b) s_d
  EXPECT_GT(object.disparity_sd, 0);
  EXPECT_NEAR(std::sqrt(object.position_covariance(2, 2)), 0.25 * object.disparity_sd, 0.02);
  EXPECT_DOUBLE_EQ(object.appearance.share(77, 128, 128), 0.5) << "half in its bin, half in the next";
  EXPECT_EQ(object.appearance.share(200, 128, 128), 0);
  EXPECT_GT(object.strength, 0);
  EXPECT_LE(object.strength, 1);
}

TEST_F(DetectorOf, LabelsAreThoseOfTheDetectionsLargestFirst) {
  paint(1, {10, 10, 8, 8}, 20);
  paint(2, {60, 60, 20, 20}, 30);
  paint(3, {120, 20, 3, 3}, 30);  // too small
  const std::span<const Detection> found = run();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].area, 400);
  EXPECT_EQ(found[1].area, 64);
  EXPECT_EQ(labels_(70, 70), 1);
  EXPECT_EQ(labels_(12, 12), 2);
  EXPECT_EQ(labels_(21, 121), 0);
  EXPECT_EQ(cv::countNonZero(labels_), 464);
}

TEST_F(DetectorOf, TooSmallIsRejectedAndCounted) {
  paint(1, {10, 10, 4, 6}, 20);
  paint(2, {60, 60, 23, 1}, 20);
  const std::span<const Detection> found = run();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].area, 24);
  EXPECT_EQ(rejected(Rejection::kSmall), 1U);
  EXPECT_EQ(rejected(), 1U);
  ASSERT_EQ(told_.size(), 1U);
  EXPECT_EQ(told_[0].why, Rejection::kSmall);
  EXPECT_EQ(told_[0].box, (Rect{60, 60, 23, 1}));
  EXPECT_EQ(told_[0].area, 23);
}

TEST_F(DetectorOf, SmallestAreaGrowsWithThePicture) {
  Detector::Config c = config();
  c.min_area_ppm = 5000;  // of 19200 px: 96 px
  make(c);
  paint(1, {10, 10, 12, 8}, 20);
  paint(2, {60, 60, 19, 5}, 20);
  const std::span<const Detection> found = run();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].area, 96);
  EXPECT_EQ(rejected(Rejection::kSmall), 1U);
}

TEST_F(DetectorOf, TouchingObjectsAtDifferentDepthsAreSplit) {
  paint(1, {40, 40, 20, 24}, 20);
  paint(1, {60, 44, 24, 24}, 40);
  const std::span<const Detection> found = run();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].box, (Rect{60, 44, 24, 24}));
  EXPECT_EQ(found[0].area, 24 * 24);
  EXPECT_NEAR(found[0].disparity, 40, 0.5);
  EXPECT_EQ(found[1].box, (Rect{40, 40, 20, 24}));
  EXPECT_EQ(found[1].area, 20 * 24);
  EXPECT_NEAR(found[1].disparity, 20, 0.5);
  for (const Detection& object : found) EXPECT_TRUE(object.whole) << "an edge in depth is an object's own edge";
}

TEST_F(DetectorOf, ObjectAtOneDepthIsNotSplit) {
  paint(1, {40, 40, 20, 24}, 20);
  paint(1, {60, 44, 24, 24}, 21.5);  // 7 %, under split_depth and split_min_px
  EXPECT_EQ(run().size(), 1U);
}

TEST_F(DetectorOf, SegmentsOfOneBlobAreOneObjectUpToSplitDepth) {
  const auto objects = [&](double right, std::uint16_t right_label) {
    Detector::Config c = config();
    c.merge_depth = 0.02;
    c.split_depth = 0.2;
    make(c);
    labels_.setTo(0);
    paint(1, {40, 40, 20, 24}, 20);
    paint(right_label, {60, 40, 20, 24}, right);
    return run().size();
  };
  // Steps of 10 % and of 40 %, both over split_jump.
  EXPECT_EQ(objects(22, 1), 1U);
  EXPECT_EQ(objects(28, 1), 2U);
  EXPECT_EQ(objects(22, 2), 2U) << "of two blobs: only up to merge_depth";
}

TEST_F(DetectorOf, SurfaceThatSlantsAwayIsOneObject) {
  for (int x = 0; x < 40; ++x) paint(1, {40 + x, 40, 1, 30}, 30 + 0.25 * x);  // from 30 to 40, over split_depth
  const std::span<const Detection> found = run();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].area, 1200);
  // Nine tenths of an even spread of 10 px are within 4.5 px of its middle.
  EXPECT_NEAR(found[0].disparity_reach, 4.5, 0.8);
}

TEST_F(DetectorOf, FewPixelsAtAnotherDepthAreNoLayer) {
  paint(1, {40, 40, 40, 30}, 20);
  paint(1, {50, 50, 6, 6}, 40);  // 3 %
  const std::span<const Detection> found = run();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].area, 1200);
  EXPECT_NEAR(found[0].disparity, 20, 0.5);
}

TEST_F(DetectorOf, NearPiecesOfEqualDepthAreMerged) {
  paint(1, {40, 30, 20, 20}, 20);
  paint(2, {40, 53, 20, 10}, 20.5);
  const std::span<const Detection> found = run();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].box, (Rect{40, 30, 20, 33}));
  EXPECT_EQ(found[0].area, 600);
  EXPECT_EQ(labels_(35, 45), 1);
  EXPECT_EQ(labels_(55, 45), 1);
}

TEST_F(DetectorOf, FarPiecesAndPiecesOfOtherDepthAreNotMerged) {
  const auto objects = [&](const Rect& other, double other_disparity) {
    labels_.setTo(0);
    paint(1, {40, 30, 20, 20}, 20);
    paint(2, other, other_disparity);
    return run().size();
  };
  // The longer side is 20: merge_gap allows 6 px.
  EXPECT_EQ(objects({66, 30, 12, 20}, 20), 1U);
  EXPECT_EQ(objects({67, 30, 12, 20}, 20), 2U);
  EXPECT_EQ(objects({40, 56, 20, 10}, 20), 1U);
  EXPECT_EQ(objects({40, 57, 20, 10}, 20), 2U);
  EXPECT_EQ(objects({40, 53, 20, 10}, 30), 2U) << "another depth";
}

TEST_F(DetectorOf, PiecesThatOneTargetExplainsAreMergedAcrossAGap) {
  paint(1, {40, 20, 16, 14}, 20);
  paint(2, {40, 46, 16, 14}, 20);  // gap of 12 px
  EXPECT_EQ(run().size(), 2U);
  labels_.setTo(0);
  paint(1, {40, 20, 16, 14}, 20);
  paint(2, {40, 46, 16, 14}, 20);
  const std::span<const Detection> found = run({expected(1, {40, 20, 16, 40}, 20)});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].box, (Rect{40, 20, 16, 40}));
}

TEST_F(DetectorOf, PiecesOfATargetDoNotMakeItGrow) {
  const auto objects = [&](const Rect& target) {
    labels_.setTo(0);
    paint(1, {40, 20, 16, 14}, 20);
    paint(2, {40, 46, 16, 14}, 20);  // 40 rows together
    return run({expected(1, target, 20)}).size();
  };
  EXPECT_EQ(objects({40, 20, 16, 40}), 1U);
  EXPECT_EQ(objects({40, 24, 16, 30}), 2U) << "a quarter of the pieces would be outside";
}

TEST_F(DetectorOf, PiecesClaimedByDifferentTargetsAreNotMerged) {
  const auto draw = [&] {
    labels_.setTo(0);
    paint(1, {40, 30, 20, 20}, 20);
    paint(2, {62, 30, 20, 20}, 20);
  };
  draw();
  EXPECT_EQ(run().size(), 1U) << "without targets they are one";
  draw();
  EXPECT_EQ(run({expected(1, {40, 30, 20, 20}, 20), expected(2, {62, 30, 20, 20}, 20)}).size(), 2U);
  draw();
  std::vector<Prediction> unconfirmed{expected(1, {40, 30, 20, 20}, 20), expected(2, {62, 30, 20, 20}, 20)};
  for (Prediction& prediction : unconfirmed) prediction.confirmed = false;
  EXPECT_EQ(run(unconfirmed).size(), 1U) << "tentative targets claim nothing";
}

TEST_F(DetectorOf, TargetsOneAboveTheOtherOfOneDepthAndMotionAreOneObject) {
  const auto draw = [&](double lower_disparity) {
    labels_.setTo(0);
    paint(1, {40, 30, 20, 20}, 20);
    paint(2, {40, 53, 20, 20}, lower_disparity);
  };
  std::vector<Prediction> both{expected(1, {40, 30, 20, 20}, 20), expected(2, {40, 53, 20, 20}, 20)};
  for (Prediction& prediction : both) prediction.vx = 100;
  draw(20);
  EXPECT_EQ(run(both).size(), 2U) << "seen side by side before";
  for (Prediction& prediction : both) prediction.apart = 0;
  draw(20);
  EXPECT_EQ(run(both).size(), 1U);
  both[1].vx = -100;
  draw(20);
  EXPECT_EQ(run(both).size(), 2U) << "another motion";
  both[1] = expected(2, {40, 53, 20, 20}, 30);
  both[1].vx = 100;
  both[1].apart = 0;
  draw(30);
  EXPECT_EQ(run(both).size(), 2U) << "another depth";
}

TEST_F(DetectorOf, BlobOfTwoTargetsIsSplitBetweenThem) {
  // One blob at one depth: only the places tell.
  paint(1, {40, 40, 48, 20}, 20);
  const std::span<const Detection> found = run({expected(1, {40, 40, 24, 20}, 20), expected(2, {64, 40, 24, 20}, 20)});
  ASSERT_EQ(found.size(), 2U);
  for (const Detection& object : found) {
    EXPECT_NEAR(object.box.width, 24, 1);
    EXPECT_EQ(object.box.height, 20);
    EXPECT_FALSE(object.whole);
  }
}

TEST_F(DetectorOf, OverlappingTargetsOfDifferentDepthGetTheirOwnPixels) {
  paint(1, {40, 40, 40, 24}, 20);
  paint(1, {60, 40, 12, 24}, 40);
  const std::span<const Detection> found = run({expected(1, {40, 40, 40, 24}, 20), expected(2, {60, 40, 12, 24}, 40)});
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].area, 28 * 24);
  EXPECT_NEAR(found[0].disparity, 20, 0.5);
  EXPECT_EQ(found[1].box, (Rect{60, 40, 12, 24}));
  EXPECT_NEAR(found[1].disparity, 40, 0.5);
}

TEST_F(DetectorOf, TargetHiddenBehindAnotherClaimsNothing) {
  paint(1, {40, 40, 30, 24}, 40);
  const std::span<const Detection> found = run({expected(1, {40, 40, 30, 24}, 40), expected(2, {46, 40, 20, 24}, 20)});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].area, 30 * 24);
}

TEST_F(DetectorOf, HiddenTargetClaimsNothingOfWhatHidesIt) {
  paint(1, {40, 40, 30, 24}, 40);
  const std::vector<Prediction> hidden{expected(1, {44, 40, 24, 24}, 20)};
  std::span<const Detector::Candidate> pieces = detector_->segment(input(hidden));
  ASSERT_EQ(pieces.size(), 1U);
  EXPECT_EQ(pieces[0].claim, -1);
  const std::vector<Prediction> seen{expected(1, {44, 40, 24, 24}, 40)};
  pieces = detector_->segment(input(seen));
  ASSERT_EQ(pieces.size(), 1U);
  EXPECT_EQ(pieces[0].claim, 0) << "at its own depth it does";
}

TEST_F(DetectorOf, HiddenTargetsLooksDoNotCutWhatHidesIt) {
  // The near object has the far one's colour in part of it, where one pixel in five is matched at its depth by mistake.
  paint(1, {40, 40, 30, 24}, 40);
  for (int v = 40; v < 64; ++v) {
    for (int u = 50; u < 62; ++u) {
      if ((u + 2 * v) % 5 == 0) disparity_(v, u) = fixed(20);
    }
  }
  y_(cv::Rect(50, 40, 12, 24)).setTo(200);
  Appearance pale;
  for (int i = 0; i < 300; ++i) pale.add(200, 128, 128);
  std::vector<Prediction> both{expected(1, {40, 40, 30, 24}, 40), expected(2, {50, 40, 12, 24}, 20)};
  both[1].appearance = &pale;
  const std::span<const Detection> found = run(both);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].area, 30 * 24);
  EXPECT_TRUE(found[0].whole);
}

TEST_F(DetectorOf, PieceMayBeSomewhatNearerOrLookSomewhatDifferentNotBoth) {
  // A target of grey 77. Half of a strange piece is of grey 200; a near one is most of merge_depth nearer.
  Appearance grey;
  for (int i = 0; i < 480; ++i) grey.add(77, 128, 128);
  std::vector<Prediction> target{expected(1, {40, 40, 20, 24}, 20)};
  target[0].appearance = &grey;
  const auto claim = [&](double d, int strange_columns) {
    labels_.setTo(0);
    y_.setTo(77);
    paint(1, {40, 40, 20, 24}, d);
    if (strange_columns > 0) y_(cv::Rect(40, 40, strange_columns, 24)).setTo(200);
    const std::span<const Detector::Candidate> pieces = detector_->segment(input(target));
    EXPECT_EQ(pieces.size(), 1U);
    return pieces.empty() ? -2 : pieces[0].claim;
  };
  EXPECT_EQ(claim(20, 0), 0);
  EXPECT_EQ(claim(23, 0), 0) << "nearer";
  EXPECT_EQ(claim(20, 10), 0) << "half strange";
  EXPECT_EQ(claim(23, 10), -1) << "both";
  EXPECT_EQ(claim(20, 20), -1) << "wholly strange";
  EXPECT_EQ(claim(30, 0), -1) << "at another depth";
}

TEST_F(DetectorOf, PieceThatLooksAlikeMayLieWithinTheTargetsKnownReach) {
  Appearance grey;
  for (int i = 0; i < 480; ++i) grey.add(77, 128, 128);
  Detector::Config c = config();
  c.merge_depth = 0.05;
  c.split_depth = 0.3;
  make(c);
  paint(1, {40, 40, 20, 24}, 24.5);  // 4.5 px nearer; merge_depth and noise alone allow 2.5
  std::vector<Prediction> target{expected(1, {40, 40, 20, 24}, 20)};
  target[0].appearance = &grey;
  EXPECT_EQ(detector_->segment(input(target))[0].claim, -1);
  target[0].disparity_reach = 6;
  EXPECT_EQ(detector_->segment(input(target))[0].claim, 0);
}

TEST_F(DetectorOf, LooksDecideWhoseThePixelsAreWhereDepthDoesNot) {
  // One blob at one depth, expected side by side half and half; by its looks the left one has a third.
  paint(1, {40, 40, 48, 20}, 20);
  y_(cv::Rect(40, 40, 16, 20)).setTo(200);
  Appearance pale;
  Appearance grey;
  for (int i = 0; i < 400; ++i) {
    pale.add(200, 128, 128);
    grey.add(77, 128, 128);
  }
  std::vector<Prediction> both{expected(1, {40, 40, 24, 20}, 20), expected(2, {64, 40, 24, 20}, 20)};
  both[0].appearance = &pale;
  both[1].appearance = &grey;
  const std::span<const Detection> found = run(both);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_GT(overlap(found[0].box, {56, 40, 32, 20}), 0.9);
  EXPECT_GT(overlap(found[1].box, {40, 40, 16, 20}), 0.85);
  for (const Detection& object : found) EXPECT_FALSE(object.whole);
}

TEST_F(DetectorOf, PixelsWithoutDisparityFollowTheirPlace) {
  paint(1, {40, 40, 20, 24}, 20);
  paint(1, {60, 40, 24, 24}, 40);
  paint(1, {44, 44, 6, 6}, -1);
  paint(1, {70, 50, 6, 6}, -1);
  const std::span<const Detection> found = run();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_NEAR(found[0].area, 24 * 24, 20);
  EXPECT_NEAR(found[1].area, 20 * 24, 20);
}

TEST_F(DetectorOf, MonoHasBoxesAndNoDepth) {
  paint(1, {40, 40, 20, 24}, 20);
  paint(1, {60, 44, 24, 24}, 40);
  paint(2, {120, 80, 3, 3}, 20);
  const std::span<const Detection> found = run({}, false);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].box, (Rect{40, 40, 44, 28}));
  EXPECT_FALSE(found[0].has_depth);
  EXPECT_EQ(rejected(Rejection::kSmall), 1U);
  EXPECT_EQ(rejected(), 1U);
}

TEST_F(DetectorOf, WithoutAnyMatchAStereoCandidateIsRejected) {
  paint(1, {40, 40, 20, 24}, -1);
  EXPECT_TRUE(run().empty());
  EXPECT_EQ(rejected(Rejection::kNoTexture), 1U);
  EXPECT_EQ(rejected(), 1U);
}

TEST_F(DetectorOf, KnownTargetNeedsNoMatch) {
  paint(1, {40, 40, 20, 24}, -1);
  const std::span<const Detection> found = run({expected(1, {40, 40, 20, 24}, 20)});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_FALSE(found[0].has_depth);
}

TEST_F(DetectorOf, ScatteredDisparitiesAreRejected) {
  std::mt19937 random(1);
  // Even from 10 to 50 px: half of them are 10 px and more from the median of 30, a third of it.
  for (int v = 40; v < 64; ++v) {
    for (int u = 40; u < 70; ++u) paint(1, {u, v, 1, 1}, 10 + 40.0 * static_cast<double>(random() % 1000) / 1000);
  }
  EXPECT_TRUE(run().empty());
  EXPECT_EQ(rejected(Rejection::kInconsistent), 1U);
  EXPECT_EQ(rejected(), 1U);
}

TEST_F(DetectorOf, ScatterUnderTheLimitIsKept) {
  std::mt19937 random(1);
  for (int v = 40; v < 64; ++v) {
    for (int u = 40; u < 70; ++u) paint(1, {u, v, 1, 1}, 28 + 4.0 * static_cast<double>(random() % 1000) / 1000);
  }
  const std::span<const Detection> found = run();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].disparity, 30, 0.5);
  EXPECT_EQ(rejected(), 0U);
}

TEST_F(DetectorOf, CandidateThatTheCallerCallsTheBackgroundsOwnSurfaceIsRejected) {
  paint(1, {10, 20, 20, 16}, 20.5);
  paint(2, {100, 80, 20, 16}, 23);
  const Detector::Input in = input();
  for (Detector::Candidate& candidate : detector_->segment(in)) {
    EXPECT_FALSE(candidate.own_surface);
    candidate.own_surface = candidate.box.left == 10;
  }
  const std::span<const Detection> found = detector_->conclude(in);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].box.left, 100);
  EXPECT_EQ(labels_(25, 15), 0);
  EXPECT_EQ(rejected(Rejection::kOwnSurface), 1U);
  EXPECT_EQ(rejected(), 1U);
}

TEST_F(DetectorOf, CallerMayGiveACandidateItsDisparity) {
  paint(1, {100, 40, 20, 16}, -1);
  const Detector::Input in = input();
  const std::span<Detector::Candidate> candidates = detector_->segment(in);
  ASSERT_EQ(candidates.size(), 1U);
  EXPECT_FALSE(candidates[0].has_depth);
  EXPECT_EQ(candidates[0].valid, 0);
  candidates[0].has_depth = true;
  candidates[0].disparity = 25;
  candidates[0].disparity_sd = 0.5;
  candidates[0].scatter = 0.5;
  const std::span<const Detection> found = detector_->conclude(in);
  ASSERT_EQ(found.size(), 1U);
  ASSERT_TRUE(found[0].has_depth);
  EXPECT_NEAR(found[0].position.z(), 4, 1e-9);
  EXPECT_EQ(rejected(), 0U);
}

TEST_F(DetectorOf, WhatIsOutsideOfTheVolumeIsNoDetectionThoughATargetClaimsIt) {
  Zone near;
  near.x_m = near.y_m = {-100, 100};
  near.z_m = {0, 4};
  rule({.volume = near, .unit_m = 1});
  paint(1, {20, 40, 20, 16}, 20);   // Z = 5
  paint(2, {100, 40, 20, 16}, 40);  // Z = 2.5
  const std::span<const Detection> found = run({expected(1, {20, 40, 20, 16}, 20)});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].box.left, 100);
  EXPECT_EQ(labels_(48, 30), 0) << "and its pixels are no object's";
  EXPECT_EQ(rejected(Rejection::kOutside), 1U);
  EXPECT_EQ(rejected(), 1U);
  ASSERT_EQ(told_.size(), 1U);
  EXPECT_EQ(told_[0].why, Rejection::kOutside);
  EXPECT_EQ(told_[0].box, (Rect{20, 40, 20, 16}));
}

TEST_F(DetectorOf, SizeIsThatOfNewObjectsAndIsTold) {
  rule({.max_size_m = 0.4, .unit_m = 1});
  paint(1, {20, 40, 20, 16}, 20);   // 20 px at Z = 5, f = 200: 0.5
  paint(2, {100, 40, 20, 16}, 40);  // 0.25
  std::span<const Detection> found = run();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].box.left, 100);
  EXPECT_EQ(rejected(Rejection::kOverSize), 1U);
  ASSERT_EQ(told_.size(), 1U);
  EXPECT_NEAR(told_[0].size_m, 0.5, 0.02);
  labels_.setTo(0);
  paint(1, {20, 40, 20, 16}, 20);
  paint(2, {100, 40, 20, 16}, 40);
  found = run({expected(1, {20, 40, 20, 16}, 20)});
  EXPECT_EQ(found.size(), 2U) << "a target that is known";
  EXPECT_EQ(rejected(), 0U);
}

TEST_F(DetectorOf, WhereNoneBeginsIsADetectionThatSaysSo) {
  ZoneRules::Config c;
  Zone door;
  door.kind = Zone::Kind::kPicture;
  for (const Zone::Corner& corner : {Zone::Corner{0, 0}, {60, 0}, {60, 120}, {0, 120}}) {
    ASSERT_TRUE(door.corners.push(corner));
  }
  ASSERT_TRUE(c.zones.push({.zone = door, .targets = ZoneRules::Targets::kNoneBegin}));
  rule(c);
  paint(1, {20, 40, 20, 16}, 20);
  paint(2, {100, 40, 24, 16}, 40);
  const std::span<const Detection> found = run();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_TRUE(found[0].may_begin);
  EXPECT_FALSE(found[1].may_begin);
  EXPECT_EQ(rejected(), 0U);
}

TEST_F(DetectorOf, OneDetectionMoreThanTheCapacityIsRejectedAndCounted) {
  Detector::Config c = config();
  c.merge_gap = 0;
  make(c);
  for (int i = 0; i < Detector::kMaxDetections + 1; ++i) {
    paint(static_cast<std::uint16_t>(i + 1), {4 + 15 * (i % 10), 4 + 15 * (i / 10), 6, 5}, 20);
  }
  EXPECT_EQ(run().size(), 64U);
  EXPECT_EQ(rejected(Rejection::kNoRoom), 1U);
  EXPECT_EQ(rejected(), 1U);
}

TEST_F(DetectorOf, RejectionsAreThoseOfTheLastRun) {
  paint(1, {10, 10, 3, 3}, 20);
  (void)run();
  EXPECT_EQ(rejected(), 1U);
  labels_.setTo(0);
  (void)run();
  EXPECT_EQ(rejected(), 0U);
}

TEST(Detector, EveryRejectionHasAName) {
  EXPECT_STREQ(to_string(Rejection::kSmall), "small");
  EXPECT_STREQ(to_string(Rejection::kOwnSurface), "own_surface");
  EXPECT_STREQ(to_string(Rejection::kNoRoom), "no_room");
  EXPECT_STREQ(to_string(Rejection::kOutside), "outside_volume");
  EXPECT_STREQ(to_string(Rejection::kNoneBegin), "none_begin");
}

TEST(Detector, Faults) {
  Arena arena;
  const auto fault_of = [&](auto&& change) {
    Detector::Config c = config();
    change(c);
    const auto created = Detector::create(c, 32, 32, arena);
    return created ? Fault{} : created.error();
  };
  EXPECT_EQ(fault_of([](auto&) {}), Fault{});
  EXPECT_EQ(fault_of([](auto& c) { c.min_area_px = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.merge_gap = -1; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.merge_depth = -1; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.split_depth = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.split_min_px = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.split_jump = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.split_part = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.split_part = 0.51; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.most_scatter = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.match_noise_px = 0; }), Fault::kBadConfig);
  EXPECT_FALSE(Detector::create(config(), 0, 32, arena).has_value());
  arena.seal();
  EXPECT_EQ(fault_of([](auto&) {}), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
