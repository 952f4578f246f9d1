#include "pipeline/shape/blob_extractor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/unit/shape/pictures.hpp"

namespace stereotrack {
namespace {

using test::const_view;
using test::edge_like;
using test::salt;

BlobExtractor make(Arena& arena, const cv::Mat& mask, const BlobExtractor::Config& config) {
  auto extractor = BlobExtractor::create(config, mask.cols, mask.rows, arena);
  EXPECT_TRUE(extractor.has_value());
  return *extractor;
}

BlobSet run(BlobExtractor& extractor, cv::Mat_<std::uint8_t>& mask) {
  auto blobs = extractor.run(const_view(mask));
  EXPECT_TRUE(blobs.has_value());
  return *blobs;
}

// A set pixel in every second column of every second row: each a component of its own.
cv::Mat_<std::uint8_t> dots(int columns, int rows) {
  cv::Mat_<std::uint8_t> mask(2 * rows, 2 * columns, std::uint8_t{0});
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) mask(2 * y, 2 * x) = 255;
  }
  return mask;
}

TEST(BlobExtractor, TwoBlobsByHand) {
  cv::Mat_<std::uint8_t> mask = (cv::Mat_<std::uint8_t>(4, 6) << 0, 0, 0, 0, 0, 9,  //
                                 0, 9, 0, 0, 9, 0,                                  //
                                 0, 9, 9, 0, 0, 0,                                  //
                                 0, 0, 0, 0, 0, 0);
  Arena arena;
  BlobExtractor extractor = make(arena, mask, {});
  const BlobSet set = run(extractor, mask);
  ASSERT_EQ(set.blobs.size(), 2U);
  EXPECT_EQ(set.blobs[0].label, 1);
  EXPECT_EQ(set.blobs[0].area, 2);
  EXPECT_EQ(set.blobs[0].box, (Rect{4, 0, 2, 2}));
  EXPECT_EQ(set.blobs[0].first, (Point{5, 0}));
  EXPECT_EQ(set.blobs[0].sides, kTopSide | kRightSide);
  EXPECT_DOUBLE_EQ(set.blobs[0].center_x, 4.5);
  EXPECT_DOUBLE_EQ(set.blobs[0].center_y, 0.5);
  EXPECT_EQ(set.blobs[1].area, 3);
  EXPECT_EQ(set.blobs[1].box, (Rect{1, 1, 2, 2}));
  EXPECT_EQ(set.blobs[1].sides, 0);
  EXPECT_DOUBLE_EQ(set.blobs[1].center_x, 4.0 / 3.0);
  EXPECT_DOUBLE_EQ(set.blobs[1].center_y, 5.0 / 3.0);
  EXPECT_EQ(set.labels.at(5, 0), 1);
  EXPECT_EQ(set.labels.at(2, 2), 2);
  EXPECT_EQ(set.labels.at(0, 0), 0);
}

void expect_equal_to_opencv(cv::Mat_<std::uint8_t>& mask) {
  cv::Mat_<std::int32_t> labels;
  cv::Mat_<std::int32_t> stats;
  cv::Mat_<double> centers;
  const int theirs = cv::connectedComponentsWithStats(mask, labels, stats, centers, 8, CV_32S);
  Arena arena;
  BlobExtractor extractor = make(arena, mask, {.max_runs = mask.rows * mask.cols, .max_blobs = 65535});
  const BlobSet set = run(extractor, mask);
  ASSERT_EQ(static_cast<int>(set.blobs.size()), theirs - 1);
  EXPECT_EQ(set.small + set.dropped_blobs + set.dropped_runs, 0);
  std::vector<int> their_label(set.blobs.size() + 1, 0);
  for (const Blob& blob : set.blobs) {
    const int label = labels(blob.first.y, blob.first.x);
    their_label[blob.label] = label;
    ASSERT_GT(label, 0);
    EXPECT_EQ(blob.area, stats(label, cv::CC_STAT_AREA));
    EXPECT_EQ(blob.box, (Rect{stats(label, cv::CC_STAT_LEFT), stats(label, cv::CC_STAT_TOP),
                              stats(label, cv::CC_STAT_WIDTH), stats(label, cv::CC_STAT_HEIGHT)}));
    EXPECT_NEAR(blob.center_x, centers(label, 0), 1e-9);
    EXPECT_NEAR(blob.center_y, centers(label, 1), 1e-9);
  }
  int wrong = 0;
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) wrong += their_label[set.labels.at(x, y)] != labels(y, x);
  }
  EXPECT_EQ(wrong, 0);
  for (std::size_t i = 1; i < set.blobs.size(); ++i) {
    const Point& a = set.blobs[i - 1].first;
    const Point& b = set.blobs[i].first;
    EXPECT_TRUE(a.y < b.y || (a.y == b.y && a.x < b.x));
  }
}

TEST(BlobExtractor, EqualsOpenCvOnNoiseOfAnyDensity) {
  for (int percent = 0; percent <= 100; percent += 10) {
    cv::Mat_<std::uint8_t> mask = salt(83, 61, percent / 100.0, static_cast<std::uint64_t>(percent) + 3);
    SCOPED_TRACE(percent);
    expect_equal_to_opencv(mask);
  }
}

TEST(BlobExtractor, EqualsOpenCvOnEdgeLikePictures) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    cv::Mat_<std::uint8_t> mask = edge_like(97, 71, seed);
    SCOPED_TRACE(seed);
    expect_equal_to_opencv(mask);
  }
}

TEST(BlobExtractor, EqualsOpenCvAtManySizes) {
  for (const cv::Size size :
       {cv::Size(1, 1), cv::Size(1, 9), cv::Size(9, 1), cv::Size(15, 8), cv::Size(16, 8), cv::Size(17, 8)}) {
    cv::Mat_<std::uint8_t> mask = salt(size.width, size.height, 0.5, 2);
    SCOPED_TRACE(size.width);
    expect_equal_to_opencv(mask);
  }
}

