#include "pipeline/core/mailbox.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <memory>
#include <thread>

namespace stereotrack {
namespace {

TEST(Mailbox, HasNothingBeforeTheFirst) {
  Mailbox<int> box;
  EXPECT_EQ(box.take(), nullptr);
}

TEST(Mailbox, GivesTheNewestOnce) {
  Mailbox<int> box;
  box.draft() = 1;
  box.publish();
  box.draft() = 2;
  box.publish();
  const int* value = box.take();
  ASSERT_NE(value, nullptr);
  EXPECT_EQ(*value, 2);
  EXPECT_EQ(box.unread(), 1U);
  EXPECT_EQ(box.take(), nullptr);
}

TEST(Mailbox, WhatWasTakenStaysWhileTheWriterGoesOn) {
  Mailbox<int> box;
  box.draft() = 1;
  box.publish();
  const int* value = box.take();
  ASSERT_NE(value, nullptr);
  for (int i = 2; i < 20; ++i) {
    box.draft() = i;
    EXPECT_NE(&box.draft(), value);
    box.publish();
    EXPECT_EQ(*value, 1);
  }
  const int* newer = box.take();
  ASSERT_NE(newer, nullptr);
  EXPECT_EQ(*newer, 19);
  EXPECT_EQ(box.unread(), 17U);
}

TEST(Mailbox, TwoThreadsNeverSeeATornOrAnOlderValue) {
  struct Large {
    std::array<std::uint64_t, 128> words{};
  };
  constexpr std::uint64_t kPublishes = 100'000;
  const auto box = std::make_unique<Mailbox<Large>>();
  std::thread writer([&] {
    for (std::uint64_t i = 1; i <= kPublishes; ++i) {
      box->draft().words.fill(i);
      box->publish();
      if (i % 16 == 0) std::this_thread::yield();
    }
  });
  std::uint64_t last = 0;
  std::uint64_t taken = 0;
  while (last < kPublishes) {
    const Large* value = box->take();
    if (value == nullptr) {
      std::this_thread::yield();
      continue;
    }
    ++taken;
    ASSERT_GT(value->words[0], last);
    last = value->words[0];
    for (const std::uint64_t word : value->words) ASSERT_EQ(word, last);
  }
  writer.join();
  EXPECT_EQ(box->unread() + taken, kPublishes);
}

}  // namespace
}  // namespace stereotrack
