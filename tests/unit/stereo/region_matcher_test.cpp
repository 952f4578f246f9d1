#include "pipeline/stereo/region_matcher.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "stereo_pictures.hpp"

namespace stereotrack {
namespace {

using test::noise;
using test::view;

RegionMatcher::Config config_for(const cv::Mat& left, int disparities) {
  RegionMatcher::Config config;
  config.width = left.cols;
  config.height = left.rows;
  config.disparities = disparities;
  return config;
}

RegionMatch matched(const cv::Mat& left, const cv::Mat& right, const cv::Mat& labels, DisparityRange range,
                    const cv::Mat& right_foreground = {}, RegionMatcher::Config config = {}) {
  if (config.width == 0) config = config_for(left, range.count());
  Arena arena;
  auto matcher = RegionMatcher::create(config, arena);
  EXPECT_TRUE(matcher.has_value());
  arena.seal();
  const auto match =
      matcher->run<std::uint8_t>(view<std::uint8_t>(left), view<std::uint8_t>(right), view<std::uint8_t>(labels), 1,
                                 {0, 0, left.cols, left.rows}, range, view<std::uint8_t>(right_foreground));
  EXPECT_TRUE(match.has_value());
  EXPECT_FALSE(arena.failed());
  return *match;
}

/// A textured disc at `centre`, sub-pixel, painted over `background`; `mask` gets 1 where it is.
cv::Mat with_disc(const cv::Mat& background, double centre_x, double centre_y, double radius, cv::Mat& mask) {
  cv::Mat picture = background.clone();
  mask = cv::Mat(background.size(), CV_8U, cv::Scalar(0));
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const double dx = x - centre_x;
      const double dy = y - centre_y;
      if (dx * dx + dy * dy > radius * radius) continue;
      picture.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(test::waves(dx, dy));
      mask.at<std::uint8_t>(y, x) = 1;
    }
  }
  return picture;
}

TEST(RegionMatcher, SmallDiscBeforeDifferentBackgroundsFromFewToSeventyPercentOfTheWidth) {
  for (const double d : {3.0, 40.5, 81.25, 140.0}) {
    cv::Mat labels;
    cv::Mat unused;
    const cv::Mat left = with_disc(noise(200, 60, 1), 170, 30, 4.5, labels);
    const cv::Mat right = with_disc(noise(200, 60, 2), 170 - d, 30, 4.5, unused);
    const RegionMatch match = matched(left, right, labels, {0, 140});
    ASSERT_TRUE(match.found);
    EXPECT_NEAR(match.disparity_px, d, 0.4) << d;
    EXPECT_EQ(match.row_offset, 0);
    EXPECT_GT(match.uniqueness, 1.4) << d;
    EXPECT_LT(match.sigma_px, d < 140 ? 0.5 : 1.1);
  }
}

TEST(RegionMatcher, OneRowOffIsFoundAndTold) {
  cv::Mat labels;
  cv::Mat unused;
  const cv::Mat left = with_disc(noise(120, 60, 1), 90, 30, 6, labels);
  for (const int v : {-1, 1}) {
    const RegionMatch match = matched(left, with_disc(noise(120, 60, 2), 60, 30 + v, 6, unused), labels, {0, 63});
    EXPECT_NEAR(match.disparity_px, 30, 0.1);
    EXPECT_EQ(match.row_offset, v);
  }
}

TEST(RegionMatcher, ExposureDifferenceWithinTheToleranceCostsNothing) {
  cv::Mat labels;
  cv::Mat unused;
  const cv::Mat left = with_disc(noise(120, 60, 1), 90, 30, 6, labels) * 0.8;
  const cv::Mat right = with_disc(noise(120, 60, 2), 60, 30, 6, unused) * 0.8;
  const RegionMatch same = matched(left, right, labels, {0, 63});
  const RegionMatch brighter = matched(left, right + 10, labels, {0, 63});
  EXPECT_NEAR(brighter.disparity_px, same.disparity_px, 0.02);
  EXPECT_NEAR(brighter.cost, same.cost, 1.0);
}

