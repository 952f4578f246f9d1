#include "pipeline/photometry/ingest.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "pipeline/photometry/colour.hpp"
#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

using Plane = cv::Mat_<std::uint8_t>;

ImageView<std::uint8_t> view(Plane& mat) {
  return {mat.data, mat.cols, mat.rows, static_cast<std::ptrdiff_t>(mat.step1())};
}

Picture picture_of(const cv::Mat& memory, int height, PixelFormat format) {
  return {memory.data, memory.cols, height, static_cast<std::ptrdiff_t>(memory.step), format};
}

void ingest(const Picture& in, const IngestPlanes& out, Histogram* histogram) {
  Arena arena;
  Result<Ingest> stage = Ingest::create(std::max(in.width, 1), arena);
  ASSERT_TRUE(stage.has_value());
  stage->run(in, out, histogram);
}

struct Planes {
  Plane y, cb, cr;
  Histogram histogram{};
};

Planes planes_of(const Picture& picture) {
  const cv::Size size(picture.width, picture.height);
  Planes out{Plane(size), Plane(size), Plane(size)};
  ingest(picture, {view(out.y), view(out.cb), view(out.cr)}, &out.histogram);
  return out;
}
Planes planes_of(const cv::Mat& bgr) { return planes_of(picture_of(bgr, bgr.rows, PixelFormat::kBgr8)); }

int differing(const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a != b); }

cv::Mat channel(const cv::Mat& from, int index) {
  cv::Mat to;
  cv::extractChannel(from, to, index);
  return to;
}

TEST(Ingest, LumaOfPrimariesByHand) {
  // (3.1): 0.299 255 = 76.2, 0.587 255 = 149.7, 0.114 255 = 29.1
  EXPECT_EQ(luma(0, 0, 255), 76);
  EXPECT_EQ(luma(0, 255, 0), 150);
  EXPECT_EQ(luma(255, 0, 0), 29);
  for (int v = 0; v < 256; ++v) EXPECT_EQ(luma(v, v, v), v);
}

TEST(Ingest, ChromaOfPrimariesByHand) {
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

TEST(Ingest, EveryColourIsOpencvsYCrCbBitForBit) {
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
    off_gray += differing(ours.y, theirs_gray);
    ASSERT_LE(cv::norm(ours.y, theirs_gray, cv::NORM_INF), 1.0) << "blue " << b;
    ASSERT_EQ(differing(ours.y, channel(theirs, 0)), 0) << "luma, blue " << b;
    ASSERT_EQ(differing(ours.cr, channel(theirs, 1)), 0) << "red difference, blue " << b;
    ASSERT_EQ(differing(ours.cb, channel(theirs, 2)), 0) << "blue difference, blue " << b;
  }
  // COLOR_BGR2GRAY has weights of 15 bits in OpenCV 4: one level apart where they round the other way.
  EXPECT_LT(off_gray, 256 * 256 * 256 * 3 / 1000);
}

TEST(Ingest, OddSizesAndPaddedRowsOfBgrAgreeWithOpencv) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 7), cv::Size(33, 5), cv::Size(64, 3)}) {
    cv::Mat wide(size.height, size.width + 5, CV_8UC3);
    cv::RNG(11).fill(wide, cv::RNG::UNIFORM, 0, 256);
    const cv::Mat part = wide.colRange(2, 2 + size.width);
    cv::Mat expected;
    cv::cvtColor(part, expected, cv::COLOR_BGR2YCrCb);
    const Planes ours = planes_of(part);
    EXPECT_EQ(differing(ours.y, channel(expected, 0)), 0) << size;
    EXPECT_EQ(differing(ours.cr, channel(expected, 1)), 0) << size;
    EXPECT_EQ(differing(ours.cb, channel(expected, 2)), 0) << size;
  }
}

TEST(Ingest, GreySourceIsCopied) {
  Plane wide(9, 20);
  cv::RNG(12).fill(wide, cv::RNG::UNIFORM, 0, 256);
  const Plane part = wide.colRange(3, 16);
  Planes out{Plane(part.size()), Plane(part.size(), std::uint8_t{77}), Plane(part.size(), std::uint8_t{77})};
  ingest(picture_of(part, part.rows, PixelFormat::kGrey8), {view(out.y), view(out.cb), view(out.cr)}, nullptr);
  EXPECT_EQ(differing(out.y, part), 0);
  EXPECT_EQ(cv::countNonZero(out.cb != 77) + cv::countNonZero(out.cr != 77), 0);
}

