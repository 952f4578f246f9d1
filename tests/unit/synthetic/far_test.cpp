#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticFar, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("far", small(), 1), 0x9b386c2f2349b384ULL);
  EXPECT_EQ(hash_at("far", small(), 300), 0xbb83dff5aa49edb1ULL);
}

class SyntheticFarSeeds : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SyntheticFarSeeds, WholeTargetsAreSixPixelsWideAndHigh) {
  SyntheticOptions options;
  options.seed = GetParam();
  options.truth = true;
  options.fps = 2;
  options.frames = 40;
  const auto source = open_synthetic("far", options);
  std::map<std::uint32_t, int> seen;
  std::set<std::uint32_t> whole;
  FramePair pair;
  while (source->next(pair) == Next::kPair) {
    const GroundTruth& truth = source->truth();
    int objects = 0;
    for (const TrueObject& o : truth.objects) {
      ++seen[o.id];
      objects += o.visible_px;
      EXPECT_LE(o.box.width, 8) << "ball " << o.id;
      EXPECT_LE(o.box.height, 8) << "ball " << o.id;
      EXPECT_LE(o.visible_px, 40) << "ball " << o.id;
      EXPECT_GT(o.z, 11.0);
      EXPECT_LT(o.z, 29.0);
      if (o.visible_px < 0.95 * o.whole_px || o.hidden_px > 0) continue;
      whole.insert(o.id);
      EXPECT_GE(o.box.width, 5) << "ball " << o.id << " frame " << pair.ordinal;
      EXPECT_GE(o.box.height, 5) << "ball " << o.id << " frame " << pair.ordinal;
      EXPECT_GE(o.visible_px, 20) << "ball " << o.id << " frame " << pair.ordinal;
    }
    EXPECT_EQ(objects, std::count(truth.labels.begin(), truth.labels.end(), GroundTruth::kMoving));
  }
  ASSERT_EQ(seen.size(), 9U);
  EXPECT_EQ(whole.size(), 9U);
  for (const auto& [id, frames] : seen) EXPECT_GE(frames, 5) << "ball " << id;
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticFarSeeds, testing::Range<std::uint64_t>(1, 6));

}  // namespace
}  // namespace stereotrack::capture
