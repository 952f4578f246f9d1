#include "pipeline/motion/mean_background.hpp"

#include <gtest/gtest.h>

#include <array>

#include "pictures.hpp"
#include "pipeline/motion/difference.hpp"

namespace stereotrack {
namespace {

using test::Plane;
using test::view;

std::array<int, 2> learnt(MeanBackground& background, int first, int second) {
  Plane picture = (Plane(1, 2) << first, second);
  background.learn(view(picture));
  return {background.mean().at(0, 0), background.mean().at(1, 0)};
}

TEST(MeanBackground, MeanOfKPicturesByHand) {
  Arena arena;
  auto background = MeanBackground::create(4, 2, 1, arena);
  ASSERT_TRUE(background.has_value());
  EXPECT_EQ(background->seen(), 0);
  EXPECT_EQ(background->mean().at(0, 0), 0);
  using Pair = std::array<int, 2>;
  EXPECT_EQ(learnt(*background, 10, 255), (Pair{10, 255}));
  EXPECT_EQ(learnt(*background, 11, 255), (Pair{11, 255}));  // 10.5 is rounded up
  EXPECT_EQ(learnt(*background, 10, 255), (Pair{10, 255}));  // 10.33
  EXPECT_FALSE(background->complete());
  EXPECT_EQ(learnt(*background, 20, 0), (Pair{13, 191}));  // 51 / 4 = 12.75, 765 / 4 = 191.25
  EXPECT_TRUE(background->complete());
}

TEST(MeanBackground, IsFrozenAfterK) {
  Arena arena;
  auto background = MeanBackground::create(2, 2, 1, arena);
  ASSERT_TRUE(background.has_value());
  (void)learnt(*background, 100, 50);
  const std::array<int, 2> complete = learnt(*background, 110, 52);
  EXPECT_EQ(complete, (std::array<int, 2>{105, 51}));
  for (int i = 0; i < 50; ++i) EXPECT_EQ(learnt(*background, 250, 250), complete);
  EXPECT_EQ(background->seen(), 2);
}

TEST(MeanBackground, EveryNumberOfPicturesIsDividedExactly) {
  constexpr int kColumns = 64;
  Arena arena;
  auto background = MeanBackground::create(65535, kColumns, 1, arena);
  ASSERT_TRUE(background.has_value());
  std::array<int, kColumns> sum{};
  Plane picture(1, kColumns);
  int wrong = 0;
  for (int n = 1; n <= 65535; ++n) {
    // A column that is all white, one that is black but for a pixel now and then, and everything between.
    for (int x = 0; x < kColumns; ++x) {
      picture(0, x) = static_cast<std::uint8_t>(x == 0 ? 255 : (n * (x + 3) + x * x * 37) % (4 * x + 1));
      sum[static_cast<std::size_t>(x)] += picture(0, x);
    }
    background->learn(view(picture));
    for (int x = 0; x < kColumns; ++x) {
      wrong += background->mean().at(x, 0) != (sum[static_cast<std::size_t>(x)] + n / 2) / n ? 1 : 0;
    }
  }
  EXPECT_EQ(wrong, 0);
}

TEST(MeanBackground, RandomPicturesAgreeWithTheMeanInDoublePrecision) {
  Arena arena;
  const cv::Size size(33, 7);
  auto background = MeanBackground::create(37, size.width, size.height, arena);
  ASSERT_TRUE(background.has_value());
  cv::Mat_<double> sum(size, 0.0);
  for (int k = 1; k <= 37; ++k) {
    Plane picture = test::random_plane(size, 0, 255, static_cast<std::uint64_t>(k));
    background->learn(view(picture));
    cv::Mat_<double> wide;
    picture.convertTo(wide, CV_64F);
    sum += wide;
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        ASSERT_EQ(background->mean().at(x, y), std::floor(sum(y, x) / k + 0.5)) << k;
      }
    }
  }
}

TEST(MeanBackground, BrightestSumDoesNotOverflow) {
  Arena arena;
  auto background = MeanBackground::create(65535, 1, 1, arena);
  ASSERT_TRUE(background.has_value());
  Plane white(1, 1, std::uint8_t{255});
  for (int i = 0; i < 65535; ++i) background->learn(view(white));
  EXPECT_TRUE(background->complete());
  EXPECT_EQ(background->mean().at(0, 0), 255);
}

TEST(MeanBackground, Faults) {
  Arena arena;
  EXPECT_EQ(MeanBackground::create(0, 4, 4, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(MeanBackground::create(65536, 4, 4, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(MeanBackground::create(1, 0, 4, arena).error(), Fault::kBadSize);
  EXPECT_EQ(MeanBackground::create(1, 4, -1, arena).error(), Fault::kBadSize);
  arena.seal();
  EXPECT_EQ(MeanBackground::create(1, 4, 4, arena).error(), Fault::kOutOfMemory);
}

TEST(Difference, IsTheDistanceForAllPairsOfValues) {
  Plane background(256, 256);
  Plane picture(256, 256);
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 256; ++x) {
      background(y, x) = static_cast<std::uint8_t>(y);
      picture(y, x) = static_cast<std::uint8_t>(x);
    }
  }
  Plane out(256, 256, std::uint8_t{0});
  difference(view(background), view(picture), view(out));
  EXPECT_EQ(out(10, 30), 20);
  EXPECT_EQ(out(30, 10), 20);
  cv::Mat expected;
  cv::absdiff(background, picture, expected);
  EXPECT_EQ(cv::countNonZero(out != expected), 0);
}

TEST(Difference, EmptyPictureIsNoWork) { difference({}, {}, {}); }

}  // namespace
}  // namespace stereotrack
