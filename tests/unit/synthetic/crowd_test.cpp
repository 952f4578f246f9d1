#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticCrowd, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("crowd", small(), 1), 0xcef74473b51ac15bULL);
  EXPECT_EQ(hash_at("crowd", small(), 240), 0xea4b76e9bf3cdac6ULL);
}

class SyntheticCrowdSeeds : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SyntheticCrowdSeeds, FortyAreInViewAtThePeak) {
  SyntheticOptions options = small(GetParam());
  options.width = 320;
  options.height = 240;
  options.fps = 4;
  options.frames = 52;
  const auto source = open_synthetic("crowd", options);
  source->skip_to(24);
  std::set<std::uint32_t> ids;
  int most = 0;
  int over_thirty = 0;
  FramePair pair;
  while (source->next(pair) == Next::kPair) {
    int scored = 0;
    int moving = 0;
    for (const TrueObject& o : source->truth().objects) {
      ids.insert(o.id);
      scored += o.scored() ? 1 : 0;
      moving += o.visible_px;
    }
    const auto& labels = source->truth().labels;
    EXPECT_EQ(moving, std::count(labels.begin(), labels.end(), GroundTruth::kMoving)) << "frame " << pair.ordinal;
    most = std::max(most, scored);
    over_thirty += scored > 30 ? 1 : 0;
  }
  EXPECT_GE(most, 40);
  EXPECT_GE(over_thirty, 12);
  EXPECT_GT(ids.size(), 45U);
  EXPECT_LE(*ids.rbegin(), 52U);
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticCrowdSeeds, testing::Range<std::uint64_t>(1, 6));

}  // namespace
}  // namespace stereotrack::capture
