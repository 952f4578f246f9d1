// A pipeline of two views whose right pictures stay away for a while: a camera is gone.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "config/load.hpp"
#include "pipeline/pipeline.hpp"
#include "tests/support/moving_scene.hpp"
#include "tests/support/scene_cases.hpp"

namespace stereotrack::test {
namespace {

class Scene {
 public:
  explicit Scene(const char* preset = "robust") : scene_(kSceneFormats[0]) {
    const SceneCase one{preset, &kSceneFormats[0], SceneMatching::kRegions};
    Pipeline::Setup setup;
    setup.width = MovingScene::kWidth;
    setup.height = MovingScene::kHeight;
    setup.colour = true;
    setup.calibration = &calibration_;
    const Result<Pipeline> made = Pipeline::create(scene_config(one), setup, arena_);
    EXPECT_TRUE(made.has_value());
    if (made.has_value()) pipeline_.emplace(*made);
  }

  FrameResult run(int ordinal, bool both) {
    const Result<FrameResult> result = pipeline_->run(scene_.pair(ordinal, both));
    EXPECT_TRUE(result.has_value());
    return result.has_value() ? *result : FrameResult{};
  }
  /// The last of them.
  FrameResult run(int first, int last, bool both) {
    FrameResult result;
    for (int ordinal = first; ordinal <= last; ++ordinal) result = run(ordinal, both);
    return result;
  }
  Pipeline& pipeline() { return *pipeline_; }
  MovingScene& scene() { return scene_; }

 private:
  StereoCalibration calibration_ = MovingScene::calibration();
  MovingScene scene_;
  Arena arena_;
  std::optional<Pipeline> pipeline_;
};

const TrackReport* confirmed(const FrameResult& result) {
  for (const TrackReport& track : result.tracks) {
    if (track.state == TrackState::kConfirmed) return &track;
  }
  return nullptr;
}

TEST(LoneLeft, TargetsGoOnUnderTheirNamesWithPredictedDepthAndGetItBack) {
  Scene scene;
  const FrameResult before = scene.run(1, 70, true);
  EXPECT_EQ(before.flags & kFlagMono, 0U);
  const TrackReport* target = confirmed(before);
  ASSERT_NE(target, nullptr);
  ASSERT_TRUE(target->has_depth);
  const std::uint32_t id = target->id;
  const double z = target->position.z();
  // Half a second without the right camera. A board goes 3 px a frame to the right from frame 41 on, 12 px of
  // disparity.
  for (int ordinal = 71; ordinal <= 85; ++ordinal) {
    const FrameResult lone = scene.run(ordinal, false);
    EXPECT_EQ(lone.flags & kFlagMono, kFlagMono);
    target = confirmed(lone);
    ASSERT_NE(target, nullptr) << ordinal;
    EXPECT_EQ(target->id, id);
    EXPECT_TRUE(target->measured);
    EXPECT_TRUE(target->has_depth);
    EXPECT_NEAR(target->position.z(), z, 0.1 * z);
    const int reach = 3 * (ordinal - 41);
    EXPECT_NEAR(target->box.left, reach <= 130 ? reach : 260 - reach, 3) << ordinal;
    EXPECT_EQ(lone.detections[0].has_depth, false);
  }
  const FrameResult after = scene.run(86, 95, true);
  EXPECT_EQ(after.flags & kFlagMono, 0U);
  target = confirmed(after);
  ASSERT_NE(target, nullptr);
  EXPECT_EQ(target->id, id);
  EXPECT_NEAR(target->position.z(), z, 0.05 * z);
  ASSERT_FALSE(after.detections.empty());
  EXPECT_TRUE(after.detections[0].has_depth);
}

TEST(LoneLeft, DepthThatWasNotSeenForLongIsGivenUp) {
  Scene scene;
  (void)scene.run(1, 70, true);
  const FrameResult late = scene.run(71, 150, false);  // 2.7 s
  const TrackReport* target = confirmed(late);
  ASSERT_NE(target, nullptr);
  EXPECT_FALSE(target->has_depth);
}

TEST(LoneLeft, WhatComesMeanwhileIsATargetWithoutDepthAndHasItAsSoonAsThereAreTwoViews) {
  for (const char* preset : {"robust", "thesis"}) {
    SCOPED_TRACE(preset);
    Scene scene(preset);
    (void)scene.run(1, 40, true);
    int without = 0;
    int with = 0;
    for (int ordinal = 41; ordinal <= 100; ++ordinal) {
      const bool both = ordinal > 70;
      const FrameResult result = scene.run(ordinal, both);
      const TrackReport* target = confirmed(result);
      if (target == nullptr) continue;
      EXPECT_TRUE(both || !target->has_depth) << ordinal;
      ++(target->has_depth ? with : without);
    }
    EXPECT_GT(without, 5);
    EXPECT_GT(with, 5);
  }
}

TEST(LoneLeft, FromTheFirstFrameOnItTracksAndLearnsTheRightViewWhenItComes) {
  Scene scene;
  const TrackReport* target = confirmed(scene.run(1, 60, false));
  ASSERT_NE(target, nullptr);
  EXPECT_FALSE(target->has_depth);
  target = confirmed(scene.run(61, 130, true));
  ASSERT_NE(target, nullptr);
  EXPECT_TRUE(target->has_depth);
}

TEST(LoneLeft, TheLightMayChangeMeanwhile) {
  Scene scene;
  (void)scene.run(640, 695, true);
  // At 701 the wall is another.
  const FrameResult lone = scene.run(696, 749, false);
  EXPECT_EQ(lone.flags & kFlagMono, kFlagMono);
  const FrameResult after = scene.run(750, 800, true);
  const TrackReport* target = confirmed(after);
  ASSERT_NE(target, nullptr);
  EXPECT_TRUE(target->has_depth);
}

TEST(LoneLeft, ARightPictureOfAnotherSizeIsAFaultAsBefore) {
  Scene scene;
  FramePair pair = scene.scene().pair(1, true);
  pair.right.width /= 2;
  const Result<FrameResult> result = scene.pipeline().run(pair);
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error(), Fault::kBadSize);
}

}  // namespace
}  // namespace stereotrack::test
