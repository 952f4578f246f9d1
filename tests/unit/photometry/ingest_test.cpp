#include "pipeline/photometry/ingest.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <initializer_list>
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

constexpr auto kAllFormats = [] {
  std::array<PixelFormat, kPixelFormats> all{};
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<PixelFormat>(i);
  return all;
}();

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
  for (const PixelFormat format : kAllFormats) {
    const Planes ours = planes_of({memory.data, 36, 8, static_cast<std::ptrdiff_t>(memory.step), format});
    Histogram expected{};
    for (const std::uint8_t pixel : ours.y) ++expected[pixel];
    EXPECT_EQ(ours.histogram, expected) << static_cast<int>(format);
  }
}

// Samples of 16 bits with random ones above the format's, in rows of odd strides at odd addresses.
TEST(Ingest, GreyWordsAreCutOffToTheirMostSignificantBits) {
  struct Case {
    PixelFormat format;
    int bits;
  };
  for (const Case& one :
       {Case{PixelFormat::kGrey10, 10}, Case{PixelFormat::kGrey12, 12}, Case{PixelFormat::kGrey16, 16}}) {
    for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 7), cv::Size(33, 5), cv::Size(64, 3), cv::Size(641, 2)}) {
      const int stride = 2 * size.width + 3;
      Plane memory(1, stride * size.height + 1);
      cv::RNG(17).fill(memory, cv::RNG::UNIFORM, 0, 256);
      const std::uint8_t* pixels = memory.data + 1;
      Plane expected(size);
      for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
          std::uint16_t word = 0;
          std::memcpy(&word, pixels + y * stride + 2 * x, sizeof word);
          expected(y, x) = static_cast<std::uint8_t>(word % (1 << one.bits) / (1 << (one.bits - 8)));
        }
      }
      test::on_each_target([&] {
        EXPECT_EQ(differing(planes_of({pixels, size.width, size.height, stride, one.format}).y, expected), 0) << size;
      });
    }
  }
}

// Packed here as MIPI CSI-2 says, from samples of 10 and 12 bits.
TEST(Ingest, GreyPackedIsWhatWasPacked) {
  for (const int bits : {10, 12}) {
    const int together = bits == 10 ? 4 : 2;
    for (const cv::Size size : {cv::Size(4, 1), cv::Size(64, 3), cv::Size(132, 5), cv::Size(644, 2)}) {
      cv::Mat_<std::uint16_t> samples(size);
      cv::RNG(18).fill(samples, cv::RNG::UNIFORM, 0, 1 << bits);
      const PixelFormat format = bits == 10 ? PixelFormat::kGrey10Packed : PixelFormat::kGrey12Packed;
      Plane memory(size.height, static_cast<int>(row_bytes(format, size.width)) + 7, std::uint8_t{0});
      Plane expected(size);
      for (int y = 0; y < size.height; ++y) {
        std::uint8_t* to = memory.ptr(y);
        for (int x = 0; x < size.width; x += together) {
          unsigned rest = 0;
          for (int i = 0; i < together; ++i) {
            const std::uint16_t sample = samples(y, x + i);
            *to++ = static_cast<std::uint8_t>(sample >> (bits - 8));
            rest |= (sample & ((1U << (bits - 8)) - 1)) << (i * (bits - 8));
            expected(y, x + i) = static_cast<std::uint8_t>(sample >> (bits - 8));
          }
          *to++ = static_cast<std::uint8_t>(rest);
        }
      }
      test::on_each_target([&] {
        const Picture picture{memory.data, size.width, size.height, static_cast<std::ptrdiff_t>(memory.step), format};
        EXPECT_EQ(differing(planes_of(picture).y, expected), 0) << size << ' ' << bits;
      });
    }
  }
}

TEST(Ingest, SaturatedSamplesAreSaturatedAndNoOthersAre) {
  const auto luma_of = [](PixelFormat format, std::initializer_list<std::uint8_t> bytes) {
    const std::vector<std::uint8_t> memory(bytes);
    return int{planes_of({memory.data(), 1, 1, 8, format}).y(0, 0)};
  };
  EXPECT_EQ(luma_of(PixelFormat::kGrey10, {0xFF, 0x03}), 255);
  EXPECT_EQ(luma_of(PixelFormat::kGrey10, {0xFB, 0x03}), 254) << "1019";
  EXPECT_EQ(luma_of(PixelFormat::kGrey12, {0xFF, 0x0F}), 255);
  EXPECT_EQ(luma_of(PixelFormat::kGrey12, {0xEF, 0x0F}), 254);
  EXPECT_EQ(luma_of(PixelFormat::kGrey16, {0xFF, 0xFF}), 255);
  EXPECT_EQ(luma_of(PixelFormat::kGrey16, {0xFF, 0xFE}), 254);
}

