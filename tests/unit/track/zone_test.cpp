#include "pipeline/track/zone.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <limits>
#include <random>

#include "tests/unit/signals/targets.hpp"

namespace stereotrack {
namespace {

using signals::target_at;
using signals::target_in_picture;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Zone box() {
  Zone zone;
  zone.kind = Zone::Kind::kSpace;
  zone.x_m = {-1, 1};
  zone.y_m = {-2, 2};
  zone.z_m = {0, 5};
  return zone;
}

Zone polygon(std::initializer_list<Zone::Corner> corners, Zone::Anchor anchor = Zone::Anchor::kCentre) {
  Zone zone;
  zone.kind = Zone::Kind::kPicture;
  zone.anchor = anchor;
  for (const Zone::Corner& corner : corners) EXPECT_TRUE(zone.corners.push(corner));
  return zone;
}

TEST(ZoneInSpace, BothEndsBelongToIt) {
  EXPECT_TRUE(contains(box(), target_at(0, 0, 3), 1));
  for (const double x : {-1.0, 1.0}) EXPECT_TRUE(contains(box(), target_at(x, 0, 3), 1));
  for (const double y : {-2.0, 2.0}) EXPECT_TRUE(contains(box(), target_at(0, y, 3), 1));
  for (const double z : {0.0, 5.0}) EXPECT_TRUE(contains(box(), target_at(0, 0, z), 1));
  for (const double x : {-1.001, 1.001}) EXPECT_FALSE(contains(box(), target_at(x, 0, 3), 1));
  for (const double y : {-2.001, 2.001}) EXPECT_FALSE(contains(box(), target_at(0, y, 3), 1));
  for (const double z : {-0.001, 5.001}) EXPECT_FALSE(contains(box(), target_at(0, 0, z), 1));
}

TEST(ZoneInSpace, IsInMetresWhateverTheUnitOfTheTracks) {
  constexpr double kInch_m = 0.0254;
  EXPECT_TRUE(contains(box(), target_at(0, 0, 196.85), kInch_m));   // 4.99999 m
  EXPECT_FALSE(contains(box(), target_at(0, 0, 196.86), kInch_m));  // 5.00024 m
}

TEST(ZoneInSpace, HoldsNobodyWithoutDepth) {
  TrackReport target = target_at(0, 0, 3);
  target.has_depth = false;
  EXPECT_FALSE(contains(box(), target, 1));
}

TEST(ZoneInSpace, WhatIsNotFiniteIsNowhere) {
  EXPECT_FALSE(contains(box(), target_at(kNan, 0, 3), 1));
  EXPECT_FALSE(contains(box(), target_at(0, kNan, 3), 1));
  EXPECT_FALSE(contains(box(), target_at(0, 0, kNan), 1));
  EXPECT_FALSE(contains(box(), target_at(0, 0, kInfinity), 1));
  EXPECT_FALSE(contains(box(), target_at(0, 0, 3), kNan));
}

TEST(ZoneInPicture, TriangleWorkedByHand) {
  // The diagonal from (0, 0) to (100, 480): at y = 240 it is at x = 50.
  const Zone zone = polygon({{0, 0}, {100, 0}, {100, 480}});
  EXPECT_TRUE(contains(zone, target_in_picture(51, 240), 0));
  EXPECT_FALSE(contains(zone, target_in_picture(49, 240), 0));
  EXPECT_TRUE(contains(zone, target_in_picture(99, 240), 0));
  EXPECT_FALSE(contains(zone, target_in_picture(101, 240), 0));
  EXPECT_FALSE(contains(zone, target_in_picture(50, -1), 0));
  EXPECT_FALSE(contains(zone, target_in_picture(99, 481), 0));
}

TEST(ZoneInPicture, TheOtherOrderOfCornersIsTheSame) {
  const Zone zone = polygon({{100, 480}, {100, 0}, {0, 0}});
  EXPECT_TRUE(contains(zone, target_in_picture(51, 240), 0));
  EXPECT_FALSE(contains(zone, target_in_picture(49, 240), 0));
}

TEST(ZoneInPicture, MayBeConcave) {
  // A U, open at the top.
  const Zone zone = polygon({{0, 0}, {10, 0}, {10, 20}, {20, 20}, {20, 0}, {30, 0}, {30, 30}, {0, 30}});
  EXPECT_TRUE(contains(zone, target_in_picture(5, 10), 0));
  EXPECT_FALSE(contains(zone, target_in_picture(15, 10), 0));
  EXPECT_TRUE(contains(zone, target_in_picture(25, 10), 0));
  EXPECT_TRUE(contains(zone, target_in_picture(15, 25), 0));
  // Level with a corner: counted once.
  EXPECT_FALSE(contains(zone, target_in_picture(-1, 20), 0));
  EXPECT_FALSE(contains(zone, target_in_picture(31, 20), 0));
}

TEST(ZoneInPicture, ZonesSideBySideShareNoPointAndLeaveNoGap) {
  const Zone left = polygon({{0, 0}, {10, 0}, {10, 10}, {0, 10}});
  const Zone right = polygon({{10, 0}, {20, 0}, {20, 10}, {10, 10}});
  for (int x = 0; x < 20; ++x) {
    for (int y = 0; y < 10; ++y) {
      const TrackReport target = target_in_picture(x, y);
      EXPECT_NE(contains(left, target, 0), contains(right, target, 0)) << x << " " << y;
    }
  }
}

TEST(ZoneInPicture, BottomIsTheLastRowOfTheBox) {
  const Zone floor = polygon({{0, 100}, {200, 100}, {200, 200}, {0, 200}}, Zone::Anchor::kBottom);
  EXPECT_TRUE(contains(floor, target_in_picture(50, 91), 0));   // rows 81 to 100
  EXPECT_FALSE(contains(floor, target_in_picture(50, 90), 0));  // rows 80 to 99
  Zone by_centre = floor;
  by_centre.anchor = Zone::Anchor::kCentre;
  EXPECT_FALSE(contains(by_centre, target_in_picture(50, 91), 0));
}

TEST(ZoneInPicture, WhatHasLeftThePictureHasNoBottom) {
  const Zone all = polygon({{-1000, -1000}, {1000, -1000}, {1000, 1000}, {-1000, 1000}}, Zone::Anchor::kBottom);
  TrackReport target = target_in_picture(50, 50);
  EXPECT_TRUE(contains(all, target, 0));
  target.box = {};
  EXPECT_FALSE(contains(all, target, 0));
}

TEST(ZoneInPicture, NeedsNeitherDepthNorUnit) {
  EXPECT_FALSE(target_in_picture(5, 5).has_depth);
  EXPECT_TRUE(contains(polygon({{0, 0}, {10, 0}, {10, 10}, {0, 10}}), target_in_picture(5, 5), 0));
}

TEST(ZoneInPicture, WhatIsNotFiniteIsNowhere) {
  const Zone zone = polygon({{0, 0}, {10, 0}, {10, 10}, {0, 10}});
  TrackReport target = target_in_picture(5, 5);
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    target.image_x = bad;
    target.image_y = 5;
    EXPECT_FALSE(contains(zone, target, 0));
    target.image_x = 5;
    target.image_y = bad;
    EXPECT_FALSE(contains(zone, target, 0));
  }
}

TEST(ZoneOfADetection, IsAskedAsThatOfATarget) {
  Detection detection;
  detection.box = {45, 81, 11, 20};  // centre (50, 90.5), last row 100
  const Zone floor = polygon({{0, 100}, {200, 100}, {200, 200}, {0, 200}}, Zone::Anchor::kBottom);
  EXPECT_TRUE(contains(floor, detection, 0));
  Zone by_centre = floor;
  by_centre.anchor = Zone::Anchor::kCentre;
  EXPECT_FALSE(contains(by_centre, detection, 0));
  EXPECT_FALSE(contains(box(), detection, 1)) << "without depth";
  detection.has_depth = true;
  detection.position = {0, 0, 3};
  EXPECT_TRUE(contains(box(), detection, 1));
  EXPECT_FALSE(contains(box(), detection, 2));
}

/// The mask has the pixels that contains() says, and no bit after a row's end.
void expect_same(std::initializer_list<Zone::Corner> corners, int width, int height) {
  const Zone zone = polygon(corners);
  Arena arena;
  const BitMask mask = BitMask::create(width, height, arena);
  add_polygon(zone.corners.view(), mask);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      ASSERT_EQ(mask.at(x, y), contains(zone.corners.view(), x, y)) << x << " " << y;
    }
    ASSERT_EQ(mask.row(y)[mask.words_a_row() - 1] & ~BitMask::last_word(width), 0U);
  }
}

