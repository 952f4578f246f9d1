#include "pipeline/shape/convex_hull.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/unit/shape/pictures.hpp"

namespace stereotrack {
namespace {

using test::const_view;
using test::view;

Hull hull_of(cv::Mat_<std::uint16_t>& labels, std::uint16_t label = 1, int max_vertices = 48) {
  Arena arena;
  auto stage = ConvexHull::create({max_vertices}, labels.cols, labels.rows, arena);
  EXPECT_TRUE(stage.has_value());
  const auto hull = stage->run(const_view(labels), {0, 0, labels.cols, labels.rows}, label);
  EXPECT_TRUE(hull.has_value());
  return *hull;
}

std::vector<cv::Point> pixels_of(const cv::Mat_<std::uint16_t>& labels, int label = 1) {
  std::vector<cv::Point> points;
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      if (labels(y, x) == label) points.emplace_back(x, y);
    }
  }
  return points;
}

std::vector<Point> in_raster_order(std::vector<Point> points) {
  std::sort(points.begin(), points.end(),
            [](const Point& a, const Point& b) { return a.y != b.y ? a.y < b.y : a.x < b.x; });
  return points;
}

std::vector<Point> list(const Hull& hull) { return {hull.begin(), hull.end()}; }

// Twice the area, positive where the polygon runs clockwise on the screen (x right, y down).
long doubled_area(const Hull& hull) {
  long sum = 0;
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Point& p = hull[i];
    const Point& q = hull[(i + 1) % hull.size()];
    sum += static_cast<long>(p.x) * q.y - static_cast<long>(q.x) * p.y;
  }
  return sum;
}

cv::Mat_<std::uint16_t> disc(int radius) {
  cv::Mat_<std::uint16_t> labels(2 * radius + 3, 2 * radius + 3, std::uint16_t{0});
  for (int y = -radius; y <= radius; ++y) {
    for (int x = -radius; x <= radius; ++x) {
      if (x * x + y * y <= radius * radius) labels(y + radius + 1, x + radius + 1) = 1;
    }
  }
  return labels;
}

TEST(ConvexHull, LetterLByHandClockwiseFromTheTop) {
  cv::Mat_<std::uint16_t> labels(6, 7, std::uint16_t{0});
  labels(cv::Rect(1, 1, 1, 4)).setTo(1);
  labels(cv::Rect(1, 4, 4, 1)).setTo(1);
  EXPECT_EQ(list(hull_of(labels)), (std::vector<Point>{{1, 1}, {4, 4}, {1, 4}}));
}

TEST(ConvexHull, PixelAndLinesAreDegenerate) {
  cv::Mat_<std::uint16_t> labels(6, 7, std::uint16_t{0});
  EXPECT_TRUE(hull_of(labels).empty());
  labels(2, 3) = 1;
  EXPECT_EQ(list(hull_of(labels)), (std::vector<Point>{{3, 2}}));
  labels(2, 5) = 1;
  EXPECT_EQ(list(hull_of(labels)), (std::vector<Point>{{3, 2}, {5, 2}}));
  labels.setTo(0);
  for (int i = 1; i < 5; ++i) labels(i, i) = 1;
  EXPECT_EQ(list(hull_of(labels)), (std::vector<Point>{{1, 1}, {4, 4}}));
}

TEST(ConvexHull, EqualsOpenCvOnScatteredPixels) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    cv::RNG rng(seed);
    cv::Mat_<std::uint16_t> labels(41, 53, std::uint16_t{2});
    const int count = rng.uniform(1, 60);
    for (int i = 0; i < count; ++i) labels(rng.uniform(0, 41), rng.uniform(0, 53)) = 1;
    std::vector<cv::Point> theirs;
    cv::convexHull(pixels_of(labels), theirs);
    std::vector<Point> expected;
    expected.reserve(theirs.size());
    for (const cv::Point& p : theirs) expected.push_back({p.x, p.y});
    const Hull ours = hull_of(labels);
    EXPECT_EQ(in_raster_order(list(ours)), in_raster_order(expected)) << "seed " << seed;
    if (ours.size() > 2) {
      EXPECT_GT(doubled_area(ours), 0);
      EXPECT_EQ(doubled_area(ours), std::lround(2 * cv::contourArea(theirs)));
    }
    EXPECT_EQ(ours[0], in_raster_order(expected)[0]);
  }
}

TEST(ConvexHull, BoxLimitsTheRegion) {
  cv::Mat_<std::uint16_t> labels(6, 7, std::uint16_t{1});
  Arena arena;
  auto stage = ConvexHull::create({}, 7, 6, arena);
  ASSERT_TRUE(stage.has_value());
  const auto hull = stage->run(const_view(labels), {4, 3, 50, 50}, 1);
  ASSERT_TRUE(hull.has_value());
  EXPECT_EQ(list(*hull), (std::vector<Point>{{4, 3}, {6, 3}, {6, 5}, {4, 5}}));
}

