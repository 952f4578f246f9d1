#include "pipeline/photometry/colour_kernel.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

using test::kRowLengths;
using test::on_each_target;
using Row = std::vector<std::uint8_t>;

Row random_row(std::size_t size, unsigned seed) {
  std::mt19937 engine(seed);
  Row row(size);
  for (std::uint8_t& value : row) value = static_cast<std::uint8_t>(engine());
  return row;
}

TEST(ColourKernel, LumaOfEveryColourIsTheReference) {
  constexpr int kSize = 65536;
  Row bgr(3 * kSize);
  Row expected(kSize);
  Row got(kSize);
  for (int b = 0; b < 256; ++b) {
    for (std::size_t i = 0; i < kSize; ++i) {
      bgr[3 * i] = static_cast<std::uint8_t>(b);
      bgr[3 * i + 1] = static_cast<std::uint8_t>(i);
      bgr[3 * i + 2] = static_cast<std::uint8_t>(i >> 8);
    }
    luma_row_reference(bgr.data(), kSize, expected.data());
    on_each_target([&] {
      luma_row(bgr.data(), kSize, got.data());
      EXPECT_TRUE(got == expected) << "blue " << b;
    });
  }
}

TEST(ColourKernel, ChromaOfEveryColourValueAndLumaIsTheReference) {
  constexpr int kSize = 65536;
  Row bgr(3 * kSize);
  Row luma(kSize);
  for (std::size_t i = 0; i < kSize; ++i) {
    luma[i] = static_cast<std::uint8_t>(i);
    bgr[3 * i] = static_cast<std::uint8_t>(i >> 8);
    bgr[3 * i + 2] = static_cast<std::uint8_t>(i >> 8);
  }
  Row cb(kSize);
  Row cr(kSize);
  chroma_row_reference(bgr.data(), luma.data(), kSize, cb.data(), cr.data());
  on_each_target([&] {
    Row got_cb(kSize);
    Row got_cr(kSize);
    chroma_row(bgr.data(), luma.data(), kSize, got_cb.data(), got_cr.data());
    EXPECT_TRUE(got_cb == cb);
    EXPECT_TRUE(got_cr == cr);
  });
}

TEST(ColourKernel, EveryLengthIsTheReferenceAndNothingBeyondIsTouched) {
  const Row bgr = random_row(1000, 1);
  const Row luma = random_row(300, 2);
  for (const int width : kRowLengths) {
    const auto room = [&] { return Row(static_cast<std::size_t>(width) + 1, 77); };
    Row expected[3] = {room(), room(), room()};
    luma_row_reference(bgr.data() + 1, width, expected[0].data());
    chroma_row_reference(bgr.data() + 1, luma.data() + 1, width, expected[1].data(), expected[2].data());
    on_each_target([&] {
      Row got[3] = {room(), room(), room()};
      luma_row(bgr.data() + 1, width, got[0].data());
      chroma_row(bgr.data() + 1, luma.data() + 1, width, got[1].data(), got[2].data());
      for (int i = 0; i < 3; ++i) EXPECT_EQ(got[i], expected[i]) << width;
    });
  }
}

}  // namespace
}  // namespace stereotrack