TEST(RegionMatcher, RightForegroundDecidesForAFlatObject) {
  // A flat grey disc, and in the right picture a wall of the same grey: only what moves tells them apart.
  cv::Mat left = noise(160, 60, 1);
  cv::Mat right = noise(160, 60, 2);
  cv::Mat labels(60, 160, CV_8U, cv::Scalar(0));
  cv::Mat moving(60, 160, CV_8U, cv::Scalar(0));
  cv::circle(left, {120, 30}, 5, 128, cv::FILLED);
  cv::circle(labels, {120, 30}, 5, 1, cv::FILLED);
  cv::rectangle(right, {100, 0}, {125, 59}, 128, cv::FILLED);
  cv::circle(right, {70, 30}, 5, 128, cv::FILLED);
  cv::circle(moving, {70, 30}, 5, 255, cv::FILLED);
  EXPECT_LT(matched(left, right, labels, {0, 100}).uniqueness, 1.1);
  const RegionMatch match = matched(left, right, labels, {0, 100}, moving);
  EXPECT_NEAR(match.disparity_px, 50, 0.1);
  EXPECT_GT(match.uniqueness, 10);
  EXPECT_EQ(match.foreground_share, 1.0);
}

TEST(RegionMatcher, SigmaCoversTheErrorsUnderNoise) {
  int within_two_sigma = 0;
  constexpr int kTrials = 60;
  for (int trial = 0; trial < kTrials; ++trial) {
    const double d = 20 + 0.37 * trial;
    cv::Mat labels;
    cv::Mat unused;
    cv::Mat left = with_disc(noise(160, 40, 2 * trial + 1), 120, 20, 5, labels);
    cv::Mat right = with_disc(noise(160, 40, 2 * trial + 2), 120 - d, 20, 5, unused);
    cv::Mat grain(40, 160, CV_8S);
    cv::RNG random(trial);
    for (cv::Mat* picture : {&left, &right}) {
      random.fill(grain, cv::RNG::NORMAL, 0, 5);
      cv::add(*picture, grain, *picture, cv::noArray(), CV_8U);
    }
    const RegionMatch match = matched(left, right, labels, {0, 63});
    within_two_sigma += std::abs(match.disparity_px - d) <= 2 * match.sigma_px ? 1 : 0;
    EXPECT_LT(match.sigma_px, 0.6);
  }
  EXPECT_GE(within_two_sigma, kTrials * 9 / 10);
}

TEST(RegionMatcher, LargeRegionIsSampledWithinTheCapacity) {
  const cv::Mat left = test::waves_picture(300, 200, 0);
  const cv::Mat right = test::waves_picture(300, 200, 21);
  cv::Mat labels(200, 300, CV_8U, cv::Scalar(0));
  labels(cv::Rect(80, 10, 200, 180)).setTo(1);
  RegionMatcher::Config config = config_for(left, 64);
  config.largest_sample = 100;
  const RegionMatch match = matched(left, right, labels, {0, 63}, {}, config);
  EXPECT_NEAR(match.disparity_px, 21, 0.05);
  EXPECT_LE(match.pixels, 100);
  EXPECT_GE(match.pixels, 40);
}

