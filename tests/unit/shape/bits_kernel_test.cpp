#include "pipeline/shape/bits_kernel.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <vector>

#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

std::vector<std::uint64_t> bits_by_hand(const std::uint8_t* pixels, int width) {
  std::vector<std::uint64_t> words(static_cast<std::size_t>(width + 63) / 64);
  for (int x = 0; x < width; ++x) {
    if (pixels[x] != 0) words[static_cast<std::size_t>(x / 64)] |= std::uint64_t{1} << x % 64;
  }
  return words;
}

TEST(BitsKernel, EveryWidthIsTheDefinitionOnEachTarget) {
  std::mt19937 engine(3);
  std::vector<std::uint8_t> pixels(400);
  for (const std::uint8_t value : std::to_array<std::uint8_t>({1, 128, 255})) {
    for (std::uint8_t& pixel : pixels) pixel = engine() % 3 == 0 ? value : 0;
    for (int width = 0; width <= 330; ++width) {
      const std::vector<std::uint64_t> expected = bits_by_hand(pixels.data() + 1, width);
      test::on_each_target([&] {
        // One word more than the function may write, which must stay.
        std::vector<std::uint64_t> got(expected.size() + 2, 77);
        row_bits(pixels.data() + 1, width, got.data());
        EXPECT_EQ(got.back(), 77U);
        got.resize(expected.size());
        EXPECT_EQ(got, expected) << width;
      });
    }
  }
}

TEST(BitsKernel, BitsFillTheRowTheyCameFromAndNothingBeyond) {
  std::mt19937 engine(5);
  for (const unsigned gaps : {1U, 2U, 200U}) {
    for (int width = 0; width <= 330; ++width) {
      std::vector<std::uint8_t> expected(static_cast<std::size_t>(width) + 1, 7);
      for (int x = 0; x < width; ++x) expected[static_cast<std::size_t>(x)] = engine() % gaps == 0 ? 0 : 255;
      const std::vector<std::uint64_t> words = bits_by_hand(expected.data(), width);
      std::vector<std::uint8_t> got(expected.size(), 7);
      fill_from_bits(words.data(), width, got.data());
      EXPECT_EQ(got, expected) << width;
    }
  }
}

TEST(BitsKernel, PixelsAreClearedWhereBitsAreAndNowhereElse) {
  std::mt19937 random(11);
  for (const int width : {1, 63, 64, 65, 128, 200}) {
    std::vector<std::uint64_t> words(static_cast<std::size_t>((width + 63) / 64));
    for (std::size_t w = 0; w < words.size(); ++w) words[w] = w % 2 == 0 ? random() * 0x100000001U : ~std::uint64_t{0};
    if (width % 64 != 0) words.back() &= ~std::uint64_t{0} >> (64 - width % 64);
    std::vector<std::uint8_t> got(static_cast<std::size_t>(width) + 8, 99);
    clear_where_bits(words.data(), width, got.data());
    for (int x = 0; x < width + 8; ++x) {
      const auto i = static_cast<std::size_t>(x);
      const bool cleared = x < width && (words[i / 64] >> i % 64 & 1) != 0;
      ASSERT_EQ(got[i], cleared ? 0 : 99) << width << " " << x;
    }
  }
}

TEST(BitsKernel, RunsAreThoseOfThePixels) {
  std::mt19937 engine(4);
  for (const int width : {0, 1, 63, 64, 65, 128, 640, 2048, 2049, 5000}) {
    for (const unsigned gaps : {2U, 9U, 1000U}) {
      std::vector<std::uint8_t> pixels(static_cast<std::size_t>(width) + 1, 1);  // one after the row's end
      for (int x = 0; x < width; ++x) pixels[static_cast<std::size_t>(x)] = engine() % gaps == 0 ? 0 : 9;
      test::on_each_target([&] {
        std::vector<std::uint8_t> painted(pixels.size(), 0);
        painted.back() = 1;
        int last = -1;
        for_each_set_run(pixels.data(), width, [&](int begin, int end) {
          EXPECT_GT(begin, last);
          EXPECT_LT(begin, end);
          last = end;
          for (int x = begin; x < end; ++x) painted[static_cast<std::size_t>(x)] = pixels[static_cast<std::size_t>(x)];
        });
        EXPECT_EQ(painted, pixels) << width;
      });
    }
  }
}

}  // namespace
}  // namespace stereotrack
