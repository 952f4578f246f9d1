// The scene of a bad link: what of its wrong pairs the pipeline tells, and that it tells no others.
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "pipeline/pipeline.hpp"
#include "tests/unit/pipeline/scene_setup.hpp"

namespace stereotrack {
namespace {

// Soon before it nobody is there any more in seed 1.
constexpr std::uint64_t kLast = 380;

TEST(Dropout, WrongPairsAreToldWhereSomethingMovesFastEnough) {
  capture::SyntheticSource source("dropout", {.seed = 1, .frames = kLast});
  Arena arena;
  Result<Pipeline> pipeline = Pipeline::create({}, test::setup_of(source), arena);
  ASSERT_TRUE(pipeline.has_value());
  int wrong = 0;
  int told = 0;
  std::vector<std::uint64_t> false_alarms;
  bool wrong_before = false;
  FramePair pair;
  for (capture::Next next = source.next(pair); next != capture::Next::kEnd; next = source.next(pair)) {
    if (next != capture::Next::kPair) continue;
    const Result<FrameResult> result = pipeline->run(pair);
    ASSERT_TRUE(result.has_value());
    const bool is_wrong = source.delivery().right_off != 0;
    const bool is_told = (result->flags & kFlagWrongPair) != 0;
    wrong += is_wrong ? 1 : 0;
    told += is_wrong && is_told ? 1 : 0;
    // One that was not told has moved the targets' distances, so that the next right one looks wrong.
    if (is_told && !is_wrong && !wrong_before) false_alarms.push_back(pair.ordinal);
    wrong_before = is_wrong;
  }
  EXPECT_EQ(wrong, 28);
  EXPECT_GE(told, 17);
  EXPECT_TRUE(false_alarms.empty()) << false_alarms.size() << ", the first in pair " << false_alarms.front();
}

}  // namespace
}  // namespace stereotrack
