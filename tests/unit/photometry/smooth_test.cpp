#include "pipeline/photometry/smooth.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace stereotrack {
namespace {

cv::Mat_<std::uint8_t> smoothed(cv::Mat_<std::uint8_t> in) {
  cv::Mat_<std::uint8_t> out(in.size(), std::uint8_t{0});
  smooth3x3(ImageView<const std::uint8_t>{in[0], in.cols, in.rows, static_cast<std::ptrdiff_t>(in.step1())},
            {out[0], out.cols, out.rows, static_cast<std::ptrdiff_t>(out.step1())});
  return out;
}

cv::Mat_<std::uint8_t> naive(const cv::Mat_<std::uint8_t>& in) {
  cv::Mat_<std::uint8_t> out(in.size());
  for (int y = 0; y < in.rows; ++y) {
    for (int x = 0; x < in.cols; ++x) {
      int sum = 8;
      for (int v = -1; v <= 1; ++v) {
        for (int u = -1; u <= 1; ++u) {
          sum += (2 - std::abs(u)) * (2 - std::abs(v)) *
                 in(std::clamp(y + v, 0, in.rows - 1), std::clamp(x + u, 0, in.cols - 1));
        }
      }
      out(y, x) = static_cast<std::uint8_t>(sum / 16);
    }
  }
  return out;
}

TEST(Smooth, PointSpreadsAsBinomialWeights) {
  cv::Mat_<std::uint8_t> point(5, 5, std::uint8_t{0});
  point(2, 2) = 160;
  const cv::Mat_<std::uint8_t> expected = (cv::Mat_<std::uint8_t>(5, 5) << 0, 0, 0, 0, 0,  //
                                           0, 10, 20, 10, 0,                               //
                                           0, 20, 40, 20, 0,                               //
                                           0, 10, 20, 10, 0,                               //
                                           0, 0, 0, 0, 0);
  EXPECT_EQ(cv::countNonZero(smoothed(point) != expected), 0);
}

TEST(Smooth, AgreesWithTheNaiveSumAndWithOpencvAtAllSizes) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 8), cv::Size(8, 1), cv::Size(2, 2), cv::Size(3, 3),
                              cv::Size(63, 17), cv::Size(64, 16), cv::Size(65, 15)}) {
    cv::Mat_<std::uint8_t> in(size);
    cv::RNG(static_cast<std::uint64_t>(size.area())).fill(in, cv::RNG::UNIFORM, 0, 256);
    cv::Mat theirs;
    cv::GaussianBlur(in, theirs, {3, 3}, 0, 0, cv::BORDER_REPLICATE);
    EXPECT_EQ(cv::countNonZero(smoothed(in) != naive(in)), 0) << size;
    EXPECT_EQ(cv::countNonZero(smoothed(in) != theirs), 0) << size;
  }
}

TEST(Smooth, EvenPictureStaysAsItIs) {
  for (int v : {0, 1, 127, 255}) {
    const cv::Mat_<std::uint8_t> even(4, 6, static_cast<std::uint8_t>(v));
    EXPECT_EQ(cv::countNonZero(smoothed(even) != v), 0);
  }
}

TEST(Smooth, WhiteNoiseLeavesWithThreeEighths) {
  cv::Mat_<std::uint8_t> noise(512, 512);
  cv::RNG(1).fill(noise, cv::RNG::NORMAL, 128, 20);
  cv::Scalar mean;
  cv::Scalar before;
  cv::Scalar after;
  cv::meanStdDev(noise, mean, before);
  cv::meanStdDev(smoothed(noise), mean, after);
  EXPECT_NEAR(after[0] / before[0], 0.375, 0.006);
}

}  // namespace
}  // namespace stereotrack
