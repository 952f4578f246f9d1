#include "pipeline/track/zone_rules.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <limits>
#include <optional>

namespace stereotrack {
namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 120;
constexpr double kFocal = 200;

StereoCalibration ideal_rig() {
  StereoCalibration c;
  c.left = {kWidth, kHeight, kFocal, kFocal, 79, 59, LensModel::kRadtan, {}};
  c.right = c.left;
  c.t_right_left = {-0.5, 0, 0};
  return c;
}

Zone box(double z_from, double z_to) {
  Zone zone;
  zone.x_m = zone.y_m = {-1e6, 1e6};
  zone.z_m = {z_from, z_to};
  return zone;
}

Zone polygon(std::initializer_list<Zone::Corner> corners) {
  Zone zone;
  zone.kind = Zone::Kind::kPicture;
  for (const Zone::Corner& corner : corners) EXPECT_TRUE(zone.corners.push(corner));
  return zone;
}

Zone left_half() { return polygon({{-1, -1}, {79.5, -1}, {79.5, 200}, {-1, 200}}); }

Detection seen(const Rect& box, double z) {
  Detection out;
  out.box = box;
  out.has_depth = z > 0;
  out.position = {0, 0, z};
  return out;
}

class ZoneRulesOf : public testing::Test {
 protected:
  ZoneRulesOf() {
    auto made = Rectifier::create(ideal_rig(), kWidth, kHeight, arena_);
    EXPECT_TRUE(made.has_value());
    if (made) rectifier_.emplace(*made);
  }
  void make(const ZoneRules::Config& config) {
    auto made = ZoneRules::create(config, kWidth, kHeight, arena_);
    ASSERT_TRUE(made.has_value());
    rules_.emplace(*made);
  }
  [[nodiscard]] std::optional<Rejection> judged(const Detection& detection, bool claimed = false) const {
    return rules_->judge(detection, claimed, &*rectifier_).why;
  }
  static Result<ZoneRules> created(const ZoneRules::Config& config) {
    Arena arena;
    return ZoneRules::create(config, kWidth, kHeight, arena);
  }

