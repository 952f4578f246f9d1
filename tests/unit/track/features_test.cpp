#include "pipeline/track/features.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

namespace stereotrack {
namespace {

using Plane = cv::Mat_<std::uint8_t>;
using Vector2 = ConstantVelocityFilter<2>::Vector;
using Matrix2 = ConstantVelocityFilter<2>::Matrix;

const cv::Size kSize(120, 90);

template <class T>
ImageView<T> view(cv::Mat_<T>& mat) {
  return {mat[0], mat.cols, mat.rows, static_cast<std::ptrdiff_t>(mat.step1())};
}

/// A texture that is known between the pixels too.
double waves(double x, double y) {
  return 128 + 30 * std::sin(0.61 * x + 0.37 * y) + 28 * std::sin(0.43 * x - 0.71 * y + 1) +
         25 * std::sin(0.97 * x + 0.11 * y + 2) + 22 * std::sin(0.23 * x + 0.53 * y + 3);
}
Plane waves_moved(double dx, double dy) {
  Plane out(kSize);
  for (int y = 0; y < out.rows; ++y) {
    for (int x = 0; x < out.cols; ++x) out(y, x) = cv::saturate_cast<std::uint8_t>(waves(x - dx, y - dy));
  }
  return out;
}

/// A grey picture with one textured patch of 15 x 15 whose centre is at (x, y).
Plane patch_at(int x, int y) {
  Plane out(kSize, std::uint8_t{90});
  Plane patch(15, 15);
  cv::RNG(5).fill(patch, cv::RNG::UNIFORM, 0, 256);
  patch.copyTo(out(cv::Rect(x - 7, y - 7, 15, 15)));
  return out;
}

Features::Config config() {
  Features::Config c;
  c.corner_quality = 100;
  c.most_difference = 14;
  c.search_px = 12;
  return c;
}

class FeaturesOf : public testing::Test {
 protected:
  void make(const Features::Config& c = config()) {
    auto created = Features::create(c, kSize.width, kSize.height, arena_);
    ASSERT_TRUE(created.has_value());
    features_.emplace(*created);
  }
  void refill(Plane picture, const Rect& box, Features::Set& set, const Vector2& velocity = Vector2::Zero(),
              double velocity_sd = 50) {
    features_->refill(view(picture), view(labels_), 1, box, velocity, velocity_sd, set);
  }
  void follow(Plane picture, double dt, Features::Set& set, double acceleration_sd = 20) const {
    features_->follow(view(picture), dt, acceleration_sd, set);
  }

  cv::Mat_<std::uint16_t> labels_{kSize, std::uint16_t{1}};
  std::optional<Features> features_;

