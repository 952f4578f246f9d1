#include "drivers/capture/frame_pool.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <concepts>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

namespace stereotrack::capture {
namespace {

using Claim = FramePool::Claim;
using Wait = FramePool::Wait;

static_assert(!std::copyable<PairLease> && std::movable<PairLease>);
static_assert(std::is_nothrow_move_constructible_v<PairLease> && std::is_nothrow_move_assignable_v<PairLease>);

MonotonicTime now() { return MonotonicTime(std::chrono::steady_clock::now().time_since_epoch()); }

/// Captures one pair with that ordinal.
FramePool::Claimed capture(FramePool& pool, std::uint64_t ordinal) {
  const FramePool::Claimed claimed = pool.claim();
  if (claimed.pair != nullptr) {
    *claimed.pair = FramePair{};
    claimed.pair->ordinal = ordinal;
    pool.publish();
  }
  return claimed;
}

TEST(FramePool, RefusesSizesThatCannotWork) {
  EXPECT_THROW(FramePool(0), std::invalid_argument);
  EXPECT_THROW(FramePool(1), std::invalid_argument);
  EXPECT_THROW(FramePool(17), std::invalid_argument);
  EXPECT_EQ(FramePool(2).slots(), 2U);
  EXPECT_EQ(FramePool(16).slots(), 16U);
}

TEST(FramePool, HandsPairsOverInOrder) {
  FramePool pool(4);
  EXPECT_FALSE(pool.take_oldest());
  EXPECT_EQ(capture(pool, 1).how, Claim::kFree);
  EXPECT_EQ(capture(pool, 2).how, Claim::kFree);
  PairLease first = pool.take_oldest();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->ordinal, 1U);
  const PairLease second = pool.take_oldest();
  ASSERT_TRUE(second);
  EXPECT_EQ((*second).ordinal, 2U);
  EXPECT_FALSE(pool.take_oldest());
  EXPECT_EQ(pool.counters().captured, 2U);
  EXPECT_EQ(pool.counters().waiting_high, 2U);
  EXPECT_EQ(pool.counters().free_low, 2U);
}

TEST(FramePool, TheNewestPassesOverTheOlderOnes) {
  FramePool pool(4);
  for (std::uint64_t i = 1; i <= 3; ++i) capture(pool, i);
  const PairLease lease = pool.take_newest();
  ASSERT_TRUE(lease);
  EXPECT_EQ(lease->ordinal, 3U);
  EXPECT_EQ(pool.counters().skipped, 2U);
  std::uint32_t slot = 99;
  EXPECT_TRUE(pool.take_back(slot));
  EXPECT_EQ(slot, 0U);
  EXPECT_TRUE(pool.take_back(slot));
  EXPECT_EQ(slot, 1U);
  EXPECT_FALSE(pool.take_back(slot));
  EXPECT_FALSE(pool.take_newest());
  EXPECT_EQ(pool.counters().skipped, 2U);
}

TEST(FramePool, WithoutAFreeSlotTheOldestThatWaitsGoes) {
  FramePool pool(3);
  for (std::uint64_t i = 1; i <= 3; ++i) EXPECT_EQ(capture(pool, i).how, Claim::kFree);
  const FramePool::Claimed fourth = capture(pool, 4);
  EXPECT_EQ(fourth.how, Claim::kEvicted);
  EXPECT_EQ(fourth.slot, 0U) << "the slot of pair 1";
  EXPECT_EQ(pool.counters().evicted, 1U);
  EXPECT_EQ(pool.counters().free_low, 0U);
  for (std::uint64_t i = 2; i <= 4; ++i) {
    const PairLease lease = pool.take_oldest();
    ASSERT_TRUE(lease);
    EXPECT_EQ(lease->ordinal, i);
  }
}

TEST(FramePool, StarvesWhenEverythingIsLeasedAndRecovers) {
  FramePool pool(2);
  capture(pool, 1);
  capture(pool, 2);
  PairLease a = pool.take_oldest();
  PairLease b = pool.take_oldest();
  EXPECT_EQ(pool.claim().how, Claim::kStarved);
  EXPECT_EQ(pool.claim().pair, nullptr);
  EXPECT_EQ(pool.counters().starved, 2U);
  EXPECT_EQ(a->ordinal, 1U);
  EXPECT_EQ(b->ordinal, 2U);
  a.release();
  EXPECT_FALSE(a);
  const FramePool::Claimed third = capture(pool, 3);
  EXPECT_EQ(third.how, Claim::kFree);
  EXPECT_EQ(third.slot, 0U);
  EXPECT_EQ(pool.counters().captured, 3U);
  EXPECT_EQ(pool.counters().evicted, 0U);
}

TEST(FramePool, ALeaseComesBackOnceHoweverItEnds) {
  FramePool pool(4);
  for (std::uint64_t i = 1; i <= 4; ++i) capture(pool, i);
  std::uint32_t slot = 0;
  {
    PairLease lease = pool.take_oldest();
    PairLease other = std::move(lease);
    EXPECT_FALSE(lease);  // NOLINT(bugprone-use-after-move): that it is empty is the fact
    EXPECT_TRUE(other);
    EXPECT_FALSE(pool.take_back(slot)) << "a move is no end";
    other.release();
    other.release();
    EXPECT_TRUE(pool.take_back(slot));
    EXPECT_EQ(slot, 0U);
  }
  EXPECT_FALSE(pool.take_back(slot)) << "released before it was destroyed";
  { const PairLease lease = pool.take_oldest(); }
  EXPECT_TRUE(pool.take_back(slot));
  EXPECT_EQ(slot, 1U);
  PairLease third = pool.take_oldest();
  third = pool.take_oldest();  // what it held goes back
  EXPECT_TRUE(pool.take_back(slot));
  EXPECT_EQ(slot, 2U);
  EXPECT_FALSE(pool.take_back(slot));
  EXPECT_EQ(third->ordinal, 4U);
  PairLease& same = third;
  third = std::move(same);
  EXPECT_TRUE(third) << "assigned to itself";
}

TEST(FramePool, AClaimThatIsGivenUpLeavesNoTrace) {
  FramePool pool(2);
  const FramePool::Claimed claimed = pool.claim();
  ASSERT_NE(claimed.pair, nullptr);
  pool.give_up();
  EXPECT_FALSE(pool.take_oldest());
  EXPECT_EQ(pool.counters().captured, 0U);
  EXPECT_EQ(capture(pool, 1).slot, claimed.slot);
  EXPECT_EQ(capture(pool, 2).how, Claim::kFree);
}

TEST(FramePool, WaitsForAPairADeadlineOrTheEnd) {
  FramePool pool(2);
  const MonotonicTime deadline = now() + std::chrono::milliseconds(20);
  EXPECT_EQ(pool.wait(deadline), Wait::kDeadline);
  EXPECT_GE(now(), deadline);
  capture(pool, 1);
  EXPECT_EQ(pool.wait(MonotonicTime()), Wait::kPair);
  std::thread closer([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    pool.close();
  });
  EXPECT_EQ(pool.wait(now() + std::chrono::hours(1)), Wait::kPair) << "what waits comes first";
  EXPECT_TRUE(pool.take_oldest());
  EXPECT_EQ(pool.wait(now() + std::chrono::hours(1)), Wait::kClosed);
  closer.join();
}

TEST(FramePool, TwoThreadsNeverTouchTheSamePixels) {
  // Every pixel of a pair holds its ordinal. The thread sanitizer sees each plain access; a wrong hand-over also shows
  // as a mixed picture.
  constexpr std::uint64_t kPairs = 60'000;
  constexpr std::size_t kSlots = 4;
  constexpr std::size_t kPixels = 512;
  FramePool pool(kSlots);
  std::vector<std::vector<std::uint8_t>> buffers(kSlots, std::vector<std::uint8_t>(kPixels));
  std::uint64_t starved = 0;
  std::thread capturing([&] {
    for (std::uint64_t ordinal = 1; ordinal <= kPairs; ++ordinal) {
      std::uint32_t slot = 0;
      while (ordinal % 3 == 0 && pool.take_back(slot)) std::fill(buffers[slot].begin(), buffers[slot].end(), 0);
      const FramePool::Claimed claimed = pool.claim();
      if (claimed.pair == nullptr) {
        ++starved;
        std::this_thread::yield();
        continue;
      }
      std::vector<std::uint8_t>& buffer = buffers[claimed.slot];
      std::fill(buffer.begin(), buffer.end(), static_cast<std::uint8_t>(ordinal));
      *claimed.pair = FramePair{};
      claimed.pair->ordinal = ordinal;
      claimed.pair->left.data = buffer.data();
      pool.publish();
      if (ordinal % 8 == 0) std::this_thread::yield();
    }
    pool.close();
  });
  std::uint64_t taken = 0;
  std::uint64_t last = 0;
  for (;;) {
    const Wait outcome = pool.wait(now() + std::chrono::minutes(2));
    ASSERT_NE(outcome, Wait::kDeadline);
    if (outcome == Wait::kClosed) break;
    PairLease lease = last % 2 == 0 ? pool.take_newest() : pool.take_oldest();
    if (!lease) continue;  // evicted in between
    ++taken;
    ASSERT_GT(lease->ordinal, last);
    last = lease->ordinal;
    ASSERT_TRUE(std::all_of(lease->left.data, lease->left.data + kPixels,
                            [&](std::uint8_t pixel) { return pixel == static_cast<std::uint8_t>(last); }));
  }
  capturing.join();
  const FramePool::Counters counters = pool.counters();
  EXPECT_EQ(counters.captured + counters.starved, kPairs);
  EXPECT_EQ(counters.starved, starved);
  EXPECT_EQ(taken + counters.evicted + counters.skipped, counters.captured);
  EXPECT_GT(taken, 0U);
  // All slots are found again.
  std::set<std::uint32_t> seen;
  std::uint32_t slot = 0;
  while (pool.take_back(slot)) {
  }
  for (std::size_t i = 0; i < kSlots; ++i) {
    const FramePool::Claimed claimed = capture(pool, kPairs + 1 + i);
    EXPECT_EQ(claimed.how, Claim::kFree);
    seen.insert(claimed.slot);
  }
  EXPECT_EQ(seen.size(), kSlots);
}

}  // namespace
}  // namespace stereotrack::capture
