#include "firmware-app/render/style.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace stereotrack::render {
namespace {

double distance(const cv::Scalar& a, const cv::Scalar& b) { return cv::norm(a - b); }

int coloured(const cv::Mat& picture) {
  cv::Mat grey;
  cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
  return cv::countNonZero(grey);
}

TEST(Style, TwelveIdsInARowHaveColoursApart) {
  for (std::uint32_t a = 1; a <= 12; ++a) {
    EXPECT_EQ(colour_of(a), colour_of(a + 12));
    for (std::uint32_t b = a + 1; b <= 12; ++b) EXPECT_GT(distance(colour_of(a), colour_of(b)), 60) << a << " " << b;
  }
}

TEST(Style, NumbersKeepTheirFirstDigits) {
  EXPECT_EQ(number_text(0), "0.00");
  EXPECT_EQ(number_text(0.424), "0.42");
  EXPECT_EQ(number_text(-4.24), "-4.2");
  EXPECT_EQ(number_text(42.14), "42.1");
  EXPECT_EQ(number_text(421.4), "421");
}

TEST(Style, DashedLineLeavesGaps) {
  cv::Mat solid(20, 100, CV_8UC3, cv::Scalar::all(0));
  cv::Mat dashed = solid.clone();
  draw_line(solid, {{0, 10}, {99, 10}}, false, {kBright, 1, 1, false});
  draw_line(dashed, {{0, 10}, {99, 10}}, false, {kBright, 1, 1, true});
  EXPECT_EQ(coloured(solid.row(10)), 100);
  EXPECT_LT(coloured(dashed.row(10)), 85);
  EXPECT_GT(coloured(dashed.row(10)), 45);
}

TEST(Style, FadingLineIsAsStrongAsSaid) {
  cv::Mat picture(11, 120, CV_8UC3, cv::Scalar::all(0));
  draw_fading_line(picture, {{0, 5}, {60, 5}, {119, 5}}, {0.2, 1.0}, cv::Scalar(200, 100, 50), 3);
  EXPECT_EQ(picture.at<cv::Vec3b>(5, 20), cv::Vec3b(40, 20, 10));
  EXPECT_EQ(picture.at<cv::Vec3b>(5, 100), cv::Vec3b(200, 100, 50));
}

TEST(Style, HalfStrengthMixesHalf) {
  cv::Mat picture(40, 40, CV_8UC3, cv::Scalar::all(100));
  fill(picture, {{5, 5}, {35, 5}, {35, 35}, {5, 35}}, cv::Scalar(200, 200, 200), 0.5);
  EXPECT_EQ(picture.at<cv::Vec3b>(20, 20), cv::Vec3b(150, 150, 150));
  EXPECT_EQ(picture.at<cv::Vec3b>(1, 1), cv::Vec3b(100, 100, 100));
}

TEST(Style, WhatLiesOutsideOrIsNotANumberIsLeftOut) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  cv::Mat picture(30, 30, CV_8UC3, cv::Scalar::all(0));
  const Pen half{kBright, 0.5, 2, true};
  draw_line(picture, {{-1e9, -50}, {1e9, -50}}, false, half);
  draw_line(picture, {{nan, 3}, {nan, 9}}, false, half);
  draw_line(picture, {}, true, half);
  fill(picture, {{100, 100}, {120, 100}, {110, 130}}, kBright, 0.3);
  fill(picture, {}, kBright, 0.3);
  draw_fading_line(picture, {{-50, -50}, {-40, -40}}, {1.0}, kBright, 2);
  draw_arrow(picture, {15, 15}, {nan, 0}, 50, half);
  draw_arrow(picture, {15, 15}, {2, 0}, 50, half);
  EXPECT_EQ(coloured(picture), 0);
}

TEST(Labels, NamesOfThingsAtOnePlaceDoNotCoverEachOther) {
  cv::Mat picture(200, 200, CV_8UC3, cv::Scalar::all(0));
  const cv::Rect thing(80, 90, 30, 20);
  Labels labels(picture, false);
  labels.draw("#1", thing, 0.5, kBright);
  const cv::Mat one = picture.clone();
  labels.draw("#2", thing, 0.5, kBright);
  EXPECT_EQ(cv::norm(one.rowRange(0, 90), picture.rowRange(0, 90), cv::NORM_INF), 0);
  EXPECT_GT(coloured(one.rowRange(0, 90)), 20);
  EXPECT_GT(coloured(picture.rowRange(110, 200)), 20);
}

TEST(Labels, NameAtTheEdgeStaysInside) {
  cv::Mat picture(60, 120, CV_8UC3, cv::Scalar::all(0));
  cv::Mat inner = picture.clone();
  Labels(picture, true).draw("#12 4.2 m", {110, 0, 30, 10}, 0.5, kBright);
  Labels(inner, true).draw("#12 4.2 m", {10, 30, 30, 10}, 0.5, kBright);
  EXPECT_NEAR(coloured(picture), coloured(inner), 40);
}

}  // namespace
}  // namespace stereotrack::render
