#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <vector>

#include "pipeline/photometry/chroma.hpp"
#include "pipeline/photometry/gray.hpp"

namespace stereotrack {
namespace {

template <class T>
ImageView<T> view(cv::Mat_<T>& mat) {
  return {reinterpret_cast<T*>(mat.data), mat.cols, mat.rows, static_cast<std::ptrdiff_t>(mat.step1())};
}

Picture colour_picture(const cv::Mat& bgr) {
  return {bgr.data, bgr.cols, bgr.rows, static_cast<std::ptrdiff_t>(bgr.step), PixelFormat::kBgr8};
}

struct Planes {
  cv::Mat_<std::uint8_t> y, cb, cr;
};

Planes planes_of(const cv::Mat& bgr) {
  Planes out{cv::Mat_<std::uint8_t>(bgr.size()), cv::Mat_<std::uint8_t>(bgr.size()),
             cv::Mat_<std::uint8_t>(bgr.size())};
  gray(colour_picture(bgr), view(out.y));
  chroma(colour_picture(bgr), view(out.y), view(out.cb), view(out.cr));
  return out;
}

int differing(const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a != b); }

TEST(Gray, PrimariesByHand) {
  // (3.1): 0.299 255 = 76.2, 0.587 255 = 149.7, 0.114 255 = 29.1
  EXPECT_EQ(luma(0, 0, 255), 76);
  EXPECT_EQ(luma(0, 255, 0), 150);
  EXPECT_EQ(luma(255, 0, 0), 29);
  for (int v = 0; v < 256; ++v) EXPECT_EQ(luma(v, v, v), v);
}

TEST(Chroma, PrimariesByHand) {
  // (3.18), (3.19) with the standard's B and R: pure blue (255 - 29) 0.564 + 128 = 255.5, clamped;
  // its red difference (0 - 29) 0.713 + 128 = 107.3.
  EXPECT_EQ(chroma_blue(255, 29), 255);
  EXPECT_EQ(chroma_red(0, 29), 107);
  // pure red: (255 - 76) 0.713 + 128 = 255.6; (0 - 76) 0.564 + 128 = 85.1
  EXPECT_EQ(chroma_red(255, 76), 255);
  EXPECT_EQ(chroma_blue(0, 76), 85);
  for (int v = 0; v < 256; ++v) {
    EXPECT_EQ(chroma_blue(v, v), 128);
    EXPECT_EQ(chroma_red(v, v), 128);
  }
}

TEST(GrayAndChroma, EveryColourIsOpencvsYCrCbBitForBit) {
  cv::Mat_<cv::Vec3b> bgr(256, 256);
  std::int64_t off_gray = 0;
  for (int b = 0; b < 256; ++b) {
    for (int g = 0; g < 256; ++g) {
      for (int r = 0; r < 256; ++r) {
        bgr(g, r) = {static_cast<std::uint8_t>(b), static_cast<std::uint8_t>(g), static_cast<std::uint8_t>(r)};
      }
    }
    const Planes ours = planes_of(bgr);
    cv::Mat theirs_gray;
    cv::Mat theirs;
    cv::cvtColor(bgr, theirs_gray, cv::COLOR_BGR2GRAY);
    cv::cvtColor(bgr, theirs, cv::COLOR_BGR2YCrCb);
    std::vector<cv::Mat> channels;
    cv::split(theirs, channels);
    off_gray += differing(ours.y, theirs_gray);
    ASSERT_LE(cv::norm(ours.y, theirs_gray, cv::NORM_INF), 1.0) << "blue " << b;
    ASSERT_EQ(differing(ours.y, channels[0]), 0) << "luma, blue " << b;
    ASSERT_EQ(differing(ours.cr, channels[1]), 0) << "red difference, blue " << b;
    ASSERT_EQ(differing(ours.cb, channels[2]), 0) << "blue difference, blue " << b;
  }
  // COLOR_BGR2GRAY has weights of 15 bits in OpenCV 4: one level apart where they round the other way.
  EXPECT_LT(off_gray, 256 * 256 * 256 * 3 / 1000);
}

TEST(Gray, OddSizesAndPaddedRowsAgreeWithOpencv) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 7), cv::Size(33, 5), cv::Size(64, 3)}) {
    cv::Mat wide(size.height, size.width + 5, CV_8UC3);
    cv::RNG(11).fill(wide, cv::RNG::UNIFORM, 0, 256);
    const cv::Mat part = wide.colRange(2, 2 + size.width);
    cv::Mat expected;
    cv::Mat expected_y;
    cv::cvtColor(part, expected, cv::COLOR_BGR2YCrCb);
    cv::extractChannel(expected, expected_y, 0);
    EXPECT_EQ(differing(planes_of(part).y, expected_y), 0) << size;
  }
}

TEST(Gray, GreySourceIsCopied) {
  cv::Mat_<std::uint8_t> wide(9, 20);
  cv::RNG(12).fill(wide, cv::RNG::UNIFORM, 0, 256);
  const cv::Mat part = wide.colRange(3, 16);
  cv::Mat_<std::uint8_t> out(part.size(), std::uint8_t{0});
  gray({part.data, part.cols, part.rows, static_cast<std::ptrdiff_t>(part.step), PixelFormat::kGrey8}, view(out));
  EXPECT_EQ(differing(out, part), 0);
}

TEST(Gray, EmptyPictureIsNoWork) {
  const ImageView<std::uint8_t> none;
  gray({}, none);
  chroma({}, none, none, none);
}

}  // namespace
}  // namespace stereotrack
