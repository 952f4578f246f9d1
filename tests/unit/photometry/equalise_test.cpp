#include "pipeline/photometry/equalise.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

namespace stereotrack {
namespace {

ImageView<std::uint8_t> view(cv::Mat_<std::uint8_t>& mat) {
  return {mat.data, mat.cols, mat.rows, static_cast<std::ptrdiff_t>(mat.step1())};
}

cv::Mat_<std::uint8_t> random_grey(int width, int height, int low, int high, std::uint64_t seed) {
  cv::Mat_<std::uint8_t> grey(height, width);
  cv::RNG(seed).fill(grey, cv::RNG::UNIFORM, low, high + 1);
  return grey;
}

Histogram histogram_of(const cv::Mat_<std::uint8_t>& picture) {
  Histogram histogram{};
  for (const std::uint8_t pixel : picture) ++histogram[pixel];
  return histogram;
}

cv::Mat_<std::uint8_t> equalised(Equalise& stage, const cv::Mat_<std::uint8_t>& picture) {
  cv::Mat_<std::uint8_t> copy = picture.clone();
  stage.run(histogram_of(picture), view(copy));
  return copy;
}

bool equal(const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a != b) == 0; }

TEST(Equalise, TableByHand) {
  // n = 8: four of 10, two of 20, one of 30, one of 200. c = 4/8, 6/8, 7/8, 8/8; times 255:
  // 127.5, 191.25, 223.125, 255, rounded half up.
  cv::Mat_<std::uint8_t> picture = (cv::Mat_<std::uint8_t>(2, 4) << 10, 20, 10, 30, 10, 200, 20, 10);
  const Equalise::Table table = Equalise::table_of(histogram_of(picture));
  EXPECT_EQ(table[0], 0);
  EXPECT_EQ(table[9], 0);
  EXPECT_EQ(table[10], 128);
  EXPECT_EQ(table[19], 128);
  EXPECT_EQ(table[20], 191);
  EXPECT_EQ(table[30], 223);
  EXPECT_EQ(table[199], 223);
  EXPECT_EQ(table[200], 255);
  EXPECT_EQ(table[255], 255);
  Equalise stage({.mode = EqualiseMode::kFrame});
  const cv::Mat_<std::uint8_t> expected = (cv::Mat_<std::uint8_t>(2, 4) << 128, 191, 128, 223, 128, 255, 191, 128);
  EXPECT_TRUE(equal(equalised(stage, picture), expected));
}

TEST(Equalise, TableNeverDecreasesAndTheBrightestBecomesWhite) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    cv::Mat_<std::uint8_t> picture = random_grey(37, 23, static_cast<int>(seed), 100 + static_cast<int>(seed), seed);
    const Equalise::Table table = Equalise::table_of(histogram_of(picture));
    for (std::size_t i = 1; i < 256; ++i) ASSERT_LE(table[i - 1], table[i]) << seed;
    double brightest = 0;
    cv::minMaxLoc(picture, nullptr, &brightest);
    EXPECT_EQ(table[static_cast<std::size_t>(brightest)], 255);
  }
}

TEST(Equalise, TableIsTheCumulativeShareInDoublePrecision) {
  cv::Mat_<std::uint8_t> picture = random_grey(101, 67, 0, 255, 3);
  const Equalise::Table table = Equalise::table_of(histogram_of(picture));
  double c = 0;
  for (int i = 0; i < 256; ++i) {
    c += cv::countNonZero(picture == i) / (101.0 * 67.0);
    EXPECT_NEAR(table[static_cast<std::size_t>(i)], c * 255, 0.5 + 1e-9) << i;
  }
}

TEST(Equalise, OffChangesNothing) {
  const cv::Mat_<std::uint8_t> picture = random_grey(16, 9, 40, 90, 4);
  Equalise stage({.mode = EqualiseMode::kOff});
  EXPECT_TRUE(equal(equalised(stage, picture), picture));
}

TEST(Equalise, FrozenKeepsTheTableOfTheFirstPicture) {
  cv::Mat_<std::uint8_t> first = random_grey(40, 30, 40, 90, 5);
  const cv::Mat_<std::uint8_t> second = random_grey(40, 30, 80, 200, 6);
  const Equalise::Table table = Equalise::table_of(histogram_of(first));
  Equalise stage({.mode = EqualiseMode::kFrozen});
  (void)equalised(stage, first);
  const cv::Mat_<std::uint8_t> out = equalised(stage, second);
  for (int y = 0; y < out.rows; ++y) {
    for (int x = 0; x < out.cols; ++x) ASSERT_EQ(out(y, x), table[second(y, x)]);
  }
}

TEST(Equalise, FrameTakesEachPicturesOwnTable) {
  const cv::Mat_<std::uint8_t> first = random_grey(40, 30, 40, 90, 5);
  cv::Mat_<std::uint8_t> second = random_grey(40, 30, 80, 200, 6);
  const Equalise::Table table = Equalise::table_of(histogram_of(second));
  Equalise stage({.mode = EqualiseMode::kFrame});
  (void)equalised(stage, first);
  const cv::Mat_<std::uint8_t> out = equalised(stage, second);
  for (int y = 0; y < out.rows; ++y) {
    for (int x = 0; x < out.cols; ++x) ASSERT_EQ(out(y, x), table[second(y, x)]);
  }
}

TEST(Equalise, AsksForAHistogramOnlyWhereItsTableIsNew) {
  const cv::Mat_<std::uint8_t> picture = random_grey(8, 8, 0, 255, 7);
  Equalise off({.mode = EqualiseMode::kOff});
  Equalise frame({.mode = EqualiseMode::kFrame});
  Equalise frozen({.mode = EqualiseMode::kFrozen});
  for (const bool first : {true, false}) {
    EXPECT_FALSE(off.needs_histogram());
    EXPECT_TRUE(frame.needs_histogram());
    EXPECT_EQ(frozen.needs_histogram(), first);
    for (Equalise* stage : {&off, &frame, &frozen}) (void)equalised(*stage, picture);
  }
}

TEST(Equalise, EmptyPictureDoesNotFreezeATable) {
  Equalise stage({.mode = EqualiseMode::kFrozen});
  stage.run({}, {});
  cv::Mat_<std::uint8_t> one(1, 1, std::uint8_t{77});
  stage.run(histogram_of(one), view(one));
  EXPECT_EQ(one(0, 0), 255);
}

}  // namespace
}  // namespace stereotrack
