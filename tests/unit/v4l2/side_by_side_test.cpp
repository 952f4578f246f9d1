#include "drivers/capture/side_by_side.hpp"

#include <gtest/gtest.h>

#include <array>
#include <numeric>

namespace stereotrack::capture {
namespace {

TEST(SideBySide, TheRightViewBeginsHalfARowOn) {
  std::array<std::uint8_t, 4 * 20> memory{};
  std::iota(memory.begin(), memory.end(), std::uint8_t{0});
  const Picture whole{memory.data(), 16, 4, 20, PixelFormat::kGrey8};
  ASSERT_TRUE(splits_side_by_side(whole.format, whole.width, whole.height));
  const SideBySide views = split_side_by_side(whole);
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) {
      EXPECT_EQ(views.left.row(y)[x], y * 20 + x);
      EXPECT_EQ(views.right.row(y)[x], y * 20 + 8 + x);
    }
  }
  EXPECT_EQ(views.left.width, 8);
  EXPECT_EQ(views.right.width, 8);
  EXPECT_EQ(views.right.height, 4);
  EXPECT_EQ(views.right.stride_bytes, 20);
}

// 8 pixels are 8, 16, 24 and 10 bytes; the colour rows of kNv12 are as long as the others.
TEST(SideBySide, BytesAreCountedByTheFormat) {
  const std::uint8_t memory[96] = {};
  const auto skipped = [&](PixelFormat format) {
    return split_side_by_side({memory, 16, 2, 99, format}).right.data - memory;
  };
  EXPECT_EQ(skipped(PixelFormat::kNv12), 8);
  EXPECT_EQ(skipped(PixelFormat::kYuyv), 16);
  EXPECT_EQ(skipped(PixelFormat::kGrey16), 16);
  EXPECT_EQ(skipped(PixelFormat::kBgr8), 24);
  EXPECT_EQ(skipped(PixelFormat::kGrey10Packed), 10);
}

TEST(SideBySide, WhatWouldTearColoursApartIsNotSplit) {
  EXPECT_FALSE(splits_side_by_side(PixelFormat::kGrey8, 15, 4));
  EXPECT_TRUE(splits_side_by_side(PixelFormat::kGrey8, 14, 4));
  EXPECT_FALSE(splits_side_by_side(PixelFormat::kYuyv, 14, 4));
  EXPECT_TRUE(splits_side_by_side(PixelFormat::kYuyv, 16, 4));
  EXPECT_FALSE(splits_side_by_side(PixelFormat::kBayerRggb8, 14, 4));
  EXPECT_FALSE(splits_side_by_side(PixelFormat::kGrey10Packed, 12, 4));
  EXPECT_FALSE(splits_side_by_side(PixelFormat::kGrey8, 0, 4));
}

}  // namespace
}  // namespace stereotrack::capture
