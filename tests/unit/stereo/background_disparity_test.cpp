#include "pipeline/stereo/background_disparity.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "tests/unit/stereo/identity_rig.hpp"

namespace stereotrack {
namespace {

constexpr int kWidth = 96;
constexpr int kHeight = 40;
constexpr int kFrames = 5;  // 8 rows a frame at first, then 1
constexpr DisparityRange kRange{0, 15};
constexpr int kColumn = 50;  // its block and all of its partners are in the pictures

class BackgroundDisparityTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto matcher = BlockMatcher::create({.method = MatchMethod::kSad, .block = 5, .max = kRange.max},
                                              rig_.rectifier().geometry(), rig_.arena);
    ASSERT_TRUE(matcher.has_value());
    matcher_.emplace(*matcher);
    const auto made = BackgroundDisparity::create({.frames = kFrames}, rig_.rectifier().mask(View::kLeft), rig_.arena);
    ASSERT_TRUE(made.has_value());
    background_.emplace(*made);
  }

  void renew(int times = 1) {
    for (int i = 0; i < times; ++i) background_->renew(rig_.pair, *matcher_, kRange);
  }
  [[nodiscard]] int at(int y) const { return background_->map().at(kColumn, y); }

  test::IdentityRig rig_{kWidth, kHeight};
  std::optional<BlockMatcher> matcher_;
  std::optional<BackgroundDisparity> background_;
};

TEST_F(BackgroundDisparityTest, NothingIsKnownAtFirst) {
  const ImageView<const std::uint16_t> map = background_->map();
  ASSERT_EQ(map.width, kWidth);
  ASSERT_EQ(map.height, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    EXPECT_EQ(std::count(map.row(y), map.row(y) + kWidth, kNoDisparity), kWidth);
  }
}

TEST_F(BackgroundDisparityTest, FirstPassTakesAsManyFramesAsTheBackground) {
  rig_.show(6);
  for (int frame = 1; frame <= kFrames; ++frame) {
    renew();
    for (int y = 2; y < kHeight - 2; ++y) {
      EXPECT_EQ(at(y), y < 8 * frame ? 6 * kDisparityScale : kNoDisparity) << frame << ' ' << y;
    }
  }
}

TEST_F(BackgroundDisparityTest, LaterPassesAreTenTimesSlower) {
  rig_.show(6);
  renew(kFrames);
  rig_.show(9);
  renew(10);
  for (int y = 2; y < kHeight - 2; ++y) EXPECT_EQ(at(y), (y < 10 ? 9 : 6) * kDisparityScale) << y;
  renew(40);  // round the end and on from the top
  for (int y = 2; y < kHeight - 2; ++y) EXPECT_EQ(at(y), 9 * kDisparityScale) << y;
}

TEST_F(BackgroundDisparityTest, RestartForgetsAndIsFastAgain) {
  rig_.show(6);
  renew(kFrames + 3);
  background_->restart();
  EXPECT_EQ(at(4), kNoDisparity);
  rig_.show(9);
  renew();
  EXPECT_EQ(at(4), 9 * kDisparityScale);
  EXPECT_EQ(at(12), kNoDisparity);
}

// Columns that the rig does not show have no disparity of their own.
TEST_F(BackgroundDisparityTest, APlaceIsForgottenUntilItsStripIsRenewed) {
  rig_.show(6);
  renew(kFrames);
  for (const auto& [x, y] : {std::pair(-1, 3), std::pair(kWidth, 3), std::pair(3, -1), std::pair(3, kHeight)}) {
    background_->forget(x, y);
  }
  for (int y = 10; y < 40; ++y) background_->forget(kColumn, y);
  EXPECT_EQ(at(9), 6 * kDisparityScale);
  EXPECT_EQ(at(10), kNoDisparity);
  EXPECT_EQ(background_->map().at(kColumn - 1, 10), 6 * kDisparityScale);
  renew(12);  // rows up to 11
  EXPECT_EQ(at(11), 6 * kDisparityScale);
  EXPECT_EQ(at(20), kNoDisparity);
}

TEST_F(BackgroundDisparityTest, NarrowGapsBetweenEndsThatAgreeAreBridged) {
  const ImageView<std::uint8_t> shown = rig_.arena.image<std::uint8_t>(kWidth, kHeight);
  const auto map_with_gap = [&](int from, int to) {
    for (int y = 0; y < kHeight; ++y) {
      std::fill_n(shown.row(y), kWidth, std::uint8_t{255});
      std::fill(shown.row(y) + from, shown.row(y) + to, std::uint8_t{0});
    }
    auto background = BackgroundDisparity::create({.frames = 1}, shown, rig_.arena);
    EXPECT_TRUE(background.has_value());
    background->renew(rig_.pair, *matcher_, kRange);
    return background->map();
  };
  rig_.show(6);
  EXPECT_EQ(map_with_gap(24, 87).at(kColumn, 20), 6 * kDisparityScale);  // 64 columns from end to end
  EXPECT_EQ(map_with_gap(23, 87).at(kColumn, 20), kNoDisparity);         // 65
}

TEST_F(BackgroundDisparityTest, GapsBetweenEndsThatDifferStayOpen) {
  // Left of column 45 disparity 4, from there on 12: the picture's two halves are drawn one after the other.
  rig_.show(4, 7);
  const ImageView<std::uint8_t> shown = rig_.arena.image<std::uint8_t>(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 45; x + 12 < kWidth; ++x) rig_.right.at(x, y) = rig_.left.at(x + 12, y);
    std::fill_n(shown.row(y), kWidth, std::uint8_t{255});
    std::fill(shown.row(y) + 40, shown.row(y) + 65, std::uint8_t{0});
  }
  rig_.pair.right.show(rig_.right);
  auto background = BackgroundDisparity::create({.frames = 1}, shown, rig_.arena);
  ASSERT_TRUE(background.has_value());
  background->renew(rig_.pair, *matcher_, kRange);
  const ImageView<const std::uint16_t> map = background->map();
  EXPECT_EQ(map.at(30, 20), 4 * kDisparityScale);
  EXPECT_EQ(map.at(70, 20), 12 * kDisparityScale);
  EXPECT_EQ(map.at(52, 20), kNoDisparity);
}

TEST_F(BackgroundDisparityTest, Faults) {
  const ImageView<const std::uint8_t> shown = rig_.rectifier().mask(View::kLeft);
  EXPECT_EQ(BackgroundDisparity::create({.frames = 0}, shown, rig_.arena).error(), Fault::kBadConfig);
  EXPECT_EQ(BackgroundDisparity::create({.frames = 10001}, shown, rig_.arena).error(), Fault::kBadConfig);
  EXPECT_EQ(BackgroundDisparity::create({}, {}, rig_.arena).error(), Fault::kBadSize);
  rig_.arena.seal();
  EXPECT_EQ(BackgroundDisparity::create({}, shown, rig_.arena).error(), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
