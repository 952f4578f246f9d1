#include "pipeline/track/pair_check.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace stereotrack {
namespace {

constexpr double kPeriod_s = 1.0 / 30;

/// Targets that are expected at `disparity` and move by `vx`, and what a pair whose right picture is `lag_s` late shows
/// of them.
class Pairs {
 public:
  void add(double vx, double disparity, double disparity_rate = 0) {
    Prediction target;
    target.id = static_cast<std::uint32_t>(targets_.size() + 1);
    target.confirmed = true;
    target.box = {20 + 100 * static_cast<int>(targets_.size()), 40, 40, 80};
    target.vx = vx;
    target.has_depth = true;
    target.disparity = disparity;
    target.disparity_sd = 0.1;
    target.disparity_rate = disparity_rate;
    target.disparity_reach = 0.5;
    targets_.push_back(target);
  }
  std::vector<Prediction>& targets() { return targets_; }

  /// With `off` [px] added to the disparity of target `which`.
  PairCheck::Verdict run(double lag_s, double off = 0, std::size_t which = 0, double dt = kPeriod_s) {
    std::vector<Detection> detections;
    for (const Prediction& target : targets_) {
      Detection detection;
      detection.box = target.box;
      detection.has_depth = true;
      detection.disparity = target.disparity - (target.vx - target.disparity_rate) * lag_s;
      detection.disparity_sd = 0.1;
      detections.push_back(detection);
    }
    if (which < detections.size()) detections[which].disparity += off;
    return check_.run(targets_, detections, dt);
  }

 private:
  PairCheck check_;
  std::vector<Prediction> targets_;
};

TEST(PairCheck, APairOfOneInstantIsRight) {
  Pairs pairs;
  pairs.add(150, 20);
  pairs.add(-90, 30);
  const PairCheck::Verdict verdict = pairs.run(0);
  EXPECT_FALSE(verdict.wrong);
  EXPECT_EQ(verdict.witnesses, 2);
}

TEST(PairCheck, ARightPictureThatIsAFrameLateOrEarlyIsTold) {
  for (const double lag : {kPeriod_s, -kPeriod_s}) {
    Pairs pairs;
    pairs.add(120, 20);
    pairs.add(-90, 30);
    const PairCheck::Verdict verdict = pairs.run(lag);
    EXPECT_TRUE(verdict.wrong);
    EXPECT_DOUBLE_EQ(verdict.lag_s, lag);
  }
}

// 3 px a frame each: three witnesses suffice, one does not.
TEST(PairCheck, WhatIsSlowNeedsCompany) {
  Pairs alone;
  alone.add(60, 20);
  EXPECT_FALSE(alone.run(kPeriod_s).wrong);
  Pairs three;
  for (const double vx : {60.0, 66.0, -60.0}) three.add(vx, 25);
  EXPECT_TRUE(three.run(kPeriod_s).wrong);
}

TEST(PairCheck, OneFastTargetSuffices) {
  Pairs pairs;
  pairs.add(240, 40);
  EXPECT_TRUE(pairs.run(-kPeriod_s).wrong);
}

// What comes straight on moves in the right picture alone.
TEST(PairCheck, AnApproachTells) {
  Pairs pairs;
  pairs.add(0, 40, 200);
  EXPECT_TRUE(pairs.run(kPeriod_s).wrong);
}

TEST(PairCheck, WhatStandsTellsNothing) {
  Pairs pairs;
  pairs.add(0, 20);
  pairs.add(6, 30);
  const PairCheck::Verdict verdict = pairs.run(kPeriod_s, 8);
  EXPECT_FALSE(verdict.wrong);
  EXPECT_EQ(verdict.witnesses, 0);
}

TEST(PairCheck, ATentativeTargetAndOneInTheBlindStripTellNothing) {
  Pairs pairs;
  pairs.add(240, 70);  // columns 20 to 59: the right camera sees none of them
  EXPECT_EQ(pairs.run(kPeriod_s).witnesses, 0);
  pairs.targets()[0].disparity = 20;
  pairs.targets()[0].confirmed = false;
  EXPECT_EQ(pairs.run(kPeriod_s).witnesses, 0);
}

// One of three turned, was hidden, or is another now: by whatever it is off, the two others know better.
TEST(PairCheck, OneTargetThatJumpsInDepthIsNoWrongPair) {
  for (double off = -20; off <= 20; off += 0.25) {
    Pairs pairs;
    pairs.add(120, 30);
    pairs.add(-120, 30);
    pairs.add(90, 30);
    EXPECT_FALSE(pairs.run(0, off, 1).wrong) << off;
  }
}

TEST(PairCheck, NoiseIsNoWrongPair) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 0.3);
  for (int run = 0; run < 1000; ++run) {
    Pairs pairs;
    for (int i = 0; i < 4; ++i) pairs.add(60.0 * (i + 1) * (i % 2 == 0 ? 1 : -1), 30 + noise(random));
    for (Prediction& target : pairs.targets()) target.disparity_sd = 0.3;
    EXPECT_FALSE(pairs.run(0, noise(random), static_cast<std::size_t>(run % 4)).wrong) << run;
  }
}

// The pair after a wrong one is probably wrong, too: a slow target is believed then.
TEST(PairCheck, WhatWasWrongNeedsLessToStayWrong) {
  Pairs pairs;
  pairs.add(150, 20);
  EXPECT_TRUE(pairs.run(kPeriod_s).wrong);
  pairs.targets()[0].vx = 60;
  EXPECT_TRUE(pairs.run(kPeriod_s).wrong);
  EXPECT_FALSE(pairs.run(0).wrong);
  EXPECT_FALSE(pairs.run(kPeriod_s).wrong);
}

// A rig whose cameras stay a frame apart looks like targets at other distances: it must not lose their depth for good.
TEST(PairCheck, HalfASecondIsBelievedAndNoMore) {
  Pairs pairs;
  pairs.add(150, 20);
  int wrong = 0;
  for (int frame = 0; frame < 60; ++frame) wrong += pairs.run(kPeriod_s).wrong ? 1 : 0;
  EXPECT_EQ(wrong, 15);
  EXPECT_FALSE(pairs.run(0).wrong);
  EXPECT_TRUE(pairs.run(kPeriod_s).wrong);
}

// A frame was missing before this pair: a lag is still of one period.
TEST(PairCheck, AGapBeforeThePairDoesNotStretchTheLag) {
  Pairs pairs;
  pairs.add(150, 20);
  pairs.add(-150, 20);
  EXPECT_FALSE(pairs.run(0).wrong);
  const PairCheck::Verdict verdict = pairs.run(kPeriod_s, 0, 9, 3 * kPeriod_s);
  EXPECT_TRUE(verdict.wrong);
  EXPECT_NEAR(verdict.lag_s, kPeriod_s, 0.02 * kPeriod_s);
}

TEST(PairCheck, TheFirstFrameTellsNothing) {
  Pairs pairs;
  pairs.add(240, 20);
  EXPECT_FALSE(pairs.run(kPeriod_s, 0, 9, 0).wrong);
}

}  // namespace
}  // namespace stereotrack
