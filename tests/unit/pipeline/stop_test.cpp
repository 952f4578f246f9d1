// Who stands still before a background that was seen shorter than that stays a target.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <set>

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "pipeline/pipeline.hpp"
#include "tests/unit/pipeline/scene_setup.hpp"

namespace stereotrack {
namespace {

// In seed 1 the second one stands from the second second to the seventh.
constexpr std::uint32_t kWho = 2;
constexpr std::uint64_t kFrom = 60;
constexpr std::uint64_t kTo = 200;

TEST(Stop, WhoStandsForFiveSecondsKeepsItsIdentityAndIsSeenAllTheTime) {
  capture::SyntheticSource source("stop-and-go",
                                  {.seed = 1, .frames = kTo, .width = 320, .height = 240, .truth = true});
  Arena arena;
  Result<Pipeline> pipeline = Pipeline::create({}, test::setup_of(source), arena);
  ASSERT_TRUE(pipeline.has_value());
  std::set<std::uint32_t> ids;
  int seen = 0;
  FramePair pair;
  while (source.next(pair) == capture::Next::kPair) {
    const Result<FrameResult> result = pipeline->run(pair);
    ASSERT_TRUE(result.has_value());
    if (pair.ordinal < kFrom) continue;
    const auto& objects = source.truth().objects;
    const auto who = std::find_if(objects.begin(), objects.end(), [](const auto& object) { return object.id == kWho; });
    ASSERT_NE(who, objects.end());
    for (const TrackReport& track : result->tracks) {
      if (!track.measured || track.state != TrackState::kConfirmed || overlap(track.box, who->box) < 0.5) continue;
      ids.insert(track.id);
      ++seen;
    }
  }
  EXPECT_EQ(ids.size(), 1U);
  EXPECT_GE(seen, 135) << "of " << kTo - kFrom + 1;
}

}  // namespace
}  // namespace stereotrack