// Searches that leave what does not count, against one that sums everything up.
TEST(RegionMatcher, WhatDoesNotCountLeavesNoTrace) {
  int unique = 0;
  int vague = 0;
  for (int seed = 1; seed <= 40; ++seed) {
    cv::Mat labels;
    cv::Mat place;
    const int radius = 3 + seed % 9;
    const int d = 5 + 3 * seed % 50;
    cv::Mat left = with_disc(noise(140, 50, seed), 100, 25, radius, labels);
    cv::Mat right = with_disc(noise(140, 50, 100 + seed), 100 - d, 25 + seed % 3 - 1, radius, place);
    if (seed % 4 == 0) {  // flat: many places fit
      left.setTo(90 + seed % 5, labels);
      right.setTo(90, place);
    }
    if (seed % 5 == 0) cv::GaussianBlur(right, right, {7, 7}, 2);
    if (seed % 7 == 0) cv::dilate(labels, labels, cv::Mat());  // a rim of what lies behind
    const cv::Mat moving = seed % 2 == 0 ? cv::Mat(place * 255) : cv::Mat();
    Arena arena;
    auto matcher = RegionMatcher::create(config_for(left, 80), arena);
    ASSERT_TRUE(matcher.has_value());
    matcher->take({0, 0, left.cols, left.rows}, [&](int x, int y) { return labels.at<std::uint8_t>(y, x) == 1; });
    const auto run = [&](const RegionMatcher::Search& search) {
      return *matcher->match_taken(view<std::uint8_t>(left), view<std::uint8_t>(right), search,
                                   view<std::uint8_t>(moving));
    };
    for (const DisparityRange range : {DisparityRange{0, 63}, {0, 79}, {d - 1, d + 1}, {d - 5, d + 14}}) {
      const RegionMatch whole = run({.range = range});
      ASSERT_TRUE(whole.found);
      EXPECT_NEAR(whole.look, whole.cost - 3600 * (1 - whole.foreground_share), 1e-9);
      for (const double enough : {1.0, 1.5, 3.0}) {
        for (const double most : {RegionMatcher::kAnyCost, whole.cost, whole.cost * 1.4}) {
          const RegionMatch found = run({.range = range, .most_cost = most, .enough_uniqueness = enough});
          ASSERT_TRUE(found.found) << seed;
          EXPECT_EQ(found.disparity_px, whole.disparity_px) << seed;
          EXPECT_EQ(found.sigma_px, whole.sigma_px);
          EXPECT_EQ(found.cost, whole.cost);
          EXPECT_EQ(found.look, whole.look);
          EXPECT_EQ(found.uniqueness, std::min(whole.uniqueness, enough)) << seed << ' ' << enough;
          EXPECT_EQ(found.foreground_share, whole.foreground_share);
          EXPECT_EQ(found.row_offset, whole.row_offset);
          EXPECT_EQ(found.pixels, whole.pixels);
        }
        EXPECT_FALSE(run({.range = range, .most_cost = whole.cost - 0.01, .enough_uniqueness = enough}).found);
      }
      (whole.uniqueness >= 1.5 ? unique : vague) += 1;
    }
  }
  EXPECT_GT(unique, 20);
  EXPECT_GT(vague, 20);
}

TEST(RegionMatcher, OnlyTheLabelledPixelsCount) {
  cv::Mat labels;
  cv::Mat unused;
  const cv::Mat left = with_disc(noise(120, 60, 1), 90, 30, 6, labels);
  const cv::Mat right = with_disc(noise(120, 60, 2), 60, 30, 6, unused);
  const RegionMatch alone = matched(left, right, labels, {0, 63});
  labels.rowRange(0, 10).setTo(2);
  const RegionMatch beside = matched(left, right, labels, {0, 63});
  EXPECT_EQ(alone.disparity_px, beside.disparity_px);
  EXPECT_EQ(alone.pixels, beside.pixels);
}

TEST(RegionMatcher, EmptyRegionIsNotFound) {
  const cv::Mat left = noise(60, 30, 1);
  EXPECT_FALSE(matched(left, left, cv::Mat(30, 60, CV_8U, cv::Scalar(0)), {0, 31}).found);
}

TEST(RegionMatcher, RegionWhosePartnersLieOutsideIsNotFound) {
  const cv::Mat left = noise(60, 30, 1);
  cv::Mat labels(30, 60, CV_8U, cv::Scalar(0));
  labels(cv::Rect(0, 5, 8, 8)).setTo(1);
  EXPECT_FALSE(matched(left, left, labels, {20, 40}).found);
  EXPECT_TRUE(matched(left, left, labels, {4, 40}).found);
}

TEST(RegionMatcher, OffsetOfTheCanvasIsTakenOut) {
  cv::Mat labels;
  cv::Mat unused;
  const cv::Mat left = with_disc(noise(160, 40, 1), 60, 20, 5, labels);
  const cv::Mat right = with_disc(noise(160, 40, 2), 80, 20, 5, unused);
  RegionMatcher::Config config = config_for(left, 64);
  config.offset = -35;
  EXPECT_NEAR(matched(left, right, labels, {0, 63}, {}, config).disparity_px, 15, 0.05);
}

