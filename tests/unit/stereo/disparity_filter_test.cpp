#include "pipeline/stereo/disparity_filter.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "stereo_pictures.hpp"

namespace stereotrack {
namespace {

using test::view;
using test::writable;

constexpr std::uint16_t kNone = kNoDisparity;
constexpr DisparityFilter::Config kOff{.median = false, .speckle_size = 0, .speckle_step = 0, .fill_px = 0};

cv::Mat filtered(const cv::Mat& in, const DisparityFilter::Config& config, DisparityCounts& counts,
                 const cv::Mat& mask = {}) {
  Arena arena;
  auto filter = DisparityFilter::create(config, in.cols, in.rows, arena);
  EXPECT_TRUE(filter.has_value());
  cv::Mat out(in.size(), CV_16U, cv::Scalar(4321));
  filter->run(view<std::uint16_t>(in), view<std::uint8_t>(mask), writable<std::uint16_t>(out), counts);
  return out;
}

bool equal(const cv::Mat& a, const cv::Mat& b) { return a.size() == b.size() && cv::countNonZero(a != b) == 0; }

TEST(DisparityFilter, AllOffCopies) {
  const cv::Mat in = (cv::Mat_<std::uint16_t>(2, 3) << 1, 2, kNone, 4, kNone, 6);
  DisparityCounts counts;
  EXPECT_TRUE(equal(filtered(in, kOff, counts), in));
  EXPECT_EQ(counts.matched, 4);
}

TEST(DisparityFilter, MedianEqualsOpenCvInside) {
  cv::Mat in;
  test::noise(37, 21, 1).convertTo(in, CV_16U, 7);
  cv::Mat theirs;
  cv::medianBlur(in, theirs, 3);
  DisparityFilter::Config config = kOff;
  config.median = true;
  DisparityCounts counts;
  const cv::Rect inner(1, 1, 35, 19);
  EXPECT_TRUE(equal(filtered(in, config, counts)(inner), theirs(inner)));
}

TEST(DisparityFilter, MedianTakesOnlyNeighboursThatHaveADisparity) {
  const cv::Mat in = (cv::Mat_<std::uint16_t>(3, 3) << kNone, 10, kNone, 30, 99, kNone, kNone, 20, kNone);
  DisparityFilter::Config config = kOff;
  config.median = true;
  DisparityCounts counts;
  const cv::Mat out = filtered(in, config, counts);
  EXPECT_EQ(out.at<std::uint16_t>(1, 1), 30);     // upper median of 10 20 30 99
  EXPECT_EQ(out.at<std::uint16_t>(0, 0), kNone);  // none stays none
  EXPECT_EQ(out.at<std::uint16_t>(0, 1), 30);     // of 10 30 99
}

TEST(DisparityFilter, IslandsUnderTheSizeGo) {
  cv::Mat in(5, 9, CV_16U, cv::Scalar(kNone));
  in(cv::Rect(0, 0, 2, 2)).setTo(100);
  in(cv::Rect(4, 1, 3, 2)).setTo(100);
  in.at<std::uint16_t>(3, 7) = 100;  // touches only by a corner
  in.at<std::uint16_t>(2, 6) = 140;  // more than a step away from its neighbours
  DisparityFilter::Config config = kOff;
  config.speckle_size = 5;
  config.speckle_step = 32;
  DisparityCounts counts;
  const cv::Mat out = filtered(in, config, counts);
  EXPECT_EQ(counts.speckle, 4 + 1 + 1);
  EXPECT_EQ(cv::countNonZero(out == 100), 5);
  EXPECT_EQ(out.at<std::uint16_t>(0, 0), kNone);
}

TEST(DisparityFilter, UShapeIsOneIsland) {
  cv::Mat in(4, 5, CV_16U, cv::Scalar(kNone));
  in.col(0).setTo(7);
  in.col(4).setTo(7);
  in.row(3).setTo(7);
  DisparityFilter::Config config = kOff;
  config.speckle_size = 11;
  DisparityCounts counts;
  EXPECT_TRUE(equal(filtered(in, config, counts), in));
}

TEST(DisparityFilter, NarrowGapTakesTheFartherSide) {
  const cv::Mat in = (cv::Mat_<std::uint16_t>(1, 9) << kNone, 50, kNone, kNone, 20, kNone, kNone, kNone, 60);
  DisparityFilter::Config config = kOff;
  config.fill_px = 2;
  DisparityCounts counts;
  const cv::Mat expected = (cv::Mat_<std::uint16_t>(1, 9) << 50, 50, 20, 20, 20, kNone, kNone, kNone, 60);
  EXPECT_TRUE(equal(filtered(in, config, counts), expected));
  EXPECT_EQ(counts.filled, 3);
  EXPECT_EQ(counts.matched, 6);
}

TEST(DisparityFilter, PixelsThatAreNotWantedStayUntouchedAndEndGaps) {
  const cv::Mat in = (cv::Mat_<std::uint16_t>(1, 5) << 50, kNone, kNone, kNone, 20);
  const cv::Mat mask = (cv::Mat_<std::uint8_t>(1, 5) << 1, 1, 0, 1, 1);
  DisparityFilter::Config config = kOff;
  config.fill_px = 1;
  DisparityCounts counts;
  const cv::Mat expected = (cv::Mat_<std::uint16_t>(1, 5) << 50, 50, 4321, 20, 20);
  EXPECT_TRUE(equal(filtered(in, config, counts, mask), expected));
}

TEST(DisparityFilter, RowWithoutAnyDisparityStaysEmpty) {
  const cv::Mat in(3, 6, CV_16U, cv::Scalar(kNone));
  DisparityCounts counts;
  EXPECT_TRUE(equal(filtered(in, {}, counts), in));
  EXPECT_EQ(counts.matched, 0);
}

TEST(DisparityFilter, BadConfigurationIsRefused) {
  Arena arena;
  EXPECT_EQ(DisparityFilter::create({}, 0, 5, arena).error(), Fault::kBadConfig);
  EXPECT_EQ(DisparityFilter::create({.speckle_step = -1}, 5, 5, arena).error(), Fault::kBadConfig);
  arena.seal();
  EXPECT_EQ(DisparityFilter::create({}, 5, 5, arena).error(), Fault::kOutOfMemory);
}

}  // namespace
}  // namespace stereotrack
