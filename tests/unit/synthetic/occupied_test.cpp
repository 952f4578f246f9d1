#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

constexpr std::uint32_t kStanding = 6;  ///< ids 1 .. 6

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticOccupied, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("occupied", small(), 1), 0xc1b69432a151f959ULL);
  EXPECT_EQ(hash_at("occupied", small(), 150), 0x54b85e95675d6097ULL);
}

int count(const GroundTruth& truth, std::uint8_t label) {
  int n = 0;
  for (const std::uint8_t l : truth.labels) n += l == label ? 1 : 0;
  return n;
}

class SyntheticOccupiedSeeds : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SyntheticOccupiedSeeds, WhatStandsIsUnknownUntilItMovesAndThenAnObject) {
  SyntheticOptions options = small(GetParam());
  options.frames = 400;
  const auto source = open_synthetic("occupied", options);
  std::map<std::uint32_t, std::uint64_t> decided;  // first frame
  std::map<std::uint32_t, std::uint64_t> stood;    // last frame
  std::map<std::uint32_t, std::uint64_t> last_seen;
  std::map<std::uint32_t, Rect> box_before;
  FramePair pair;
  while (source->next(pair) == Next::kPair) {
    const GroundTruth& truth = source->truth();
    int undecided_px = 0;
    int decided_px = 0;
    for (const TrueObject& o : truth.objects) {
      (o.undecided ? undecided_px : decided_px) += o.visible_px;
      last_seen[o.id] = pair.ordinal;
      if (o.undecided) {
        EXPECT_LE(o.id, kStanding);
        EXPECT_FALSE(o.scored());
        stood[o.id] = pair.ordinal;
        EXPECT_EQ(decided.count(o.id), 0U) << "object " << o.id << " stands again";
        if (o.hidden_px == 0) {  // nobody before it
          const Rect before = box_before.try_emplace(o.id, o.box).first->second;
          // A pixel at the edge may fall to what goes by behind it.
          EXPECT_NEAR(o.box.left, before.left, 1) << "object " << o.id << " moves in frame " << pair.ordinal;
          EXPECT_NEAR(o.box.top, before.top, 1) << "object " << o.id << " moves in frame " << pair.ordinal;
        }
      } else if (decided.count(o.id) == 0) {
        decided[o.id] = pair.ordinal;
      }
    }
    EXPECT_EQ(count(truth, GroundTruth::kUnknown), undecided_px) << "frame " << pair.ordinal;
    EXPECT_EQ(count(truth, GroundTruth::kMoving), decided_px) << "frame " << pair.ordinal;
    if (pair.ordinal == 1) {
      EXPECT_EQ(truth.objects.size(), kStanding);
      EXPECT_EQ(decided_px, 0);
    }
  }
  ASSERT_EQ(decided.size(), 9U);
  // Seen standing until `last` at the latest, moving from `first` on; others may hide the moment itself.
  const auto moves_within = [&](std::uint32_t id, std::uint64_t first, std::uint64_t last) {
    EXPECT_GE(decided[id], first) << "object " << id;
    EXPECT_LT(stood[id], last) << "object " << id;
  };
  moves_within(1, 13, 22);
  moves_within(2, 31, 50);
  moves_within(3, 76, 107);
  moves_within(4, 70, 113);
  moves_within(5, 121, 161);
  moves_within(6, 223, 254);
  for (std::uint32_t id = 1; id <= kStanding; ++id) EXPECT_LT(last_seen[id], 400U) << "object " << id << " stays";
}

// The place of what has left is that of the empty yard.
TEST_P(SyntheticOccupiedSeeds, PlaceIsBackgroundOnceEmpty) {
  SyntheticOptions options = small(GetParam());
  options.frames = 400;
  const auto source = open_synthetic("occupied", options);
  FramePair pair;
  ASSERT_EQ(source->next(pair), Next::kPair);
  const std::vector<std::uint8_t> first = source->truth().labels;
  const std::vector<std::uint16_t> disparity = source->truth().disparity;
  source->skip_to(398);
  ASSERT_EQ(source->next(pair), Next::kPair);
  int emptied = 0;
  for (std::size_t p = 0; p < first.size(); ++p) {
    if (first[p] != GroundTruth::kUnknown || source->truth().labels[p] != GroundTruth::kStill) continue;
    ++emptied;
    EXPECT_LE(source->truth().disparity[p], disparity[p] + 2);  // 1/256 px
  }
  EXPECT_GT(emptied, 500);
}

TEST_P(SyntheticOccupiedSeeds, PasserByWhoStopsStaysAnObject) {
  SyntheticOptions options = small(GetParam());
  options.frames = 300;
  const auto source = open_synthetic("occupied", options);
  FramePair pair;
  int still_for = 0;
  int longest = 0;
  double x_before = 0;
  while (source->next(pair) == Next::kPair) {
    for (const TrueObject& o : source->truth().objects) {
      if (o.id != kStanding + 1) continue;
      EXPECT_FALSE(o.undecided);
      still_for = std::abs(o.x - x_before) < 0.004 ? still_for + 1 : 0;
      longest = std::max(longest, still_for);
      x_before = o.x;
    }
  }
  EXPECT_GT(longest, 90);
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticOccupiedSeeds, testing::Values(1, 2));

TEST(SyntheticOccupied, LaterCastsComeFromOutside) {
  SyntheticOptions options = small();
  options.frames = 2000;
  const auto source = open_synthetic("occupied", options);
  source->skip_to(1100);
  FramePair pair;
  ASSERT_EQ(source->next(pair), Next::kPair);
  for (const TrueObject& o : source->truth().objects) {
    EXPECT_FALSE(o.undecided);
    EXPECT_GT(o.id, 16U);
  }
}

}  // namespace
}  // namespace stereotrack::capture