// Luma as OpenCV takes it from the same bytes; each pair's chroma for both of its pixels, as cv::resize repeats it.
TEST(Ingest, PackedPicturesAgreeWithOpencv) {
  for (const cv::Size size : {cv::Size(2, 1), cv::Size(2, 7), cv::Size(34, 5), cv::Size(130, 3), cv::Size(640, 4)}) {
    cv::Mat wide(size.height, size.width + 6, CV_8UC2);
    cv::RNG(13).fill(wide, cv::RNG::UNIFORM, 0, 256);
    const cv::Mat part = wide.colRange(2, 2 + size.width);
    for (const PixelFormat format : {PixelFormat::kYuyv, PixelFormat::kUyvy}) {
      const bool luma_first = format == PixelFormat::kYuyv;
      cv::Mat expected_y;
      cv::cvtColor(part, expected_y, luma_first ? cv::COLOR_YUV2GRAY_YUYV : cv::COLOR_YUV2GRAY_UYVY);
      const cv::Mat pairs = channel(part, luma_first ? 1 : 0).reshape(2);  // Cb Cr, half as wide
      cv::Mat chroma;
      cv::resize(pairs, chroma, size, 0, 0, cv::INTER_NEAREST);
      test::on_each_target([&] {
        const Planes ours = planes_of(picture_of(part, part.rows, format));
        EXPECT_EQ(differing(ours.y, expected_y), 0) << size;
        EXPECT_EQ(differing(ours.cb, channel(chroma, 0)), 0) << size;
        EXPECT_EQ(differing(ours.cr, channel(chroma, 1)), 0) << size;
      });
    }
  }
}

TEST(Ingest, Nv12PicturesAgreeWithOpencv) {
  for (const cv::Size size : {cv::Size(2, 2), cv::Size(34, 6), cv::Size(130, 4), cv::Size(640, 4)}) {
    Plane wide(size.height * 3 / 2, size.width + 6);
    cv::RNG(14).fill(wide, cv::RNG::UNIFORM, 0, 256);
    const Plane part = wide.colRange(2, 2 + size.width);
    cv::Mat expected_y;
    cv::cvtColor(part, expected_y, cv::COLOR_YUV2GRAY_NV12);
    cv::Mat chroma;
    cv::resize(cv::Mat(part.rowRange(size.height, part.rows).clone()).reshape(2), chroma, size, 0, 0,
               cv::INTER_NEAREST);
    test::on_each_target([&] {
      const Planes ours = planes_of(picture_of(part, size.height, PixelFormat::kNv12));
      EXPECT_EQ(differing(ours.y, expected_y), 0) << size;
      EXPECT_EQ(differing(ours.cb, channel(chroma, 0)), 0) << size;
      EXPECT_EQ(differing(ours.cr, channel(chroma, 1)), 0) << size;
    });
  }
}

// What kBgr8 gives, packed, is unpacked again: the formats mean the same.
TEST(Ingest, PackedPlanesOfBgrAreThoseOfBgr) {
  cv::Mat bgr(8, 64, CV_8UC3);
  cv::RNG(15).fill(bgr, cv::RNG::UNIFORM, 0, 256);
  cv::resize(bgr.clone().colRange(0, 32), bgr, bgr.size(), 0, 0, cv::INTER_NEAREST);  // pairs of one colour
  const Planes expected = planes_of(bgr);
  cv::Mat yuyv(bgr.size(), CV_8UC2);
  for (int y = 0; y < bgr.rows; ++y) {
    for (int x = 0; x < bgr.cols; ++x) {
      yuyv.at<cv::Vec2b>(y, x) = {expected.y(y, x), x % 2 == 0 ? expected.cb(y, x) : expected.cr(y, x)};
    }
  }
  const Planes got = planes_of(picture_of(yuyv, yuyv.rows, PixelFormat::kYuyv));
  EXPECT_EQ(differing(got.y, expected.y), 0);
  EXPECT_EQ(differing(got.cb, expected.cb), 0);
  EXPECT_EQ(differing(got.cr, expected.cr), 0);
}

TEST(Ingest, HistogramIsThatOfTheLumaPlaneForEachFormat) {
  cv::Mat memory(12, 38 * 3, CV_8UC1);
  cv::RNG(16).fill(memory, cv::RNG::UNIFORM, 0, 256);
  for (const PixelFormat format :
       {PixelFormat::kGrey8, PixelFormat::kBgr8, PixelFormat::kYuyv, PixelFormat::kUyvy, PixelFormat::kNv12}) {
    const Planes ours = planes_of({memory.data, 38, 8, static_cast<std::ptrdiff_t>(memory.step), format});
    Histogram expected{};
    for (const std::uint8_t pixel : ours.y) ++expected[pixel];
    EXPECT_EQ(ours.histogram, expected) << static_cast<int>(format);
  }
}

TEST(Ingest, EmptyPictureIsNoWork) {
  Histogram histogram;
  histogram.fill(77);
  ingest({}, {}, &histogram);
  EXPECT_EQ(histogram, Histogram{});
}

}  // namespace
}  // namespace stereotrack
