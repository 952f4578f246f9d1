#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticDark, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("dark", small(), 1), 0x86c60b6e573659daULL);
  EXPECT_EQ(hash_at("dark", small(), 250), 0xb9d9e6193f95f06fULL);
}

class SyntheticDarkSeeds : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SyntheticDarkSeeds, PictureIsDarkAndNoisy) {
  SyntheticOptions options = small(GetParam());
  options.fps = 1000;  // the light does not change meanwhile
  const auto source = open_synthetic("dark", options);
  constexpr int kFrames = 16;
  std::vector<double> sum(160 * 120, 0.0);
  std::vector<double> square(160 * 120, 0.0);
  FramePair pair;
  for (int i = 0; i < kFrames; ++i) {
    ASSERT_EQ(source->next(pair), Next::kPair);
    EXPECT_TRUE(source->truth().objects.empty());
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 160; ++x) {
        const double v = luma(pair.left, x, y);
        sum[static_cast<std::size_t>(y * 160 + x)] += v;
        square[static_cast<std::size_t>(y * 160 + x)] += v * v;
      }
    }
  }
  double variance = 0;
  double floor = 0;
  double brightest = 0;
  for (std::size_t p = 0; p < sum.size(); ++p) {
    variance += (square[p] - sum[p] * sum[p] / kFrames) / (kFrames - 1) / static_cast<double>(sum.size());
    brightest = std::max(brightest, sum[p] / kFrames);
    if (p >= 160 * 60) floor += sum[p] / kFrames / (160 * 60);
  }
  EXPECT_GT(std::sqrt(variance), 5.0);
  EXPECT_LT(std::sqrt(variance), 7.5);
  EXPECT_GT(floor, 25);
  EXPECT_LT(floor, 50);
  EXPECT_LT(brightest, 90);
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticDarkSeeds, testing::Range<std::uint64_t>(1, 6));

TEST(SyntheticDark, TruthIsThere) {
  const auto source = open_synthetic("dark", small());
  FramePair pair;
  int seen = 0;
  for (const std::uint64_t ordinal : {170U, 210U, 250U}) {
    source->skip_to(ordinal - 1);
    ASSERT_EQ(source->next(pair), Next::kPair);
    int objects = 0;
    for (const TrueObject& o : source->truth().objects) objects += o.visible_px;
    const auto& labels = source->truth().labels;
    EXPECT_EQ(objects, std::count(labels.begin(), labels.end(), GroundTruth::kMoving));
    seen += static_cast<int>(source->truth().objects.size());
  }
  EXPECT_GE(seen, 3);
}

}  // namespace
}  // namespace stereotrack::capture