int area_of(std::initializer_list<Zone::Corner> corners, int width, int height) {
  const Zone zone = polygon(corners);
  Arena arena;
  const BitMask mask = BitMask::create(width, height, arena);
  add_polygon(zone.corners.view(), mask);
  int area = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) area += mask.at(x, y) ? 1 : 0;
  }
  return area;
}

TEST(MaskOfAPolygon, RectangleHasItsArea) {
  // Pixel centres 10..29 by 5..14.
  EXPECT_EQ(area_of({{9.5, 4.5}, {29.5, 4.5}, {29.5, 14.5}, {9.5, 14.5}}, 100, 40), 20 * 10);
  EXPECT_EQ(area_of({{63.5, 0.5}, {64.5, 0.5}, {64.5, 1.5}, {63.5, 1.5}}, 100, 40), 1) << "first bit of a word";
  EXPECT_EQ(area_of({{-0.5, -0.5}, {127.5, -0.5}, {127.5, 3.5}, {-0.5, 3.5}}, 128, 4), 128 * 4) << "whole words";
}

TEST(MaskOfAPolygon, WhatReachesOutOfThePictureIsCut) {
  EXPECT_EQ(area_of({{-1000, -1000}, {9.5, -1000}, {9.5, 4.5}, {-1000, 4.5}}, 100, 40), 10 * 5);
  EXPECT_EQ(area_of({{89.5, 30.5}, {1e5, 30.5}, {1e5, 1e5}, {89.5, 1e5}}, 100, 40), 10 * 9);
  EXPECT_EQ(area_of({{-1e5, -1e5}, {1e5, -1e5}, {1e5, 1e5}, {-1e5, 1e5}}, 100, 40), 100 * 40);
  EXPECT_EQ(area_of({{200, 0}, {300, 0}, {300, 30}}, 100, 40), 0);
  EXPECT_EQ(area_of({{-300, 0}, {-200, 0}, {-200, 30}}, 100, 40), 0);
}