 private:
  Arena arena_;
};

constexpr Rect kAll{0, 0, 120, 90};

Features::Set one_feature(Plane picture, const Vector2& at, const Vector2& velocity, double velocity_sd) {
  Features::Feature feature;
  feature.filter.start(at, 0.16 * Matrix2::Identity(), velocity_sd, velocity);
  for (int v = 0; v < Features::kPatch; ++v) {
    for (int u = 0; u < Features::kPatch; ++u) {
      feature.patch[static_cast<std::size_t>(v * Features::kPatch + u)] =
          picture(static_cast<int>(at.y()) + v - 4, static_cast<int>(at.x()) + u - 4);
    }
  }
  Features::Set set;
  EXPECT_TRUE(set.push(feature));
  return set;
}

TEST(Corner, StrengthIsOpencvsSmallerEigenvalue) {
  Plane picture(kSize);
  cv::RNG(1).fill(picture, cv::RNG::UNIFORM, 0, 256);
  // ksize 1: plain differences, as ours. OpenCV scales each gradient by 1 / (5 255).
  cv::Mat theirs;
  cv::cornerMinEigenVal(picture, theirs, 5, 1);
  for (int y = 3; y < kSize.height - 3; ++y) {
    for (int x = 3; x < kSize.width - 3; ++x) {
      const double expected = theirs.at<float>(y, x) * 255.0 * 255.0;
      ASSERT_NEAR(Features::corner_strength(view(picture), x, y), expected, 1e-3 * (1 + expected)) << x << ' ' << y;
    }
  }
}

TEST(Corner, EdgesHaveNoStrength) {
  // Along an edge one eigenvalue is 0, in an even place both are; at the corner of a rectangle neither is.
  Plane picture(kSize, std::uint8_t{0});
  picture(cv::Rect(20, 20, 60, 50)).setTo(100);
  EXPECT_EQ(Features::corner_strength(view(picture), 50, 20), 0);
  EXPECT_EQ(Features::corner_strength(view(picture), 20, 45), 0);
  EXPECT_EQ(Features::corner_strength(view(picture), 50, 45), 0);
  EXPECT_GT(Features::corner_strength(view(picture), 20, 20), 500);
}

TEST(Corner, AtThePicturesBorderThereIsNone) {
  Plane picture(kSize);
  cv::RNG(1).fill(picture, cv::RNG::UNIFORM, 0, 256);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(Features::corner_strength(view(picture), i, 40), 0);
    EXPECT_EQ(Features::corner_strength(view(picture), 40, i), 0);
    EXPECT_EQ(Features::corner_strength(view(picture), kSize.width - 1 - i, 40), 0);
    EXPECT_EQ(Features::corner_strength(view(picture), 40, kSize.height - 1 - i), 0);
  }
  EXPECT_GT(Features::corner_strength(view(picture), 3, 3), 0);
}

TEST_F(FeaturesOf, CornersAreTheStrongestPlacesOfOpencvsMap) {
  make();
  Plane picture = waves_moved(0, 0);
  cv::Mat map;
  cv::cornerMinEigenVal(picture, map, 5, 1);
  std::vector<float> values(map.begin<float>(), map.end<float>());
  std::sort(values.begin(), values.end());
  Features::Set set;
  refill(picture, kAll, set);
  ASSERT_EQ(set.size(), static_cast<std::size_t>(Features::kMost));
  for (const auto& feature : set) {
    const Vector2 at = feature.filter.position();
    const float strength = map.at<float>(static_cast<int>(at.y()), static_cast<int>(at.x()));
    EXPECT_GT(strength, values[values.size() * 95 / 100]) << at.transpose();
  }
}

TEST_F(FeaturesOf, CornersOfARectangleAreFoundAndNothingElse) {
  make();
  Plane picture(kSize, std::uint8_t{40});
  picture(cv::Rect(30, 25, 40, 35)).setTo(200);
  Features::Set set;
  refill(picture, kAll, set);
  ASSERT_EQ(set.size(), 4U);
  for (const Vector2& corner : {Vector2(30, 25), Vector2(69, 25), Vector2(30, 59), Vector2(69, 59)}) {
    const auto near = [&](const Features::Feature& f) { return (f.filter.position() - corner).norm() < 3; };
    EXPECT_EQ(std::count_if(set.begin(), set.end(), near), 1) << corner.transpose();
  }
}

TEST_F(FeaturesOf, CornersAreAPatchApartAndInsideTheLabelAndTheBox) {
  make();
  labels_.setTo(0);
  labels_(cv::Rect(20, 20, 60, 50)).setTo(1);
  const Rect box{30, 10, 60, 50};
  Plane picture = waves_moved(0, 0);
  Features::Set set;
  refill(picture, box, set);
  ASSERT_GT(set.size(), 3U);
  const std::size_t first_fill = set.size();
  refill(picture, box, set);
  EXPECT_EQ(set.size(), first_fill) << "what is there already takes its place";
  for (std::size_t i = 0; i < set.size(); ++i) {
    const Vector2 at = set[i].filter.position();
    EXPECT_EQ(labels_(static_cast<int>(at.y()), static_cast<int>(at.x())), 1);
    EXPECT_GE(at.x(), box.left);
    EXPECT_LT(at.y(), box.bottom());
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_GE((set[j].filter.position() - at).cwiseAbs().maxCoeff(), Features::kPatch);
    }
  }
}

TEST_F(FeaturesOf, WeakCornersAndEmptyBoxesGiveNone) {
  make();
  Features::Set set;
  refill(Plane(kSize, std::uint8_t{128}), kAll, set);
  EXPECT_TRUE(set.empty());
  refill(waves_moved(0, 0), {50, 50, 0, 0}, set);
  refill(waves_moved(0, 0), {500, 50, 20, 20}, set);
  EXPECT_TRUE(set.empty());
  Features::Config c = config();
  c.corner_quality = 1'000'000;
  make(c);
  refill(waves_moved(0, 0), kAll, set);
  EXPECT_TRUE(set.empty());
}

TEST_F(FeaturesOf, NewFilterStartsWithTheGivenVelocity) {
  make();
  Features::Set set;
  refill(waves_moved(0, 0), kAll, set, {30, -10}, 5);
  ASSERT_FALSE(set.empty());
  EXPECT_EQ(set[0].filter.velocity(), Vector2(30, -10));
  EXPECT_DOUBLE_EQ(set[0].filter.covariance()(2, 2), 25);
}

TEST_F(FeaturesOf, TextureIsFollowedBySubPixelSteps) {
  make();
  constexpr double kFps = 25;
  for (const Vector2& step : {Vector2(1.25, -0.5), Vector2(0.4, 0.3), Vector2(-2.3, 1.6)}) {
    Features::Set set;
    refill(waves_moved(0, 0), {40, 30, 40, 30}, set);
    ASSERT_GT(set.size(), 2U);
    std::vector<Vector2> origin;
    for (const Features::Feature& feature : set) origin.push_back(feature.filter.position());
    for (int k = 1; k <= 12; ++k) follow(waves_moved(k * step.x(), k * step.y()), 1 / kFps, set);
    ASSERT_EQ(set.size(), origin.size());
    for (std::size_t i = 0; i < set.size(); ++i) {
      EXPECT_LT((set[i].filter.position() - origin[i] - 12 * step).norm(), 0.75) << step.transpose();
      EXPECT_LT((set[i].filter.velocity() / kFps - step).norm(), 0.15) << step.transpose();
    }
  }
}

