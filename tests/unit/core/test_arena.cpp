#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <limits>

#include "pipeline/core/arena.hpp"

// Under the address sanitizer a refused allocation ends the program unless it is told to answer null.
// NOLINTNEXTLINE(bugprone-reserved-identifier): the sanitizer looks for this name
extern "C" const char* __asan_default_options();
extern "C" const char* __asan_default_options() { return "allocator_may_return_null=1"; }

namespace stereotrack {
namespace {

bool aligned(const void* pointer) { return reinterpret_cast<std::uintptr_t>(pointer) % Arena::kAlignment == 0; }

TEST(Arena, ArraysAreAlignedZeroedAndApart) {
  Arena arena;
  const std::span<std::uint8_t> a = arena.array<std::uint8_t>(3);
  const std::span<double> b = arena.array<double>(1000);
  ASSERT_EQ(a.size(), 3U);
  ASSERT_EQ(b.size(), 1000U);
  EXPECT_TRUE(aligned(a.data()));
  EXPECT_TRUE(aligned(b.data()));
  EXPECT_TRUE(std::all_of(a.begin(), a.end(), [](std::uint8_t v) { return v == 0; }));
  EXPECT_TRUE(std::all_of(b.begin(), b.end(), [](double v) { return v == 0; }));
  std::fill(b.begin(), b.end(), -1.0);
  EXPECT_EQ(a[0] + a[1] + a[2], 0);
  EXPECT_EQ(arena.bytes_used(), 3U + 1000U * sizeof(double));
  EXPECT_FALSE(arena.failed());
}

TEST(Arena, EveryRowOfAnImageIsAlignedAndPadded) {
  Arena arena;
  for (int width : {1, 15, 16, 17, 63, 64, 65, 641}) {
    const ImageView<std::uint8_t> bytes = arena.image<std::uint8_t>(width, 3);
    const ImageView<float> floats = arena.image<float>(width, 3);
    for (int y = 0; y < 3; ++y) {
      EXPECT_TRUE(aligned(bytes.row(y))) << width;
      EXPECT_TRUE(aligned(floats.row(y))) << width;
    }
    EXPECT_GE(bytes.stride - width, 64) << width;
    EXPECT_GE((floats.stride - width) * 4, 64) << width;
  }
}

TEST(Arena, NothingIsHandedOutAfterSeal) {
  Arena arena;
  ASSERT_FALSE(arena.array<int>(4).empty());
  arena.seal();
  EXPECT_FALSE(arena.failed());
  EXPECT_TRUE(arena.array<int>(4).empty());
  EXPECT_TRUE(arena.failed());
  EXPECT_TRUE(arena.image<std::uint8_t>(4, 4).empty());
  EXPECT_EQ(arena.bytes_used(), 16U);
}

TEST(Arena, CapacityIsWhatWasUsedAndAHeaderForEachRequest) {
  Arena arena;
  EXPECT_EQ(arena.capacity(), 0U);
  ASSERT_FALSE(arena.array<int>(4).empty());
  ASSERT_FALSE(arena.array<std::uint8_t>(100).empty());
  EXPECT_EQ(arena.bytes_used(), 116U);
  EXPECT_EQ(arena.capacity(), 116U + 2 * Arena::kAlignment);
  arena.seal();
  EXPECT_TRUE(arena.array<int>(4).empty());
  EXPECT_EQ(arena.capacity(), 116U + 2 * Arena::kAlignment);
}

TEST(Arena, MoreThanThereIsFailsAndStaysFailed) {
  Arena arena;
  EXPECT_TRUE(arena.array<std::uint8_t>(std::numeric_limits<std::size_t>::max() / 4).empty());
  EXPECT_TRUE(arena.failed());
  EXPECT_EQ(arena.array<std::uint8_t>(1).size(), 1U);
  EXPECT_TRUE(arena.failed());
}

// With the header that each request has, this many bytes are none.
TEST(Arena, RequestThatOverflowsWithItsHeaderFails) {
  Arena arena;
  EXPECT_TRUE(arena.array<std::uint8_t>(std::numeric_limits<std::size_t>::max() - Arena::kAlignment + 1).empty());
  EXPECT_TRUE(arena.failed());
  EXPECT_EQ(arena.bytes_used(), 0U);
}

TEST(Arena, ImageWithoutRowsIsEmpty) {
  Arena arena;
  EXPECT_TRUE(arena.image<std::uint8_t>(5, 0).empty());
  EXPECT_TRUE(arena.image<std::uint8_t>(0, 5).empty());
  EXPECT_FALSE(arena.failed());
}

}  // namespace
}  // namespace stereotrack
