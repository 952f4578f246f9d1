#include "pipeline/shape/sobel_kernel.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/support/each_target.hpp"

namespace stereotrack {
namespace {

TEST(SobelKernel, EveryWidthIsTheReference) {
  std::mt19937 engine(2);
  for (const unsigned levels : {2U, 4U, 256U}) {  // the steepest edges, and all greys
    for (const int width : test::kRowLengths) {
      std::vector<std::uint8_t> rows[3];
      for (std::vector<std::uint8_t>& row : rows) {
        row.resize(static_cast<std::size_t>(width));
        for (std::uint8_t& pixel : row) pixel = static_cast<std::uint8_t>(engine() % levels * 255 / (levels - 1));
      }
      const SobelRows in{rows[0].data(), rows[1].data(), rows[2].data()};
      std::vector<std::uint8_t> expected(static_cast<std::size_t>(width) + 1, 77);
      sobel_row_reference(in, width, expected.data());
      test::on_each_target([&] {
        std::vector<std::uint8_t> got(expected.size(), 77);
        sobel_row(in, width, got.data());
        EXPECT_EQ(got, expected) << width;
      });
    }
  }
}

// Roots that are just whole and just not: a corner of g has Gx = Gy = g, Gx^2 + Gy^2 = 2 g^2.
TEST(SobelKernel, RootsAreRoundedDownExactly) {
  for (int grey = 0; grey < 256; ++grey) {
    std::vector<std::uint8_t> flat(40, 0);
    std::vector<std::uint8_t> corner(40, 0);
    corner[20] = static_cast<std::uint8_t>(grey);
    int root = 0;
    while ((root + 1) * (root + 1) <= 2 * grey * grey) ++root;
    test::on_each_target([&] {
      std::vector<std::uint8_t> out(40);
      sobel_row({flat.data(), flat.data(), corner.data()}, 40, out.data());
      EXPECT_EQ(out[19], std::min(root, 255)) << grey;
      EXPECT_EQ(out[20], std::min(2 * grey, 255)) << grey;
      EXPECT_EQ(out[21], std::min(root, 255)) << grey;
    });
  }
}

}  // namespace
}  // namespace stereotrack
