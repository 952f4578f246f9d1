#include <gtest/gtest.h>

#include <array>
#include <cstdint>

#include "pipeline/core/image_view.hpp"

namespace stereotrack {
namespace {

TEST(ImageView, RowsAreAStrideApart) {
  std::array<std::uint8_t, 12> pixels{};
  const ImageView<std::uint8_t> view{pixels.data(), 3, 3, 4};
  view.at(2, 1) = 9;
  EXPECT_EQ(pixels[6], 9);
  EXPECT_EQ(view.row(2), pixels.data() + 8);
}

TEST(ImageView, ContainsItsPixelsAndNoOthers) {
  std::array<int, 6> pixels{};
  const ImageView<int> view{pixels.data(), 3, 2, 3};
  EXPECT_TRUE(view.contains(0, 0));
  EXPECT_TRUE(view.contains(2, 1));
  EXPECT_FALSE(view.contains(3, 1));
  EXPECT_FALSE(view.contains(2, 2));
  EXPECT_FALSE(view.contains(-1, 0));
  EXPECT_FALSE(view.contains(0, -1));
}

TEST(ImageView, AWindowLooksAtTheSamePixels) {
  std::array<int, 20> pixels{};
  const ImageView<int> view{pixels.data(), 5, 4, 5};
  const ImageView<int> part = view.window(1, 2, 3, 2);
  part.at(2, 1) = 7;
  EXPECT_EQ(view.at(3, 3), 7);
  EXPECT_EQ(part.width, 3);
  EXPECT_EQ(part.height, 2);
  EXPECT_EQ(part.stride, 5);
}

TEST(ImageView, IsEmptyWithoutMemoryOrWithoutASide) {
  int pixel = 0;
  EXPECT_TRUE(ImageView<int>().empty());
  EXPECT_TRUE((ImageView<int>{&pixel, 0, 1, 0}.empty()));
  EXPECT_TRUE((ImageView<int>{&pixel, 1, 0, 1}.empty()));
  EXPECT_FALSE((ImageView<int>{&pixel, 1, 1, 1}.empty()));
}

TEST(ImageView, OneThatWritesBecomesOneThatReads) {
  int pixel = 4;
  const ImageView<int> writes{&pixel, 1, 1, 1};
  const ImageView<const int> reads = writes;
  EXPECT_EQ(reads.at(0, 0), 4);
  EXPECT_TRUE(reads.same_size(writes));
  EXPECT_FALSE(reads.same_size(ImageView<char>{}));
}

}  // namespace
}  // namespace stereotrack
