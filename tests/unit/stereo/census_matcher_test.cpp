#include "pipeline/stereo/census_matcher.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "stereo_pictures.hpp"

namespace stereotrack {
namespace {

using test::noise;
using test::shifted;
using test::view;
using test::waves_picture;
using test::writable;

CensusMatcher::Config config_for(const cv::Mat& left, DisparityRange range) {
  CensusMatcher::Config config;
  config.width = left.cols;
  config.height = left.rows;
  config.range = range;
  return config;
}

/// Winner takes all and nothing after it.
CensusMatcher::Config bare(CensusMatcher::Config config) {
  config.texture = 0;
  config.uniqueness = 0;
  config.left_right_px = -1;
  config.filter = {.median = false, .speckle_size = 0, .speckle_step = 0, .fill_px = 0};
  return config;
}

struct Output {
  cv::Mat disparity;
  DisparityCounts counts;
};

Output matched(const cv::Mat& left, const cv::Mat& right, const CensusMatcher::Config& config) {
  Arena arena;
  auto matcher = CensusMatcher::create(config, arena);
  EXPECT_TRUE(matcher.has_value());
  arena.seal();
  Output out{cv::Mat(left.size(), CV_16U, cv::Scalar(12345)), {}};
  const auto counts =
      matcher->run(view<std::uint8_t>(left), view<std::uint8_t>(right), writable<std::uint16_t>(out.disparity));
  EXPECT_TRUE(counts.has_value());
  out.counts = *counts;
  const DisparityCounts& c = out.counts;
  EXPECT_EQ(c.wanted, c.matched + c.border + c.texture + c.uniqueness + c.left_right + c.speckle - c.filled);
  EXPECT_EQ(c.matched, cv::countNonZero(out.disparity != kNoDisparity));
  EXPECT_FALSE(arena.failed());
  return out;
}

bool equal(const cv::Mat& a, const cv::Mat& b) { return a.size() == b.size() && cv::countNonZero(a != b) == 0; }

std::vector<bool> naive_code(const cv::Mat& picture, int x, int y) {
  std::vector<bool> bits;
  const auto grey = [&](int u, int v) {
    return picture.at<std::uint8_t>(std::clamp(v, 0, picture.rows - 1), std::clamp(u, 0, picture.cols - 1));
  };
  for (int j = -3; j <= 3; ++j) {
    for (int i = -3; i <= 3; ++i) {
      if ((i + j) % 2 != 0) bits.push_back(grey(x + i, y + j) < grey(x, y));
    }
  }
  EXPECT_EQ(bits.size(), 24U);
  return bits;
}

/// The header's steps 1 and 2, word for word, whole pixels.
cv::Mat naive(const cv::Mat& left, const cv::Mat& right, int block, int offset, DisparityRange range) {
  const int radius = block / 2;
  std::vector<std::vector<bool>> left_codes;
  std::vector<std::vector<bool>> right_codes;
  for (int y = 0; y < left.rows; ++y) {
    for (int x = 0; x < left.cols; ++x) left_codes.push_back(naive_code(left, x, y));
    for (int x = 0; x < right.cols; ++x) right_codes.push_back(naive_code(right, x, y));
  }
  cv::Mat out(left.size(), CV_16U, cv::Scalar(kNoDisparity));
  for (int y = 0; y < left.rows; ++y) {
    for (int x = 0; x < left.cols; ++x) {
      int best_cost = 1 << 30;
      for (int d = range.min; d <= range.max; ++d) {
        if (x - d - offset < 0 || x - d - offset >= right.cols) continue;
        int sum = 0;
        int columns = 0;
        for (int u = x - radius; u <= x + radius; ++u) {
          const int partner = u - d - offset;
          if (u < 0 || u >= left.cols || partner < 0 || partner >= right.cols) continue;
          ++columns;
          for (int v = std::max(y - radius, 0); v <= std::min(y + radius, left.rows - 1); ++v) {
            const auto& a = left_codes[v * left.cols + u];
            const auto& b = right_codes[v * right.cols + partner];
            for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] != b[i] ? 1 : 0;
          }
        }
        const int cost = sum * block / columns;
        if (cost < best_cost) {
          best_cost = cost;
          out.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(d);
        }
      }
    }
  }
  return out;
}

TEST(CensusMatcher, WinnerEqualsTheNaiveReferenceOnEveryPixel) {
  struct Case {
    int width, height, right_width, block, offset;
    DisparityRange range;
  };
  for (const Case& c : {Case{1, 1, 1, 3, 0, {0, 3}}, Case{2, 9, 2, 9, 0, {0, 5}}, Case{31, 17, 31, 9, 0, {0, 15}},
                        Case{25, 13, 25, 5, 0, {3, 30}}, Case{24, 30, 24, 21, 0, {0, 11}},
                        Case{25, 13, 33, 7, -9, {0, 30}}, Case{25, 13, 19, 7, 5, {0, 12}}}) {
    for (const int greys : {2, 255}) {
      const cv::Mat left = noise(c.width, c.height, 1, 0, greys);
      const cv::Mat right = noise(c.right_width, c.height, 2, 0, greys);
      CensusMatcher::Config config = bare(config_for(left, c.range));
      config.right_width = c.right_width;
      config.block = c.block;
      config.offset = c.offset;
      const cv::Mat ours = matched(left, right, config).disparity;
      const cv::Mat theirs = naive(left, right, c.block, c.offset, c.range);
      for (int y = 0; y < c.height; ++y) {
        for (int x = 0; x < c.width; ++x) {
          const int d = theirs.at<std::uint16_t>(y, x);
          const int value = ours.at<std::uint16_t>(y, x);
          if (d == kNoDisparity) {
            ASSERT_EQ(value, kNoDisparity) << x << ' ' << y;
          } else {
            ASSERT_LE(std::abs(value - d * kDisparityScale), kDisparityScale / 2)
                << x << ' ' << y << " block " << c.block;
          }
        }
      }
    }
  }
}

TEST(CensusMatcher, ShiftedPictureGivesTheShift) {
  const cv::Mat left = noise(90, 40, 3);
  const cv::Mat out = matched(left, shifted(left, 17, 4), config_for(left, {0, 31})).disparity;
  for (int y = 0; y < 40; ++y) {
    for (int x = 17 + 7; x < 90; ++x) {
      ASSERT_NEAR(out.at<std::uint16_t>(y, x), 17 * kDisparityScale, 1) << x << ' ' << y;
    }
  }
}

TEST(CensusMatcher, ZeroDisparityIsNotNone) {
  const cv::Mat left = noise(50, 30, 3);
  const Output out = matched(left, left, config_for(left, {0, 15}));
  EXPECT_EQ(cv::countNonZero(out.disparity != 0), 0);
  EXPECT_EQ(out.counts.matched, 50 * 30);
}

TEST(CensusMatcher, ExposureOfOneViewChangesNothing) {
  const cv::Mat left = noise(90, 40, 3, 0, 120);
  const cv::Mat right = shifted(left, 6, 4);
  const cv::Mat brighter = right * 2 + 10;
  const CensusMatcher::Config config = config_for(left, {0, 15});
  // The columns that `shifted` invents are brightened beyond 255, where order is lost; they lie right of these.
  const cv::Mat usual = matched(left, right, config).disparity.colRange(0, 70);
  EXPECT_TRUE(equal(usual, matched(left, brighter, config).disparity.colRange(0, 70)));
}

TEST(CensusMatcher, SubPixelShiftIsFoundWithinAFifthOfAPixel) {
  const cv::Mat left = waves_picture(120, 60, 0);
  for (const double shift : {7.0, 7.25, 7.5, 7.75, 8.0}) {
    const cv::Mat out = matched(left, waves_picture(120, 60, shift), config_for(left, {0, 20})).disparity;
    double mean = 0;
    double square = 0;
    int count = 0;
    for (int y = 8; y < 52; ++y) {
      for (int x = 32; x < 112; ++x) {
        ASSERT_NE(out.at<std::uint16_t>(y, x), kNoDisparity);
        const double error = out.at<std::uint16_t>(y, x) / 16.0 - shift;
        mean += error;
        square += error * error;
        ++count;
      }
    }
    EXPECT_NEAR(mean / count, 0, 0.06) << shift;
    EXPECT_LT(std::sqrt(square / count), 0.2) << shift;
  }
}

TEST(CensusMatcher, FlatPictureIsRejectedForTexture) {
  const cv::Mat left(30, 40, CV_8U, cv::Scalar(90));
  CensusMatcher::Config config = config_for(left, {0, 15});
  config.texture = 8;
  const Output out = matched(left, left, config);
  EXPECT_EQ(out.counts.texture, 30 * 40);
  EXPECT_EQ(out.counts.matched, 0);
}

TEST(CensusMatcher, TextureGateIsTheMeanGradientOfTheBlock) {
  // A ramp of 2 grey levels a column: |L(x+1) - L(x-1)| = 4 everywhere but in the border columns.
  cv::Mat left(20, 60, CV_8U);
  for (int x = 0; x < 60; ++x) left.col(x).setTo(2 * x);
  CensusMatcher::Config config = bare(config_for(left, {0, 3}));
  config.texture = 4 * 16;
  EXPECT_EQ(matched(left, left, config).counts.texture, 2 * 5 * 20);
  config.texture = 4 * 16 + 1;
  EXPECT_EQ(matched(left, left, config).counts.texture, 60 * 20);
}

TEST(CensusMatcher, RepeatedPatternIsRejectedForUniqueness) {
  cv::Mat left(30, 80, CV_8U);
  const cv::Mat tile = noise(8, 30, 5);
  for (int x = 0; x < 80; ++x) tile.col(x % 8).copyTo(left.col(x));
  const Output out = matched(left, left, config_for(left, {0, 31}));
  EXPECT_GT(out.counts.uniqueness, 30 * 50);
}

TEST(CensusMatcher, HiddenBackgroundFailsTheLeftRightCheck) {
  // A square at disparity 20 before a background at 4: 16 columns left of it are hidden from the right camera.
  const cv::Mat texture = noise(160, 80, 6);
  const cv::Mat front = noise(40, 40, 7);
  cv::Mat left = texture.clone();
  front.copyTo(left(cv::Rect(80, 20, 40, 40)));
  cv::Mat right = shifted(texture, 4, 8);
  front.copyTo(right(cv::Rect(60, 20, 40, 40)));
  CensusMatcher::Config config = config_for(left, {0, 31});
  config.filter.fill_px = 0;
  const Output checked = matched(left, right, config);
  const cv::Mat hidden = checked.disparity(cv::Rect(68, 28, 8, 24));
  EXPECT_GT(cv::countNonZero(hidden == kNoDisparity), 8 * 24 * 8 / 10);
  EXPECT_GT(checked.counts.left_right + checked.counts.uniqueness, 8 * 24);

  config.filter.fill_px = 24;
  const Output filled = matched(left, right, config);
  for (int y = 30; y < 50; ++y) {
    for (int x = 68; x < 74; ++x) {
      ASSERT_NEAR(filled.disparity.at<std::uint16_t>(y, x), 4 * kDisparityScale, kDisparityScale) << x << ' ' << y;
    }
  }
}

TEST(CensusMatcher, RegionGivesWhatTheWholePictureGivesBeforeChecks) {
  const cv::Mat left = noise(70, 50, 5);
  const cv::Mat right = shifted(left, 9, 6);
  CensusMatcher::Config config = bare(config_for(left, {0, 15}));
  config.region_disparities = 60;
  config.uniqueness = 3;
  config.texture = 100;
  const cv::Mat mask = noise(70, 50, 7) > 200;
  Arena arena;
  auto matcher = CensusMatcher::create(config, arena);
  ASSERT_TRUE(matcher.has_value());
  arena.seal();
  for (const Rect roi : {Rect{0, 0, 70, 50}, Rect{20, 10, 13, 7}, Rect{60, 40, 30, 30}, Rect{-5, -5, 12, 12}}) {
    for (const DisparityRange range : {DisparityRange{0, 15}, DisparityRange{5, 60}}) {
      CensusMatcher::Config dense = config;
      dense.range = range;
      const cv::Mat whole = matched(left, right, dense).disparity;
      cv::Mat out(left.size(), CV_16U, cv::Scalar(12345));
      ASSERT_TRUE(matcher->run_region(view<std::uint8_t>(left), view<std::uint8_t>(right), roi,
                                      view<std::uint8_t>(mask), range, writable<std::uint16_t>(out)));
      for (int y = 0; y < 50; ++y) {
        for (int x = 0; x < 70; ++x) {
          const bool inside = x >= roi.left && x < roi.right() && y >= roi.top && y < roi.bottom();
          const bool asked = inside && mask.at<std::uint8_t>(y, x) != 0;
          ASSERT_EQ(out.at<std::uint16_t>(y, x), asked ? whole.at<std::uint16_t>(y, x) : 12345) << x << ' ' << y;
        }
      }
    }
  }
}

TEST(CensusMatcher, RegionKeepsWhatTheCheckedWholePictureKeeps) {
  const cv::Mat left = noise(90, 50, 5);
  cv::Mat right = shifted(left, 9, 6);
  cv::Mat part = right(cv::Rect(20, 10, 30, 30));
  noise(30, 30, 9).copyTo(part);
  CensusMatcher::Config config = config_for(left, {0, 31});
  config.filter = {.median = false, .speckle_size = 0, .speckle_step = 0, .fill_px = 0};
  const cv::Mat whole = matched(left, right, config).disparity;
  Arena arena;
  auto matcher = CensusMatcher::create(config, arena);
  ASSERT_TRUE(matcher.has_value());
  cv::Mat out(left.size(), CV_16U, cv::Scalar(kNoDisparity));
  ASSERT_TRUE(matcher->run_region(view<std::uint8_t>(left), view<std::uint8_t>(right), {30, 8, 40, 30}, {}, {0, 31},
                                  writable<std::uint16_t>(out)));
  int kept = 0;
  for (int y = 8; y < 38; ++y) {
    for (int x = 30; x < 70; ++x) {
      if (whole.at<std::uint16_t>(y, x) == kNoDisparity) continue;
      ++kept;
      ASSERT_EQ(out.at<std::uint16_t>(y, x), whole.at<std::uint16_t>(y, x)) << x << ' ' << y;
    }
  }
  EXPECT_GT(kept, 300);
  EXPECT_LT(kept, 40 * 30);
}

TEST(CensusMatcher, BadConfigurationIsRefused) {
  CensusMatcher::Config good;
  good.width = 32;
  good.height = 16;
  Arena arena;
  EXPECT_TRUE(CensusMatcher::create(good, arena).has_value());
  const auto refused = [&](auto change) {
    CensusMatcher::Config bad = good;
    change(bad);
    const auto result = CensusMatcher::create(bad, arena);
    return !result.has_value() && result.error() == Fault::kBadConfig;
  };
  EXPECT_TRUE(refused([](auto& c) { c.width = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.block = 4; }));
  EXPECT_TRUE(refused([](auto& c) { c.range = {9, 8}; }));
  EXPECT_TRUE(refused([](auto& c) { c.texture = -1; }));
  EXPECT_TRUE(refused([](auto& c) { c.uniqueness = 101; }));
  EXPECT_TRUE(refused([](auto& c) { c.left_right_px = -2; }));
  EXPECT_TRUE(refused([](auto& c) { c.filter.fill_px = -1; }));
  EXPECT_TRUE(refused([](auto& c) { c.filter.speckle_size = -1; }));
  arena.seal();
  EXPECT_EQ(CensusMatcher::create(good, arena).error(), Fault::kOutOfMemory);
}

TEST(CensusMatcher, FaultAtRunLeavesTheOutputUntouched) {
  const cv::Mat left = noise(32, 16, 1);
  const cv::Mat other = noise(32, 15, 1);
  Arena arena;
  auto matcher = CensusMatcher::create(config_for(left, {0, 15}), arena);
  ASSERT_TRUE(matcher.has_value());
  cv::Mat out(left.size(), CV_16U, cv::Scalar(7));
  const auto l = view<std::uint8_t>(left);
  const auto o = view<std::uint8_t>(other);
  const auto to = writable<std::uint16_t>(out);
  EXPECT_EQ(matcher->run(o, l, to).error(), Fault::kBadSize);
  EXPECT_EQ(matcher->run(l, o, to).error(), Fault::kBadSize);
  EXPECT_EQ(matcher->run_region(l, l, {0, 0, 9, 9}, o, {0, 15}, to).error(), Fault::kBadSize);
  EXPECT_EQ(matcher->run_region(l, l, {0, 0, 9, 9}, {}, {0, 16}, to).error(), Fault::kBadConfig);
  EXPECT_EQ(cv::countNonZero(out != 7), 0);
}

TEST(CensusMatcher, ConesAreWithinTwoPixelsOnNinetyFivePercent) {
  const std::filesystem::path folder =
      std::filesystem::path(STEREOTRACK_SOURCE_DIR) / "../shared/data/middlebury_stereo/Cones";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no test archive at " << folder;
  const cv::Mat left = cv::imread((folder / "im2.png").string(), cv::IMREAD_GRAYSCALE);
  const cv::Mat right = cv::imread((folder / "im6.png").string(), cv::IMREAD_GRAYSCALE);
  const cv::Mat truth = cv::imread((folder / "disp2.png").string(), cv::IMREAD_GRAYSCALE);
  const cv::Mat visible = cv::imread((folder / "occl.png").string(), cv::IMREAD_GRAYSCALE);
  ASSERT_FALSE(left.empty() || right.empty() || truth.empty() || visible.empty());
  const cv::Mat out = matched(left, right, config_for(left, {0, 63})).disparity;
  int all = 0;
  int good = 0;
  for (int y = 0; y < left.rows; ++y) {
    for (int x = 0; x < left.cols; ++x) {
      if (visible.at<std::uint8_t>(y, x) != 255 || truth.at<std::uint8_t>(y, x) == 0) continue;
      ++all;
      if (out.at<std::uint16_t>(y, x) == kNoDisparity) continue;
      good += std::abs(out.at<std::uint16_t>(y, x) / 16.0 - truth.at<std::uint8_t>(y, x) / 4.0) <= 2 ? 1 : 0;
    }
  }
  EXPECT_GT(good, all * 95 / 100) << "of " << all;
}

}  // namespace
}  // namespace stereotrack
