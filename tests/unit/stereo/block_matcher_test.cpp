#include "pipeline/stereo/block_matcher.hpp"

#include <gtest/gtest.h>

#include "tests/unit/stereo/identity_rig.hpp"

namespace stereotrack {
namespace {

constexpr int kWidth = 60;
constexpr int kHeight = 24;

// Census finds fractions of a pixel, which noise bends.
int whole_px(std::uint16_t disparity) { return (disparity + kDisparityScale / 2) / kDisparityScale; }

class BlockMatcherTest : public testing::TestWithParam<MatchMethod> {
 protected:
  [[nodiscard]] BlockMatcher make(int max, int region_disparities = 0) {
    const auto made =
        BlockMatcher::create({.method = GetParam(), .block = 5, .max = max, .region_disparities = region_disparities},
                             rig_.rectifier().geometry(), rig_.arena);
    EXPECT_TRUE(made.has_value());
    return *made;
  }

  test::IdentityRig rig_{kWidth, kHeight};
};

INSTANTIATE_TEST_SUITE_P(Methods, BlockMatcherTest, testing::Values(MatchMethod::kSad, MatchMethod::kCensus),
                         [](const auto& method) { return method.param == MatchMethod::kSad ? "Sad" : "Census"; });

TEST_P(BlockMatcherTest, WholePictureHasTheDisparityThatWasShown) {
  rig_.show(7);
  BlockMatcher matcher = make(15);
  ASSERT_TRUE(matcher.run(rig_.pair, rig_.map).has_value());
  // Away from the border, where blocks are whole and the partner is in the picture.
  for (int y = 5; y < kHeight - 5; ++y) {
    for (int x = 20; x < kWidth - 10; ++x) EXPECT_EQ(whole_px(rig_.map.at(x, y)), 7) << x << ' ' << y;
  }
}

// Only what the search needs is drawn, so a region that gives what the whole gives was drawn far enough.
TEST_P(BlockMatcherTest, RegionGivesWhatTheWholePictureGives) {
  rig_.show(7);
  BlockMatcher matcher = make(15);
  ASSERT_TRUE(matcher.run(rig_.pair, rig_.map).has_value());
  const ImageView<std::uint16_t> part = rig_.arena.image<std::uint16_t>(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) std::fill_n(part.row(y), kWidth, std::uint16_t{12345});
  rig_.pair.left.show(rig_.left);  // nothing is drawn any more
  rig_.pair.right.show(rig_.right);
  const Rect roi{25, 8, 12, 6};
  ASSERT_TRUE(matcher.run_region(rig_.pair, roi, {}, {0, 15}, part).has_value());
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool inside = x >= roi.left && x < roi.right() && y >= roi.top && y < roi.bottom();
      EXPECT_EQ(part.at(x, y), inside ? rig_.map.at(x, y) : 12345) << x << ' ' << y;
    }
  }
}

TEST_P(BlockMatcherTest, RegionMaySearchFartherThanTheWholePicture) {
  rig_.show(20);
  BlockMatcher matcher = make(15, 31);
  ASSERT_TRUE(matcher.run_region(rig_.pair, {35, 8, 10, 6}, {}, {10, 30}, rig_.map).has_value());
  EXPECT_EQ(whole_px(rig_.map.at(40, 11)), 20);
  const auto outcome = matcher.run_region(rig_.pair, {35, 8, 10, 6}, {}, {0, 31}, rig_.map);
  ASSERT_FALSE(outcome.has_value());
  EXPECT_EQ(outcome.error(), Fault::kBadConfig);
}

TEST_P(BlockMatcherTest, FaultsOfItsMatcherAreItsOwn) {
  const RectifiedGeometry& canvas = rig_.rectifier().geometry();
  EXPECT_EQ(BlockMatcher::create({.method = GetParam(), .block = 4, .max = 15}, canvas, rig_.arena).error(),
            Fault::kBadConfig);
  rig_.arena.seal();
  EXPECT_EQ(BlockMatcher::create({.method = GetParam(), .block = 5, .max = 15}, canvas, rig_.arena).error(),
            Fault::kOutOfMemory);
}

TEST(PartnersOf, ReachFromTheLargestToTheSmallestDisparity) {
  // u_right = u_left - d - offset: columns 100..109 with d = 3..20 and an offset of 5 lie in 75..101.
  const Rect partners = partners_of({100, 40, 10, 7}, {3, 20}, 5);
  EXPECT_EQ(partners.left, 75);
  EXPECT_EQ(partners.right(), 102);
  EXPECT_EQ(partners.top, 40);
  EXPECT_EQ(partners.height, 7);
}

}  // namespace
}  // namespace stereotrack
