#include "pipeline/core/time.hpp"

#include <gtest/gtest.h>

#include <concepts>

namespace stereotrack {
namespace {

using std::chrono::nanoseconds;

template <class A, class B>
concept Subtract = requires(A a, B b) {
  a - b;
};
template <class A, class B>
concept Compare = requires(A a, B b) {
  a < b;
};

// The clocks do not mix: this is what the types are for.
static_assert(Subtract<CaptureTime, CaptureTime> && Subtract<MonotonicTime, MonotonicTime>);
static_assert(!Subtract<CaptureTime, MonotonicTime> && !Subtract<MonotonicTime, CaptureTime>);
static_assert(!Compare<CaptureTime, MonotonicTime> && Compare<MonotonicTime, MonotonicTime>);
static_assert(!std::convertible_to<CaptureTime, MonotonicTime> && !std::constructible_from<MonotonicTime, CaptureTime>);
static_assert(!std::convertible_to<MonotonicTime, CaptureTime> && !std::constructible_from<CaptureTime, MonotonicTime>);
static_assert(!Subtract<MonotonicTime, std::chrono::steady_clock::time_point>);
static_assert(!std::convertible_to<std::chrono::steady_clock::time_point, MonotonicTime>);
static_assert(!std::constructible_from<MonotonicTime, std::chrono::system_clock::time_point>);

TEST(ClockMap, MapsThereAndBack) {
  const ClockMap map(CaptureTime(nanoseconds(1000)), MonotonicTime(nanoseconds(250)));
  EXPECT_EQ(map.offset(), nanoseconds(-750));
  EXPECT_EQ(map.to_monotonic(CaptureTime(nanoseconds(1010))), MonotonicTime(nanoseconds(260)));
  EXPECT_EQ(map.to_capture(MonotonicTime(nanoseconds(260))), CaptureTime(nanoseconds(1010)));
}

TEST(ClockMap, IsTheIdentityUnlessToldOtherwise) {
  EXPECT_EQ(ClockMap().to_monotonic(CaptureTime(nanoseconds(7))), MonotonicTime(nanoseconds(7)));
}

}  // namespace
}  // namespace stereotrack