  Arena arena_;
  std::optional<Rectifier> rectifier_;
  std::optional<ZoneRules> rules_;
};

TEST_F(ZoneRulesOf, NothingSaidIsNothingToDo) {
  EXPECT_FALSE(ZoneRules::Config{}.any());
  make({});
  EXPECT_EQ(rules_->ignored().width, 0);
  EXPECT_EQ(judged(seen({10, 10, 20, 20}, 5)), std::nullopt);
  EXPECT_TRUE(rules_->may_begin(seen({10, 10, 20, 20}, 5)));
}

TEST_F(ZoneRulesOf, WhatIsOutsideOfTheVolumeIsRejectedClaimedOrNot) {
  make({.volume = box(2, 5), .unit_m = 0.1});  // 20 to 50 units
  for (const bool claimed : {false, true}) {
    EXPECT_EQ(judged(seen({40, 40, 20, 20}, 20), claimed), std::nullopt);
    EXPECT_EQ(judged(seen({40, 40, 20, 20}, 50.1), claimed), Rejection::kOutside);
    EXPECT_EQ(judged(seen({40, 40, 20, 20}, 0), claimed), std::nullopt) << "without depth";
  }
}

TEST_F(ZoneRulesOf, WhatIsInAnIgnoredBoxIsRejectedClaimedOrNot) {
  ZoneRules::Config config{.unit_m = 1};
  ASSERT_TRUE(config.zones.push({.zone = box(2, 5), .targets = ZoneRules::Targets::kIgnore}));
  make(config);
  EXPECT_EQ(rules_->ignored().width, 0);
  for (const bool claimed : {false, true}) {
    EXPECT_EQ(judged(seen({40, 40, 20, 20}, 3), claimed), Rejection::kIgnored);
    EXPECT_EQ(judged(seen({40, 40, 20, 20}, 6), claimed), std::nullopt);
    EXPECT_EQ(judged(seen({40, 40, 20, 20}, 0), claimed), std::nullopt);
  }
}

TEST_F(ZoneRulesOf, SizeIsTheLongerSideAtItsDistance) {
  // 40 px at 5 units, f = 200 px: 1 unit, of half a metre.
  make({.min_size_m = 0.499, .max_size_m = 0.501, .unit_m = 0.5});
  EXPECT_EQ(judged(seen({40, 40, 20, 40}, 5)), std::nullopt);
  EXPECT_EQ(judged(seen({40, 40, 40, 20}, 5)), std::nullopt);
  EXPECT_EQ(judged(seen({40, 40, 20, 40}, 4.9)), Rejection::kUnderSize);
  EXPECT_EQ(judged(seen({40, 40, 20, 40}, 5.1)), Rejection::kOverSize);
  EXPECT_NEAR(rules_->judge(seen({40, 40, 20, 40}, 4), false, &*rectifier_).size_m, 0.4, 1e-4);
}

TEST_F(ZoneRulesOf, SizeIsNotAskedWithoutDepthNorOfWhatATargetClaims) {
  make({.min_size_m = 2, .max_size_m = 3, .unit_m = 1});
  EXPECT_EQ(judged(seen({40, 40, 20, 40}, 5)), Rejection::kUnderSize);
  EXPECT_EQ(judged(seen({40, 40, 20, 40}, 0)), std::nullopt);
  EXPECT_EQ(judged(seen({40, 40, 20, 40}, 5), true), std::nullopt);
  EXPECT_EQ(judged(seen({40, 40, 20, 40}, 30)), Rejection::kOverSize);
  EXPECT_EQ(judged(seen({40, 40, 20, 40}, 30), true), std::nullopt);
  EXPECT_EQ(rules_->judge(seen({40, 40, 20, 40}, 5), false, nullptr).why, std::nullopt) << "mono";
}

TEST_F(ZoneRulesOf, WhatTheBorderCutsIsNotTooSmallButMayBeTooLarge) {
  ZoneRules::Config config{.min_size_m = 2, .max_size_m = 3, .unit_m = 1};
  const Zone pole = polygon({{79.5, -1}, {89.5, -1}, {89.5, 200}, {79.5, 200}});  // columns 80 to 89
  ASSERT_TRUE(config.zones.push({.zone = pole, .targets = ZoneRules::Targets::kIgnore}));
  make(config);
  for (const Rect& cut : {Rect{0, 40, 20, 40}, Rect{140, 40, 20, 40}, Rect{40, 0, 20, 40}, Rect{40, 80, 20, 40},
                          Rect{60, 40, 20, 40}, Rect{90, 40, 20, 40}}) {
    EXPECT_EQ(judged(seen(cut, 5)), std::nullopt) << cut.left << " " << cut.top;
    EXPECT_EQ(judged(seen(cut, 30)), Rejection::kOverSize) << cut.left << " " << cut.top;
  }
  for (const Rect& whole : {Rect{1, 1, 20, 40}, Rect{139, 79, 20, 40}, Rect{59, 40, 20, 40}, Rect{91, 40, 20, 40}}) {
    EXPECT_EQ(judged(seen(whole, 5)), Rejection::kUnderSize) << whole.left << " " << whole.top;
  }
}

TEST_F(ZoneRulesOf, LimitsOfTheFirstZoneThatHasOneAreThose) {
  ZoneRules::Config config{.min_size_m = 0.1, .max_size_m = 0.5, .unit_m = 1};
  ASSERT_TRUE(config.zones.push({.zone = left_half(), .max_size_m = 2}));
  ASSERT_TRUE(config.zones.push({.zone = left_half(), .min_size_m = 1.5, .max_size_m = 9}));
  make(config);
  EXPECT_EQ(judged(seen({100, 40, 20, 40}, 5)), Rejection::kOverSize) << "1 m, elsewhere";
  EXPECT_EQ(judged(seen({20, 40, 20, 40}, 5)), Rejection::kUnderSize) << "1 m, of the second zone";
  EXPECT_EQ(judged(seen({20, 40, 20, 40}, 8)), std::nullopt) << "1.6 m";
  EXPECT_EQ(judged(seen({20, 40, 20, 40}, 10.5)), Rejection::kOverSize) << "2.1 m, of the first";
}

TEST_F(ZoneRulesOf, NoneBeginsWhereItIsSaid) {
  ZoneRules::Config config{.unit_m = 1};
  ASSERT_TRUE(config.zones.push({.zone = left_half(), .targets = ZoneRules::Targets::kNoneBegin}));
  ASSERT_TRUE(config.zones.push({.zone = box(2, 5), .targets = ZoneRules::Targets::kNoneBegin}));
  make(config);
  EXPECT_FALSE(rules_->may_begin(seen({20, 40, 20, 20}, 0)));
  EXPECT_TRUE(rules_->may_begin(seen({100, 40, 20, 20}, 0)));
  EXPECT_FALSE(rules_->may_begin(seen({100, 40, 20, 20}, 4)));
  EXPECT_TRUE(rules_->may_begin(seen({100, 40, 20, 20}, 6)));
  EXPECT_EQ(judged(seen({20, 40, 20, 20}, 4)), std::nullopt);
}

TEST_F(ZoneRulesOf, IgnoredPolygonsAreOneMask) {
  ZoneRules::Config config;
  ASSERT_TRUE(config.zones.push(
      {.zone = polygon({{-9, -9}, {9.5, -9}, {9.5, 4.5}, {-9, 4.5}}), .targets = ZoneRules::Targets::kIgnore}));
  ASSERT_TRUE(config.zones.push({.zone = polygon({{149.5, 99.5}, {999, 99.5}, {999, 999}, {149.5, 999}}),
                                 .targets = ZoneRules::Targets::kIgnore}));
  ASSERT_TRUE(config.zones.push({.zone = left_half(), .targets = ZoneRules::Targets::kNoneBegin}));
  make(config);
  ASSERT_EQ(rules_->ignored().width, kWidth);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      ASSERT_EQ(rules_->ignored().at(x, y), (x < 10 && y < 5) || (x >= 150 && y >= 100)) << x << " " << y;
    }
  }
}

