#include "pipeline/track/tracker.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <vector>

namespace stereotrack {
namespace {

constexpr double kFps = 25;
constexpr double kDt = 1 / kFps;
constexpr double kFocal = 500;
constexpr double kFocalBaseline = 100;  // f b: 20 px of disparity at 5 m
constexpr int kWidth = 640;
constexpr int kHeight = 480;

Tracker::Config config() {
  Tracker::Config c;
  c.confirm_hits = 3;
  c.tentative_misses = 2;
  c.coast_s = 1;
  c.gate = 4;
  c.acceleration = 1.5;
  c.initial_speed = 2;
  c.centre_noise_px = 0.7;
  c.centre_noise_size = 0.05;
  c.travel_px = 3;
  c.straight_part = 0.4;
  return c;
}

Features::Config features() {
  Features::Config c;
  c.corner_quality = 100;
  c.most_difference = 14;
  c.search_px = 12;
  return c;
}

/// A box of 24 x 24 around (x, y); disparity 0: not seen by stereo.
Detection seen_at(double x, double y, double disparity = 0) {
  Detection out;
  out.box = {static_cast<int>(std::lround(x)) - 12, static_cast<int>(std::lround(y)) - 12, 24, 24};
  out.area = 450;
  out.strength = 1;
  (void)out.hull.push({out.box.left, out.box.top});
  if (disparity <= 0) return out;
  out.has_depth = true;
  out.disparity = disparity;
  out.disparity_sd = 0.2;
  const double z = kFocalBaseline / disparity;
  out.position = {(x - kWidth / 2.0) * z / kFocal, (y - kHeight / 2.0) * z / kFocal, z};
  const double across = z / kFocal;
  const double along = z / disparity * 0.2;
  out.position_covariance = Eigen::Vector3d(across * across, across * across, along * along).asDiagonal();
  return out;
}

/// The same for any box; its area is nine tenths of it.
Detection box_at(const Rect& box, double disparity = 0) {
  const int centre_x = box.left + box.width / 2;
  const int centre_y = box.top + box.height / 2;
  Detection out = seen_at(centre_x, centre_y, disparity);
  out.box = box;
  out.area = static_cast<int>(box.area() * 9 / 10);
  return out;
}

struct Colour {
  std::uint8_t y, cb, cr;
};
constexpr Colour kRed{90, 100, 180};
constexpr Colour kBlue{90, 180, 100};

Detection painted(Detection detection, const Colour& colour) {
  for (int i = 0; i < 100; ++i) detection.appearance.add(colour.y, colour.cb, colour.cr);
  return detection;
}

class TrackerOf : public testing::Test {
 protected:
  void SetUp() override { make(config()); }
  void make(const Tracker::Config& c, double focal_baseline = kFocalBaseline) {
    auto created = Tracker::create(c, features(), {kWidth, kHeight, kFocal, focal_baseline}, arena_);
    ASSERT_TRUE(created.has_value());
    tracker_.emplace(*created);
  }
  void step(const std::vector<Detection>& detections, double dt = kDt) {
    (void)tracker_->predict(dt);
    tracker_->update(detections);
  }
  [[nodiscard]] std::span<const TrackReport> reports() const { return tracker_->reports(); }
  [[nodiscard]] int count(TrackState state) const {
    return static_cast<int>(std::count_if(reports().begin(), reports().end(),
                                          [&](const TrackReport& report) { return report.state == state; }));
  }
  /// The report whose centre is nearest.
  [[nodiscard]] TrackReport at(double x, double y) const {
    TrackReport best;
    double least = 1e9;
    for (const TrackReport& report : reports()) {
      const double apart = std::hypot(report.image_x - x, report.image_y - y);
      if (apart < least) {
        least = apart;
        best = report;
      }
    }
    EXPECT_LT(least, 8) << "nobody near " << x << ' ' << y;
    return best;
  }
  [[nodiscard]] const TrackReport* with_id(std::uint32_t id) const {
    for (const TrackReport& report : reports()) {
      if (report.id == id) return &report;
    }
    return nullptr;
  }

  std::optional<Tracker> tracker_;

