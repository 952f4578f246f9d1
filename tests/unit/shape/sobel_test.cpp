#include "pipeline/shape/sobel.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/shape/threshold.hpp"
#include "tests/unit/shape/pictures.hpp"

namespace stereotrack {
namespace {

using test::const_view;
using test::random_grey;
using test::view;

int floor_sqrt(int value) {
  int root = 0;
  while ((root + 1) * (root + 1) <= value) ++root;
  return root;
}

cv::Mat_<std::uint8_t> reference(const cv::Mat_<std::uint8_t>& grey) {
  cv::Mat_<std::int16_t> gx;
  cv::Mat_<std::int16_t> gy;
  cv::Sobel(grey, gx, CV_16S, 1, 0, 3, 1, 0, cv::BORDER_REPLICATE);
  cv::Sobel(grey, gy, CV_16S, 0, 1, 3, 1, 0, cv::BORDER_REPLICATE);
  cv::Mat_<std::uint8_t> magnitude(grey.size());
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) {
      magnitude(y, x) = static_cast<std::uint8_t>(std::min(floor_sqrt(gx(y, x) * gx(y, x) + gy(y, x) * gy(y, x)), 255));
    }
  }
  return magnitude;
}

cv::Mat_<std::uint8_t> magnitude_of(cv::Mat_<std::uint8_t>& grey) {
  Arena arena;
  auto sobel = Sobel::create({}, grey.cols, grey.rows, arena);
  EXPECT_TRUE(sobel.has_value());
  cv::Mat_<std::uint8_t> out(grey.size(), std::uint8_t{77});
  EXPECT_TRUE(sobel->run(const_view(grey), view(out)).has_value());
  return out;
}

// Equations 3.9 and 3.10 by hand: gx = (3 + 2*5 + 9) - (1 + 2*4 + 7) = 6, gy = (7 + 2*8 + 9) - (1 + 2*2 + 3) = 24,
// sqrt(36 + 576) = 24.7.
TEST(Sobel, CentreOfThreeByThreeByHand) {
  cv::Mat_<std::uint8_t> grey = (cv::Mat_<std::uint8_t>(3, 3) << 1, 2, 3, 4, 5, 5, 7, 8, 9);
  EXPECT_EQ(magnitude_of(grey)(1, 1), 24);
}

TEST(Sobel, RootOfSquareIsExactAndJustUnderItRoundsDown) {
  // A step of height h between columns: gx = 4 h, gy = 0.
  for (int h = 0; h <= 63; ++h) {
    cv::Mat_<std::uint8_t> grey(3, 4, std::uint8_t{0});
    grey.colRange(2, 4).setTo(h);
    EXPECT_EQ(magnitude_of(grey)(1, 1), 4 * h);
  }
}

TEST(Sobel, StrongestEdgeSaturates) {
  cv::Mat_<std::uint8_t> grey(3, 4, std::uint8_t{0});
  grey.colRange(2, 4).setTo(255);
  EXPECT_EQ(magnitude_of(grey)(1, 1), 255);
}

TEST(Sobel, EqualsOpenCvAtManySizes) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 7), cv::Size(7, 1), cv::Size(2, 2), cv::Size(15, 9),
                              cv::Size(16, 9), cv::Size(17, 9), cv::Size(161, 93)}) {
    cv::Mat_<std::uint8_t> strong = random_grey(size.width, size.height, 3);
    cv::Mat_<std::uint8_t> weak(strong / 12);  // magnitudes below saturation
    EXPECT_EQ(test::differing(magnitude_of(strong), reference(strong)), 0) << size;
    EXPECT_EQ(test::differing(magnitude_of(weak), reference(weak)), 0) << size;
  }
}

TEST(Sobel, OtherSizeIsAFaultAndLeavesTheOutput) {
  Arena arena;
  auto sobel = Sobel::create({}, 8, 6, arena);
  ASSERT_TRUE(sobel.has_value());
  cv::Mat_<std::uint8_t> in(6, 8, std::uint8_t{1});
  cv::Mat_<std::uint8_t> wrong(6, 7, std::uint8_t{9});
  const auto result = sobel->run(const_view(in), view(wrong));
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error(), Fault::kBadSize);
  EXPECT_EQ(cv::countNonZero(wrong != 9), 0);
  EXPECT_EQ(sobel->run(const_view(wrong), view(wrong)).error(), Fault::kBadSize);
}

TEST(Sobel, EmptyPictureIsRefused) {
  Arena arena;
  EXPECT_EQ(Sobel::create({}, 0, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(Sobel::create({}, 6, 0, arena).error(), Fault::kBadConfig);
}

TEST(Sobel, NeedsNoMemory) {
  Arena arena;
  arena.seal();
  EXPECT_TRUE(Sobel::create({}, 6, 6, arena).has_value());
  EXPECT_FALSE(arena.failed());
}

TEST(Threshold, EqualToThresholdIsAnEdge) {
  cv::Mat_<std::uint8_t> grey = (cv::Mat_<std::uint8_t>(1, 4) << 0, 39, 40, 255);
  cv::Mat_<std::uint8_t> out(1, 4, std::uint8_t{7});
  ASSERT_TRUE(threshold(const_view(grey), 40, view(out)).has_value());
  EXPECT_EQ(out(0, 0), 0);
  EXPECT_EQ(out(0, 1), 0);
  EXPECT_EQ(out(0, 2), 255);
  EXPECT_EQ(out(0, 3), 255);
}

TEST(Threshold, ExtremesKeepAllAndNothing) {
  cv::Mat_<std::uint8_t> grey = random_grey(33, 5, 1);
  cv::Mat_<std::uint8_t> out(grey.size());
  ASSERT_TRUE(threshold(const_view(grey), 0, view(out)).has_value());
  EXPECT_EQ(cv::countNonZero(out), 33 * 5);
  ASSERT_TRUE(threshold(const_view(grey), 256, view(out)).has_value());
  EXPECT_EQ(cv::countNonZero(out), 0);
}

TEST(Threshold, EqualsOpenCvInPlace) {
  cv::Mat_<std::uint8_t> grey = random_grey(61, 47, 5);
  cv::Mat_<std::uint8_t> expected;
  cv::threshold(grey, expected, 99, 255, cv::THRESH_BINARY);  // OpenCV's ">" 99 is ">=" 100
  ASSERT_TRUE(threshold(const_view(grey), 100, view(grey)).has_value());
  EXPECT_EQ(test::differing(grey, expected), 0);
}

TEST(Threshold, OtherSizeIsAFaultAndLeavesTheOutput) {
  cv::Mat_<std::uint8_t> grey(4, 4, std::uint8_t{200});
  cv::Mat_<std::uint8_t> out(4, 5, std::uint8_t{7});
  EXPECT_EQ(threshold(const_view(grey), 100, view(out)).error(), Fault::kBadSize);
  EXPECT_EQ(cv::countNonZero(out != 7), 0);
}

}  // namespace
}  // namespace stereotrack
