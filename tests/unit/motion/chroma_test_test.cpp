#include "pipeline/motion/chroma_test.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "pictures.hpp"

namespace stereotrack {
namespace {

using test::Plane;
using test::random_plane;
using test::view;

double sigma_of(const Plane& values, const Plane& mask) {
  double n = 0;
  double mean = 0;
  for (int i = 0; i < mask.rows * mask.cols; ++i) {
    if (mask(i) == 0) continue;
    n += 1;
    mean += values(i);
  }
  mean /= n;
  double squares = 0;
  for (int i = 0; i < mask.rows * mask.cols; ++i) {
    if (mask(i) != 0) squares += (values(i) - mean) * (values(i) - mean);
  }
  return std::sqrt(squares / n);
}

/// (3.20)-(3.23) as printed, in double precision.
Plane naive(const Plane& cb, const Plane& cr, const Plane& cb_background, const Plane& cr_background,
            const Plane& mask) {
  const double sigma_b = sigma_of(cb, mask);
  const double sigma_r = sigma_of(cr, mask);
  Plane out = mask.clone();
  for (int i = 0; i < mask.rows * mask.cols; ++i) {
    const bool b = cb_background(i) - sigma_b < cb(i) && cb(i) < cb_background(i) + sigma_b;
    const bool r = cr_background(i) - sigma_r < cr(i) && cr(i) < cr_background(i) + sigma_r;
    if (b && r) out(i) = 0;
  }
  return out;
}

Plane row(const std::vector<int>& values) {
  Plane out(1, static_cast<int>(values.size()));
  for (std::size_t i = 0; i < values.size(); ++i) out(static_cast<int>(i)) = static_cast<std::uint8_t>(values[i]);
  return out;
}

TEST(ChromaTest, RandomPlanesAgreeWithDoublePrecision) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const cv::Size size(1 + static_cast<int>(seed) * 3, 17);
    const int spread = 2 + static_cast<int>(seed) * 3;
    Plane cb = random_plane(size, 128 - spread, 127 + spread, seed);
    Plane cr = random_plane(size, 128 - spread / 2, 127 + spread / 2, seed + 100);
    Plane cb_background = random_plane(size, 128 - spread, 127 + spread, seed + 200);
    Plane cr_background = random_plane(size, 128 - spread / 2, 127 + spread / 2, seed + 300);
    Plane mask = random_plane(size, 0, 255, seed + 400);
    mask = (mask < 60);
    const Plane before = mask.clone();
    const Plane expected = naive(cb, cr, cb_background, cr_background, mask);
    const std::uint32_t cleared =
        ChromaTest::run(view(cb), view(cr), view(cb_background), view(cr_background), view(mask));
    EXPECT_EQ(cv::countNonZero(mask != expected), 0) << seed;
    EXPECT_EQ(static_cast<int>(cleared), cv::countNonZero(before) - cv::countNonZero(mask)) << seed;
  }
}

TEST(ChromaTest, TablesOfTheDocumentAreDecidedAsPrinted) {
  // Table 3.2 (falsely segmented), table 3.3 (rightly segmented), then pixels of an object that bring both sigmas
  // to the document's 4.786789, to 5e-4.
  Plane cb = row({124, 124, 127, 127, 124, 114, 111, 112, 114, 113,  //
                  115, 122, 123, 117, 121, 122, 116, 123, 119, 116, 118, 116});
  Plane cb_background = row({124, 124, 127, 126, 124, 114, 112, 112, 114, 115,  //
                             60,  60,  60,  60,  60,  60,  60,  60,  60,  60,  60, 60});
  Plane cr = row({132, 132, 132, 131, 134, 145, 147, 147, 145, 145,  //
                  140, 141, 139, 141, 137, 141, 141, 137, 138, 138, 137, 138});
  Plane cr_background = row({132, 132, 132, 131, 134, 140, 142, 142, 140, 140,  //
                             60,  60,  60,  60,  60,  60,  60,  60,  60,  60,  60, 60});
  Plane mask(1, cb.cols, std::uint8_t{255});
  ASSERT_NEAR(sigma_of(cb, mask), 4.786789, 5e-4);
  ASSERT_NEAR(sigma_of(cr, mask), 4.786789, 5e-4);
  EXPECT_EQ(ChromaTest::run(view(cb), view(cr), view(cb_background), view(cr_background), view(mask)), 5U);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(mask(i), 0) << "table 3.2, row " << i + 1;
  for (int i = 5; i < 10; ++i) EXPECT_EQ(mask(i), 255) << "table 3.3, row " << i - 4;
}

TEST(ChromaTest, OneChannelOutsideKeepsThePixel) {
  // Cb: 100, 104: sigma 2; Cr the same. Pixel 0 differs by 1 and 1, pixel 1 by 1 and 3.
  Plane cb = row({100, 104});
  Plane cr = row({100, 104});
  Plane cb_background = row({101, 105});
  Plane cr_background = row({101, 107});
  Plane mask = row({255, 255});
  EXPECT_EQ(ChromaTest::run(view(cb), view(cr), view(cb_background), view(cr_background), view(mask)), 1U);
  EXPECT_EQ(mask(0), 0);
  EXPECT_EQ(mask(1), 255);
}

TEST(ChromaTest, DifferenceOfExactlySigmaKeepsThePixel) {
  Plane values = row({100, 104});  // sigma 2
  Plane at_sigma = row({102, 102});
  Plane mask = row({255, 255});
  EXPECT_EQ(ChromaTest::run(view(values), view(values), view(at_sigma), view(at_sigma), view(mask)), 0U);
  EXPECT_EQ(cv::countNonZero(mask), 2);
}

TEST(ChromaTest, EvenColourHasNoSigmaAndNothingIsRemoved) {
  Plane even(3, 5, std::uint8_t{90});
  Plane mask(3, 5, std::uint8_t{255});
  EXPECT_EQ(ChromaTest::run(view(even), view(even), view(even), view(even), view(mask)), 0U);
  EXPECT_EQ(cv::countNonZero(mask), 15);
}

TEST(ChromaTest, PixelsOutsideTheMaskDoNotCount) {
  // The unsegmented pixel would raise sigma from 0 to over 50.
  Plane values = row({100, 100, 220});
  Plane background = row({101, 99, 220});
  Plane mask = row({255, 255, 0});
  EXPECT_EQ(ChromaTest::run(view(values), view(values), view(background), view(background), view(mask)), 0U);
  EXPECT_EQ(cv::countNonZero(mask), 2);
}

TEST(ChromaTest, EmptyMaskAndEmptyPictureAreNoWork) {
  Plane values = row({1, 2, 3});
  Plane mask = row({0, 0, 0});
  EXPECT_EQ(ChromaTest::run(view(values), view(values), view(values), view(values), view(mask)), 0U);
  EXPECT_EQ(ChromaTest::run({}, {}, {}, {}, {}), 0U);
}

}  // namespace
}  // namespace stereotrack