 private:
  Arena arena_;
};

TEST_F(TrackerOf, NothingSeenIsNoTrack) {
  EXPECT_TRUE(tracker_->predict(kDt).empty());
  tracker_->update({});
  EXPECT_TRUE(reports().empty());
  EXPECT_EQ(tracker_->refused(), 0U);
}

TEST_F(TrackerOf, StraightTargetIsConfirmedByConfirmHitsDetections) {
  for (int hits : {2, 3, 6}) {
    Tracker::Config c = config();
    c.confirm_hits = hits;
    make(c);
    for (int k = 1; k <= hits + 3; ++k) {
      step({seen_at(100 + 6 * k, 200 + 2 * k)});
      ASSERT_EQ(reports().size(), 1U);
      EXPECT_EQ(reports()[0].id, 1U);
      EXPECT_TRUE(reports()[0].measured);
      EXPECT_EQ(reports()[0].state, k < hits ? TrackState::kTentative : TrackState::kConfirmed) << hits << ' ' << k;
    }
  }
}

TEST_F(TrackerOf, WeakDetectionsConfirmLater) {
  // Strengths that add up without rounding; confirm_hits is 3.
  struct Case {
    double strength, evidence;
    int frames;
  };
  for (const Case& one : {Case{1, 2, 3}, Case{0.5, 2, 4}, Case{0.25, 2, 8}, Case{0.25, 0, 3}, Case{0.25, 4, 16}}) {
    Tracker::Config c = config();
    c.confirm_evidence = one.evidence;
    make(c);
    for (int k = 1; k <= one.frames + 2; ++k) {
      Detection detection = seen_at(100 + 6 * k, 200);
      detection.strength = one.strength;
      step({detection});
      ASSERT_EQ(reports().size(), 1U);
      EXPECT_EQ(reports()[0].state, k < one.frames ? TrackState::kTentative : TrackState::kConfirmed)
          << one.strength << ' ' << one.evidence << ' ' << k;
    }
  }
}

TEST_F(TrackerOf, DetectionsWithoutStrengthConfirmNothing) {
  for (int k = 0; k < 30; ++k) {
    Detection detection = seen_at(100 + 6 * k, 200);
    detection.strength = 0;
    step({detection});
  }
  EXPECT_EQ(count(TrackState::kTentative), 1);
  EXPECT_EQ(reports().size(), 1U);
}

TEST_F(TrackerOf, PartlyHiddenTargetKeepsItsCentre) {
  for (const bool right_half : {false, true}) {
    make(config());
    double x = 100;
    for (int k = 0; k < 30; ++k, x += 4) step({seen_at(x, 200)});
    for (int k = 0; k < 6; ++k, x += 4) {
      Detection half = seen_at(x, 200);
      half.box.width = 12;  // its own middle is 6 px off
      if (right_half) half.box.left += 12;
      half.area /= 2;
      step({half});
      ASSERT_EQ(reports().size(), 1U);
      EXPECT_TRUE(reports()[0].measured);
      EXPECT_NEAR(reports()[0].image_x, x, 2) << right_half << ' ' << k;
      EXPECT_EQ(reports()[0].box, half.box) << "the box is what is visible";
    }
    EXPECT_NEAR(reports()[0].image_vx, 100, 25);
  }
}

TEST_F(TrackerOf, TargetWithSomethingAddedToItsBoxKeepsItsCentre) {
  double x = 100;
  for (int k = 0; k < 30; ++k, x += 4) step({seen_at(x, 200)});
  Detection larger = seen_at(x, 200);
  larger.box.width += 10;  // 5 px off
  larger.area += 200;
  step({larger});
  ASSERT_EQ(reports().size(), 1U);
  EXPECT_NEAR(reports()[0].image_x, x, 1.5);
}

TEST_F(TrackerOf, BoxOfTheUsualSizeMovesTheCentre) {
  // Where no part can be hidden, the centre follows what is seen: the control of the two tests before.
  double x = 100;
  for (int k = 0; k < 30; ++k, x += 4) step({seen_at(x, 200)});
  for (int k = 0; k < 6; ++k, x += 4) step({seen_at(x - 6, 200)});
  ASSERT_EQ(reports().size(), 1U);
  EXPECT_LT(reports()[0].image_x, x - 4 - 3.5);
}

TEST_F(TrackerOf, SizeGrowsFastAndShrinksSlowly) {
  const auto width_after = [&](int width) {
    make(config());
    for (int k = 0; k < 20; ++k) step({box_at({100 + 4 * k, 200, 30, 30})});
    EXPECT_NEAR(tracker_->predict(0)[0].box.width, 30, 1);
    for (int k = 20; k < 25; ++k) step({box_at({100 + 4 * k - (width - 30) / 2, 200, width, 30})});
    EXPECT_EQ(reports().size(), 1U);
    return tracker_->predict(0)[0].box.width;
  };
  EXPECT_GE(width_after(46), 38) << "more than half of the way";
  EXPECT_GE(width_after(20), 26) << "less than half of it";
  EXPECT_LT(width_after(20), 30) << "but some";
  EXPECT_GE(width_after(10), 28) << "what lost most of itself at once is hidden, not smaller";
}

TEST_F(TrackerOf, ReportTellsWhereAndHowFast) {
  // 4 m/s to the right and 2 m/s away, seen for a second.
  for (int k = 0; k <= 25; ++k) {
    const double t = k * kDt;
    const double z = 5 + 2 * t;
    step({seen_at(kWidth / 2.0 + (-2 + 4 * t) * kFocal / z, 240, kFocalBaseline / z)});
  }
  ASSERT_EQ(reports().size(), 1U);
  const TrackReport& report = reports()[0];
  EXPECT_TRUE(report.has_depth);
  EXPECT_LT((report.position - Eigen::Vector3d(2, 0, 7)).norm(), 0.1);
  EXPECT_LT((report.velocity - Eigen::Vector3d(4, 0, 2)).norm(), 0.5);
  EXPECT_NEAR(report.image_x, kWidth / 2.0 + 2 * kFocal / 7, 2);
  EXPECT_NEAR(report.image_y, 240, 1);
  EXPECT_GT(report.image_vx, 150);
  EXPECT_NEAR(report.age_s, 1, 1e-9);
  EXPECT_GT(report.confidence, 0);
  EXPECT_LE(report.confidence, 1);
  EXPECT_EQ(report.covariance.llt().info(), Eigen::Success);
}

TEST_F(TrackerOf, VelocityOfWhoGoesStraightIsHardlyMovedByErrors) {
  // 1.5 m/s across at 5 m; the box is a pixel off, by turns for three frames to either side.
  const auto worst_error = [this](double steady_acceleration) {
    Tracker::Config c = config();
    c.steady_acceleration = steady_acceleration;
    make(c);
    double worst = 0;
    for (int k = 0; k <= 75; ++k) {
      const double off = k / 3 % 2 == 0 ? 1 : -1;
      step({seen_at(100 + 1.5 * k * kDt * kFocal / 5 + off, 240, kFocalBaseline / 5)});
      if (k >= 25) worst = std::max(worst, std::abs(reports()[0].velocity.x() - 1.5));
    }
    return worst;
  };
  const double error = worst_error(config().steady_acceleration);
  EXPECT_LT(error, 0.15);
  EXPECT_GT(worst_error(config().acceleration), 1.5 * error) << "as if each target turned at any time";
}

TEST_F(TrackerOf, OneFalseMatchHardlyMovesWhatIsReported) {
  for (int k = 0; k < 40; ++k) {
    step({seen_at(320, 240, k == 30 ? 22 : 20)});  // 4.55 m in place of 5 m: ten standard deviations
    if (k < 30) continue;
    EXPECT_NEAR(reports()[0].position.z(), 5, 0.1) << k;
  }
}

// Thrown up at 5 m/s, seen for half a second, then hidden for 0.4 s.
TEST_F(TrackerOf, WhatWasThrownIsPredictedToFallWhereGravityIsKnown) {
  const auto error_when_hidden = [this](const Eigen::Vector3d& gravity) {
    Tracker::Config c = config();
    c.gravity = gravity;
    make(c);
    Eigen::Vector3d p(-1, 0.8, 5);
    Eigen::Vector3d v(1.5, -5, 0);
    for (int k = 0; k < 22; ++k) {
      if (k < 12) {
        step({seen_at(kWidth / 2.0 + p.x() * kFocal / 5, kHeight / 2.0 + p.y() * kFocal / 5, kFocalBaseline / 5)});
      } else {
        step({});
      }
      if (k == 21) break;
      const Eigen::Vector3d a(0, 9.81, 0);
      p += v * kDt + a * (kDt * kDt / 2);
      v += a * kDt;
    }
    return reports().empty() ? 1e9 : (reports()[0].position - p).norm();
  };
  EXPECT_LT(error_when_hidden({0, 9.81, 0}), 0.25);
  EXPECT_GT(error_when_hidden({0, 0, 0}), 0.5);
}

TEST_F(TrackerOf, FlickerInPlaceIsNeverConfirmed) {
  std::mt19937 random(1);
  Tracker::Config c = config();
  c.travel_px = 6;
  make(c);
  for (int k = 0; k < 200; ++k) {
    step({seen_at(300 + static_cast<double>(random() % 5), 200 + static_cast<double>(random() % 3), 20)});
    ASSERT_EQ(count(TrackState::kConfirmed) + count(TrackState::kCoasting), 0) << k;
  }
  EXPECT_EQ(reports().size(), 1U) << "the flicker was not followed, so the test says nothing";
}

TEST_F(TrackerOf, FlickerToAndFroIsNotConfirmedThoughItsJumpsAreLong) {
  for (int k = 0; k < 60; ++k) {
    step({seen_at(300 + (k % 2 == 0 ? 0 : 10), 200)});
    ASSERT_EQ(count(TrackState::kConfirmed) + count(TrackState::kCoasting), 0) << k;
  }
}

TEST_F(TrackerOf, TargetComingStraightOnIsConfirmedByItsDistance) {
  for (int k = 0; k < 12; ++k) step({seen_at(kWidth / 2.0, kHeight / 2.0, kFocalBaseline / (5 - 0.1 * k))});
  EXPECT_EQ(count(TrackState::kConfirmed), 1);
  make(config());
  for (int k = 0; k < 12; ++k) step({seen_at(kWidth / 2.0, kHeight / 2.0, kFocalBaseline / 5)});
  EXPECT_EQ(count(TrackState::kConfirmed), 0);
}

TEST_F(TrackerOf, TentativeTargetGoesAfterTentativeMisses) {
  for (int misses : {1, 2, 4}) {
    Tracker::Config c = config();
    c.tentative_misses = misses;
    make(c);
    step({seen_at(100, 100)});
    for (int k = 1; k < misses; ++k) {
      step({});
      EXPECT_EQ(reports().size(), 1U);
    }
    step({});
    EXPECT_TRUE(reports().empty()) << misses;
  }
}

TEST_F(TrackerOf, DoubledStepKeepsTheIdentity) {
  // 14 px a frame; twice a frame is missing, and nothing tells.
  double x = 60;
  for (int k = 0; k < 30; ++k) {
    x += k == 12 || k == 20 ? 28 : 14;
    step({seen_at(x, 150, 25)});
    ASSERT_EQ(reports().size(), 1U) << k;
    EXPECT_EQ(reports()[0].id, 1U) << k;
    EXPECT_TRUE(reports()[0].measured) << k;
  }
}

TEST_F(TrackerOf, DetectionFarFromThePredictionIsAnotherTarget) {
  for (int k = 0; k < 10; ++k) step({seen_at(100 + 5 * k, 150)});
  step({seen_at(400, 150)});
  ASSERT_EQ(reports().size(), 2U);
  EXPECT_EQ(reports()[0].state, TrackState::kCoasting);
  EXPECT_EQ(reports()[1].id, 2U);
  EXPECT_EQ(reports()[1].state, TrackState::kTentative);
}

TEST_F(TrackerOf, DetectionAtAnotherDepthIsAnotherTarget) {
  for (int k = 0; k < 10; ++k) step({seen_at(100 + 5 * k, 150, 20)});
  step({seen_at(150, 150, 40)});
  ASSERT_EQ(reports().size(), 2U);
  EXPECT_FALSE(reports()[0].measured);
}

TEST_F(TrackerOf, OcclusionShorterThanCoastKeepsTheIdentity) {
  const auto place = [](int k) { return seen_at(60 + 3 * k, 150, 20); };
  for (int k = 0; k < 60; ++k) step({place(k)});
  for (int k = 60; k < 84; ++k) {  // 0.96 s
    step({});
    ASSERT_EQ(reports().size(), 1U) << k;
    EXPECT_EQ(reports()[0].state, TrackState::kCoasting);
    EXPECT_FALSE(reports()[0].measured);
    EXPECT_NEAR(reports()[0].image_x, 60 + 3 * k, 8) << "coasts along its path";
  }
  step({place(84)});
  ASSERT_EQ(reports().size(), 1U);
  EXPECT_EQ(reports()[0].id, 1U);
  EXPECT_EQ(reports()[0].state, TrackState::kConfirmed);
  EXPECT_TRUE(reports()[0].measured);
}

TEST_F(TrackerOf, OcclusionLongerThanCoastEndsTheTrack) {
  for (int k = 0; k < 20; ++k) step({seen_at(60 + 3 * k, 150)});
  for (int k = 0; k < 27; ++k) step({});
  EXPECT_TRUE(reports().empty());
  step({seen_at(60 + 3 * 47, 150)});
  ASSERT_EQ(reports().size(), 1U);
  EXPECT_EQ(reports()[0].id, 2U);
}

TEST_F(TrackerOf, CoastingTargetThatLeavesThePictureEnds) {
  for (int k = 0; k < 20; ++k) step({seen_at(440 + 9 * k, 150)});
  for (int k = 0; k < 12; ++k) step({});
  EXPECT_TRUE(reports().empty());
}

TEST_F(TrackerOf, TargetThatLeavesIsNotHandedOverToAStrangerThatEntersThere) {
  const auto visible = [](double x) {
    Detection out = seen_at(x, 200);
    const Rect box = intersect(out.box, {0, 0, kWidth, kHeight});
    out.area = out.area * box.width / out.box.width;
    out.box = box;
    return out;
  };
  const auto ids_of_the_second = [&](const Colour& colour) {
    make(config());
    for (double x = 400; x <= 640; x += 8) step({painted(visible(x), kRed)});
    EXPECT_EQ(reports().size(), 1U);
    EXPECT_TRUE(reports()[0].measured);
    std::vector<std::uint32_t> ids;
    for (double x = 646; x >= 590; x -= 8) {
      step({painted(visible(x), colour)});
      for (const TrackReport& report : reports()) {
        if (report.measured) ids.push_back(report.id);
      }
    }
    return ids;
  };
  EXPECT_EQ(ids_of_the_second(kBlue), std::vector<std::uint32_t>(8, 2));
  EXPECT_EQ(with_id(1), nullptr) << "it has left";
  EXPECT_EQ(ids_of_the_second(kRed), std::vector<std::uint32_t>(8, 1)) << "one that turned: only the looks told";
}

TEST_F(TrackerOf, CentreOfATargetAtTheBorderIsTakenFromTheEdgeThatIsSeen) {
  // It leaves at the left, faster than expected. Half of it visible, its centre is at the border.
  double x = 50;
  for (; x > 12; x -= 2) step({seen_at(x, 200)});
  for (; x > -8; x -= 6) {
    Detection cut = seen_at(x, 200);
    cut.box = intersect(cut.box, {0, 0, kWidth, kHeight});
    cut.area = cut.area * cut.box.width / 24;
    step({cut});
    ASSERT_EQ(reports().size(), 1U);
    EXPECT_TRUE(reports()[0].measured);
    EXPECT_NEAR(reports()[0].image_x, x, 4);
  }
}

TEST_F(TrackerOf, TargetThatTurnsAtOnceIsRecoveredByItsLooks) {
  struct Case {
    const char* what;
    Detection detection;
    std::uint32_t id;
  };
  // 20 frames at 8 px each, the last at 252; the next is expected at 260 and seen 30 px before that, out of the gate.
  const double x = 230;
  Detection larger = painted(seen_at(x, 200, 20), kRed);
  larger.area *= 3;
  const std::vector<Case> cases{
      {"the same", painted(seen_at(x, 200, 20), kRed), 1},
      {"a stranger by its looks", painted(seen_at(x, 200, 20), kBlue), 2},
      {"a stranger by its size", larger, 2},
      {"a stranger by its depth", painted(seen_at(x, 200, 30), kRed), 2},
      {"a stranger by its place", painted(seen_at(x, 320, 20), kRed), 2},
  };
  for (const Case& one : cases) {
    make(config());
    for (int k = 0; k < 20; ++k) step({painted(seen_at(100 + 8 * k, 200, 20), kRed)});
    ASSERT_EQ(reports().size(), 1U);
    step({one.detection});
    ASSERT_EQ(reports().size(), one.id) << one.what;
    EXPECT_TRUE(reports().back().measured);
    EXPECT_EQ(reports().back().id, one.id);
    EXPECT_EQ(reports().front().measured, one.id == 1) << one.what;
  }
}

TEST_F(TrackerOf, RecoveredTargetGoesOnTheOtherWay) {
  for (int k = 0; k < 20; ++k) step({painted(seen_at(100 + 8 * k, 200, 20), kRed)});
  for (int k = 1; k < 15; ++k) {
    step({painted(seen_at(238 - 8 * k, 200, 20), kRed)});
    ASSERT_EQ(reports().size(), 1U) << k;
    EXPECT_EQ(reports()[0].id, 1U);
    EXPECT_TRUE(reports()[0].measured);
  }
  EXPECT_NEAR(reports()[0].image_vx, -200, 40);
}

Detection part_of(int region, Detection detection) {
  detection.region = region;
  return detection;
}

TEST_F(TrackerOf, PartOfAnotherTargetsRegionIsOnTrialUntilItIsSeenApart) {
  const auto body = [](int k) { return part_of(1, box_at({100 + 6 * k, 100, 40, 40}, 20)); };
  const auto arm = [](int k, int region, int gap) {
    return part_of(region, box_at({100 + 6 * k, 140 + gap, 40, 20}, 30));
  };
  for (int k = 0; k < 10; ++k) step({body(k)});
  for (int k = 10; k < 20; ++k) step({body(k), arm(k, 1, 0)});
  ASSERT_EQ(reports().size(), 2U);
  EXPECT_EQ(reports()[1].state, TrackState::kTentative);
  step({body(20), arm(20, 2, 0)});  // cut apart by a gap in the mask: still beside it
  EXPECT_EQ(reports()[1].state, TrackState::kTentative);
  for (int k = 21; k < 26; ++k) step({body(k), arm(k, 2, 3 * (k - 20))});
  EXPECT_EQ(reports()[1].state, TrackState::kConfirmed);
}

TEST_F(TrackerOf, PartThatStaysAttachedIsATargetInTheEnd) {
  for (int k = 0; k < 40; ++k) {
    // It slides along the body, so that it is no fragment that goes along with it.
    const int across = 2 * (k - 20);
    std::vector<Detection> seen{part_of(1, box_at({100 + 6 * k, 100, 40, 40}, 20))};
    if (k >= 10) seen.push_back(part_of(1, box_at({100 + 6 * k + across, 140, 20, 20}, 30)));
    step(seen);
    if (k == 20) {
      EXPECT_EQ(count(TrackState::kConfirmed), 1);
    }
  }
  EXPECT_EQ(count(TrackState::kConfirmed), 2);
}

TEST_F(TrackerOf, TargetThatLosesItsDetectionTakesOverThePartInItsPlace) {
  struct Case {
    const char* what;
    Rect part;
    double disparity;
    std::uint32_t id;
  };
  // A leg is seen, then the body above it that hides it: of another size, and at another depth where it is large. What
  // is not large and at another depth passes before the leg.
  for (const Case& one :
       {Case{"over it, large", {190, 120, 240, 140}, 32, 1}, Case{"over it, at its depth", {190, 120, 120, 100}, 16, 1},
        Case{"over it, small, nearer", {190, 120, 120, 100}, 32, 2}, Case{"beside it", {280, 120, 120, 100}, 16, 2}}) {
    make(config());
    const auto leg = [](int k) { return part_of(1, painted(box_at({100 + 8 * k, 160, 24, 60}, 16), kBlue)); };
    const auto body = [&](int k) {
      const Rect box{one.part.left + 8 * (k - 12), one.part.top, one.part.width, one.part.height};
      return part_of(1, painted(box_at(box, one.disparity), kRed));
    };
    for (int k = 0; k < 12; ++k) step({leg(k)});
    for (int k = 12; k < 14; ++k) step({leg(k), body(k)});
    ASSERT_EQ(reports().size(), 2U) << one.what;
    step({body(14)});
    const TrackReport seen = at(one.part.left + 16 + one.part.width / 2.0, one.part.top + one.part.height / 2.0);
    EXPECT_TRUE(seen.measured) << one.what;
    EXPECT_EQ(seen.id, one.id) << one.what;
    EXPECT_EQ(reports().size(), one.id) << one.what;
  }
}

TEST_F(TrackerOf, WhatLeavesThePictureIsNotReplacedByWhatEntersThere) {
  const auto leaving = [](int k) { return part_of(1, painted(box_at({60 - 5 * k, 200, 40, 60}, 20), kRed)); };
  const auto entering = [](int k) { return part_of(1, painted(box_at({0, 200, 10 + 6 * (k - 12), 60}, 30), kBlue)); };
  for (int k = 0; k < 12; ++k) step({leaving(k)});
  for (int k = 12; k < 14; ++k) step({part_of(1, painted(box_at({0, 200, 100 - 5 * k, 60}, 20), kRed)), entering(k)});
  step({entering(14)});
  EXPECT_TRUE(std::any_of(reports().begin(), reports().end(),
                          [](const TrackReport& report) { return report.id == 2 && report.measured; }));
}

TEST_F(TrackerOf, LargeDetectionInItsPlaceIsTheTargetWhateverItLooksLike) {
  for (const bool large : {true, false}) {
    make(config());
    const int size = large ? 200 : 100;  // 200 x 200 is an eighth of the picture
    for (int k = 0; k < 6; ++k) step({painted(box_at({100 + 8 * k, 100, size, size}, 20), kRed)});
    step({painted(box_at({148, 110, size, size}, 40), kBlue)});
    EXPECT_EQ(reports().size(), large ? 1U : 2U);
    EXPECT_EQ(reports().back().id, large ? 1U : 2U);
    EXPECT_TRUE(reports().back().measured);
  }
}

TEST_F(TrackerOf, DistanceThatNobodyMeasuresIsNotGuessedForLong) {
  int k = 0;
  for (; k < 10; ++k) step({seen_at(100 + 2 * k, 200, 20)});
  EXPECT_TRUE(reports()[0].has_depth);
  for (; k < 50; ++k) step({seen_at(100 + 2 * k, 200)});
  EXPECT_TRUE(reports()[0].has_depth);
  for (; k < 70; ++k) step({seen_at(100 + 2 * k, 200)});
  ASSERT_EQ(reports().size(), 1U);
  EXPECT_FALSE(reports()[0].has_depth);
}

TEST_F(TrackerOf, FragmentThatGoesAlongWithABodyIsDropped) {
  struct Case {
    const char* what;
    double dx, dy, disparity, turn;
    bool dropped;
  };
  for (const Case& one : {
           Case{"under it", 0, 40, 20, 0, true},
           Case{"far away", 0, 120, 20, 0, false},
           Case{"nearer", 0, 40, 30, 0, false},
           Case{"on another way", 0, 40, 20, 6, false},
       }) {
    make(config());
    int gone = 0;
    for (int k = 1; k <= 25; ++k) {
      const int x = 100 + 6 * k;
      const double y = 100 + one.dy + one.turn * k;
      step({box_at({x, 100, 24, 40}, 20),
            box_at({x + static_cast<int>(one.dx), static_cast<int>(y), 24, 12}, one.disparity)});
      ASSERT_NE(with_id(1), nullptr) << one.what;
      if (gone == 0 && with_id(2) == nullptr) gone = k;
    }
    if (one.dropped) {
      EXPECT_GE(gone, 8) << one.what;
      EXPECT_LE(gone, 14) << one.what;
    } else {
      EXPECT_EQ(gone, 0) << one.what;
    }
  }
}

TEST_F(TrackerOf, WhatSlidesAlongABodyIsNoFragmentOfIt) {
  // Under it for 24 frames, at its depth, but 2.5 px a frame faster.
  for (int k = 1; k <= 24; ++k) {
    const int x = 100 + 6 * k;
    step({box_at({x, 100, 60, 40}, 20), box_at({x - 12 + k * 5 / 2, 140, 24, 24}, 20)});
    ASSERT_EQ(reports().size(), 2U) << k;
    EXPECT_EQ(reports()[1].id, 2U) << k;
  }
}

TEST_F(TrackerOf, OnlyTargetsFarApartInThePictureOrInDepthAreKnownToBeTwo) {
  const auto apart = [&](int gap, double disparity) {
    make(config());
    for (int k = 0; k < 5; ++k) {
      step({box_at({100 + 3 * k, 100, 24, 40}, 20), box_at({124 + gap + 3 * k, 100, 24, 40}, disparity)});
    }
    const std::span<const Prediction> predictions = tracker_->predict(kDt);
    EXPECT_EQ(predictions.size(), 2U);
    EXPECT_EQ(predictions[0].seen_beside(predictions[1]), predictions[1].seen_beside(predictions[0]));
    return predictions[0].seen_beside(predictions[1]);
  };
  EXPECT_FALSE(apart(4, 20)) << "may be pieces of one";
  EXPECT_TRUE(apart(40, 20)) << "a size between them";
  EXPECT_TRUE(apart(4, 30)) << "5 m and 3.3 m away";
}

TEST_F(TrackerOf, CoastIsTimeNotFrames) {
  for (double dt : {0.01, 0.2}) {
    make(config());
    const int frames = static_cast<int>(2 / dt) + 10;  // long enough to be trusted for all of coast_s
    for (int k = 0; k < frames; ++k) step({seen_at(60 + 200.0 * k / frames, 150)}, dt);
    double unseen = 0;
    while (!reports().empty() && unseen < 5) {
      step({}, dt);
      unseen += dt;
    }
    EXPECT_NEAR(unseen, 1, 1.01 * dt) << dt;
  }
}

TEST_F(TrackerOf, BrieflySeenTargetCoastsBriefly) {
  constexpr double kStep = 0.04;
  for (int k = 0; k < 10; ++k) step({seen_at(60 + 6 * k, 150)}, kStep);
  double unseen = 0;
  while (!reports().empty() && unseen < 5) {
    step({}, kStep);
    unseen += kStep;
  }
  EXPECT_NEAR(unseen, 0.2 + 0.5 * 10 * kStep, 1.01 * kStep);
}

TEST_F(TrackerOf, CrossingTargetsOfDifferentDepthKeepTheirIdentities) {
  for (int k = 0; k <= 60; ++k) {
    const double near_x = 140 + 6 * k;
    const double far_x = 500 - 6 * k;
    std::vector<Detection> both{seen_at(near_x, 200, 40), seen_at(far_x, 202, 20)};
    if (k % 3 == 1) std::swap(both[0], both[1]);
    if (k >= 29 && k <= 31) both = {seen_at(near_x, 200, 40)};  // the near one hides the other
    step(both);
    if (k == 20) {
      EXPECT_EQ(at(near_x, 200).id, 1U);
      EXPECT_EQ(at(far_x, 202).id, 2U);
    }
  }
  ASSERT_EQ(reports().size(), 2U);
  EXPECT_EQ(at(500, 200).id, 1U);
  EXPECT_EQ(at(140, 202).id, 2U);
}

TEST_F(TrackerOf, TargetsThatTurnRoundWhereTheyMeetAreToldApartByDepth) {
  // The prediction says they cross; only the depth says they do not.
  for (int k = 0; k <= 60; ++k) {
    const double way = k <= 30 ? 4.0 * k : 4.0 * (60 - k);
    step({seen_at(200 + way, 200, 40), seen_at(440 - way, 200, 20)});
  }
  ASSERT_EQ(reports().size(), 2U);
  EXPECT_EQ(at(200, 200).id, 1U);
  EXPECT_NEAR(at(200, 200).position.z(), kFocalBaseline / 40, 0.2);
  EXPECT_EQ(at(440, 200).id, 2U);
}

TEST_F(TrackerOf, VelocityComesFromTheTimesNotFromTheFrames) {
  std::mt19937 random(4);
  double t = 0;
  const auto place = [](double time) { return seen_at(80 + 150 * time, 300 - 50 * time, 20); };
  step({place(0)}, 0);
  for (int k = 0; k < 40; ++k) {
    const double dt = 0.02 + 0.02 * static_cast<double>(random() % 5);
    t += dt;
    step({place(t)}, dt);
  }
  ASSERT_EQ(reports().size(), 1U);
  EXPECT_EQ(reports()[0].id, 1U);
  EXPECT_NEAR(reports()[0].image_vx, 150, 15);
  EXPECT_NEAR(reports()[0].image_vy, -50, 15);
  EXPECT_NEAR(reports()[0].velocity.x(), 150 * 5 / kFocal, 0.15);  // 5 m away
  EXPECT_NEAR(reports()[0].age_s, t, 1e-9);
}

TEST_F(TrackerOf, PredictionIsWhereTheTargetWillBe) {
  for (int k = 0; k <= 25; ++k) step({seen_at(100 + 4 * k, 150, 20)});
  const std::span<const Prediction> predictions = tracker_->predict(5 * kDt);
  ASSERT_EQ(predictions.size(), 1U);
  const Prediction& prediction = predictions[0];
  EXPECT_EQ(prediction.id, 1U);
  EXPECT_TRUE(prediction.confirmed);
  EXPECT_NEAR(prediction.box.left + 12, 220, 4);
  EXPECT_NEAR(prediction.box.top + 12, 150, 2);
  EXPECT_NEAR(prediction.box.width, 24, 1);
  EXPECT_GT(prediction.image_sd, 0);
  EXPECT_TRUE(prediction.has_depth);
  EXPECT_NEAR(prediction.disparity, 20, 0.5);
  EXPECT_GT(prediction.disparity_sd, 0);
  ASSERT_NE(prediction.appearance, nullptr);
  EXPECT_FALSE(prediction.appearance->known()) << "nobody said what it looks like";
}

TEST_F(TrackerOf, PredictionKnowsLooksAndReachOfTheTarget) {
  for (int k = 0; k <= 25; ++k) {
    Detection detection = painted(seen_at(100 + 4 * k, 150, 20), kRed);
    detection.disparity_reach = 3;
    step({detection});
  }
  const Prediction prediction = tracker_->predict(kDt)[0];
  EXPECT_NEAR(prediction.disparity_reach, 3, 1e-6);
  ASSERT_NE(prediction.appearance, nullptr);
  EXPECT_NEAR(prediction.appearance->explains(painted({}, kRed).appearance), 1, 1e-4);
  EXPECT_EQ(prediction.appearance->explains(painted({}, kBlue).appearance), 0);
}

TEST_F(TrackerOf, LooksDecideWhereTwoDetectionsAreEquallyNear) {
  for (const bool swapped : {false, true}) {
    make(config());
    for (int k = 0; k < 20; ++k) step({painted(seen_at(100 + 4 * k, 200), kRed)});
    const std::vector<Detection> both{painted(seen_at(180, 195), swapped ? kRed : kBlue),
                                      painted(seen_at(180, 205), swapped ? kBlue : kRed)};
    step(both);
    ASSERT_EQ(reports().size(), 2U);
    EXPECT_EQ(reports()[0].id, 1U);
    EXPECT_EQ(reports()[0].box, both[swapped ? 0 : 1].box);
  }
}

TEST_F(TrackerOf, UncertaintyOfThePredictionGrowsWithTime) {
  for (int k = 0; k <= 25; ++k) step({seen_at(100 + 4 * k, 150, 20)});
  double before = 0;
  for (int k = 0; k < 5; ++k) {
    const Prediction prediction = tracker_->predict(kDt)[0];
    EXPECT_GT(prediction.image_sd, before);
    before = prediction.image_sd;
    tracker_->update({});
  }
}

TEST_F(TrackerOf, MonoTargetsAreTrackedInThePicture) {
  make(config(), 0);
  for (int k = 0; k < 10; ++k) step({seen_at(100 + 5 * k, 150)});
  ASSERT_EQ(reports().size(), 1U);
  EXPECT_EQ(reports()[0].state, TrackState::kConfirmed);
  EXPECT_FALSE(reports()[0].has_depth);
  EXPECT_FALSE(tracker_->predict(kDt)[0].has_depth);
}

TEST_F(TrackerOf, DepthThatComesLaterIsTaken) {
  for (int k = 0; k < 5; ++k) step({seen_at(100 + 5 * k, 150)});
  EXPECT_FALSE(reports()[0].has_depth);
  for (int k = 5; k < 10; ++k) step({seen_at(100 + 5 * k, 150, 20)});
  ASSERT_EQ(reports().size(), 1U);
  EXPECT_TRUE(reports()[0].has_depth);
  EXPECT_NEAR(reports()[0].position.z(), 5, 0.1);
}

std::vector<Detection> grid(int count, double dx) {
  std::vector<Detection> out;
  out.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    const int column = i % 8;
    const int row = i / 8;
    out.push_back(seen_at(40 + 70 * column + dx, 30 + 55 * row));
  }
  return out;
}

TEST_F(TrackerOf, OneMoreThanTheCapacityIsRefusedAndCounted) {
  for (int k = 0; k < 10; ++k) step(grid(Tracker::kMaxTracks, 2 * k));
  EXPECT_EQ(reports().size(), 64U);
  EXPECT_EQ(tracker_->refused(), 0U);
  std::vector<Detection> next = grid(Tracker::kMaxTracks, 20);
  next[10] = seen_at(620, 465);
  step(next);
  EXPECT_EQ(reports().size(), 64U);
  EXPECT_EQ(tracker_->refused(), 1U);
  for (std::size_t i = 0; i < reports().size(); ++i) EXPECT_EQ(reports()[i].id, i + 1);
}

TEST_F(TrackerOf, MoreDetectionsThanTheCapacityAreNotLookedAt) {
  std::vector<Detection> many = grid(Tracker::kMaxDetections, 0);
  many.push_back(seen_at(620, 465));
  step(many);
  EXPECT_EQ(reports().size(), 64U);
  EXPECT_EQ(tracker_->refused(), 0U);
}

TEST_F(TrackerOf, IdsAreInOrderAndNeverUsedAgain) {
  std::uint32_t highest = 0;
  std::mt19937 random(6);
  for (int k = 0; k < 300; ++k) {
    std::vector<Detection> detections;
    for (unsigned i = 0; i < random() % 6; ++i) {
      detections.push_back(seen_at(20 + static_cast<double>(random() % 600), 20 + static_cast<double>(random() % 440)));
    }
    std::vector<std::uint32_t> before;
    for (const TrackReport& report : reports()) before.push_back(report.id);
    step(detections);
    std::uint32_t previous = 0;
    for (const TrackReport& report : reports()) {
      ASSERT_GT(report.id, previous);
      previous = report.id;
      if (std::find(before.begin(), before.end(), report.id) == before.end()) {
        ASSERT_GT(report.id, highest);
      }
    }
    highest = std::max(highest, previous);
  }
  EXPECT_GT(highest, 200U);
}

TEST_F(TrackerOf, SameDetectionsGiveTheSameReports) {
  const auto run = [&] {
    make(config());
    std::mt19937 random(7);
    for (int k = 0; k < 50; ++k) {
      step({seen_at(100 + 5 * k + static_cast<double>(random() % 3), 150, 20), seen_at(400 - 4 * k, 220, 30)});
    }
    return std::vector<TrackReport>(reports().begin(), reports().end());
  };
  const std::vector<TrackReport> first = run();
  const std::vector<TrackReport> second = run();
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].position, second[i].position);
    EXPECT_EQ(first[i].covariance, second[i].covariance);
    EXPECT_EQ(first[i].image_x, second[i].image_x);
  }
}

