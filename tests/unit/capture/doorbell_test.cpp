#include "drivers/capture/doorbell.hpp"

#include <gtest/gtest.h>
#include <pthread.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <thread>

namespace stereotrack::capture {
namespace {

using std::chrono::milliseconds;

/// libstdc++'s steady clock is CLOCK_MONOTONIC.
MonotonicTime now() { return MonotonicTime(std::chrono::steady_clock::now().time_since_epoch()); }

TEST(Doorbell, DoesNotSleepAfterARing) {
  Doorbell bell;
  const Doorbell::Count seen = bell.rings();
  bell.ring();
  EXPECT_TRUE(bell.wait(seen, now() + std::chrono::hours(1)));
  EXPECT_NE(bell.rings(), seen);
}

TEST(Doorbell, SleepsToTheDeadlineAndNotLess) {
  Doorbell bell;
  const MonotonicTime deadline = now() + milliseconds(30);
  EXPECT_FALSE(bell.wait(bell.rings(), deadline));
  EXPECT_GE(now(), deadline);
}

TEST(Doorbell, ADeadlineThatHasPassedReturnsAtOnce) {
  Doorbell bell;
  EXPECT_FALSE(bell.wait(bell.rings(), now() - milliseconds(1)));
  EXPECT_FALSE(bell.wait(bell.rings(), MonotonicTime()));
  EXPECT_FALSE(bell.wait(bell.rings(), MonotonicTime(std::chrono::nanoseconds(-5))));
}

TEST(Doorbell, WakesWhoSleeps) {
  Doorbell bell;
  const Doorbell::Count seen = bell.rings();
  std::thread ringer([&] {
    std::this_thread::sleep_for(milliseconds(30));
    bell.ring();
  });
  EXPECT_TRUE(bell.wait(seen, now() + std::chrono::hours(1)));
  ringer.join();
}

std::atomic<int> signals{0};

TEST(Doorbell, ASignalDoesNotEndTheSleep) {
  struct sigaction action {};
  struct sigaction before {};
  action.sa_handler = [](int) { ++signals; };
  ASSERT_EQ(sigaction(SIGUSR1, &action, &before), 0);
  Doorbell bell;
  const pthread_t sleeper = pthread_self();
  std::thread other([&] {
    for (int i = 0; i < 5; ++i) {
      std::this_thread::sleep_for(milliseconds(4));
      pthread_kill(sleeper, SIGUSR1);
    }
  });
  const MonotonicTime deadline = now() + milliseconds(60);
  EXPECT_FALSE(bell.wait(bell.rings(), deadline));
  EXPECT_GE(now(), deadline);
  other.join();
  EXPECT_GE(signals, 1);  // on a busy machine several come as one
  sigaction(SIGUSR1, &before, nullptr);
}

TEST(Doorbell, NoRingIsLostBetweenTheLookAndTheSleep) {
  // Each round would hang until its deadline if a ring fell between the two.
  Doorbell there;
  Doorbell back;
  constexpr int kRounds = 20'000;
  std::atomic<int> sent{0};
  std::atomic<int> answered{0};
  const MonotonicTime end = now() + std::chrono::minutes(2);
  std::thread other([&] {
    for (int i = 1; i <= kRounds; ++i) {
      for (;;) {
        const Doorbell::Count seen = there.rings();
        if (sent.load(std::memory_order_relaxed) >= i) break;
        ASSERT_TRUE(there.wait(seen, end));
      }
      answered.store(i, std::memory_order_relaxed);
      back.ring();
    }
  });
  for (int i = 1; i <= kRounds; ++i) {
    sent.store(i, std::memory_order_relaxed);
    there.ring();
    for (;;) {
      const Doorbell::Count seen = back.rings();
      if (answered.load(std::memory_order_relaxed) >= i) break;
      ASSERT_TRUE(back.wait(seen, end));
    }
  }
  other.join();
}

}  // namespace
}  // namespace stereotrack::capture
