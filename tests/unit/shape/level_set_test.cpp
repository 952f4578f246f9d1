#include "pipeline/shape/level_set.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/shape/pictures.hpp"

namespace stereotrack {
namespace {

using test::const_view;
using test::view;

constexpr int kWidth = 121;
constexpr int kHeight = 101;

/// A bright disc on dark ground under Gaussian noise, and its truth.
struct Scene {
  cv::Mat_<std::uint8_t> feature;
  cv::Mat_<std::uint8_t> truth;

  Scene(int object, int ground, double noise, std::uint64_t seed)
      : feature(kHeight, kWidth), truth(kHeight, kWidth, std::uint8_t{0}) {
    cv::circle(truth, {60, 50}, 22, 255, -1);
    cv::Mat_<double> value(kHeight, kWidth, ground);
    value.setTo(object, truth);
    cv::Mat_<double> gauss(kHeight, kWidth);
    cv::RNG(seed).fill(gauss, cv::RNG::NORMAL, 0, noise);
    value += gauss;
    value.convertTo(feature, CV_8U);
  }
};

cv::Mat_<std::uint16_t> start_rect(const cv::Rect& rect, std::uint16_t label = 1) {
  cv::Mat_<std::uint16_t> labels(kHeight, kWidth, std::uint16_t{0});
  labels(rect).setTo(label);
  return labels;
}

Rect box_of(const cv::Rect& rect) { return {rect.x, rect.y, rect.width, rect.height}; }

// The features here are pictures, not differences: without cap.
LevelSet::Outcome evolve(LevelSet::Config config, cv::Mat_<std::uint8_t>& feature, cv::Mat_<std::uint16_t>& labels,
                         const Rect& box, std::uint16_t label = 1) {
  config.feature_cap = 255;
  Arena arena;
  auto stage = LevelSet::create(config, labels.cols, labels.rows, arena);
  EXPECT_TRUE(stage.has_value());
  const auto outcome = stage->run(const_view(feature), view(labels), box, label);
  EXPECT_TRUE(outcome.has_value());
  return *outcome;
}

double iou(const cv::Mat& labels, const cv::Mat& truth) {
  const cv::Mat mask = labels == 1;
  return static_cast<double>(cv::countNonZero(mask & truth)) / cv::countNonZero(mask | truth);
}

/// E of the header in doubles, by its definition; of the region in the domain `rect`.
double naive_energy(const cv::Mat_<std::uint8_t>& feature, const cv::Mat_<std::uint16_t>& labels, const cv::Rect& rect,
                    double weight) {
  double sum[2] = {};
  double count[2] = {};
  for (int y = rect.y; y < rect.br().y; ++y) {
    for (int x = rect.x; x < rect.br().x; ++x) {
      const int side = labels(y, x) == 1;
      sum[side] += feature(y, x);
      count[side] += 1;
    }
  }
  double energy = 0;
  for (int y = rect.y; y < rect.br().y; ++y) {
    for (int x = rect.x; x < rect.br().x; ++x) {
      const int side = labels(y, x) == 1;
      energy += std::pow(feature(y, x) - sum[side] / count[side], 2);
      for (int dy = 0; dy <= 3; ++dy) {
        for (int dx = dy == 0 ? 1 : -3; dx <= 3; ++dx) {
          const cv::Point to(x + dx, y + dy);
          if (dx * dx + dy * dy > 10 || !rect.contains(to)) continue;
          if ((labels(to) == 1) != (labels(y, x) == 1)) energy += weight / 26;
        }
      }
    }
  }
  return energy;
}

TEST(LevelSet, DiscIsRecoveredFromAShiftedRectangleUnderNoise) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Scene scene(90, 40, 12, seed);
    const cv::Rect start(42, 22, 38, 38);
    cv::Mat_<std::uint16_t> labels = start_rect(start);
    ASSERT_LT(iou(labels, scene.truth), 0.6);
    const auto outcome =
        evolve({.margin_px = 16, .max_iterations = 60, .contour_weight = 400}, scene.feature, labels, box_of(start));
    EXPECT_TRUE(outcome.converged);
    EXPECT_GE(iou(labels, scene.truth), 0.97) << "seed " << seed;
    EXPECT_NEAR(outcome.mean_in / 256.0, 90, 2);
    EXPECT_NEAR(outcome.mean_out / 256.0, 40, 2);
  }
}