/// Pictures of a textured object of 24 x 24 on an even ground, and its label.
struct Texture {
  cv::Mat_<std::uint8_t> luma;
  cv::Mat_<std::uint16_t> labels;

  explicit Texture(const Rect& box)
      : luma(kHeight, kWidth, std::uint8_t{90}), labels(kHeight, kWidth, std::uint16_t{0}) {
    cv::Mat_<std::uint8_t> patch(24, 24);
    cv::RNG(3).fill(patch, cv::RNG::UNIFORM, 0, 256);
    cv::GaussianBlur(patch, patch, {3, 3}, 0);
    const cv::Rect where(box.left, box.top, 24, 24);
    patch.copyTo(luma(where));
    labels(where).setTo(1);
  }
  [[nodiscard]] ImageView<const std::uint8_t> picture() const {
    return {luma[0], kWidth, kHeight, static_cast<std::ptrdiff_t>(luma.step1())};
  }
  [[nodiscard]] ImageView<const std::uint16_t> regions() const {
    return {labels[0], kWidth, kHeight, static_cast<std::ptrdiff_t>(labels.step1())};
  }
};

TEST_F(TrackerOf, FeaturesVoteForTheDetectionInWhoseBoxTheyLie) {
  // Two detections equally far from the prediction; the texture has gone a little to one side.
  for (const double side : {-1.0, 1.0}) {
    make(config());
    double x = 100;
    for (int k = 0; k < 15; ++k, x += 6) {
      const Detection object = seen_at(x, 200);
      const Texture texture(object.box);
      (void)tracker_->predict(kDt, texture.picture());
      tracker_->update({&object, 1}, texture.picture(), texture.regions());
    }
    const Texture moved(seen_at(x + 3 * side, 200).box);
    const Prediction prediction = tracker_->predict(kDt, moved.picture())[0];
    const double centre = prediction.box.left + 12;
    const std::vector<Detection> both{seen_at(centre - 12, 200), seen_at(centre + 12, 200)};
    tracker_->update(both);
    ASSERT_EQ(reports().size(), 2U);
    EXPECT_EQ(reports()[0].id, 1U);
    EXPECT_TRUE(reports()[0].measured);
    EXPECT_EQ(reports()[0].box, both[side < 0 ? 0 : 1].box) << side;
  }
}

