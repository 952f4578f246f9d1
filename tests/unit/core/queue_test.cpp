#include "pipeline/core/queue.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <memory>
#include <thread>

namespace stereotrack {
namespace {

TEST(HandoverQueue, GivesBackInOrderAndRefusesWhenFull) {
  HandoverQueue<int, 4> queue;
  int out = 77;
  EXPECT_FALSE(queue.pop(out));
  EXPECT_EQ(out, 77);
  for (int round = 0; round < 3; ++round) {
    for (int i = 1; i <= 4; ++i) EXPECT_TRUE(queue.push(i));
    EXPECT_FALSE(queue.push(5));
    for (int i = 1; i <= 4; ++i) {
      ASSERT_TRUE(queue.pop(out));
      EXPECT_EQ(out, i);
    }
    EXPECT_FALSE(queue.pop(out));
  }
  EXPECT_EQ(queue.refused(), 3U);
}

TEST(HandoverQueue, TwoThreadsLoseNothingAndTearNothing) {
  struct Large {
    std::array<std::uint64_t, 16> words{};
  };
  constexpr std::uint64_t kPushes = 100'000;
  const auto queue = std::make_unique<HandoverQueue<Large, 8>>();
  std::thread producer([&] {
    Large value;
    for (std::uint64_t i = 1; i <= kPushes; ++i) {
      value.words.fill(i);
      while (!queue->push(value)) std::this_thread::yield();
    }
  });
  Large value;
  for (std::uint64_t i = 1; i <= kPushes; ++i) {
    while (!queue->pop(value)) std::this_thread::yield();
    for (const std::uint64_t word : value.words) ASSERT_EQ(word, i);
  }
  producer.join();
  EXPECT_FALSE(queue->pop(value));
}

}  // namespace
}  // namespace stereotrack