TEST(ConvexHull, LargeDiscKeepsFortyEightVerticesNearItsRim) {
  for (const int radius : {60, 150, 230}) {
    cv::Mat_<std::uint16_t> labels = disc(radius);
    const Hull hull = hull_of(labels);
    ASSERT_EQ(hull.size(), 48U);
    std::vector<cv::Point> polygon;
    for (const Point& p : hull) polygon.emplace_back(p.x, p.y);
    EXPECT_TRUE(cv::isContourConvex(polygon));
    double outside = 0;
    for (const cv::Point& p : pixels_of(labels)) outside = std::max(outside, -cv::pointPolygonTest(polygon, p, true));
    EXPECT_LT(outside, 0.004 * radius + 0.2) << radius;
  }
}

// The octagon's four short sides have the least triangles at their ends.
TEST(ConvexHull, LeastTriangleGoesFirst) {
  cv::Mat_<std::uint16_t> labels(12, 12, std::uint16_t{0});
  for (const cv::Point p : {cv::Point(0, 0), cv::Point(10, 0), cv::Point(11, 1), cv::Point(11, 11), cv::Point(0, 11)}) {
    labels(p) = 1;
  }
  EXPECT_EQ(list(hull_of(labels, 1, 5)).size(), 5U);
  // Triangles: (10,0) with (0,0) and (11,1): 10 * 1; (11,1) with (10,0) and (11,11): 1 * 10; the first goes.
  EXPECT_EQ(list(hull_of(labels, 1, 4)), (std::vector<Point>{{0, 0}, {11, 1}, {11, 11}, {0, 11}}));
}

TEST(ConvexHull, HullsThatLoseVerticesAreCounted) {
  cv::Mat_<std::uint16_t> small = disc(20);
  cv::Mat_<std::uint16_t> large = disc(150);
  Arena arena;
  auto stage = ConvexHull::create({}, large.cols, large.rows, arena);
  ASSERT_TRUE(stage.has_value());
  cv::Mat_<std::uint16_t> labels(large.size(), std::uint16_t{0});
  small.copyTo(labels(cv::Rect(0, 0, small.cols, small.rows)));
  const Rect all{0, 0, labels.cols, labels.rows};
  ASSERT_TRUE(stage->run(const_view(labels), all, 1).has_value());
  EXPECT_EQ(stage->reduced(), 0U);
  for (const std::uint64_t times : {1U, 2U}) {
    ASSERT_TRUE(stage->run(const_view(large), all, 1).has_value());
    EXPECT_EQ(stage->reduced(), times);
  }
}

TEST(ConvexHull, FaultsAndBadConfiguration) {
  Arena arena;
  EXPECT_EQ(ConvexHull::create({}, 0, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(ConvexHull::create({2}, 6, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(ConvexHull::create({49}, 6, 6, arena).error(), Fault::kBadConfig);
  auto stage = ConvexHull::create({}, 7, 6, arena);
  ASSERT_TRUE(stage.has_value());
  cv::Mat_<std::uint16_t> wrong(7, 7, std::uint16_t{1});
  EXPECT_EQ(stage->run(const_view(wrong), {0, 0, 7, 7}, 1).error(), Fault::kBadSize);
  arena.seal();
  EXPECT_EQ(ConvexHull::create({}, 6, 6, arena).error(), Fault::kOutOfMemory);
}

TEST(HullFill, EqualsPointInPolygonAndIsClipped) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    cv::RNG rng(seed);
    cv::Mat_<std::uint16_t> labels(31, 43, std::uint16_t{0});
    const int count = rng.uniform(1, 25);
    for (int i = 0; i < count; ++i) labels(rng.uniform(0, 31), rng.uniform(0, 43)) = 1;
    Hull hull = hull_of(labels);
    const cv::Point shift(rng.uniform(-20, 20), rng.uniform(-20, 20));
    std::vector<cv::Point> polygon;
    for (Point& p : hull) {
      p = {p.x + shift.x, p.y + shift.y};
      polygon.emplace_back(p.x, p.y);
    }
    cv::Mat_<std::uint8_t> mask(31, 43, std::uint8_t{7});
    hull_fill(hull, view(mask), 200);
    int wrong = 0;
    for (int y = 0; y < 31; ++y) {
      for (int x = 0; x < 43; ++x) {
        const bool inside = cv::pointPolygonTest(polygon, cv::Point2f(cv::Point(x, y)), false) >= 0;
        wrong += mask(y, x) != (inside ? 200 : 7);
      }
    }
    EXPECT_EQ(wrong, 0) << "seed " << seed;
  }
}

TEST(HullFill, EmptyHullFillsNothing) {
  cv::Mat_<std::uint8_t> mask(5, 5, std::uint8_t{0});
  hull_fill({}, view(mask), 255);
  EXPECT_EQ(cv::countNonZero(mask), 0);
}

TEST(HullFill, ClaimLeavesOtherRegions) {
  cv::Mat_<std::uint16_t> labels(6, 6, std::uint16_t{0});
  labels(1, 1) = labels(4, 1) = labels(1, 4) = labels(4, 4) = 3;
  labels(2, 2) = 5;
  hull_claim(hull_of(labels, 3), view(labels), 3);
  EXPECT_EQ(cv::countNonZero(labels == 3), 15);
  EXPECT_EQ(labels(2, 2), 5);
}

}  // namespace
}  // namespace stereotrack
