#include "pipeline/shape/contour_fill.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/unit/shape/pictures.hpp"

namespace stereotrack {
namespace {

using test::const_view;
using test::edge_like;
using test::salt;
using test::view;

cv::Mat_<std::uint8_t> reference(const cv::Mat_<std::uint8_t>& edges) {
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(edges, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::Mat_<std::uint8_t> filled(edges.size(), std::uint8_t{0});
  cv::drawContours(filled, contours, -1, 255, cv::FILLED);
  return filled;
}

cv::Mat_<std::uint8_t> filled_of(cv::Mat_<std::uint8_t>& edges, std::int64_t max_hole_px = ContourFill::kUnlimited) {
  Arena arena;
  auto fill = ContourFill::create({.max_hole_px = max_hole_px}, edges.cols, edges.rows, arena);
  EXPECT_TRUE(fill.has_value());
  cv::Mat_<std::uint8_t> out(edges.size(), std::uint8_t{77});
  EXPECT_TRUE(fill->run(const_view(edges), view(out)).has_value());
  return out;
}

// A diamond is closed 8-connected: its inside must not leak through the corners.
TEST(ContourFill, DiagonalContourHolds) {
  cv::Mat_<std::uint8_t> edges = (cv::Mat_<std::uint8_t>(5, 5) << 0, 0, 0, 0, 0,  //
                                  0, 0, 9, 0, 0,                                  //
                                  0, 9, 0, 9, 0,                                  //
                                  0, 0, 9, 0, 0,                                  //
                                  0, 0, 0, 0, 0);
  const cv::Mat_<std::uint8_t> filled = filled_of(edges);
  EXPECT_EQ(cv::countNonZero(filled == 255), 5);
  EXPECT_EQ(filled(2, 2), 255);
}

TEST(ContourFill, GapOpensTheContour) {
  cv::Mat_<std::uint8_t> edges(7, 7, std::uint8_t{0});
  cv::rectangle(edges, {1, 1, 5, 5}, 255);
  edges(1, 3) = 0;
  EXPECT_EQ(cv::countNonZero(filled_of(edges)), 15);
}

TEST(ContourFill, PictureBorderDoesNotCloseAContour) {
  cv::Mat_<std::uint8_t> edges(6, 6, std::uint8_t{0});
  edges.row(3).setTo(255);
  EXPECT_EQ(cv::countNonZero(filled_of(edges)), 6);
}

TEST(ContourFill, EqualsOpenCvOnEdgeLikePictures) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    cv::Mat_<std::uint8_t> edges = edge_like(97, 71, seed);
    EXPECT_EQ(test::differing(filled_of(edges), reference(edges)), 0) << "seed " << seed;
  }
}

TEST(ContourFill, EqualsOpenCvOnNoiseOfAnyDensity) {
  for (int percent = 0; percent <= 100; percent += 5) {
    cv::Mat_<std::uint8_t> edges = salt(83, 61, percent / 100.0, 7 + static_cast<std::uint64_t>(percent));
    EXPECT_EQ(test::differing(filled_of(edges), reference(edges)), 0) << percent << " %";
  }
}

TEST(ContourFill, EqualsOpenCvAtManySizes) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 9), cv::Size(9, 1), cv::Size(2, 2), cv::Size(3, 3),
                              cv::Size(15, 8), cv::Size(16, 8), cv::Size(17, 8)}) {
    cv::Mat_<std::uint8_t> edges = salt(size.width, size.height, 0.6, 11);
    EXPECT_EQ(test::differing(filled_of(edges), reference(edges)), 0) << size;
  }
}

TEST(ContourFill, ChequerboardWithMostRunsFits) {
  cv::Mat_<std::uint8_t> edges(33, 65, std::uint8_t{0});
  for (int y = 0; y < 33; ++y) {
    for (int x = 0; x < 65; ++x) edges(y, x) = (x + y) % 2 == 0 ? 0 : 255;
  }
  EXPECT_EQ(test::differing(filled_of(edges), reference(edges)), 0);
}

TEST(ContourFill, InPlace) {
  cv::Mat_<std::uint8_t> edges = edge_like(64, 48, 4);
  const cv::Mat_<std::uint8_t> expected = reference(edges);
  Arena arena;
  auto fill = ContourFill::create({}, 64, 48, arena);
  ASSERT_TRUE(fill.has_value());
  ASSERT_TRUE(fill->run(const_view(edges), view(edges)).has_value());
  EXPECT_EQ(test::differing(edges, expected), 0);
}

TEST(ContourFill, HoleOfTheLimitIsFilledAndOneLargerStays) {
  cv::Mat_<std::uint8_t> edges(8, 20, std::uint8_t{0});
  cv::rectangle(edges, {1, 1, 5, 4}, 255);  // hole 3 x 2
  cv::rectangle(edges, {9, 1, 9, 3}, 255);  // hole 7 x 1
  const cv::Mat_<std::uint8_t> filled = filled_of(edges, 6);
  EXPECT_EQ(cv::countNonZero(filled(cv::Rect(2, 2, 3, 2))), 6);
  EXPECT_EQ(cv::countNonZero(filled(cv::Rect(10, 2, 7, 1))), 0);
  EXPECT_EQ(test::differing(filled_of(edges, 0), edges), 0);
}

TEST(ContourFill, AreaAtTheBorderIsFilledUpToItsOwnLimit) {
  cv::Mat_<std::uint8_t> edges(10, 20, std::uint8_t{0});
  cv::rectangle(edges, {-1, 2, 5, 5}, 255);  // cut by the picture, 3 x 3 inside
  cv::rectangle(edges, {9, 2, 5, 5}, 255);   // a hole of 3 x 3
  for (const int limit : {8, 9}) {
    Arena arena;
    auto fill = ContourFill::create({.max_hole_px = 0, .max_border_px = limit}, 20, 10, arena);
    ASSERT_TRUE(fill.has_value());
    cv::Mat_<std::uint8_t> filled(edges.size());
    ASSERT_TRUE(fill->run(const_view(edges), view(filled)).has_value());
    EXPECT_EQ(cv::countNonZero(filled) - cv::countNonZero(edges), limit == 9 ? 9 : 0);
    EXPECT_EQ(filled(4, 1), limit == 9 ? 255 : 0);
    EXPECT_EQ(filled(9, 19), 0);
  }
}

TEST(ContourFill, OtherSizeIsAFaultAndLeavesTheOutput) {
  Arena arena;
  auto fill = ContourFill::create({}, 8, 6, arena);
  ASSERT_TRUE(fill.has_value());
  cv::Mat_<std::uint8_t> in(6, 8, std::uint8_t{1});
  cv::Mat_<std::uint8_t> wrong(7, 8, std::uint8_t{9});
  EXPECT_EQ(fill->run(const_view(in), view(wrong)).error(), Fault::kBadSize);
  EXPECT_EQ(cv::countNonZero(wrong != 9), 0);
}

TEST(ContourFill, BadConfigurationIsRefused) {
  Arena arena;
  EXPECT_EQ(ContourFill::create({}, 0, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(ContourFill::create({.max_hole_px = -1}, 6, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(ContourFill::create({.max_border_px = -1}, 6, 6, arena).error(), Fault::kBadConfig);
  arena.seal();
  EXPECT_EQ(ContourFill::create({}, 6, 6, arena).error(), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
