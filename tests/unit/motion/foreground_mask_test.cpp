#include "pipeline/motion/foreground_mask.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <utility>

#include "pictures.hpp"
#include "pipeline/motion/adaptive_background.hpp"

namespace stereotrack {
namespace {

using test::Plane;
using test::view;

const cv::Size kSize(64, 48);
constexpr int kStep = AdaptiveBackground::kStepsPerSd;

ForegroundMask::Config config() {
  ForegroundMask::Config c;
  c.low_sd = 4;
  c.high_sd = 8;
  c.halo_percent = 0;
  c.min_seeds = 5;
  c.max_runs = 4096;
  return c;
}

struct Outcome {
  Plane mask;
  double share = -1;
};

Outcome run(Plane distance, const ForegroundMask::Config& c = config()) {
  Arena arena;
  auto stage = ForegroundMask::create(c, distance.cols, distance.rows, arena);
  EXPECT_TRUE(stage.has_value());
  Outcome out{Plane(distance.size(), std::uint8_t{7}), -1};
  const Result<double> share = stage->run(view(distance), view(out.mask));
  EXPECT_TRUE(share.has_value());
  if (share) out.share = *share;
  return out;
}

Plane quiet() { return {kSize, std::uint8_t{0}}; }

TEST(ForegroundMask, StrongObjectIsKeptButForItsCorners) {
  Plane distance = quiet();
  const cv::Rect object(20, 10, 12, 9);
  distance(object).setTo(12 * kStep);
  const Outcome out = run(distance);
  Plane expected = quiet();
  expected(object).setTo(255);
  for (int x : {20, 31}) {
    for (int y : {10, 18}) expected(y, x) = 0;  // 4 of 9 neighbours are no majority
  }
  EXPECT_EQ(cv::countNonZero(out.mask != expected), 0);
  EXPECT_DOUBLE_EQ(out.share, (12 * 9 - 4) / (64.0 * 48.0));
}

TEST(ForegroundMask, IgnoredPixelsAreNeverForegroundAndNoPartOfThePicture) {
  Plane distance = quiet();
  distance(cv::Rect(20, 10, 24, 9)).setTo(12 * kStep);
  Arena arena;
  const BitMask ignored = BitMask::create(kSize.width, kSize.height, arena);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < 32; ++x) ignored.set(x, y, true);
  }
  auto stage = ForegroundMask::create(config(), kSize.width, kSize.height, arena, ignored);
  ASSERT_TRUE(stage.has_value());
  Plane mask(kSize, std::uint8_t{7});
  const Result<double> share = stage->run(view(distance), view(mask));
  ASSERT_TRUE(share.has_value());
  Plane expected = quiet();
  expected(cv::Rect(32, 10, 12, 9)).setTo(255);
  expected(10, 43) = expected(18, 43) = 0;  // what is ignored keeps its vote: no corner on its side
  EXPECT_EQ(cv::countNonZero(mask != expected), 0);
  EXPECT_DOUBLE_EQ(*share, (12 * 9 - 2) / (32.0 * 48.0));
}

TEST(ForegroundMask, WhereAllIsIgnoredNothingIsForeground) {
  Plane distance(kSize, std::uint8_t{12 * kStep});
  Arena arena;
  const BitMask ignored = BitMask::create(kSize.width, kSize.height, arena);
  for (int y = 0; y < kSize.height; ++y) ignored.row(y)[0] = ~std::uint64_t{0};
  auto stage = ForegroundMask::create(config(), kSize.width, kSize.height, arena, ignored);
  ASSERT_TRUE(stage.has_value());
  Plane mask(kSize, std::uint8_t{7});
  EXPECT_EQ(*stage->run(view(distance), view(mask)), 0);
  EXPECT_EQ(cv::countNonZero(mask), 0);
  const BitMask other = BitMask::create(kSize.width, kSize.height - 1, arena);
  EXPECT_EQ(ForegroundMask::create(config(), kSize.width, kSize.height, arena, other).error(), Fault::kBadSize);
}

TEST(ForegroundMask, SingleNoisyPixelsAreRemoved) {
  Plane distance = quiet();
  for (int y = 1; y < kSize.height; y += 3) {
    for (int x = 1; x < kSize.width; x += 3) distance(y, x) = 31 * kStep;
  }
  const Outcome out = run(distance);
  EXPECT_EQ(cv::countNonZero(out.mask), 0);
  EXPECT_EQ(out.share, 0);
}

