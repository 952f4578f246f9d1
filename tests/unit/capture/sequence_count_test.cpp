#include "drivers/capture/sequence_count.hpp"

#include <gtest/gtest.h>

#include <cstdint>

namespace stereotrack::capture {
namespace {

TEST(SequenceCount, FirstFrameIsWhatTheDriverCalls) {
  SequenceCount count;
  const auto frame = count.next(17);
  EXPECT_EQ(frame.sequence, 17U);
  EXPECT_EQ(frame.lost, 0U);
}

TEST(SequenceCount, GapsAreLostFrames) {
  SequenceCount count;
  (void)count.next(0);
  EXPECT_EQ(count.next(1).lost, 0U);
  const auto frame = count.next(5);
  EXPECT_EQ(frame.sequence, 5U);
  EXPECT_EQ(frame.lost, 3U);
}

TEST(SequenceCount, GoesOnBeyond32Bits) {
  SequenceCount count;
  std::uint32_t raw = 0xFFFF'FF00U;
  std::uint64_t expected = raw;
  (void)count.next(raw);
  for (int i = 0; i < 1000; ++i) {
    EXPECT_EQ(count.next(++raw).sequence, ++expected);
  }
  EXPECT_EQ(count.next(raw + 3).lost, 2U);
}

TEST(SequenceCount, ComesRoundAsOftenAsItLikes) {
  SequenceCount count;
  std::uint32_t raw = 0;
  std::uint64_t expected = 0;
  (void)count.next(raw);
  for (int i = 0; i < 20; ++i) {
    raw += 0x7000'0000U;
    expected += 0x7000'0000U;
    EXPECT_EQ(count.next(raw).sequence, expected);
  }
}

TEST(SequenceCount, ThatStartsAnewGoesOnWithoutALoss) {
  SequenceCount count;
  for (std::uint32_t raw = 0; raw <= 100; ++raw) (void)count.next(raw);
  for (std::uint32_t raw = 0; raw < 10; ++raw) {
    const auto frame = count.next(raw);
    EXPECT_EQ(frame.sequence, 101 + raw);
    EXPECT_EQ(frame.lost, 0U);
  }
  EXPECT_EQ(count.next(12).lost, 2U);
}

TEST(SequenceCount, ThatStandsStillCountsFrames) {
  SequenceCount count;
  for (std::uint64_t i = 0; i < 5; ++i) EXPECT_EQ(count.next(0).sequence, i);
}

}  // namespace
}  // namespace stereotrack::capture
