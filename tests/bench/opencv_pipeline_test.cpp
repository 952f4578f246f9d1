// A rival that finds nothing would be a rival in nothing.
#include "tests/bench/opencv_pipeline.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/bench/moving_boxes.hpp"

namespace stereotrack::bench {
namespace {

constexpr int kEmptyFrames = 10;

cv::Mat view(const Picture& picture) {
  // OpenCV's Mat takes no const memory; it is only read.
  return {picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.data),
          static_cast<std::size_t>(picture.stride_bytes)};
}

OpenCvPipeline pipeline(const CvObserver& observer = {}) {
  OpenCvPipeline::Config config;
  config.background_frames = kEmptyFrames;
  OpenCvPipeline::Rig rig;
  rig.size = {MovingBoxes::kWidth, MovingBoxes::kHeight};
  rig.K1 = rig.K2 = (cv::Mat_<double>(3, 3) << 600, 0, 319.5, 0, 600, 239.5, 0, 0, 1);
  rig.D1 = rig.D2 = cv::Mat::zeros(1, 5, CV_64F);
  rig.R = cv::Mat::eye(3, 3, CV_64F);
  rig.T = (cv::Mat_<double>(3, 1) << -0.25, 0, 0);
  return {config, rig, observer};
}

void run(OpenCvPipeline& theirs, MovingBoxes& source, int frames) {
  FramePair pair;
  for (int i = 0; i < frames; ++i) {
    ASSERT_EQ(source.next(pair), capture::Next::kPair);
    theirs.run(view(pair.left), view(pair.right), i == 0 ? 0.0 : 1.0 / 30);
  }
}

TEST(OpenCvPipeline, FollowsTheMovingSquaresAtTheirDistance) {
  constexpr int kBoxes = 8;
  MovingBoxes source(kBoxes, kEmptyFrames);
  OpenCvPipeline theirs = pipeline();
  run(theirs, source, kEmptyFrames + 15);
  int followed = 0;
  for (int i = 0; i < kBoxes; ++i) {
    const cv::Rect box = source.box(i);
    const double z = 600 * 0.25 / MovingBoxes::disparity(i);
    const double x = (box.x + (box.width - 1) / 2.0 - 319.5) * z / 600;
    for (const OpenCvPipeline::Target& target : theirs.targets()) {
      const bool here = (target.box & box).area() * 2 > (target.box | box).area();
      if (!here || target.hits < 10) continue;
      ++followed;
      if (box.x < 64) continue;  // StereoBM gives no disparity there
      EXPECT_NEAR(target.position.z, z, 0.1 * z) << i;
      EXPECT_NEAR(target.position.x, x, 0.1) << i;
      EXPECT_FALSE(target.features.empty()) << i;
    }
  }
  EXPECT_EQ(followed, kBoxes);
}

TEST(OpenCvPipeline, FindsNothingBeforeTheWallAlone) {
  MovingBoxes source(0, 0);
  OpenCvPipeline theirs = pipeline();
  run(theirs, source, kEmptyFrames + 5);
  EXPECT_LT(cv::countNonZero(theirs.mask()), MovingBoxes::kWidth * MovingBoxes::kHeight / 1000);
}

TEST(OpenCvPipeline, EveryStepEndsOnceAFrameInItsOrder) {
  std::vector<CvStep> steps;
  const CvObserver observer{
      [](void* list, CvStep step) noexcept { static_cast<std::vector<CvStep>*>(list)->push_back(step); }, &steps};
  MovingBoxes source(1, 0);
  OpenCvPipeline theirs = pipeline(observer);
  run(theirs, source, 1);
  ASSERT_EQ(steps.size(), kCvSteps);
  for (std::size_t i = 0; i < kCvSteps; ++i) EXPECT_EQ(steps[i], static_cast<CvStep>(i));
}

TEST(MovingBoxes, StayApartInBothViews) {
  MovingBoxes source(MovingBoxes::kMost, 0);
  FramePair pair;
  for (int frame = 0; frame < 60; ++frame) {
    ASSERT_EQ(source.next(pair), capture::Next::kPair);
    for (int i = 0; i < MovingBoxes::kMost; ++i) {
      const cv::Rect box = source.box(i);
      const cv::Rect right = box - cv::Point(MovingBoxes::disparity(i), 0);
      ASSERT_GE(right.x, 0);
      ASSERT_LE(box.x + box.width, MovingBoxes::kWidth);
      for (int k = 0; k < i; ++k) {
        ASSERT_TRUE((box & source.box(k)).empty()) << i << ' ' << k;
      }
    }
  }
}

}  // namespace
}  // namespace stereotrack::bench