TEST(ForegroundMask, WeakRegionWithoutSeedsIsRemovedWhateverItsSize) {
  Plane distance = quiet();
  distance(cv::Rect(5, 5, 40, 30)).setTo(8 * kStep - 1);
  EXPECT_EQ(cv::countNonZero(run(distance).mask), 0);
  for (int i = 0; i < 4; ++i) distance(20, 20 + i) = 8 * kStep;
  EXPECT_EQ(cv::countNonZero(run(distance).mask), 0) << "4 seeds of 5";
  distance(20, 24) = 8 * kStep;
  EXPECT_EQ(cv::countNonZero(run(distance).mask), 40 * 30 - 4) << "5 seeds hold the whole region";
}

TEST(ForegroundMask, SeedsOfOneRegionDoNotHoldAnother) {
  Plane distance = quiet();
  distance(cv::Rect(4, 5, 12, 12)).setTo(5 * kStep);
  distance(cv::Rect(30, 5, 12, 12)).setTo(12 * kStep);
  const Plane mask = run(distance).mask;
  EXPECT_EQ(cv::countNonZero(mask(cv::Rect(0, 0, 24, 48))), 0);
  EXPECT_EQ(cv::countNonZero(mask), 12 * 12 - 4);
}

TEST(ForegroundMask, UnderTheLowThresholdNothingIsACandidate) {
  Plane distance = quiet();
  distance(cv::Rect(20, 10, 12, 9)).setTo(12 * kStep);
  distance(cv::Rect(32, 10, 12, 9)).setTo(4 * kStep - 1);
  ForegroundMask::Config c = config();
  c.faint_sd = 30;
  EXPECT_EQ(cv::countNonZero(run(distance, c).mask(cv::Rect(33, 0, 31, 48))), 0);
  distance(cv::Rect(32, 10, 12, 9)).setTo(4 * kStep);
  EXPECT_EQ(cv::countNonZero(run(distance, c).mask), 24 * 9 - 4);
}

TEST(ForegroundMask, FaintAreaIsForegroundOnlyWhereItHangsOnAStrongOne) {
  const cv::Rect area(12, 12, 24, 20);
  Plane distance = quiet();
  distance(area).setTo(2 * kStep);  // under low_sd = 4, over faint_sd = 1.25
  EXPECT_EQ(cv::countNonZero(run(distance).mask), 0) << "alone";
  distance(cv::Rect(36, 12, 8, 20)).setTo(8 * kStep);
  const Plane mask = run(distance).mask;
  EXPECT_EQ(test::part(mask, test::inner(area, 2)), 1);
  EXPECT_EQ(test::part(mask, {37, 13, 6, 18}), 1);
  // Where the 5x5 around is all quiet, nothing is added.
  EXPECT_EQ(cv::countNonZero(mask) - cv::countNonZero(mask(cv::Rect(10, 10, 36, 24))), 0);
}

TEST(ForegroundMask, FaintAreaCountsByItsMeanNotByItsPixels) {
  // Pixels of 1 and 2 sd in turn: the mean of 5x5 is (13 + 24) / 25 or (26 + 12) / 25 sd, 1.48 and 1.52.
  const cv::Rect area(12, 12, 24, 20);
  Plane distance = quiet();
  distance(cv::Rect(36, 12, 8, 20)).setTo(8 * kStep);
  for (int y = area.y; y < area.br().y; ++y) {
    for (int x = area.x; x < area.br().x; ++x) distance(y, x) = (x + y) % 2 == 0 ? 2 * kStep : kStep;
  }
  const auto kept = [&](double faint_sd) {
    ForegroundMask::Config c = config();
    c.faint_sd = faint_sd;
    return test::part(run(distance, c).mask, test::inner(area, 4));
  };
  EXPECT_EQ(kept(1.25), 1);
  EXPECT_EQ(kept(1.75), 0);
}

TEST(ForegroundMask, HaloOfAStrongObjectIsTrimmed) {
  Plane distance = quiet();
  const cv::Rect object(20, 10, 14, 12);
  distance(test::inner(object, -2)).setTo(6 * kStep);
  distance(object).setTo(30 * kStep);
  ForegroundMask::Config c = config();
  const Plane with_halo = run(distance, c).mask;
  EXPECT_EQ(cv::countNonZero(with_halo), 18 * 16 - 4);
  c.halo_percent = 25;  // 6 is 20 % of 30
  const Plane trimmed = run(distance, c).mask;
  EXPECT_EQ(cv::countNonZero(trimmed(object)), 14 * 12 - 4);
  EXPECT_EQ(cv::countNonZero(trimmed), 14 * 12 - 4);
}

