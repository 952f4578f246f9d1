// Right pictures of another instant than the left ones: a driver or a cable has lost a frame, and the stamps agree.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "pipeline/pipeline.hpp"
#include "tests/support/moving_scene.hpp"
#include "tests/support/scene_cases.hpp"

namespace stereotrack::test {
namespace {

// From here on two boards go 2 px a frame each, towards each other, before a wall.
constexpr int kFirst = 751;

class WrongPairs : public testing::Test {
 protected:
  WrongPairs() : scene_(kSceneFormats[0]) {
    Pipeline::Setup setup;
    setup.width = MovingScene::kWidth;
    setup.height = MovingScene::kHeight;
    setup.colour = true;
    setup.calibration = &calibration_;
    setup.decisions.context = this;
    setup.decisions.mispaired = [](void* context, const WrongPair& pair) noexcept {
      static_cast<WrongPairs*>(context)->told_ = pair;
    };
    const Result<Pipeline> made =
        Pipeline::create(scene_config({"robust", &kSceneFormats[0], SceneMatching::kRegions}), setup, arena_);
    EXPECT_TRUE(made.has_value());
    if (made.has_value()) pipeline_.emplace(*made);
  }

  /// The left picture of `ordinal` with the right one of `off` frames later.
  FrameResult run(int ordinal, int off = 0) {
    told_.reset();
    FramePair pair = scene_.pair(ordinal, true);
    const std::vector<std::uint8_t> left(pair.left.data, pair.left.data + pair.left.stride_bytes * pair.left.height);
    const Picture right = scene_.pair(ordinal + off, true).right;
    pair.left.data = left.data();
    pair.right = right;
    const Result<FrameResult> result = pipeline_->run(pair);
    EXPECT_TRUE(result.has_value());
    return result.has_value() ? *result : FrameResult{};
  }

  /// Distances of the confirmed targets, by id.
  static std::map<std::uint32_t, double> distances(const FrameResult& result) {
    std::map<std::uint32_t, double> z;
    for (const TrackReport& track : result.tracks) {
      if (track.state == TrackState::kConfirmed && track.has_depth) z[track.id] = track.position.z();
    }
    return z;
  }

  StereoCalibration calibration_ = MovingScene::calibration();
  MovingScene scene_;
  Arena arena_;
  std::optional<Pipeline> pipeline_;
  std::optional<WrongPair> told_;
};

TEST_F(WrongPairs, AreTurnedDownAndTheTargetsKeepTheirDistances) {
  for (const int off : {1, -1}) {
    FrameResult result;
    for (int ordinal = kFirst - 40; ordinal <= kFirst + 20; ++ordinal) result = run(ordinal);
    const std::map<std::uint32_t, double> before = distances(result);
    ASSERT_EQ(before.size(), 2U);
    for (int ordinal = kFirst + 21; ordinal <= kFirst + 24; ++ordinal) {
      result = run(ordinal, off);
      EXPECT_EQ(result.flags & kFlagWrongPair, kFlagWrongPair) << ordinal;
      ASSERT_TRUE(told_.has_value()) << ordinal;
      EXPECT_NEAR(told_->lag_s, off / 30.0, 1e-3);
      EXPECT_EQ(told_->witnesses, 2);
      for (const Detection& detection : result.detections) EXPECT_FALSE(detection.has_depth);
      const std::map<std::uint32_t, double> now = distances(result);
      ASSERT_EQ(now.size(), 2U) << ordinal;
      for (const auto& [id, z] : before) {
        ASSERT_TRUE(now.contains(id));
        EXPECT_NEAR(now.at(id), z, 0.02 * z) << ordinal;
      }
    }
    result = run(kFirst + 25);
    EXPECT_EQ(result.flags & kFlagWrongPair, 0U);
    EXPECT_FALSE(told_.has_value());
    EXPECT_EQ(distances(result).size(), 2U);
    for (const Detection& detection : result.detections) EXPECT_TRUE(detection.has_depth);
  }
}

TEST_F(WrongPairs, NoTargetBeginsWithOne) {
  for (int ordinal = kFirst - 40; ordinal <= kFirst + 20; ++ordinal) (void)run(ordinal);
  std::uint32_t last = 0;
  for (const TrackReport& track : run(kFirst + 21).tracks) last = std::max(last, track.id);
  for (int ordinal = kFirst + 22; ordinal <= kFirst + 30; ++ordinal) {
    for (const TrackReport& track : run(ordinal, 1).tracks) EXPECT_LE(track.id, last);
  }
}

// Boards that turn back, cross each other and stop; another light.
TEST_F(WrongPairs, ThereIsNoneInAThousandRightOnes) {
  for (int ordinal = 1; ordinal <= MovingScene::kFrames; ++ordinal) {
    EXPECT_EQ(run(ordinal).flags & kFlagWrongPair, 0U) << ordinal;
  }
}

}  // namespace
}  // namespace stereotrack::test