TEST(RegionMatcher, FaultsAreTold) {
  const cv::Mat left = noise(60, 30, 1);
  const cv::Mat other = noise(61, 30, 1);
  Arena arena;
  auto matcher = RegionMatcher::create(config_for(left, 32), arena);
  ASSERT_TRUE(matcher.has_value());
  const auto l = view<std::uint8_t>(left);
  const auto o = view<std::uint8_t>(other);
  const Rect all{0, 0, 60, 30};
  const std::uint8_t one = 1;
  EXPECT_EQ(matcher->run(o, l, l, one, all, {0, 31}, {}).error(), Fault::kBadSize);
  EXPECT_EQ(matcher->run(l, o, l, one, all, {0, 31}, {}).error(), Fault::kBadSize);
  EXPECT_EQ(matcher->run(l, l, o, one, all, {0, 31}, {}).error(), Fault::kBadSize);
  EXPECT_EQ(matcher->run(l, l, l, one, all, {0, 31}, o).error(), Fault::kBadSize);
  EXPECT_EQ(matcher->run(l, l, l, one, all, {0, 32}, {}).error(), Fault::kBadConfig);
  EXPECT_EQ(matcher->run(l, l, l, one, all, {3, 2}, {}).error(), Fault::kBadConfig);
}

TEST(RegionMatcher, BadConfigurationIsRefused) {
  RegionMatcher::Config good;
  good.width = 32;
  good.height = 16;
  Arena arena;
  EXPECT_TRUE(RegionMatcher::create(good, arena).has_value());
  const auto refused = [&](auto change) {
    RegionMatcher::Config bad = good;
    change(bad);
    const auto result = RegionMatcher::create(bad, arena);
    return !result.has_value() && result.error() == Fault::kBadConfig;
  };
  EXPECT_TRUE(refused([](auto& c) { c.width = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.disparities = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.row_tolerance = 4; }));
  EXPECT_TRUE(refused([](auto& c) { c.largest_sample = 15; }));
  EXPECT_TRUE(refused([](auto& c) { c.saturation = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.noise = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.sigma_floor_px = 0; }));
  EXPECT_TRUE(refused([](auto& c) { c.bias_tolerance = -1; }));
  EXPECT_TRUE(refused([](auto& c) { c.foreground_penalty = 256; }));
  arena.seal();
  EXPECT_EQ(RegionMatcher::create(good, arena).error(), Fault::kOutOfMemory);
}

cv::Mat median_picture(const std::vector<cv::Mat>& pictures) {
  cv::Mat out(pictures[0].size(), CV_8U);
  std::vector<std::uint8_t> greys(pictures.size());
  for (int y = 0; y < out.rows; ++y) {
    for (int x = 0; x < out.cols; ++x) {
      for (std::size_t i = 0; i < pictures.size(); ++i) greys[i] = pictures[i].at<std::uint8_t>(y, x);
      std::nth_element(greys.begin(), greys.begin() + greys.size() / 2, greys.end());
      out.at<std::uint8_t>(y, x) = greys[greys.size() / 2];
    }
  }
  return out;
}

/// Both views of a pitch, rectified as its calibration file says.
void read_pitch(const std::filesystem::path& folder, const std::string& pitch, std::vector<cv::Mat>& left,
                std::vector<cv::Mat>& right) {
  const cv::FileStorage file((folder / "calibration.yml").string(), cv::FileStorage::READ);
  const auto read = [&](const std::string& side, const std::string& number, std::vector<cv::Mat>& pictures) {
    cv::Mat map_x;
    cv::Mat map_y;
    cv::initUndistortRectifyMap(file["K" + number].mat(), file["D" + number].mat(), file["R" + number].mat(),
                                file["P" + number].mat(), {640, 480}, CV_32F, map_x, map_y);
    std::vector<cv::String> names;
    cv::glob((folder / pitch / side / "*.jpeg").string(), names);
    for (const cv::String& name : names) {
      cv::Mat picture;
      cv::remap(cv::imread(name, cv::IMREAD_GRAYSCALE), picture, map_x, map_y, cv::INTER_LINEAR);
      pictures.push_back(picture);
    }
  };
  read("left", "1", left);
  read("right", "2", right);
}