/// What an observer was told, frame by frame.
class TrackerTells : public TrackerOf {
 protected:
  void SetUp() override {
    make(config());
    tracker_->observe({.decided = &TrackerTells::decided, .context = this});
  }
  static void decided(void* self, const Decision& decision) noexcept {
    static_cast<TrackerTells*>(self)->told_.push_back(decision);
  }
  /// Steps, and answers what was told of the target but pairs weighed.
  std::vector<Decision> told_of(std::uint32_t id, const std::vector<Detection>& detections) {
    told_.clear();
    step(detections);
    std::vector<Decision> of_it;
    for (const Decision& one : told_) {
      if (one.id == id && one.kind != Decision::Kind::kWeighed) of_it.push_back(one);
    }
    return of_it;
  }
  std::vector<Decision> told_;
};
using Kind = Decision::Kind;

TEST_F(TrackerTells, WhatATargetWaitsForAndWhatConfirmsIt) {
  std::vector<Decision> told = told_of(1, {seen_at(100, 200, 20)});
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].kind, Kind::kBorn);
  EXPECT_EQ(told[0].detection, 1);
  told = told_of(1, {seen_at(106, 200, 20)});
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[0].kind, Kind::kTook);
  EXPECT_EQ(told[0].taken, Taken::kAssociated);
  EXPECT_EQ(told[1].kind, Kind::kWaits);
  EXPECT_EQ(told[1].hits, 2);
  told = told_of(1, {seen_at(112, 200, 20)});
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].kind, Kind::kConfirmed);
  EXPECT_NEAR(told[1].way_px, 12, 1e-9);
}