TEST(LevelSet, ContourInsideTheObjectGrowsToIt) {
  Scene scene(120, 20, 5, 3);
  const cv::Rect start(55, 45, 10, 10);
  cv::Mat_<std::uint16_t> labels = start_rect(start);
  evolve({.margin_px = 24, .max_iterations = 60}, scene.feature, labels, box_of(start));
  EXPECT_GE(iou(labels, scene.truth), 0.98);
}

TEST(LevelSet, DarkObjectOnBrightGroundIsTheSame) {
  Scene scene(30, 140, 5, 3);
  const cv::Rect start(36, 26, 50, 50);
  cv::Mat_<std::uint16_t> labels = start_rect(start);
  evolve({.max_iterations = 60}, scene.feature, labels, box_of(start));
  EXPECT_GE(iou(labels, scene.truth), 0.98);
}

TEST(LevelSet, WeightOfTheContourRemovesSpeckle) {
  Scene scene(90, 40, 25, 2);
  const cv::Rect start(30, 20, 60, 60);
  cv::Mat_<std::uint16_t> rough = start_rect(start);
  cv::Mat_<std::uint16_t> smooth = start_rect(start);
  evolve({.max_iterations = 60, .contour_weight = 0}, scene.feature, rough, box_of(start));
  evolve({.max_iterations = 60, .contour_weight = 1500}, scene.feature, smooth, box_of(start));
  EXPECT_GT(iou(smooth, scene.truth), 0.9);
  EXPECT_GT(iou(smooth, scene.truth), iou(rough, scene.truth) + 0.1);
}

// An object of two halves on empty ground, differing by 25 and by 200: the mean of both is nearer to the ground
// for the weak half, unless the cap makes them alike.
TEST(LevelSet, CapKeepsTheWeakHalfOfAnObject) {
  cv::Mat_<std::uint8_t> feature(kHeight, kWidth, std::uint8_t{2});
  feature(cv::Rect(40, 30, 20, 40)).setTo(25);
  feature(cv::Rect(60, 30, 20, 40)).setTo(200);
  for (const int cap : {30, 255}) {
    cv::Mat_<std::uint16_t> labels = start_rect({40, 30, 40, 40});
    Arena arena;
    auto stage = LevelSet::create({.max_iterations = 60, .feature_cap = cap}, kWidth, kHeight, arena);
    ASSERT_TRUE(stage.has_value());
    const auto outcome = stage->run(const_view(feature), view(labels), {40, 30, 40, 40}, 1);
    ASSERT_TRUE(outcome.has_value());
    EXPECT_NEAR(outcome->blob.area, cap == 30 ? 1600 : 800, 30) << cap;
  }
}

TEST(LevelSet, EnergyFallsWithEachIterationByWhatIsReported) {
  Scene scene(90, 40, 20, 7);
  const cv::Rect start(42, 22, 38, 38);
  const cv::Rect domain(30, 10, 62, 62);
  cv::Mat_<std::uint16_t> first = start_rect(start);
  const double energy_start = naive_energy(scene.feature, first, domain, 300);
  double last = energy_start + 1;
  int settled = 0;
  for (int n = 0; n <= 40; ++n) {
    cv::Mat_<std::uint16_t> labels = start_rect(start);
    const auto outcome =
        evolve({.margin_px = 12, .max_iterations = n, .contour_weight = 300}, scene.feature, labels, box_of(start));
    const double energy = naive_energy(scene.feature, labels, domain, 300);
    EXPECT_NEAR(static_cast<double>(outcome.energy_drop) / 65536, energy_start - energy, 1e-5 * energy_start);
    if (outcome.converged) {
      EXPECT_LE(energy, last);
      ++settled;
    } else {
      EXPECT_LT(energy, last) << n;
    }
    last = energy;
  }
  EXPECT_GT(settled, 0);
  EXPECT_LT(last, 0.7 * energy_start);
}

