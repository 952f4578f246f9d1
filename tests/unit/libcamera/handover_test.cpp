#include "drivers/capture/libcamera/module/handover.hpp"

#include <gtest/gtest.h>
#include <poll.h>

#include <array>
#include <cstdint>
#include <thread>

namespace stereotrack::libcamera_module {
namespace {

bool is_readable(const Handover& handover) {
  pollfd waits{handover.descriptor(), POLLIN, 0};
  return poll(&waits, 1, 0) == 1;
}

LibcameraFrame frame(std::uint32_t sequence, std::uint32_t buffer = 0) {
  LibcameraFrame made{};
  made.sequence = sequence;
  made.buffer = buffer;
  return made;
}

TEST(Handover, DescriptorIsReadableAsLongAsThereIsSomethingToTake) {
  Handover handover;
  LibcameraFrame taken{};
  EXPECT_FALSE(is_readable(handover));
  EXPECT_EQ(handover.take(taken), kLibcameraNothing);
  handover.push(frame(1));
  handover.push(frame(2));
  EXPECT_TRUE(is_readable(handover));
  EXPECT_EQ(handover.take(taken), kLibcameraTaken);
  EXPECT_EQ(taken.sequence, 1U);
  EXPECT_TRUE(is_readable(handover));
  EXPECT_EQ(handover.take(taken), kLibcameraTaken);
  EXPECT_EQ(taken.sequence, 2U);
  EXPECT_FALSE(is_readable(handover));
}

TEST(Handover, ALossComesAfterTheFramesBeforeItAndStays) {
  Handover handover;
  LibcameraFrame taken{};
  handover.push(frame(1));
  handover.lose("was unplugged");
  handover.lose("was something else");
  EXPECT_EQ(handover.take(taken), kLibcameraTaken);
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(is_readable(handover));
    EXPECT_EQ(handover.take(taken), kLibcameraLost);
  }
  EXPECT_STREQ(handover.loss(), "was unplugged");
}

// As a camera of four buffers has it: what is given back is filled again.
TEST(Handover, BuffersGoRoundBetweenThreadsNoneLostNoneTwice) {
  constexpr std::uint32_t kBuffers = 4;
  constexpr std::uint32_t kFrames = 20'000;
  Handover handover;
  for (std::uint32_t i = 0; i < kBuffers; ++i) handover.push(frame(i, i));
  std::uint32_t filled = kBuffers;
  std::thread queueing([&] {
    std::uint32_t buffer = 0;
    while (handover.wait_returned(buffer)) handover.push(frame(filled++, buffer));
  });
  std::array<bool, kBuffers> ours{};
  for (std::uint32_t taken = 0; taken < kFrames;) {
    LibcameraFrame at{};
    pollfd waits{handover.descriptor(), POLLIN, 0};
    ASSERT_EQ(poll(&waits, 1, 10'000), 1) << "after " << taken;
    ASSERT_EQ(handover.take(at), kLibcameraTaken);
    ASSERT_EQ(at.sequence, taken);
    ASSERT_FALSE(ours.at(at.buffer));
    ours.at(at.buffer) = true;
    ++taken;
    if (taken % 3 != 0) continue;  // several are out at once
    for (std::uint32_t i = 0; i < kBuffers; ++i) {
      if (!ours.at(i)) continue;
      ours.at(i) = false;
      handover.give_back(i);
    }
  }
  handover.end();
  queueing.join();
  EXPECT_LE(filled, kFrames + kBuffers);
}

TEST(Handover, TheQueueingThreadEndsThoughNothingComesBack) {
  Handover handover;
  std::thread queueing([&] {
    std::uint32_t buffer = 0;
    EXPECT_FALSE(handover.wait_returned(buffer));
  });
  handover.end();
  queueing.join();
}

}  // namespace
}  // namespace stereotrack::libcamera_module