TEST(BlobExtractor, AllSetIsOneBlobOnFourSides) {
  cv::Mat_<std::uint8_t> mask(5, 7, std::uint8_t{255});
  Arena arena;
  BlobExtractor extractor = make(arena, mask, {});
  const BlobSet set = run(extractor, mask);
  ASSERT_EQ(set.blobs.size(), 1U);
  EXPECT_EQ(set.blobs[0].area, 35);
  EXPECT_EQ(set.blobs[0].sides, kLeftSide | kTopSide | kRightSide | kBottomSide);
}

TEST(BlobExtractor, NoneSetIsNoBlobAndForgetsTheLastPicture) {
  cv::Mat_<std::uint8_t> mask(5, 7, std::uint8_t{255});
  Arena arena;
  BlobExtractor extractor = make(arena, mask, {});
  EXPECT_EQ(run(extractor, mask).blobs.size(), 1U);
  mask.setTo(0);
  const BlobSet set = run(extractor, mask);
  EXPECT_TRUE(set.blobs.empty());
  EXPECT_EQ(set.labels.at(3, 3), 0);
}

TEST(BlobExtractor, CapacityOfBlobsHoldsAndOneMoreDropsTheSmallest) {
  cv::Mat_<std::uint8_t> mask = dots(4, 3);
  Arena arena;
  BlobExtractor fits = make(arena, mask, {.max_blobs = 12});
  EXPECT_EQ(run(fits, mask).blobs.size(), 12U);
  EXPECT_EQ(run(fits, mask).dropped_blobs, 0);

  mask(4, 7) = 255;  // the last dot grows: it stays, and of the equals the last one goes
  BlobExtractor tight = make(arena, mask, {.max_blobs = 11});
  const BlobSet set = run(tight, mask);
  ASSERT_EQ(set.blobs.size(), 11U);
  EXPECT_EQ(set.dropped_blobs, 1);
  EXPECT_EQ(set.blobs[10].area, 2);
  EXPECT_EQ(set.labels.at(6, 4), 11);
  EXPECT_EQ(set.labels.at(4, 4), 0);
  EXPECT_EQ(set.labels.at(2, 4), 10);
}

TEST(BlobExtractor, CapacityOfRunsHoldsAndOneMoreDropsTheRest) {
  cv::Mat_<std::uint8_t> mask = dots(4, 3);
  Arena arena;
  BlobExtractor fits = make(arena, mask, {.max_runs = 12});
  EXPECT_EQ(run(fits, mask).dropped_runs, 0);
  EXPECT_EQ(run(fits, mask).blobs.size(), 12U);
  BlobExtractor tight = make(arena, mask, {.max_runs = 9});
  const BlobSet set = run(tight, mask);
  EXPECT_EQ(set.dropped_runs, 3);
  ASSERT_EQ(set.blobs.size(), 9U);
  EXPECT_EQ(set.blobs[8].first, (Point{0, 4}));
  EXPECT_EQ(set.labels.at(2, 4), 0);
}

TEST(BlobExtractor, SmallComponentsAreCountedApartFromDroppedOnes) {
  cv::Mat_<std::uint8_t> mask = dots(3, 1);
  mask(1, 0) = 255;
  Arena arena;
  BlobExtractor extractor = make(arena, mask, {.max_blobs = 1, .min_area_px = 2});
  const BlobSet set = run(extractor, mask);
  ASSERT_EQ(set.blobs.size(), 1U);
  EXPECT_EQ(set.blobs[0].area, 2);
  EXPECT_EQ(set.small, 2);
  EXPECT_EQ(set.dropped_blobs, 0);
  EXPECT_EQ(set.labels.at(2, 0), 0);
}

TEST(BlobExtractor, OrderByAreaPutsTheLargestFirstAndEqualsInRasterOrder) {
  cv::Mat_<std::uint8_t> mask = dots(4, 1);
  mask(1, 4) = 255;
  Arena arena;
  BlobExtractor extractor = make(arena, mask, {.order = BlobExtractor::Order::kArea});
  const BlobSet set = run(extractor, mask);
  ASSERT_EQ(set.blobs.size(), 4U);
  EXPECT_EQ(set.blobs[0].first, (Point{4, 0}));
  EXPECT_EQ(set.blobs[1].first, (Point{0, 0}));
  EXPECT_EQ(set.blobs[2].first, (Point{2, 0}));
  EXPECT_EQ(set.blobs[3].first, (Point{6, 0}));
  EXPECT_EQ(set.labels.at(4, 1), 1);
}

TEST(BlobExtractor, OtherSizeIsAFault) {
  Arena arena;
  cv::Mat_<std::uint8_t> mask(5, 7, std::uint8_t{255});
  BlobExtractor extractor = make(arena, mask, {});
  cv::Mat_<std::uint8_t> wrong(5, 8, std::uint8_t{255});
  EXPECT_EQ(extractor.run(const_view(wrong)).error(), Fault::kBadSize);
}

TEST(BlobExtractor, BadConfigurationIsRefused) {
  Arena arena;
  EXPECT_EQ(BlobExtractor::create({}, 0, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(BlobExtractor::create({.max_runs = 0}, 6, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(BlobExtractor::create({.max_blobs = 0}, 6, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(BlobExtractor::create({.max_blobs = 65536}, 6, 6, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(BlobExtractor::create({.min_area_px = -1}, 6, 6, arena).error(), Fault::kBadConfig);
  arena.seal();
  EXPECT_EQ(BlobExtractor::create({}, 6, 6, arena).error(), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