TEST(LevelSet, StopsAtItsIterations) {
  Scene scene(90, 40, 5, 1);
  const cv::Rect start(57, 47, 6, 6);
  for (const int n : {0, 1, 5}) {
    cv::Mat_<std::uint16_t> labels = start_rect(start);
    const auto outcome = evolve({.margin_px = 30, .max_iterations = n}, scene.feature, labels, box_of(start));
    EXPECT_EQ(outcome.iterations, n);
    EXPECT_FALSE(outcome.converged);
    // A pixel an iteration in each direction.
    EXPECT_LE(outcome.blob.box.width, 6 + 2 * n);
    EXPECT_EQ(outcome.blob.area, cv::countNonZero(labels == 1));
    if (n == 0) {
      EXPECT_EQ(outcome.blob.area, 36);
    }
  }
}

// All is bright but a dark strip, which alone is outside at the start: the contour would run over the picture.
TEST(LevelSet, NeverLeavesTheMarginBox) {
  const Rect box{50, 40, 20, 20};
  for (const int margin : {0, 1, 7}) {
    cv::Mat_<std::uint8_t> feature(kHeight, kWidth, std::uint8_t{200});
    feature(cv::Rect(50, 40, 20, 4)).setTo(10);
    cv::Mat_<std::uint16_t> labels = start_rect({50, 46, 20, 14});
    const auto outcome =
        evolve({.margin_px = margin, .max_iterations = 100, .contour_weight = 100}, feature, labels, box);
    const cv::Rect domain(50 - margin, 40 - margin, 20 + 2 * margin, 20 + 2 * margin);
    EXPECT_TRUE(outcome.converged);
    EXPECT_EQ(outcome.blob.area, domain.area() - 80);
    labels(domain).setTo(0);
    EXPECT_EQ(cv::countNonZero(labels), 0) << margin;
  }
}

TEST(LevelSet, OtherLabelsAreNeverTaken) {
  Scene scene(90, 40, 5, 4);
  const cv::Rect start(40, 30, 40, 20);  // upper half; the lower half of the disc is another's
  cv::Mat_<std::uint16_t> labels = start_rect(start);
  labels(cv::Rect(30, 50, 60, 30)).setTo(2);
  evolve({.margin_px = 20, .max_iterations = 60}, scene.feature, labels, box_of(start));
  EXPECT_EQ(cv::countNonZero(labels == 2), 60 * 30);
  cv::Mat_<std::uint8_t> upper = scene.truth.clone();
  upper.rowRange(50, kHeight).setTo(0);
  EXPECT_GE(iou(labels, upper), 0.97);
}

TEST(LevelSet, ObjectCutByThePictureIsKept) {
  cv::Mat_<std::uint8_t> feature(kHeight, kWidth, std::uint8_t{20});
  feature(cv::Rect(0, 0, 15, 20)).setTo(120);
  const cv::Rect start(0, 0, 20, 15);
  cv::Mat_<std::uint16_t> labels = start_rect(start);
  const auto outcome = evolve({.margin_px = 10, .max_iterations = 40}, feature, labels, box_of(start));
  EXPECT_TRUE(outcome.converged);
  EXPECT_NEAR(outcome.blob.area, 300, 6);  // the corner may be rounded
  EXPECT_EQ(outcome.blob.sides, kLeftSide | kTopSide);
  EXPECT_EQ(labels(0, 0), 1);
}

TEST(LevelSet, RegionThatFillsThePictureStays) {
  cv::Mat_<std::uint8_t> feature = test::random_grey(kWidth, kHeight, 1);
  cv::Mat_<std::uint16_t> labels(kHeight, kWidth, std::uint16_t{1});
  const auto outcome = evolve({}, feature, labels, {0, 0, kWidth, kHeight});
  EXPECT_TRUE(outcome.converged);
  EXPECT_EQ(outcome.blob.area, kWidth * kHeight);
}

