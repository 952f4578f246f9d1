#include <gtest/gtest.h>

#include "pipeline/photometry/smooth.hpp"
#include "tests/support/each_target.hpp"
#include "tests/support/grid.hpp"

namespace stereotrack {
namespace {

using test::Grid;

TEST(SmoothKernel, EverySizeIsTheReferenceAndNothingBesideIsTouched) {
  for (int width = 1; width <= 140; ++width) {
    for (const int height : {1, 2, 3, 9}) {
      const Grid<std::uint8_t> in = test::random_grid(width, height, 0, 255, static_cast<unsigned>(width));
      Grid<std::uint8_t> expected(width, height);
      smooth3x3_reference(in.view(), expected.view());
      test::on_each_target([&] {
        Grid<std::uint8_t> got(width, height);
        smooth3x3(in.view(), got.view());
        EXPECT_TRUE(got == expected) << width << " x " << height;
      });
    }
  }
}

}  // namespace
}  // namespace stereotrack
