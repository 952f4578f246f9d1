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

// Four labels are read at a time: against one at a time, at every width and place of a row.
TEST(Region, RunsAreThoseOfPixelByPixel) {
  cv::RNG random(5);
  for (int width = 1; width <= 19; ++width) {
    for (int round = 0; round < 40; ++round) {
      cv::Mat_<std::uint16_t> labels(3, width);
      // Neighbours of the label sought in value, too: a borrow must not pass for it.
      for (std::uint16_t& label : labels) label = static_cast<std::uint16_t>(random.uniform(0, 2 + round % 3));
      const Rect box{random.uniform(-2, width), random.uniform(-1, 2), random.uniform(0, width + 3), 2};
      for (const auto label : std::initializer_list<std::uint16_t>{0, 1, 2, 0xFFFF}) {
        std::vector<Point> expected;
        for (int y = std::max(box.top, 0); y < std::min(box.bottom(), 3); ++y) {
          for (int x = std::max(box.left, 0); x < std::min(box.right(), width); ++x) {
            if (labels(y, x) == label) expected.push_back({x, y});
          }
        }
        std::vector<Point> pixels;
        for_each_pixel(const_view(labels), box, label, [&](int x, int y) { pixels.push_back({x, y}); });
        EXPECT_EQ(pixels, expected) << width;
        std::vector<Point> of_runs;
        int last_y = -1;
        int last_end = -1;
        for_each_run(const_view(labels), box, label, [&](int y, int begin, int end) {
          EXPECT_LT(begin, end);
          EXPECT_TRUE(y != last_y || begin > last_end) << "two runs that touch are one";
          last_y = y;
          last_end = end;
          for (int x = begin; x < end; ++x) of_runs.push_back({x, y});
        });
        EXPECT_EQ(of_runs, expected) << width;
      }
    }
  }
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