TEST(LevelSet, RegionOfNoContrastUnderAHeavyContourVanishes) {
  cv::Mat_<std::uint8_t> feature(kHeight, kWidth, std::uint8_t{50});
  const cv::Rect start(50, 50, 4, 4);
  cv::Mat_<std::uint16_t> labels = start_rect(start);
  const auto outcome = evolve({.max_iterations = 50, .contour_weight = 1000}, feature, labels, box_of(start));
  EXPECT_TRUE(outcome.converged);
  EXPECT_EQ(outcome.blob.area, 0);
  EXPECT_EQ(cv::countNonZero(labels), 0);
}

TEST(LevelSet, AbsentLabelAndEmptyBoxAreNoFault) {
  Scene scene(90, 40, 5, 4);
  cv::Mat_<std::uint16_t> labels(kHeight, kWidth, std::uint16_t{0});
  EXPECT_EQ(evolve({}, scene.feature, labels, {10, 10, 20, 20}).blob.area, 0);
  EXPECT_EQ(evolve({}, scene.feature, labels, {}).blob.area, 0);
  EXPECT_EQ(evolve({}, scene.feature, labels, {500, 500, 3, 3}).blob.area, 0);
  EXPECT_EQ(cv::countNonZero(labels), 0);
}

TEST(LevelSet, PictureOfOnePixel) {
  cv::Mat_<std::uint8_t> feature(1, 1, std::uint8_t{9});
  cv::Mat_<std::uint16_t> labels(1, 1, std::uint16_t{1});
  const auto outcome = evolve({}, feature, labels, {0, 0, 1, 1});
  EXPECT_TRUE(outcome.converged);
  EXPECT_EQ(outcome.blob.area, 1);
}

TEST(LevelSet, WorkspaceLeavesNothingBehind) {
  Scene scene(90, 40, 12, 1);
  const cv::Rect start(42, 22, 38, 38);
  Arena arena;
  auto stage = LevelSet::create({}, kWidth, kHeight, arena);
  ASSERT_TRUE(stage.has_value());
  cv::Mat_<std::uint16_t> first = start_rect(start);
  cv::Mat_<std::uint16_t> other(kHeight, kWidth, std::uint16_t{1});
  cv::Mat_<std::uint16_t> second = start_rect(start);
  ASSERT_TRUE(stage->run(const_view(scene.feature), view(first), box_of(start), 1).has_value());
  ASSERT_TRUE(stage->run(const_view(scene.feature), view(other), {3, 3, 60, 80}, 1).has_value());
  ASSERT_TRUE(stage->run(const_view(scene.feature), view(second), box_of(start), 1).has_value());
  EXPECT_EQ(cv::countNonZero(first != second), 0);
}

TEST(LevelSet, FaultsLeaveTheLabels) {
  Arena arena;
  auto stage = LevelSet::create({}, 8, 6, arena);
  ASSERT_TRUE(stage.has_value());
  cv::Mat_<std::uint8_t> feature(6, 8, std::uint8_t{9});
  cv::Mat_<std::uint16_t> labels(6, 8, std::uint16_t{1});
  cv::Mat_<std::uint16_t> wrong(6, 9, std::uint16_t{1});
  EXPECT_EQ(stage->run(const_view(feature), view(wrong), {0, 0, 2, 2}, 1).error(), Fault::kBadSize);
  EXPECT_EQ(stage->run(const_view(feature), view(labels), {0, 0, 2, 2}, 0).error(), Fault::kBadConfig);
  EXPECT_EQ(cv::countNonZero(wrong != 1) + cv::countNonZero(labels != 1), 0);
}

TEST(LevelSet, BadConfigurationIsRefused) {
  Arena arena;
  EXPECT_EQ(LevelSet::create({}, 0, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(LevelSet::create({.margin_px = -1}, 6, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(LevelSet::create({.max_iterations = -1}, 6, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(LevelSet::create({.contour_weight = 65026}, 6, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(LevelSet::create({.feature_cap = 0}, 6, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(LevelSet::create({.feature_cap = 256}, 6, 6, arena).error(), Fault::kBadConfig);
  arena.seal();
  EXPECT_EQ(LevelSet::create({}, 6, 6, arena).error(), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
