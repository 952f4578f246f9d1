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

}  // namespace
}  // namespace stereotrack
