#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <random>
#include <string>
#include <vector>

#include "pipeline/core/simd.hpp"
#include "pipeline/stereo/census_matcher.hpp"
#include "pipeline/stereo/median_kernel.hpp"
#include "pipeline/stereo/row_bits_kernel.hpp"
#include "pipeline/stereo/sad_matcher.hpp"
#include "stereo_pictures.hpp"

namespace stereotrack {
namespace {

using test::noise;
using test::view;
using test::writable;

/// Every instruction set but the plain reference, which the others are compared with.
class StereoSimd : public testing::TestWithParam<SimdTarget> {
 protected:
  void TearDown() override { EXPECT_TRUE(use_simd(simd_targets().back())); }
};

INSTANTIATE_TEST_SUITE_P(Targets, StereoSimd,
                         testing::ValuesIn(std::vector<SimdTarget>(simd_targets().begin() + 1, simd_targets().end())),
                         [](const auto& target) { return std::string(to_string(target.param)); });
// A machine may have none of them.
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(StereoSimd);

struct Case {
  int width = 1;
  int height = 1;
  int right_width = 1;
  int block = 3;
  int offset = 0;
  DisparityRange range;
  bool masked = false;
  Rect roi;
  int greys = 255;
};

std::ostream& operator<<(std::ostream& out, const Case& c) {
  return out << c.width << 'x' << c.height << ", right " << c.right_width << ", block " << c.block << ", offset "
             << c.offset << ", range " << c.range.min << ".." << c.range.max << ", masked " << c.masked << ", roi "
             << c.roi.left << ' ' << c.roi.top << ' ' << c.roi.width << ' ' << c.roi.height << ", greys " << c.greys;
}

/// Around every vector's width (8, 16, 32 lanes), and what chance adds.
std::vector<Case> cases() {
  std::mt19937 random(7);
  const auto pick = [&](auto... values) {
    const int all[] = {values...};
    return all[random() % std::size(all)];
  };
  std::vector<Case> result;
  for (const int width : {1, 2, 7, 8, 9, 15, 16, 17, 31, 32, 33, 63, 64, 65, 97, 131}) {
    for (int repeat = 0; repeat < 12; ++repeat) {
      Case c;
      c.width = width;
      c.height = pick(1, 2, 5, 9, 10, 22, 30);
      c.right_width = repeat % 3 == 0 ? std::max(1, width + pick(-9, -1, 1, 12)) : width;
      c.block = pick(3, 5, 9, 9, 11, 15, 17, 21);
      c.offset = pick(0, 0, 0, -7, 5, -40);
      c.range.min = pick(0, 0, 0, 1, 3, 10);
      c.range.max = c.range.min + pick(1, 2, 7, 8, 9, 15, 16, 31, 32, 33, 63, 64, 64, 65, 96, 130) - 1;
      c.masked = repeat % 2 == 1;
      c.roi = {0, 0, c.width, c.height};
      if (repeat % 4 >= 2) c.roi = {width / 3 - 1, c.height / 4, width / 2 + 2, c.height / 2 + 1};
      c.greys = pick(1, 255, 255);
      result.push_back(c);
    }
  }
  // As the pipeline asks: whole windows far from the borders.
  result.push_back({200, 40, 200, 9, 0, {0, 63}, false, {0, 0, 200, 40}, 255});
  result.push_back({300, 30, 300, 9, 0, {0, 127}, false, {0, 0, 300, 30}, 255});
  result.push_back({200, 40, 200, 9, 0, {8, 27}, true, {90, 10, 37, 20}, 255});
  return result;
}

/// Rows of odd length that start at odd addresses.
cv::Mat odd(const cv::Mat& picture) {
  cv::Mat wide(picture.rows, picture.cols + 5 - picture.cols % 2, picture.type(), cv::Scalar(77));
  cv::Mat part = wide.colRange(1, 1 + picture.cols);
  picture.copyTo(part);
  return part;
}

cv::Mat blobs(int width, int height) {
  cv::Mat mask(height, width, CV_8U, cv::Scalar(0));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      mask.at<std::uint8_t>(y, x) = (x / 11 + y / 4) % 3 == 0 && (x * y) % 7 != 3 ? 255 : 0;
  }
  return mask;
}

struct Output {
  cv::Mat disparity;
  std::vector<std::int64_t> counts;
};

template <class Matcher>
Output matched(const Case& c, SimdTarget target, typename Matcher::Config config) {
  EXPECT_TRUE(use_simd(target));
  const cv::Mat left = odd(noise(c.width, c.height, 1, 0, c.greys));
  cv::Mat right = noise(c.right_width, c.height, 2, 0, c.greys);
  // Half of it true matches, so that gates and sub-pixel have something to pass.
  const cv::Mat shifted = test::shifted(left, c.range.min + c.range.count() / 2 + c.offset, 3);
  for (int x = 0; x < std::min(c.width, c.right_width) / 2; ++x) shifted.col(x).copyTo(right.col(x));
  right = odd(right);
  const cv::Mat mask = c.masked ? odd(blobs(c.width, c.height)) : cv::Mat();
  config.width = c.width;
  config.height = c.height;
  config.right_width = c.right_width;
  config.block = c.block;
  config.offset = c.offset;
  config.range = c.range;
  Arena arena;
  auto matcher = Matcher::create(config, arena);
  EXPECT_TRUE(matcher.has_value());
  arena.seal();
  Output out{odd(cv::Mat(c.height, c.width, CV_16U, cv::Scalar(4321))), {}};
  // Twice, and the second time counts: nothing may be left over from another region.
  cv::Mat other(c.height, c.width, CV_16U, cv::Scalar(0));
  (void)matcher->run(view<std::uint8_t>(right.cols == left.cols ? right : left), view<std::uint8_t>(right),
                     writable<std::uint16_t>(other));
  const auto counts = matcher->run_region(view<std::uint8_t>(left), view<std::uint8_t>(right), c.roi,
                                          view<std::uint8_t>(mask), c.range, writable<std::uint16_t>(out.disparity));
  EXPECT_TRUE(counts.has_value());
  EXPECT_FALSE(arena.failed());
  if (counts.has_value()) {
    out.counts = {counts->wanted,     counts->matched,    counts->border,  counts->texture,
                  counts->uniqueness, counts->left_right, counts->speckle, counts->filled};
  }
  return out;
}

bool equal(const cv::Mat& a, const cv::Mat& b) { return a.size() == b.size() && cv::countNonZero(a != b) == 0; }

template <class Matcher>
std::int64_t expect_equal_to_reference(SimdTarget target, const typename Matcher::Config& config) {
  std::int64_t pixels = 0;
  for (const Case& c : cases()) {
    const Output plain = matched<Matcher>(c, SimdTarget::kScalar, config);
    const Output lanes = matched<Matcher>(c, target, config);
    EXPECT_TRUE(equal(plain.disparity, lanes.disparity)) << c;
    EXPECT_EQ(plain.counts, lanes.counts) << c;
    pixels += plain.counts[1];
  }
  return pixels;
}

TEST_P(StereoSimd, SadEqualsTheReferenceBitForBit) {
  EXPECT_GT(expect_equal_to_reference<SadMatcher>(GetParam(), {}), 50'000);
}

TEST_P(StereoSimd, CensusEqualsTheReferenceBitForBit) {
  EXPECT_GT(expect_equal_to_reference<CensusMatcher>(GetParam(), {}), 20'000);
}

TEST_P(StereoSimd, CensusWithoutGatesAndFiltersEqualsTheReferenceBitForBit) {
  CensusMatcher::Config config;
  config.texture = 0;
  config.uniqueness = 0;
  config.left_right_px = -1;
  config.filter = {.median = false, .speckle_size = 0, .speckle_step = 0, .fill_px = 0};
  EXPECT_GT(expect_equal_to_reference<CensusMatcher>(GetParam(), config), 50'000);
}

TEST_P(StereoSimd, CensusWithHardGatesEqualsTheReferenceBitForBit) {
  CensusMatcher::Config config;
  config.texture = 1000;
  config.uniqueness = 30;
  config.left_right_px = 0;
  EXPECT_GT(expect_equal_to_reference<CensusMatcher>(GetParam(), config), 1'000);
}

TEST_P(StereoSimd, MedianEqualsTheReferenceBitForBit) {
  ASSERT_TRUE(use_simd(GetParam()));
  for (const int width : {1, 2, 3, 8, 9, 10, 16, 17, 18, 31, 32, 33, 34, 35, 65, 100}) {
    for (const int height : {1, 2, 3, 8}) {
      for (const int holes : {0, 30, 150, 256}) {
        cv::Mat in(height, width, CV_16U);
        const cv::Mat values = noise(width, height, 5);
        const cv::Mat missing = noise(width, height, 6);
        for (int y = 0; y < height; ++y) {
          for (int x = 0; x < width; ++x) {
            in.at<std::uint16_t>(y, x) = missing.at<std::uint8_t>(y, x) < holes
                                             ? kNoDisparity
                                             : static_cast<std::uint16_t>(values.at<std::uint8_t>(y, x) * 250);
          }
        }
        in = odd(in);
        cv::Mat plain = odd(cv::Mat(height, width, CV_16U, cv::Scalar(1)));
        cv::Mat lanes = odd(cv::Mat(height, width, CV_16U, cv::Scalar(2)));
        const std::vector<std::uint16_t> none(static_cast<std::size_t>(width), kNoDisparity);
        median_reference(view<std::uint16_t>(in), writable<std::uint16_t>(plain));
        median_lanes(view<std::uint16_t>(in), none, writable<std::uint16_t>(lanes));
        ASSERT_TRUE(equal(plain, lanes)) << width << 'x' << height << " holes " << holes;
      }
    }
  }
}

TEST_P(StereoSimd, RowBitsEqualTheReferenceBitForBit) {
  ASSERT_TRUE(use_simd(GetParam()));
  std::mt19937 random(3);
  for (const int width : {0, 1, 2, 7, 8, 9, 31, 32, 33, 63, 64, 65, 66, 127, 128, 129, 200}) {
    for (const int step : {0, 3, 40, 65535}) {
      // Odd addresses, and values behind the row that must not count.
      std::vector<std::uint16_t> row(static_cast<std::size_t>(width) + 100);
      std::vector<std::uint16_t> above(row.size());
      std::vector<std::uint8_t> mask(row.size());
      for (std::size_t x = 0; x < row.size(); ++x) {
        const auto value = [&] {
          return random() % 4 == 0 ? kNoDisparity
                                   : static_cast<std::uint16_t>(random() % 2 == 0 ? random() % 50 : 65534);
        };
        row[x] = value();
        above[x] = value();
        mask[x] = static_cast<std::uint8_t>(random() % 3 == 0 ? 0 : random());
      }
      const auto words = static_cast<std::size_t>(words_of(width));
      const RowBitsTask task{row.data() + 1, above.data() + 1, width, step};
      std::vector<std::uint64_t> plain[4];
      std::vector<std::uint64_t> lanes[4];
      for (int i = 0; i < 4; ++i) {
        plain[i].assign(words, 1);
        lanes[i].assign(words, 2);
      }
      row_bits_reference(task, {plain[0].data(), plain[1].data(), plain[2].data()});
      row_bits(task, {lanes[0].data(), lanes[1].data(), lanes[2].data()});
      wanted_bits_reference(mask.data() + 1, width, plain[3].data());
      wanted_bits(mask.data() + 1, width, lanes[3].data());
      for (int i = 0; i < 4; ++i) ASSERT_EQ(plain[i], lanes[i]) << width << " px, step " << step << ", bits " << i;
    }
  }
}

}  // namespace
}  // namespace stereotrack
