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

#if defined(__SANITIZE_ADDRESS__)
constexpr bool kSlabsAreShared = false;  // so that the sanitizer sees what leaves its own
#else
constexpr bool kSlabsAreShared = true;
#endif

TEST(Arena, RequestsAreNeighboursInOneSlab) {
  if (!kSlabsAreShared) GTEST_SKIP() << "under the address sanitizer each request has a slab of its own";
  Arena arena;
  EXPECT_EQ(arena.capacity(), 0U);
  const std::span<int> first = arena.array<int>(4);
  const std::span<std::uint8_t> second = arena.array<std::uint8_t>(100);
  EXPECT_EQ(reinterpret_cast<const std::uint8_t*>(first.data()) + Arena::kAlignment, second.data());
  EXPECT_EQ(arena.bytes_used(), 116U);
  EXPECT_EQ(arena.capacity(), Arena::kSlabBytes);
  arena.seal();
  EXPECT_TRUE(arena.array<int>(4).empty());
  EXPECT_EQ(arena.capacity(), Arena::kSlabBytes);
}

// A large one has slabs of its own, and small ones after it go on in what was left of the slab before.
TEST(Arena, TheLargestRestOfASlabIsUsedFirst) {
  if (!kSlabsAreShared) GTEST_SKIP() << "under the address sanitizer each request has a slab of its own";
  Arena arena;
  const std::span<std::uint8_t> small = arena.array<std::uint8_t>(64);
  const std::span<std::uint8_t> large = arena.array<std::uint8_t>(2 * Arena::kSlabBytes - Arena::kAlignment);
  const std::span<std::uint8_t> after = arena.array<std::uint8_t>(64);
  ASSERT_EQ(large.size(), 2 * Arena::kSlabBytes - Arena::kAlignment);
  EXPECT_EQ(after.data(), small.data() + 64);
  EXPECT_EQ(arena.capacity(), 3 * Arena::kSlabBytes);
}

TEST(Arena, AdviceIsAskedOfEachSlabBeforeItIsUsed) {
  static std::size_t bytes = 0;
  bytes = 0;
  Arena arena([](void* slab, std::size_t size) noexcept {
    if (kSlabsAreShared) {
      EXPECT_EQ(reinterpret_cast<std::uintptr_t>(slab) % (std::size_t{2} * 1024 * 1024), 0U);
    }
    bytes += size;
  });
  EXPECT_EQ(bytes, 0U);
  ASSERT_FALSE(arena.array<std::uint8_t>(100).empty());
  EXPECT_EQ(bytes, arena.capacity());
  ASSERT_FALSE(arena.array<std::uint8_t>(Arena::kSlabBytes).empty());
  EXPECT_EQ(bytes, arena.capacity());
}

// Requests that fill a slab to its last byte, one more and one less.
TEST(Arena, NothingIsHandedOutTwiceAtTheEndOfASlab) {
  const std::size_t whole = Arena::kSlabBytes - Arena::kAlignment;
  for (const std::size_t bytes : {whole - 1, whole, whole + 1}) {
    Arena arena;
    const std::span<std::uint8_t> first = arena.array<std::uint8_t>(bytes);
    const std::span<std::uint8_t> second = arena.array<std::uint8_t>(Arena::kAlignment);
    ASSERT_EQ(first.size(), bytes);
    std::fill(first.begin(), first.end(), std::uint8_t{1});
    EXPECT_TRUE(std::all_of(second.begin(), second.end(), [](std::uint8_t v) { return v == 0; })) << bytes;
    std::fill(second.begin(), second.end(), std::uint8_t{2});
    EXPECT_TRUE(std::all_of(first.begin(), first.end(), [](std::uint8_t v) { return v == 1; })) << bytes;
  }
}

TEST(Arena, MoreThanThereIsFailsAndStaysFailed) {
  Arena arena;
  EXPECT_TRUE(arena.array<std::uint8_t>(std::numeric_limits<std::size_t>::max() / 4).empty());
  EXPECT_TRUE(arena.failed());
  EXPECT_EQ(arena.array<std::uint8_t>(1).size(), 1U);
  EXPECT_TRUE(arena.failed());
}

// With the header that each slab has, this many bytes are none.
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
