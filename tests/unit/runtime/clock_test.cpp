#include "firmware-app/runtime/clock.hpp"

#include <gtest/gtest.h>

#include <chrono>

namespace stereotrack::runtime {
namespace {

TEST(Clock, IsTheOneThatTheStandardLibraryCallsSteady) {
  // libstdc++ and libc++ read CLOCK_MONOTONIC on Linux, and so do the calls that sleep to an absolute time.
  const auto before = std::chrono::steady_clock::now().time_since_epoch();
  const auto ours = monotonic_now().time_since_epoch();
  const auto after = std::chrono::steady_clock::now().time_since_epoch();
  EXPECT_LE(before, ours);
  EXPECT_LE(ours, after);
}

}  // namespace
}  // namespace stereotrack::runtime
