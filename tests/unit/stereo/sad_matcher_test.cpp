#include "pipeline/stereo/sad_matcher.hpp"

#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <tuple>

#include "stereo_pictures.hpp"

namespace stereotrack {
namespace {

using test::noise;
using test::shifted;
using test::view;
using test::writable;

/// Equation 3.6 word for word: every candidate, every pixel of its block that exists, exact means.
cv::Mat naive(const cv::Mat& left, const cv::Mat& right, int block, int offset, DisparityRange range) {
  const int radius = block / 2;
  cv::Mat out(left.size(), CV_16U, cv::Scalar(kNoDisparity));
  for (int y = 0; y < left.rows; ++y) {
    for (int x = 0; x < left.cols; ++x) {
      std::int64_t best_sum = 0;
      std::int64_t best_count = 0;
      for (int d = range.min; d <= range.max; ++d) {
        if (x - d - offset < 0 || x - d - offset >= right.cols) continue;
        std::int64_t sum = 0;
        std::int64_t count = 0;
        for (int v = y - radius; v <= y + radius; ++v) {
          for (int u = x - radius; u <= x + radius; ++u) {
            const int partner = u - d - offset;
            if (v < 0 || v >= left.rows || u < 0 || u >= left.cols || partner < 0 || partner >= right.cols) continue;
            sum += std::abs(left.at<std::uint8_t>(v, u) - right.at<std::uint8_t>(v, partner));
            ++count;
          }
        }
        if (best_count == 0 || sum * best_count < best_sum * count) {
          best_sum = sum;
          best_count = count;
          out.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(d * kDisparityScale);
        }
      }
    }
  }
  return out;
}

SadMatcher::Config config_for(const cv::Mat& left, const cv::Mat& right, int block, int offset, DisparityRange range) {
  SadMatcher::Config config;
  config.width = left.cols;
  config.height = left.rows;
  config.right_width = right.cols;
  config.block = block;
  config.offset = offset;
  config.range = range;
  return config;
}

cv::Mat matched(const cv::Mat& left, const cv::Mat& right, const SadMatcher::Config& config) {
  Arena arena;
  auto matcher = SadMatcher::create(config, arena);
  EXPECT_TRUE(matcher.has_value());
  arena.seal();
  cv::Mat out(left.size(), CV_16U, cv::Scalar(12345));
  const auto counts = matcher->run(view<std::uint8_t>(left), view<std::uint8_t>(right), writable<std::uint16_t>(out));
  EXPECT_TRUE(counts.has_value());
  EXPECT_EQ(counts->wanted, counts->matched + counts->border);
  EXPECT_EQ(counts->border, cv::countNonZero(out == kNoDisparity));
  EXPECT_FALSE(arena.failed());
  return out;
}

bool equal(const cv::Mat& a, const cv::Mat& b) { return a.size() == b.size() && cv::countNonZero(a != b) == 0; }

// width, height, right width, block, offset, min, max
class SadMatcherSizes : public testing::TestWithParam<std::tuple<int, int, int, int, int, int, int>> {};

TEST_P(SadMatcherSizes, EqualsTheNaiveReferenceOnEveryPixel) {
  const auto [width, height, right_width, block, offset, d_min, d_max] = GetParam();
  // Few greys, so that ties are common.
  for (const int greys : {2, 255}) {
    const cv::Mat left = noise(width, height, 1, 0, greys);
    const cv::Mat right = noise(right_width, height, 2, 0, greys);
    const DisparityRange range{d_min, d_max};
    EXPECT_TRUE(equal(matched(left, right, config_for(left, right, block, offset, range)),
                      naive(left, right, block, offset, range)))
        << "greys " << greys;
  }
}

INSTANTIATE_TEST_SUITE_P(All, SadMatcherSizes,
                         testing::Values(std::tuple{1, 1, 1, 3, 0, 0, 0}, std::tuple{1, 9, 1, 9, 0, 0, 5},
                                         std::tuple{9, 1, 9, 9, 0, 0, 5}, std::tuple{31, 17, 31, 9, 0, 0, 15},
                                         std::tuple{31, 17, 31, 9, 0, 3, 12}, std::tuple{40, 5, 40, 21, 0, 0, 39},
                                         std::tuple{33, 23, 33, 3, 0, 0, 63}, std::tuple{33, 12, 41, 5, -7, 0, 20},
                                         std::tuple{33, 12, 27, 5, 4, 1, 20}, std::tuple{20, 12, 20, 5, -30, 0, 60},
                                         std::tuple{64, 30, 64, 21, 0, 0, 31}, std::tuple{15, 40, 15, 21, 2, 0, 9}));

TEST(SadMatcher, SumOfTheLargestBlockDoesNotOverflow) {
  const cv::Mat left(43, 43, CV_8U, cv::Scalar(255));
  const cv::Mat right(43, 43, CV_8U, cv::Scalar(0));
  EXPECT_TRUE(equal(matched(left, right, config_for(left, right, 21, 0, {0, 7})), naive(left, right, 21, 0, {0, 7})));
}

TEST(SadMatcher, ShiftedPictureGivesTheShiftExactly) {
  const cv::Mat left = noise(80, 40, 3);
  const cv::Mat out = matched(left, shifted(left, 13, 4), config_for(left, left, 9, 0, {0, 31}));
  EXPECT_EQ(cv::countNonZero(out.colRange(13 + 4, 80) != 13 * kDisparityScale), 0);
}

TEST(SadMatcher, BorderColumnsAreFilled) {
  const cv::Mat left = noise(60, 20, 3);
  const cv::Mat out = matched(left, shifted(left, 5, 4), config_for(left, left, 9, 0, {0, 63}));
  EXPECT_EQ(cv::countNonZero(out == kNoDisparity), 0);
  EXPECT_EQ(cv::countNonZero(out.colRange(56, 60) != 5 * kDisparityScale), 0);
}

TEST(SadMatcher, NoPartnerInTheRightPictureIsCountedAsBorder) {
  const cv::Mat left = noise(60, 20, 3);
  const cv::Mat out = matched(left, left, config_for(left, left, 5, 0, {10, 20}));
  EXPECT_EQ(cv::countNonZero(out == kNoDisparity), 10 * 20);
  EXPECT_EQ(cv::countNonZero(out.colRange(0, 10) != kNoDisparity), 0);
}

TEST(SadMatcher, AgreesWithOpenCvOnMostInnerPixels) {
  const cv::Mat left = test::waves_picture(160, 60, 0);
  cv::Mat right = test::waves_picture(160, 60, 9);
  right.colRange(0, 80) = test::waves_picture(160, 60, 14).colRange(0, 80) + 0;
  const cv::Mat ours = matched(left, right, config_for(left, right, 9, 0, {0, 31}));
  auto block_matcher = cv::StereoBM::create(32, 9);
  block_matcher->setPreFilterCap(63);
  block_matcher->setTextureThreshold(0);
  block_matcher->setUniquenessRatio(0);
  cv::Mat theirs;
  block_matcher->compute(left, right, theirs);
  int both = 0;
  int same = 0;
  for (int y = 8; y < 52; ++y) {
    for (int x = 48; x < 150; ++x) {
      if (theirs.at<std::int16_t>(y, x) < 0) continue;
      ++both;
      same += std::abs(theirs.at<std::int16_t>(y, x) - ours.at<std::uint16_t>(y, x)) <= kDisparityScale ? 1 : 0;
    }
  }
  EXPECT_GT(both, 3000);
  EXPECT_GT(same, both * 90 / 100);
}

TEST(SadMatcher, RegionGivesWhatTheWholePictureGives) {
  const cv::Mat left = noise(70, 50, 5);
  const cv::Mat right = shifted(left, 9, 6);
  SadMatcher::Config config = config_for(left, right, 9, 0, {0, 15});
  config.region_disparities = 60;
  const cv::Mat mask = noise(70, 50, 7) > 200;
  Arena arena;
  auto matcher = SadMatcher::create(config, arena);
  ASSERT_TRUE(matcher.has_value());
  arena.seal();
  for (const Rect roi : {Rect{0, 0, 70, 50}, Rect{20, 10, 13, 7}, Rect{60, 40, 30, 30}, Rect{-5, -5, 12, 12}}) {
    for (const DisparityRange range : {DisparityRange{0, 15}, DisparityRange{5, 60}}) {
      const cv::Mat whole = naive(left, right, 9, 0, range);
      cv::Mat out(left.size(), CV_16U, cv::Scalar(12345));
      const auto counts = matcher->run_region(view<std::uint8_t>(left), view<std::uint8_t>(right), roi,
                                              view<std::uint8_t>(mask), range, writable<std::uint16_t>(out));
      ASSERT_TRUE(counts.has_value());
      std::int64_t wanted = 0;
      for (int y = 0; y < 50; ++y) {
        for (int x = 0; x < 70; ++x) {
          const bool inside = x >= roi.left && x < roi.right() && y >= roi.top && y < roi.bottom();
          const bool asked = inside && mask.at<std::uint8_t>(y, x) != 0;
          wanted += asked ? 1 : 0;
          ASSERT_EQ(out.at<std::uint16_t>(y, x), asked ? whole.at<std::uint16_t>(y, x) : 12345) << x << ' ' << y;
        }
      }
      EXPECT_EQ(counts->wanted, wanted);
    }
  }
}

TEST(SadMatcher, RegionOutsideThePictureIsEmptyNotAFault) {
  const cv::Mat left = noise(20, 20, 5);
  Arena arena;
  auto matcher = SadMatcher::create(config_for(left, left, 9, 0, {0, 15}), arena);
  ASSERT_TRUE(matcher.has_value());
  cv::Mat out(left.size(), CV_16U, cv::Scalar(7));
  const auto counts = matcher->run_region(view<std::uint8_t>(left), view<std::uint8_t>(left), {30, 30, 5, 5}, {},
                                          {0, 15}, writable<std::uint16_t>(out));
  ASSERT_TRUE(counts.has_value());
  EXPECT_EQ(counts->wanted, 0);
  EXPECT_EQ(cv::countNonZero(out != 7), 0);
}

TEST(SadMatcher, BadConfigurationIsRefused) {
  SadMatcher::Config good;
  good.width = 32;
  good.height = 16;
  Arena arena;
  EXPECT_TRUE(SadMatcher::create(good, arena).has_value());
  const auto refused = [&](auto change) {
    SadMatcher::Config bad = good;
    change(bad);
    const auto result = SadMatcher::create(bad, arena);
    return !result.has_value() && result.error() == Fault::kBadConfig;
  };
  EXPECT_TRUE(refused([](auto& c) { c.width = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.height = 8193; }));
  EXPECT_TRUE(refused([](auto& c) { c.block = 8; }));
  EXPECT_TRUE(refused([](auto& c) { c.block = 1; }));
  EXPECT_TRUE(refused([](auto& c) { c.block = 23; }));
  EXPECT_TRUE(refused([](auto& c) { c.range = {5, 4}; }));
  EXPECT_TRUE(refused([](auto& c) { c.range = {-1, 4}; }));
  EXPECT_TRUE(refused([](auto& c) { c.range = {0, 4001}; }));
  EXPECT_TRUE(refused([](auto& c) { c.region_disparities = -1; }));
}

TEST(SadMatcher, SealedArenaIsOutOfMemory) {
  SadMatcher::Config config;
  config.width = 32;
  config.height = 16;
  Arena arena;
  arena.seal();
  const auto result = SadMatcher::create(config, arena);
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error(), Fault::kOutOfMemory);
}

TEST(SadMatcher, FaultAtRunLeavesTheOutputUntouched) {
  const cv::Mat left = noise(32, 16, 1);
  const cv::Mat other = noise(31, 16, 1);
  Arena arena;
  auto matcher = SadMatcher::create(config_for(left, left, 9, 0, {0, 15}), arena);
  ASSERT_TRUE(matcher.has_value());
  cv::Mat out(left.size(), CV_16U, cv::Scalar(7));
  const auto l = view<std::uint8_t>(left);
  const auto o = view<std::uint8_t>(other);
  const auto to = writable<std::uint16_t>(out);
  EXPECT_EQ(matcher->run(o, l, to).error(), Fault::kBadSize);
  EXPECT_EQ(matcher->run(l, o, to).error(), Fault::kBadSize);
  EXPECT_EQ(matcher->run_region(l, l, {0, 0, 9, 9}, o, {0, 15}, to).error(), Fault::kBadSize);
  EXPECT_EQ(matcher->run_region(l, l, {0, 0, 9, 9}, {}, {0, 16}, to).error(), Fault::kBadConfig);
  EXPECT_EQ(matcher->run_region(l, l, {0, 0, 9, 9}, {}, {4, 3}, to).error(), Fault::kBadConfig);
  EXPECT_EQ(cv::countNonZero(out != 7), 0);
}

}  // namespace
}  // namespace stereotrack