TEST_F(TrackerTells, HowLongItCoastsAndThatItIsGone) {
  for (int i = 0; i < 40; ++i) (void)told_of(1, {seen_at(100 + 2 * i, 200)});
  const double limit = config().coast_s;
  bool removed = false;
  for (int i = 1; i < 60 && !removed; ++i) {
    const std::vector<Decision> told = told_of(1, {});
    ASSERT_FALSE(told.empty());
    EXPECT_EQ(told[0].kind, Kind::kMissed);
    EXPECT_NEAR(told[0].unseen_s, i * kDt, 1e-9);
    EXPECT_LE(told[0].limit_s, limit);
    if (told.size() < 2) continue;
    removed = true;
    EXPECT_EQ(told[1].kind, Kind::kRemoved);
    EXPECT_EQ(told[1].removal, Removal::kUnseen);
    EXPECT_GT(told[1].unseen_s, told[1].limit_s);
  }
  EXPECT_TRUE(removed);
  EXPECT_EQ(with_id(1), nullptr);
}

TEST_F(TrackerTells, ATentativeOneThatIsNotSeenAgain) {
  (void)told_of(1, {seen_at(100, 200)});
  (void)told_of(1, {});
  const std::vector<Decision> told = told_of(1, {});
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].kind, Kind::kRemoved);
  EXPECT_EQ(told[1].removal, Removal::kUnconfirmed);
}

