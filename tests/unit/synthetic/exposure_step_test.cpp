#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticExposureStep, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("exposure_step", small(), 1), 0xfedf044f4cb4ed9aULL);
  EXPECT_EQ(hash_at("exposure_step", small(), 215), 0x6d0e537b8cc94b8bULL);
}

double mean(const Picture& p, int top, int bottom) {
  double sum = 0;
  for (int y = top; y < bottom; ++y) {
    for (int x = 0; x < p.width; ++x) sum += luma(p, x, y);
  }
  return sum / ((bottom - top) * p.width);
}

class SyntheticExposureStepSeeds : public testing::TestWithParam<std::uint64_t> {};

// Light x k makes levels x k^(29/64). Sky and roofs, where nobody is and no lamp shines.
TEST_P(SyntheticExposureStepSeeds, StepsHaveTheStatedSizeInBothCameras) {
  SyntheticOptions options = small(GetParam());
  options.frames = 420;
  options.truth = false;
  const auto source = open_synthetic("exposure_step", options);
  std::vector<double> left(421, 0.0);
  std::vector<double> right(421, 0.0);
  FramePair pair;
  while (source->next(pair) == Next::kPair) {
    left[pair.ordinal] = mean(pair.left, 0, 12);
    right[pair.ordinal] = mean(pair.right, 0, 12);
  }
  const auto exponent = [](double ratio) { return std::pow(ratio, 64.0 / 29.0); };
  std::vector<std::uint64_t> steps;
  for (std::uint64_t i = 2; i <= 420; ++i) {
    const double l = exponent(left[i] / left[i - 1]);
    const double r = exponent(right[i] / right[i - 1]);
    EXPECT_NEAR(l, r, 0.05) << "frame " << i;
    if (std::abs(l - 1.0) > 0.1) steps.push_back(i);
  }
  ASSERT_EQ(steps.size(), 3U);
  const auto step = [&](std::uint64_t i) { return exponent(left[i] / left[i - 1]); };
  EXPECT_NEAR(step(steps[0]), 1.5, 0.05);
  EXPECT_NEAR(step(steps[1]), 1 / 1.4, 0.03);
  EXPECT_NEAR(step(steps[2]), 0.7, 0.03);
  EXPECT_NEAR(static_cast<double>(steps[0]), 86, 10);
  EXPECT_NEAR(static_cast<double>(steps[1]), 141, 10);
  EXPECT_NEAR(static_cast<double>(steps[2]), 241, 10);
  // The ramp, apart from the clouds' few per cent.
  EXPECT_NEAR(exponent(left[318] / left[275]), 4.0 / 3.0, 0.08);
}

TEST_P(SyntheticExposureStepSeeds, FloodlightAddsLightToAPartOfTheYard) {
  SyntheticOptions options = small(GetParam());
  options.frames = 420;
  const auto source = open_synthetic("exposure_step", options);
  constexpr int kTile = 8;
  std::vector<double> before(20 * 15, 0.0);
  std::vector<double> now(20 * 15, 0.0);
  std::uint64_t on = 0;
  double most = 0;
  double least = 0;
  FramePair pair;
  source->skip_to(178);
  while (on == 0 && source->next(pair) == Next::kPair && pair.ordinal < 205) {
    most = 0;
    least = 9;
    for (int y = 0; y < 15; ++y) {
      for (int x = 0; x < 20; ++x) {
        double sum = 0;
        bool still = true;
        for (int i = 0; i < kTile * kTile; ++i) {
          const int u = x * kTile + i % kTile;
          const int v = y * kTile + i / kTile;
          still = still && source->truth().labels[static_cast<std::size_t>(v * 160 + u)] == GroundTruth::kStill;
          sum += luma(pair.left, u, v);
        }
        const auto t = static_cast<std::size_t>(y * 20 + x);
        now[t] = still ? sum : 0.0;
        if (now[t] == 0 || before[t] == 0) continue;
        most = std::max(most, now[t] / before[t]);
        least = std::min(least, now[t] / before[t]);
      }
    }
    if (pair.ordinal > 179 && most > 1.1) on = pair.ordinal;
    std::swap(before, now);
  }
  ASSERT_NE(on, 0U) << "no light comes on";
  EXPECT_NEAR(static_cast<double>(on), 191, 10);
  EXPECT_GT(most, 1.12);
  EXPECT_LT(most, 1.6);
  EXPECT_NEAR(least, 1.0, 0.03);
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticExposureStepSeeds, testing::Values(1, 2));

TEST(SyntheticExposureStep, MaskIsThatOfTheObjects) {
  const auto source = open_synthetic("exposure_step", small());
  FramePair pair;
  std::size_t seen = 0;
  for (const std::uint64_t ordinal : {40U, 86U, 150U, 200U, 260U, 300U}) {
    source->skip_to(ordinal - 1);
    ASSERT_EQ(source->next(pair), Next::kPair);
    int objects = 0;
    int moving = 0;
    for (const TrueObject& o : source->truth().objects) objects += o.visible_px;
    for (const std::uint8_t l : source->truth().labels) {
      EXPECT_TRUE(l == GroundTruth::kStill || l == GroundTruth::kShadow || l == GroundTruth::kMoving);
      moving += l == GroundTruth::kMoving ? 1 : 0;
    }
    EXPECT_EQ(objects, moving);
    seen += source->truth().objects.size();
  }
  EXPECT_GE(seen, 10U);
}

}  // namespace
}  // namespace stereotrack::capture