TEST_F(ZoneRulesOf, WhatContradictsItselfIsRefused) {
  EXPECT_EQ(created({.min_size_m = 1}).error(), Fault::kBadConfig) << "metres without a unit";
  EXPECT_EQ(created({.volume = box(1, 2)}).error(), Fault::kBadConfig);
  EXPECT_EQ(created({.volume = left_half(), .unit_m = 1}).error(), Fault::kBadConfig);
  EXPECT_EQ(created({.min_size_m = 2, .max_size_m = 1, .unit_m = 1}).error(), Fault::kBadConfig);
  EXPECT_EQ(created({.min_size_m = -1, .unit_m = 1}).error(), Fault::kBadConfig);
  EXPECT_EQ(created({.unit_m = std::numeric_limits<double>::quiet_NaN()}).error(), Fault::kNotFinite);
  EXPECT_EQ(created({.volume = box(2, 1), .unit_m = 1}).error(), Fault::kBadConfig);
  ZoneRules::Config in_space;
  ASSERT_TRUE(in_space.zones.push({.zone = box(1, 2), .targets = ZoneRules::Targets::kIgnore}));
  EXPECT_EQ(created(in_space).error(), Fault::kBadConfig);
  in_space.unit_m = 1;
  EXPECT_TRUE(created(in_space).has_value());
  ZoneRules::Config picture;
  ASSERT_TRUE(picture.zones.push({.zone = left_half(), .targets = ZoneRules::Targets::kIgnore}));
  EXPECT_TRUE(created(picture).has_value()) << "pixels need no unit";
  Arena arena;
  EXPECT_EQ(ZoneRules::create(picture, 0, 5, arena).error(), Fault::kBadSize);
}

TEST_F(ZoneRulesOf, FingerprintIsOfEachNumber) {
  ZoneRules::Config config{.min_size_m = 1, .max_size_m = 2, .unit_m = 1};
  ASSERT_TRUE(config.zones.push({.zone = left_half(), .targets = ZoneRules::Targets::kIgnore}));
  const auto of = [](const ZoneRules::Config& c) { return created(c)->fingerprint(); };
  const std::uint64_t first = of(config);
  EXPECT_EQ(of(config), first);
  EXPECT_NE(first, 0U);
  const auto changed = [&](auto&& change) {
    ZoneRules::Config other = config;
    change(other);
    return of(other) != first;
  };
  EXPECT_TRUE(changed([](auto& c) { c.min_size_m = 0.5; }));
  EXPECT_TRUE(changed([](auto& c) { c.max_size_m = 3; }));
  EXPECT_TRUE(changed([](auto& c) { c.unit_m = 0.5; }));
  EXPECT_TRUE(changed([](auto& c) { c.volume = box(1, 2); }));
  EXPECT_TRUE(changed([](auto& c) { c.zones[0].targets = ZoneRules::Targets::kNoneBegin; }));
  EXPECT_TRUE(changed([](auto& c) { c.zones[0].min_size_m = 0.5; }));
  EXPECT_TRUE(changed([](auto& c) { c.zones[0].zone.corners[1].y = 7; }));
  EXPECT_TRUE(changed([](auto& c) { c.zones[0].zone.anchor = Zone::Anchor::kBottom; }));
  EXPECT_TRUE(changed([](auto& c) { (void)c.zones.push(c.zones[0]); }));
}

}  // namespace
}  // namespace stereotrack