TEST_F(TrackerTells, WhichGateForbadeAPair) {
  for (int i = 0; i < 12; ++i) (void)told_of(1, {seen_at(100 + 2 * i, 200, 20)});
  (void)told_of(1, {seen_at(124, 200, 20), seen_at(500, 200, 20), seen_at(126, 200, 40)});
  const auto pair = [this](int detection) {
    const auto found = std::find_if(told_.begin(), told_.end(), [&](const Decision& one) {
      return one.id == 1 && one.kind == Kind::kWeighed && one.detection == detection;
    });
    EXPECT_NE(found, told_.end()) << detection;
    return found == told_.end() ? Decision{} : *found;
  };
  EXPECT_EQ(pair(1).cost.gate, PairCost::Gate::kOpen);
  EXPECT_LT(pair(1).cost.sum(), pair(1).limit);
  EXPECT_EQ(pair(2).cost.gate, PairCost::Gate::kPicture);
  EXPECT_GT(pair(2).offset_x, 300);
  EXPECT_EQ(pair(3).cost.gate, PairCost::Gate::kDepth);
  EXPECT_NEAR(pair(3).offset_disparity, 20, 2);
  EXPECT_TRUE(std::isinf(pair(3).cost.sum()));
}

Detection not_to_begin(Detection detection) {
  detection.may_begin = false;
  return detection;
}