TEST(MaskOfAPolygon, DegenerateOnesAreEmpty) {
  EXPECT_EQ(area_of({{10, 10}, {10, 10}, {10, 10}}, 100, 40), 0);
  EXPECT_EQ(area_of({{10, 10}, {50, 10}, {90, 10}}, 100, 40), 0);
  EXPECT_EQ(area_of({{10, 0}, {10, 30}, {10, 15}}, 100, 40), 0);
}

TEST(MaskOfAPolygon, SelfCrossingOnesHoldWhatAnOddNumberOfEdgesSurrounds) {
  // A bow tie, whose middle is one point.
  expect_same({{0, 0}, {100, 40}, {100, 0}, {0, 40}}, 101, 41);
  // A star of five points: its middle is surrounded twice, and outside.
  const std::initializer_list<Zone::Corner> star{{50, 0}, {80, 90}, {2, 34}, {98, 34}, {20, 90}};
  expect_same(star, 101, 95);
  EXPECT_FALSE(contains(polygon(star).corners.view(), 50, 50));
  EXPECT_TRUE(contains(polygon(star).corners.view(), 50, 10));
}

TEST(MaskOfAPolygon, AnyPolygonIsThatOfContains) {
  std::mt19937 random(5);
  const auto corner = [&] {
    return Zone::Corner{static_cast<double>(random() % 2000) / 10 - 50, static_cast<double>(random() % 1200) / 10 - 30};
  };
  for (int i = 0; i < 200; ++i) {
    // Every second one has corners at pixel centres, too.
    const Zone::Corner even{static_cast<double>(random() % 100), static_cast<double>(random() % 60)};
    expect_same({corner(), corner(), i % 2 == 0 ? even : corner(), corner(), corner(), even, corner()}, 97, 61);
  }
}

TEST(MaskOfAPolygon, SeveralAreUnited) {
  const Zone first = polygon({{-1, -1}, {10.5, -1}, {10.5, 5.5}, {-1, 5.5}});
  const Zone second = polygon({{5.5, -1}, {20.5, -1}, {20.5, 5.5}, {5.5, 5.5}});
  Arena arena;
  const BitMask mask = BitMask::create(30, 6, arena);
  add_polygon(first.corners.view(), mask);
  add_polygon(second.corners.view(), mask);
  for (int x = 0; x < 30; ++x) EXPECT_EQ(mask.at(x, 3), x <= 20) << x;
}

TEST(CheckZone, RefusesWhatIsNoZone) {
  EXPECT_TRUE(check(box()).has_value());
  Zone zone = box();
  zone.y_m = {2, 1.999};
  EXPECT_EQ(check(zone).error(), Fault::kBadConfig);
  zone.y_m = {2, 2};
  EXPECT_TRUE(check(zone).has_value());
  zone.z_m = {0, kInfinity};
  EXPECT_EQ(check(zone).error(), Fault::kNotFinite);
  EXPECT_EQ(check(polygon({})).error(), Fault::kBadConfig);
  EXPECT_EQ(check(polygon({{0, 0}, {1, 0}})).error(), Fault::kBadConfig);
  EXPECT_TRUE(check(polygon({{0, 0}, {1, 0}, {0, 1}})).has_value());
  EXPECT_EQ(check(polygon({{0, 0}, {1, 0}, {0, kNan}})).error(), Fault::kNotFinite);
}

}  // namespace
}  // namespace stereotrack
