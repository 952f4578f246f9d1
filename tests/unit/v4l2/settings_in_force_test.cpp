#include "drivers/capture/v4l2/settings_in_force.hpp"

#include <gtest/gtest.h>

namespace stereotrack::capture::v4l2 {
namespace {

using namespace std::chrono_literals;

SensorSettings gain(float value) { return {std::nullopt, value}; }

TEST(SettingsInForce, TheFirstOnesHoldFromTheFirstFrame) {
  SettingsInForce in_force(gain(2), 2);
  EXPECT_EQ(in_force.of_frame(0, 0ms).gain, 2.0F);
}

TEST(SettingsInForce, AChangeActsAfterItsDelay) {
  SettingsInForce in_force(gain(1), 2);
  EXPECT_EQ(in_force.of_frame(10, 100ms).gain, 1.0F);
  in_force.change(gain(3), 105ms);
  EXPECT_EQ(in_force.asked().gain, 3.0F);
  EXPECT_EQ(in_force.of_frame(11, 110ms).gain, 1.0F);  // the first whose stamp is later
  EXPECT_EQ(in_force.of_frame(12, 120ms).gain, 3.0F);
  EXPECT_EQ(in_force.of_frame(13, 130ms).gain, 3.0F);
}

// The change is told before older frames were taken: they waited.
TEST(SettingsInForce, FramesThatWaitedAreOlderThanTheChange) {
  SettingsInForce in_force(gain(1), 1);
  in_force.change(gain(3), 105ms);
  EXPECT_EQ(in_force.of_frame(8, 80ms).gain, 1.0F);
  EXPECT_EQ(in_force.of_frame(10, 100ms).gain, 1.0F);
  EXPECT_EQ(in_force.of_frame(11, 110ms).gain, 3.0F);
}

TEST(SettingsInForce, LostFramesCountForTheDelay) {
  SettingsInForce in_force(gain(1), 3);
  in_force.change(gain(3), 105ms);
  EXPECT_EQ(in_force.of_frame(11, 110ms).gain, 1.0F);
  EXPECT_EQ(in_force.of_frame(15, 150ms).gain, 3.0F);
}

TEST(SettingsInForce, ChangesFollowOneAnother) {
  SettingsInForce in_force(gain(0), 2);
  for (int i = 1; i <= 4; ++i) {
    in_force.change(gain(static_cast<float>(i)), i * 10ms - 5ms);
    EXPECT_EQ(in_force.of_frame(static_cast<std::uint64_t>(i), i * 10ms).gain, static_cast<float>(i - 1));
  }
}

TEST(SettingsInForce, OfMoreThanEightTheNewestWins) {
  SettingsInForce in_force(gain(0), 1);
  for (int i = 1; i <= 20; ++i) in_force.change(gain(static_cast<float>(i)), 1ms * i);
  EXPECT_EQ(in_force.of_frame(1, 100ms).gain, 20.0F);
}

TEST(SettingsInForce, ADelayBelowOneIsOne) {
  SettingsInForce in_force(gain(1), -5);
  in_force.change(gain(2), 5ms);
  EXPECT_EQ(in_force.of_frame(1, 10ms).gain, 2.0F);
}

}  // namespace
}  // namespace stereotrack::capture::v4l2