TEST_F(TrackerTells, NoneBeginsWithADetectionThatMayNot) {
  for (int i = 0; i < 10; ++i) {
    told_.clear();
    step({seen_at(100 + 4 * i, 200, 20), not_to_begin(seen_at(400 + 4 * i, 200, 20))});
    ASSERT_EQ(reports().size(), 1U);
    EXPECT_EQ(tracker_->held_back(), 1U);
    const auto told =
        std::find_if(told_.begin(), told_.end(), [](const Decision& one) { return one.kind == Kind::kNoneBegin; });
    ASSERT_NE(told, told_.end());
    EXPECT_EQ(told->detection, 2);
    EXPECT_EQ(told->id, 0U);
  }
  EXPECT_EQ(tracker_->refused(), 0U) << "there is room";
  step({seen_at(140, 200, 20)});
  EXPECT_EQ(tracker_->held_back(), 0U);
  step({seen_at(144, 200, 20), seen_at(440, 200, 20)});
  EXPECT_EQ(reports().size(), 2U) << "once it may";
  EXPECT_EQ(reports()[1].id, 2U) << "no id was spent";
}

TEST_F(TrackerTells, WhatBeganElsewhereGoesOnWhereNoneBegins) {
  for (int i = 0; i < 10; ++i) step({seen_at(100 + 4 * i, 200, 20)});
  for (int i = 10; i < 20; ++i) {
    step({not_to_begin(seen_at(100 + 4 * i, 200, 20))});
    EXPECT_EQ(tracker_->held_back(), 0U);
  }
  ASSERT_EQ(reports().size(), 1U);
  EXPECT_EQ(reports()[0].id, 1U);
  EXPECT_EQ(reports()[0].state, TrackState::kConfirmed);
  EXPECT_TRUE(reports()[0].measured);
}

