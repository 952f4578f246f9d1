#include "pipeline/shape/region.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/unit/shape/pictures.hpp"

namespace stereotrack {
namespace {

using test::const_view;
using test::view;

std::vector<Point> boundary_of(cv::Mat_<std::uint16_t>& labels, const Rect& box, std::uint16_t label) {
  std::vector<Point> points;
  for_each_boundary_pixel(const_view(labels), box, label, [&](int x, int y) { points.push_back({x, y}); });
  return points;
}

TEST(Region, BoundaryOfASquareIsItsRimInRasterOrder) {
  cv::Mat_<std::uint16_t> labels(6, 6, std::uint16_t{0});
  labels(cv::Rect(1, 1, 3, 3)).setTo(4);
  const std::vector<Point> expected = {{1, 1}, {2, 1}, {3, 1}, {1, 2}, {3, 2}, {1, 3}, {2, 3}, {3, 3}};
  EXPECT_EQ(boundary_of(labels, {1, 1, 3, 3}, 4), expected);
}

TEST(Region, EndOfThePictureIsNoBoundaryButAnotherLabelIs) {
  cv::Mat_<std::uint16_t> labels(3, 4, std::uint16_t{1});
  labels.col(3).setTo(2);
  const std::vector<Point> expected = {{2, 0}, {2, 1}, {2, 2}};
  EXPECT_EQ(boundary_of(labels, {0, 0, 4, 3}, 1), expected);
}

TEST(Region, BoxIsClippedAndLimits) {
  cv::Mat_<std::uint16_t> labels(3, 4, std::uint16_t{1});
  int count = 0;
  for_each_pixel(const_view(labels), {-5, -5, 100, 100}, 1, [&](int, int) { ++count; });
  EXPECT_EQ(count, 12);
  count = 0;
  for_each_pixel(const_view(labels), {1, 1, 2, 1}, 1, [&](int, int) { ++count; });
  EXPECT_EQ(count, 2);
  for_each_pixel(const_view(labels), {9, 9, 2, 2}, 1, [&](int, int) { ++count; });
  EXPECT_EQ(count, 2);
}

TEST(Region, MeasuredAnewEqualsTheExtractor) {
  cv::Mat_<std::uint8_t> mask = test::edge_like(97, 71, 3);
  Arena arena;
  auto extractor = BlobExtractor::create({}, mask.cols, mask.rows, arena);
  ASSERT_TRUE(extractor.has_value());
  const auto set = extractor->run(const_view(mask));
  ASSERT_TRUE(set.has_value());
  ASSERT_GT(set->blobs.size(), 3U);
  for (const Blob& blob : set->blobs) {
    const Blob measured = measure_region(set->labels, {0, 0, 97, 71}, blob.label);
    EXPECT_EQ(measured.area, blob.area);
    EXPECT_EQ(measured.box, blob.box);
    EXPECT_EQ(measured.first, blob.first);
    EXPECT_EQ(measured.sides, blob.sides);
    EXPECT_EQ(measured.center_x, blob.center_x);
    EXPECT_EQ(measured.center_y, blob.center_y);
  }
}

TEST(Region, AbsentLabelMeasuresAsNothing) {
  cv::Mat_<std::uint16_t> labels(3, 4, std::uint16_t{1});
  const Blob blob = measure_region(const_view(labels), {0, 0, 4, 3}, 2);
  EXPECT_EQ(blob.area, 0);
  EXPECT_TRUE(blob.box.empty());
  EXPECT_EQ(blob.sides, 0);
}

TEST(Region, RelabelTouchesOnlyItsOwn) {
  cv::Mat_<std::uint16_t> labels(3, 4, std::uint16_t{1});
  labels.col(3).setTo(2);
  relabel_region(view(labels), {0, 0, 4, 2}, 1, 7);
  EXPECT_EQ(cv::countNonZero(labels == 7), 6);
  EXPECT_EQ(cv::countNonZero(labels == 2), 3);
  EXPECT_EQ(cv::countNonZero(labels == 1), 3);
}

}  // namespace
}  // namespace stereotrack
