#include <gtest/gtest.h>

#include <array>

#include "pipeline/core/bounded_vector.hpp"

namespace stereotrack {
namespace {

TEST(BoundedVector, TakesItsCapacityAndNotOneMore) {
  std::array<int, 3> storage{};
  BoundedVector<int> list{std::span<int>(storage)};
  EXPECT_TRUE(list.empty());
  EXPECT_EQ(list.capacity(), 3U);
  EXPECT_TRUE(list.push(1));
  EXPECT_TRUE(list.push(2));
  EXPECT_FALSE(list.full());
  EXPECT_TRUE(list.push(3));
  EXPECT_TRUE(list.full());
  EXPECT_FALSE(list.push(4));
  ASSERT_EQ(list.size(), 3U);
  EXPECT_EQ(list[2], 3);
}

TEST(BoundedVector, WithoutMemoryIsFullAndEmptyAtOnce) {
  BoundedVector<int> list;
  EXPECT_TRUE(list.empty());
  EXPECT_TRUE(list.full());
  EXPECT_FALSE(list.push(1));
  EXPECT_EQ(list.begin(), list.end());
}

TEST(BoundedVector, TruncateShortensButNeverLengthens) {
  std::array<int, 3> storage{};
  BoundedVector<int> list{std::span<int>(storage)};
  ASSERT_TRUE(list.push(7));
  ASSERT_TRUE(list.push(8));
  list.truncate(3);
  EXPECT_EQ(list.size(), 2U);
  list.truncate(1);
  ASSERT_EQ(list.size(), 1U);
  EXPECT_EQ(list[0], 7);
  list.clear();
  EXPECT_TRUE(list.empty());
  EXPECT_TRUE(list.push(9));
  EXPECT_EQ(list.view().size(), 1U);
  EXPECT_EQ(list.view()[0], 9);
}

TEST(FixedVector, TakesItsCapacityAndNotOneMore) {
  FixedVector<int, 2> list;
  EXPECT_TRUE(list.push(1));
  EXPECT_TRUE(list.push(2));
  EXPECT_FALSE(list.push(3));
  ASSERT_EQ(list.size(), 2U);
  EXPECT_EQ(list[1], 2);
  EXPECT_EQ(decltype(list)::capacity(), 2U);
}

TEST(FixedVector, ACopyHasItsOwnMemory) {
  FixedVector<int, 2> list;
  ASSERT_TRUE(list.push(1));
  FixedVector<int, 2> copy = list;
  copy[0] = 5;
  ASSERT_TRUE(copy.push(6));
  EXPECT_EQ(list[0], 1);
  EXPECT_EQ(list.size(), 1U);
  EXPECT_EQ(copy.size(), 2U);
  list.clear();
  EXPECT_TRUE(list.empty());
  EXPECT_EQ(list.begin(), list.end());
}

}  // namespace
}  // namespace stereotrack