TEST_F(TrackerTells, ATentativeOneThatBeganElsewhereIsConfirmedThere) {
  step({seen_at(100, 200, 20)});
  for (int i = 1; i < 4; ++i) step({not_to_begin(seen_at(100 + 6 * i, 200, 20))});
  ASSERT_EQ(reports().size(), 1U);
  EXPECT_EQ(reports()[0].state, TrackState::kConfirmed);
}

TEST(Tracker, Faults) {
  Arena arena;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto fault_of = [&](auto&& change, const Tracker::View& view = {640, 480, 500, 100}) {
    Tracker::Config c = config();
    change(c);
    const auto created = Tracker::create(c, features(), view, arena);
    return created ? Fault{} : created.error();
  };
  const auto nothing = [](Tracker::Config&) {};
  EXPECT_EQ(fault_of(nothing), Fault{});
  EXPECT_EQ(fault_of([](auto& c) { c.confirm_hits = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.confirm_hits = 21; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.tentative_misses = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.coast_s = -1; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([&](auto& c) { c.gate = nan; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.acceleration = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.steady_acceleration = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([&](auto& c) { c.gravity.y() = nan; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.initial_speed = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.centre_noise_px = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.centre_noise_size = -1; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of(nothing, {0, 480, 500, 100}), Fault::kBadSize);
  EXPECT_EQ(fault_of(nothing, {640, 480, 0, 100}), Fault::kBadSize);
  EXPECT_EQ(fault_of(nothing, {640, 480, 500, nan}), Fault::kBadSize);
  arena.seal();
  EXPECT_EQ(fault_of(nothing), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