TEST(ForegroundMask, HaloReachesNoFurtherThanTwoPixels) {
  // A weak region that hangs on a strong one is halo at 1 and 2 px from it, object from 3 px on.
  Plane distance = quiet();
  distance(cv::Rect(10, 10, 10, 12)).setTo(30 * kStep);
  distance(cv::Rect(20, 10, 20, 12)).setTo(6 * kStep);
  for (int i = 0; i < 5; ++i) distance(15, 30 + i) = 8 * kStep;
  ForegroundMask::Config c = config();
  c.halo_percent = 25;
  const Plane mask = run(distance, c).mask;
  EXPECT_EQ(cv::countNonZero(mask(cv::Rect(20, 0, 2, 48))), 0);
  EXPECT_EQ(cv::countNonZero(mask(cv::Rect(22, 11, 17, 10))), 17 * 10);
}

TEST(ForegroundMask, ObjectAtThePicturesBorderIsKept) {
  Plane distance = quiet();
  distance(cv::Rect(0, 0, 10, 8)).setTo(12 * kStep);
  const Plane mask = run(distance).mask;
  EXPECT_EQ(mask(0, 0), 255);
  EXPECT_EQ(cv::countNonZero(mask), 10 * 8 - 1);
}

TEST(ForegroundMask, OneSeedAndOnePixelSuffice) {
  ForegroundMask::Config c = config();
  c.min_seeds = 1;
  EXPECT_EQ(run(Plane(1, 1, std::uint8_t{255}), c).share, 1.0);
  EXPECT_EQ(run(Plane(1, 1, std::uint8_t{10}), c).share, 0.0);
}

TEST(ForegroundMask, PictureOfAnotherSizeIsAFaultAndLeavesTheMask) {
  Arena arena;
  auto stage = ForegroundMask::create(config(), kSize.width, kSize.height, arena);
  ASSERT_TRUE(stage.has_value());
  Plane distance(kSize.height, kSize.width - 1, std::uint8_t{255});
  Plane mask(kSize, std::uint8_t{7});
  EXPECT_EQ(stage->run(view(distance), view(mask)).error(), Fault::kBadSize);
  EXPECT_EQ(cv::countNonZero(mask != 7), 0);
  EXPECT_EQ(stage->run(view(mask), view(distance)).error(), Fault::kBadSize);
  EXPECT_EQ(cv::countNonZero(distance != 255), 0);
}

// Two objects of 9 rows, one above the other: with room for the runs of the first, those of the second are counted.
TEST(ForegroundMask, RunsWithoutRoomAreCountedAndTheLowerPartIsBackground) {
  Plane distance = quiet();
  const cv::Rect upper(20, 5, 12, 9);
  const cv::Rect lower(20, 25, 12, 9);
  distance(upper).setTo(12 * kStep);
  distance(lower).setTo(12 * kStep);
  for (const auto& [room, dropped] : {std::pair{18, 0}, std::pair{9, 9}}) {
    ForegroundMask::Config c = config();
    c.max_runs = room;
    Arena arena;
    auto stage = ForegroundMask::create(c, distance.cols, distance.rows, arena);
    ASSERT_TRUE(stage.has_value());
    Plane mask(distance.size(), std::uint8_t{7});
    ASSERT_TRUE(stage->run(view(distance), view(mask)).has_value());
    EXPECT_EQ(stage->dropped_runs(), dropped);
    EXPECT_GT(cv::countNonZero(mask(upper)), 100);
    EXPECT_EQ(cv::countNonZero(mask(lower)) == 0, dropped > 0);
  }
}

TEST(ForegroundMask, Faults) {
  Arena arena;
  const auto fault_of = [&](auto&& change, int width = 8, int height = 8) {
    ForegroundMask::Config c = config();
    change(c);
    const auto created = ForegroundMask::create(c, width, height, arena);
    return created ? Fault{} : created.error();
  };
  const auto nothing = [](ForegroundMask::Config&) {};
  EXPECT_EQ(fault_of(nothing), Fault{});
  EXPECT_EQ(fault_of([](auto& c) { c.low_sd = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.low_sd = std::numeric_limits<double>::quiet_NaN(); }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.high_sd = 3.9; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.high_sd = 255.0 / kStep + 0.5; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.halo_percent = -1; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.halo_percent = 91; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.min_seeds = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of([](auto& c) { c.max_runs = 0; }), Fault::kBadConfig);
  EXPECT_EQ(fault_of(nothing, 0, 8), Fault::kBadSize);
  arena.seal();
  EXPECT_EQ(fault_of(nothing), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
