#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "drivers/capture/synthetic/scenes/crossing.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticCrossing, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("crossing", small(), 1), 0x46617fc8b4ecbdf9ULL);
  EXPECT_EQ(hash_at("crossing", small(), 300), 0x515144085ab60ad3ULL);
}

class SyntheticCrossingSeeds : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SyntheticCrossingSeeds, WhoIsBehindIsHalfHiddenForAsLongAsTheHeaderSays) {
  constexpr double kFps = 20;
  SyntheticOptions options = small(GetParam());
  options.fps = kFps;
  options.frames = 440;
  const auto source = open_synthetic("crossing", options);
  std::map<std::uint32_t, int> hidden_for;
  std::map<std::uint32_t, int> longest;
  std::map<std::uint32_t, int> seen;
  FramePair pair;
  while (source->next(pair) == Next::kPair) {
    std::map<std::uint32_t, int> now;
    int moving = 0;
    for (const TrueObject& o : source->truth().objects) {
      ++seen[o.id];
      moving += o.visible_px;
      if (o.hidden_px >= o.visible_px) now[o.id] = hidden_for[o.id] + 1;
      longest[o.id] = std::max(longest[o.id], now[o.id]);
    }
    hidden_for = now;
    const auto& labels = source->truth().labels;
    EXPECT_EQ(moving, std::count(labels.begin(), labels.end(), GroundTruth::kMoving)) << "frame " << pair.ordinal;
  }
  ASSERT_EQ(seen.size(), 12U);
  EXPECT_EQ(seen.rbegin()->first, 12U);
  for (const auto& [id, frames] : seen) {
    EXPECT_GE(frames, 2.5 * kFps) << "person " << id;
    // Somebody who comes in behind another one is gone from the truth while all of him is hidden.
    EXPECT_LE(longest[id], 1.5 * kFps + 2) << "person " << id;
  }
  // Two frames for the coarser picture.
  const auto hidden = [&](std::uint32_t id, double least_s) {
    EXPECT_GE(longest[id], std::max(1.0, least_s * kFps - 2)) << "person " << id;
  };
  hidden(2, 0.1);
  hidden(4, 0.1);
  hidden(6, 0.6);
  hidden(8, 0.2);
  hidden(10, 1.0);
  hidden(12, 0.1);
}

TEST_P(SyntheticCrossingSeeds, ClothesAreTheSameOrDifferentByPair) {
  const synthetic::Scene scene = synthetic::make_crossing(GetParam());
  const std::vector<synthetic::Actor> people = scene.cast(0);
  ASSERT_EQ(people.size(), 12U);
  for (std::size_t i = 0; i < people.size(); i += 2) {
    const bool same = people[i].materials == people[i + 1].materials;
    EXPECT_EQ(same, i == 2 || i == 8 || i == 10) << "pair " << i / 2 + 1;
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticCrossingSeeds, testing::Range<std::uint64_t>(1, 6));

}  // namespace
}  // namespace stereotrack::capture
