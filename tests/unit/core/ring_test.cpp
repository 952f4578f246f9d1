#include "pipeline/core/ring.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <iterator>
#include <thread>
#include <vector>

namespace stereotrack {
namespace {

TEST(EvictingRing, GivesBackInOrder) {
  EvictingRing<int, 4> ring;
  EXPECT_TRUE(ring.empty());
  EXPECT_EQ(ring.pop(), std::nullopt);
  for (int i = 1; i <= 3; ++i) EXPECT_EQ(ring.push(i), std::nullopt);
  EXPECT_FALSE(ring.empty());
  EXPECT_EQ(ring.pop(), 1);
  EXPECT_EQ(ring.pop(), 2);
  EXPECT_EQ(ring.push(4), std::nullopt);
  EXPECT_EQ(ring.pop(), 3);
  EXPECT_EQ(ring.pop(), 4);
  EXPECT_EQ(ring.pop(), std::nullopt);
  EXPECT_TRUE(ring.empty());
  EXPECT_EQ(ring.evicted(), 0U);
}

TEST(EvictingRing, FullHandsBackTheOldestAndCountsIt) {
  EvictingRing<int, 4> ring;
  for (int i = 1; i <= 4; ++i) EXPECT_EQ(ring.push(i), std::nullopt);
  EXPECT_EQ(ring.push(5), 1);
  EXPECT_EQ(ring.push(6), 2);
  EXPECT_EQ(ring.evicted(), 2U);
  for (int i = 3; i <= 6; ++i) EXPECT_EQ(ring.pop(), i);
  EXPECT_EQ(ring.pop(), std::nullopt);
}

TEST(EvictingRing, OfOneElementKeepsTheNewest) {
  EvictingRing<int, 1> ring;
  EXPECT_EQ(ring.push(1), std::nullopt);
  EXPECT_EQ(ring.push(2), 1);
  EXPECT_EQ(ring.pop(), 2);
  EXPECT_EQ(ring.pop(), std::nullopt);
}

TEST(EvictingRing, EvictsOnDemandUntilItIsEmpty) {
  EvictingRing<int, 2> ring;
  EXPECT_EQ(ring.evict(), std::nullopt);
  EXPECT_EQ(ring.evicted(), 0U);
  (void)ring.push(1);
  (void)ring.push(2);
  EXPECT_EQ(ring.evict(), 1);
  EXPECT_EQ(ring.evict(), 2);
  EXPECT_EQ(ring.evict(), std::nullopt);
  EXPECT_EQ(ring.evicted(), 2U);
}

TEST(EvictingRing, KeepsItsWaterMarks) {
  EvictingRing<int, 4> ring;
  EXPECT_EQ(ring.high_water(), 0U);
  EXPECT_EQ(ring.low_water(), 4U);
  for (int i = 0; i < 3; ++i) (void)ring.push(i);
  EXPECT_EQ(ring.high_water(), 3U);
  (void)ring.pop();
  EXPECT_EQ(ring.low_water(), 2U);
  (void)ring.pop();
  (void)ring.push(9);
  (void)ring.pop();
  EXPECT_EQ(ring.low_water(), 1U);
  EXPECT_EQ(ring.high_water(), 3U);
  for (int i = 0; i < 9; ++i) (void)ring.push(i);
  EXPECT_EQ(ring.high_water(), 4U);
}

TEST(EvictingRing, TwoThreadsLoseAndDoubleNothing) {
  constexpr int kPushes = 200'000;
  EvictingRing<int, 8> ring;
  std::vector<int> popped;
  std::vector<int> evicted;
  popped.reserve(kPushes);
  evicted.reserve(kPushes);
  std::atomic<bool> done{false};
  std::thread producer([&] {
    for (int i = 1; i <= kPushes; ++i) {
      if (const auto old = ring.push(i)) evicted.push_back(*old);
      if (i % 16 == 0) std::this_thread::yield();
    }
    done = true;
  });
  for (;;) {
    const bool last = done;
    if (const auto value = ring.pop()) {
      popped.push_back(*value);
    } else if (last) {
      break;
    } else {
      std::this_thread::yield();
    }
  }
  producer.join();
  EXPECT_EQ(popped.size() + evicted.size(), static_cast<std::size_t>(kPushes));
  EXPECT_EQ(ring.evicted(), evicted.size());
  std::vector<int> merged;
  std::merge(popped.begin(), popped.end(), evicted.begin(), evicted.end(), std::back_inserter(merged));
  for (int i = 1; i <= kPushes; ++i) ASSERT_EQ(merged[static_cast<std::size_t>(i) - 1], i);
  EXPECT_FALSE(popped.empty());
  EXPECT_FALSE(evicted.empty()) << "the two threads never met at a full ring";
}

}  // namespace
}  // namespace stereotrack