TEST(Ingest, RgbIsBgrInAnotherOrder) {
  cv::Mat bgr(5, 67, CV_8UC3);
  cv::RNG(19).fill(bgr, cv::RNG::UNIFORM, 0, 256);
  cv::Mat rgb;
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  test::on_each_target([&] {
    const Planes expected = planes_of(bgr);
    const Planes got = planes_of(picture_of(rgb, rgb.rows, PixelFormat::kRgb8));
    EXPECT_EQ(differing(got.y, expected.y) + differing(got.cb, expected.cb) + differing(got.cr, expected.cr), 0);
  });
}

// What OpenCV demosaics, but for its outermost pixels, which it takes from those beside them: the same to the bit.
// OpenCV's names tell the square that begins at the second row and column: its BG is RGGB.
TEST(Ingest, MosaicsAgreeWithOpencvWithinTheirBorders) {
  struct Case {
    PixelFormat format;
    int code;
  };
  for (const Case& one : {Case{PixelFormat::kBayerRggb8, cv::COLOR_BayerBG2BGR},
                          {PixelFormat::kBayerGrbg8, cv::COLOR_BayerGB2BGR},
                          {PixelFormat::kBayerGbrg8, cv::COLOR_BayerGR2BGR},
                          {PixelFormat::kBayerBggr8, cv::COLOR_BayerRG2BGR}}) {
    for (const cv::Size size : {cv::Size(4, 4), cv::Size(34, 6), cv::Size(130, 8), cv::Size(640, 10)}) {
      Plane wide(size.height, size.width + 5);
      cv::RNG(20).fill(wide, cv::RNG::UNIFORM, 0, 256);
      const Plane part = wide.colRange(3, 3 + size.width);
      cv::Mat bgr;
      cv::cvtColor(part, bgr, one.code);
      cv::Mat expected;
      cv::cvtColor(bgr, expected, cv::COLOR_BGR2YCrCb);
      const cv::Rect within(1, 1, size.width - 2, size.height - 2);
      test::on_each_target([&] {
        const Planes ours = planes_of(picture_of(part, part.rows, one.format));
        EXPECT_EQ(differing(ours.y(within), channel(expected, 0)(within)), 0) << size << static_cast<int>(one.format);
        EXPECT_EQ(differing(ours.cr(within), channel(expected, 1)(within)), 0) << size;
        EXPECT_EQ(differing(ours.cb(within), channel(expected, 2)(within)), 0) << size;
      });
    }
  }
}

// At the borders the mosaic goes on as in a mirror, and the colours of a picture with such a border are the same.
TEST(Ingest, MosaicsGoOnBeyondTheirBordersAsInAMirror) {
  for (const PixelFormat format :
       {PixelFormat::kBayerRggb8, PixelFormat::kBayerGrbg8, PixelFormat::kBayerGbrg8, PixelFormat::kBayerBggr8}) {
    for (const cv::Size size : {cv::Size(2, 2), cv::Size(2, 8), cv::Size(66, 2), cv::Size(66, 6)}) {
      Plane mosaic(size);
      cv::RNG(21).fill(mosaic, cv::RNG::UNIFORM, 0, 256);
      Plane larger(size + cv::Size(4, 4));
      const auto mirrored = [](int at, int count) { return at < 0 ? -at : at < count ? at : 2 * (count - 1) - at; };
      for (int y = 0; y < larger.rows; ++y) {
        for (int x = 0; x < larger.cols; ++x) {
          // The second line beyond a border is of no consequence.
          larger(y, x) = mosaic(std::clamp(mirrored(y - 2, size.height), 0, size.height - 1),
                                std::clamp(mirrored(x - 2, size.width), 0, size.width - 1));
        }
      }
      const cv::Rect within(cv::Point(2, 2), size);
      test::on_each_target([&] {
        const Planes ours = planes_of(picture_of(mosaic, mosaic.rows, format));
        const Planes expected = planes_of(picture_of(larger, larger.rows, format));
        EXPECT_EQ(differing(ours.y, expected.y(within)), 0) << size;
        EXPECT_EQ(differing(ours.cb, expected.cb(within)), 0) << size;
        EXPECT_EQ(differing(ours.cr, expected.cr(within)), 0) << size;
      });
    }
  }
}

// One colour all over has its own planes, and each pattern its own place for red.
TEST(Ingest, MosaicsOfOneColourAreThatColour) {
  constexpr int kBlue = 30;
  constexpr int kGreen = 90;
  constexpr int kRed = 200;
  const std::array<std::array<int, 4>, 4> squares{{{kRed, kGreen, kGreen, kBlue},
                                                   {kGreen, kRed, kBlue, kGreen},
                                                   {kGreen, kBlue, kRed, kGreen},
                                                   {kBlue, kGreen, kGreen, kRed}}};
  const std::uint8_t y = luma(kBlue, kGreen, kRed);
  for (int pattern = 0; pattern < 4; ++pattern) {
    Plane mosaic(6, 8);
    for (int row = 0; row < mosaic.rows; ++row) {
      for (int column = 0; column < mosaic.cols; ++column) {
        const std::size_t place = static_cast<std::size_t>(row % 2 * 2 + column % 2);
        mosaic(row, column) = static_cast<std::uint8_t>(squares[static_cast<std::size_t>(pattern)][place]);
      }
    }
    const auto format = static_cast<PixelFormat>(static_cast<int>(PixelFormat::kBayerRggb8) + pattern);
    const Planes ours = planes_of(picture_of(mosaic, mosaic.rows, format));
    EXPECT_EQ(cv::countNonZero(ours.y != y), 0) << pattern;
    EXPECT_EQ(cv::countNonZero(ours.cb != chroma_blue(kBlue, y)), 0) << pattern;
    EXPECT_EQ(cv::countNonZero(ours.cr != chroma_red(kRed, y)), 0) << pattern;
  }
}

