#include "firmware-app/stereotrackd/paced_count.hpp"

#include <gtest/gtest.h>

#include <string>

namespace stereotrack::daemon {
namespace {

using std::chrono::seconds;

constexpr MonotonicTime kBoot{std::chrono::hours(5)};

/// COUNT in SPAN [s], or nothing.
std::string said(PacedCount& paced, std::uint64_t total, int second, bool last = false) {
  const auto told = paced.tell(total, kBoot + seconds(second), last);
  if (!told) return "";
  return std::to_string(told->count) + " in " + std::to_string(std::chrono::duration_cast<seconds>(told->span).count());
}

TEST(PacedCount, OneIsToldAtOnceAndThenNoMore) {
  PacedCount paced;
  EXPECT_EQ(said(paced, 0, 0), "");
  EXPECT_EQ(said(paced, 0, 1), "");
  EXPECT_EQ(said(paced, 3, 2), "3 in 1");
  for (int second = 3; second < 1000; ++second) EXPECT_EQ(said(paced, 3, second), "");
}

TEST(PacedCount, WhatGoesOnIsToldEverMoreRarelyAndWhole) {
  PacedCount paced;
  (void)said(paced, 0, 0);
  constexpr int kNight = 12 * 3600;
  int lines = 0;
  std::uint64_t told = 0;
  int silent = 0;
  for (int second = 1; second <= kNight; ++second) {
    const auto now = paced.tell(30ULL * static_cast<std::uint64_t>(second), kBoot + seconds(second));
    silent = now ? 0 : silent + 1;
    EXPECT_LT(silent, 600);
    if (!now) continue;
    ++lines;
    told += now->count;
    EXPECT_EQ(now->count, 30U * static_cast<std::uint64_t>(now->span / seconds(1)));
  }
  EXPECT_LT(lines, 90);
  EXPECT_EQ(told + 30ULL * static_cast<std::uint64_t>(silent), 30ULL * kNight);
}

/// One a second, up to 520: told after 1, 2, 4, 8 ... 512 s.
PacedCount after_520() {
  PacedCount paced;
  for (int second = 0; second <= 520; ++second) (void)said(paced, static_cast<std::uint64_t>(second), second);
  return paced;
}

TEST(PacedCount, WhatWaitsIsToldAtTheEnd) {
  PacedCount paced = after_520();
  EXPECT_EQ(said(paced, 521, 521), "");
  EXPECT_EQ(said(paced, 522, 522, true), "10 in 10");
  EXPECT_EQ(said(paced, 522, 523, true), "");
}

TEST(PacedCount, AfterAQuietMinuteWhatWaitsIsToldAndTheNextAtOnce) {
  PacedCount paced = after_520();
  for (int second = 521; second < 580; ++second) EXPECT_EQ(said(paced, 520, second), "") << second;
  EXPECT_EQ(said(paced, 520, 580), "8 in 68");
  EXPECT_EQ(said(paced, 523, 581), "3 in 1");
}

}  // namespace
}  // namespace stereotrack::daemon