TEST_F(FeaturesOf, ChangeOfTheLightDoesNotMatter) {
  make();
  Features::Set set;
  refill(waves_moved(0, 0), {40, 30, 40, 30}, set);
  const std::size_t all = set.size();
  ASSERT_GT(all, 2U);
  const Vector2 origin = set[0].filter.position();
  for (int k = 1; k <= 6; ++k) {
    Plane darker;
    waves_moved(2 * k, 0).convertTo(darker, CV_8U, 1, k % 2 == 0 ? -20 : 15);
    follow(darker, 0.04, set);
  }
  ASSERT_EQ(set.size(), all);
  EXPECT_LT((set[0].filter.position() - origin - Vector2(12, 0)).norm(), 0.5);
}

TEST_F(FeaturesOf, FeatureThatDisappearsIsLost) {
  make();
  Features::Set set = one_feature(patch_at(60, 45), {60, 45}, Vector2::Zero(), 50);
  follow(patch_at(60, 45), 0.04, set);
  EXPECT_EQ(set.size(), 1U);
  follow(Plane(kSize, std::uint8_t{90}), 0.04, set);
  EXPECT_TRUE(set.empty());
  follow(patch_at(60, 45), 0.04, set);
  EXPECT_TRUE(set.empty());
}

TEST_F(FeaturesOf, FeatureThatLeavesThePictureIsLost) {
  make();
  Features::Set set = one_feature(patch_at(20, 45), {20, 45}, {-500, 0}, 1);
  follow(patch_at(20, 45), 0.2, set);  // expected at x = -80
  EXPECT_TRUE(set.empty());
}

TEST_F(FeaturesOf, SearchNeverReachesFurtherThanConfigured) {
  for (int search : {1, 3, 6, 12}) {
    Features::Config c = config();
    c.search_px = search;
    make(c);
    // The covariance alone would let it search 3 x 0.04 x 1000 = 120 px.
    for (const Point& way : {Point{1, 0}, Point{0, 1}, Point{-1, -1}}) {
      Features::Set near = one_feature(patch_at(60, 45), {60, 45}, Vector2::Zero(), 1000);
      follow(patch_at(60 + search * way.x, 45 + search * way.y), 0.04, near);
      ASSERT_EQ(near.size(), 1U) << search;
      EXPECT_LT((near[0].filter.position() - Vector2(60 + search * way.x, 45 + search * way.y)).norm(), 0.5);
      Features::Set far = one_feature(patch_at(60, 45), {60, 45}, Vector2::Zero(), 1000);
      follow(patch_at(60 + (search + 1) * way.x, 45 + (search + 1) * way.y), 0.04, far);
      EXPECT_TRUE(far.empty()) << search;
    }
  }
}

TEST_F(FeaturesOf, CovarianceBoundsTheSearch) {
  make();
  // S = 0.16 + (0.04 v_sd)^2 + 0.16: for v_sd = 0 a reach of 3 sqrt 0.32 = 1.7 px, for 75 px/s of 9.2 px.
  Features::Set sure = one_feature(patch_at(60, 45), {60, 45}, Vector2::Zero(), 0);
  follow(patch_at(68, 45), 0.04, sure, 0.01);
  EXPECT_TRUE(sure.empty());
  Features::Set unsure = one_feature(patch_at(60, 45), {60, 45}, Vector2::Zero(), 75);
  follow(patch_at(68, 45), 0.04, unsure, 0.01);
  EXPECT_EQ(unsure.size(), 1U);
}

TEST_F(FeaturesOf, PredictionMovesTheWindow) {
  make();
  Features::Set set = one_feature(patch_at(40, 45), {40, 45}, {750, 0}, 1);
  follow(patch_at(70, 45), 0.04, set, 0.01);
  ASSERT_EQ(set.size(), 1U);
  EXPECT_NEAR(set[0].filter.position().x(), 70, 0.3);
}

TEST(Features, Faults) {
  Arena arena;
  const auto fault_of = [&](auto&& change, int width = 8, int height = 8) {
    Features::Config c = config();
    change(c);
    const auto created = Features::create(c, width, height, arena);
    return created ? Fault{} : created.error();
  };
  const auto nothing = [](Features::Config&) {};
  EXPECT_EQ(fault_of(nothing), Fault{});
  EXPECT_EQ(fault_of([](auto& c) { c.corner_quality = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.most_difference = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.search_px = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of(nothing, 0, 8), Fault::kBadSize);
  arena.seal();
  EXPECT_EQ(fault_of(nothing), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