/// The ball flies from 451 in to 83 in at a nearly constant speed: 1/d falls on a line in time.
void expect_smooth_pitch(const std::string& pitch, int first, int last, double d_first, double d_last) {
  const std::filesystem::path folder =
      std::filesystem::path(STEREOTRACK_SOURCE_DIR) / "../shared/data/baseball_stereo_slow126";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no test archive at " << folder;
  std::vector<cv::Mat> left;
  std::vector<cv::Mat> right;
  read_pitch(folder, pitch, left, right);
  ASSERT_GT(static_cast<int>(left.size()), last);
  ASSERT_EQ(left.size(), right.size());
  const cv::Mat left_background = median_picture(left);
  const cv::Mat right_background = median_picture(right);
  Arena arena;
  auto matcher = RegionMatcher::create(config_for(left[0], 449), arena);
  ASSERT_TRUE(matcher.has_value());
  double before = 0;
  double before_that = 0;
  for (int i = first; i <= last; ++i) {
    const cv::Mat kernel = cv::getStructuringElement(cv::MORPH_RECT, {3, 3});
    cv::Mat left_moves;
    cv::Mat right_moves;
    cv::absdiff(left[i], left_background, left_moves);
    cv::absdiff(right[i], right_background, right_moves);
    cv::morphologyEx(left_moves > 20, left_moves, cv::MORPH_OPEN, kernel);
    cv::morphologyEx(right_moves > 20, right_moves, cv::MORPH_OPEN, kernel);
    // The ball is what moves most in the part of the picture that it crosses.
    cv::Mat labels;
    cv::Mat stats;
    cv::Mat centres;
    const int count = cv::connectedComponentsWithStats(left_moves, labels, stats, centres, 4, CV_16U);
    int ball = 0;
    for (int k = 1; k < count; ++k) {
      const bool machine = std::abs(centres.at<double>(k, 0) - 436) < 8 && centres.at<double>(k, 1) < 185 &&
                           centres.at<double>(k, 1) > 130 && stats.at<int>(k, cv::CC_STAT_AREA) < 520;
      if (machine) continue;
      if (ball == 0 || stats.at<int>(k, cv::CC_STAT_AREA) > stats.at<int>(ball, cv::CC_STAT_AREA)) ball = k;
    }
    ASSERT_NE(ball, 0) << "frame " << i;
    const Rect box{stats.at<int>(ball, cv::CC_STAT_LEFT), stats.at<int>(ball, cv::CC_STAT_TOP),
                   stats.at<int>(ball, cv::CC_STAT_WIDTH), stats.at<int>(ball, cv::CC_STAT_HEIGHT)};
    const auto match = matcher->run<std::uint16_t>(view<std::uint8_t>(left[i]), view<std::uint8_t>(right[i]),
                                                   view<std::uint16_t>(labels), static_cast<std::uint16_t>(ball), box,
                                                   {0, 448}, view<std::uint8_t>(right_moves));
    ASSERT_TRUE(match.has_value());
    ASSERT_TRUE(match->found) << "frame " << i;
    const double d = match->disparity_px;
    if (i == first) {
      EXPECT_NEAR(d, d_first, 1.5);
    }
    if (i == last) {
      EXPECT_NEAR(d, d_last, 6);
    }
    if (i > first) {
      EXPECT_GT(d, before) << "frame " << i;
    }
    if (i > first + 1) {
      const double expected = 1 / (2 / before - 1 / before_that);
      EXPECT_NEAR(d, expected, 0.6 + 0.04 * d * (d > 220 ? 1.0 : 0.3)) << "frame " << i;
    }
    before_that = before;
    before = d;
  }
}

TEST(RegionMatcher, BallOfPitchOneGrowsSmoothlyFrom82To293Pixels) {
  expect_smooth_pitch("one_pitch", 5, 36, 81.9, 294);
}
TEST(RegionMatcher, BallOfPitchTwoGrowsSmoothlyFrom90To424Pixels) {
  expect_smooth_pitch("two_pitch", 10, 41, 90.3, 424);
}

}  // namespace
}  // namespace stereotrack