// A mosaic of 10 bits, in words or packed, is that of its 8 most significant bits.
TEST(Ingest, MosaicsOfTenBitsAreThoseOfTheirEightMostSignificant) {
  for (const cv::Size size : {cv::Size(4, 2), cv::Size(132, 8), cv::Size(640, 4)}) {
    for (int pattern = 0; pattern < 4; ++pattern) {
      const auto format_of = [&](PixelFormat first) {
        return static_cast<PixelFormat>(static_cast<int>(first) + pattern);
      };
      Plane words(size.height, 2 * size.width);
      cv::RNG(22).fill(words, cv::RNG::UNIFORM, 0, 256);
      Plane bytes(size);
      Plane packed(size.height, size.width / 4 * 5, std::uint8_t{0xA5});
      for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
          words(y, 2 * x + 1) &= 3;
          const int sample = words(y, 2 * x) + 256 * words(y, 2 * x + 1);
          bytes(y, x) = packed(y, x / 4 * 5 + x % 4) = static_cast<std::uint8_t>(sample / 4);
        }
      }
      test::on_each_target([&] {
        const Planes expected = planes_of(picture_of(bytes, size.height, format_of(PixelFormat::kBayerRggb8)));
        for (const Picture& picture :
             {Picture{words.data, size.width, size.height, 2 * size.width, format_of(PixelFormat::kBayerRggb10)},
              Picture{packed.data, size.width, size.height, size.width / 4 * 5,
                      format_of(PixelFormat::kBayerRggb10Packed)}}) {
          const Planes got = planes_of(picture);
          EXPECT_EQ(differing(got.y, expected.y) + differing(got.cb, expected.cb) + differing(got.cr, expected.cr), 0)
              << size << ' ' << static_cast<int>(picture.format);
        }
      });
    }
  }
}

// What the right view takes.
TEST(Ingest, LumaAloneIsTheLumaOfColour) {
  cv::Mat memory(12, 36 * 3, CV_8UC1);
  cv::RNG(23).fill(memory, cv::RNG::UNIFORM, 0, 256);
  for (const PixelFormat format : kAllFormats) {
    const Picture picture{memory.data, 36, 8, static_cast<std::ptrdiff_t>(memory.step), format};
    const Planes expected = planes_of(picture);
    test::on_each_target([&] {
      Plane y(8, 36);
      ingest(picture, {view(y), {}, {}}, nullptr);
      EXPECT_EQ(differing(y, expected.y), 0) << static_cast<int>(format);
    });
  }
}

TEST(Ingest, RowsHaveTheBytesOfTheirFormat) {
  // Worked by hand: width 8.
  EXPECT_EQ(row_bytes(PixelFormat::kGrey8, 8), 8U);
  EXPECT_EQ(row_bytes(PixelFormat::kBgr8, 8), 24U);
  EXPECT_EQ(row_bytes(PixelFormat::kRgb8, 8), 24U);
  EXPECT_EQ(row_bytes(PixelFormat::kYuyv, 8), 16U);
  EXPECT_EQ(row_bytes(PixelFormat::kNv12, 8), 8U);
  EXPECT_EQ(row_bytes(PixelFormat::kGrey12, 8), 16U);
  EXPECT_EQ(row_bytes(PixelFormat::kGrey10Packed, 8), 10U);
  EXPECT_EQ(row_bytes(PixelFormat::kGrey12Packed, 8), 12U);
  EXPECT_EQ(row_bytes(PixelFormat::kBayerGbrg8, 8), 8U);
  EXPECT_EQ(row_bytes(PixelFormat::kBayerBggr10, 8), 16U);
  EXPECT_EQ(row_bytes(PixelFormat::kBayerBggr10Packed, 8), 10U);
  EXPECT_EQ(picture_bytes(PixelFormat::kNv12, 8, 4), 48U);
  EXPECT_EQ(picture_bytes(PixelFormat::kGrey10Packed, 8, 3), 30U);
}

TEST(Ingest, WidthsThatAreNoneAreAFault) {
  Arena arena;
  EXPECT_EQ(Ingest::create(0, arena).error(), Fault::kBadSize);
  arena.seal();
  EXPECT_EQ(Ingest::create(8, arena).error(), Fault::kOutOfMemory);
}

TEST(Ingest, EmptyPictureIsNoWork) {
  Histogram histogram;
  histogram.fill(77);
  ingest({}, {}, &histogram);
  EXPECT_EQ(histogram, Histogram{});
}

}  // namespace
}  // namespace stereotrack
