#include "drivers/capture/v4l2/controls.hpp"

#include <gtest/gtest.h>

namespace stereotrack::capture::v4l2 {
namespace {

Control control(std::int64_t minimum, std::int64_t maximum, std::int64_t step, std::int64_t standard) {
  Control made;
  made.minimum = minimum;
  made.maximum = maximum;
  made.step = step;
  made.standard = standard;
  return made;
}

TEST(NearestValue, IsWithinTheRangeAndOnAStep) {
  const Control steps = control(3, 100, 10, 3);  // 3, 13, ... 93
  EXPECT_EQ(nearest_value(steps, 3), 3);
  EXPECT_EQ(nearest_value(steps, 17.9), 13);
  EXPECT_EQ(nearest_value(steps, 18.1), 23);
  EXPECT_EQ(nearest_value(steps, -50), 3);
  EXPECT_EQ(nearest_value(steps, 1e12), 93);
  EXPECT_EQ(nearest_value(control(-8, 8, 1, 0), -2.4), -2);
}

TEST(GainScale, IsLinearFromTheValueThatTheDriverStartsWith) {
  const GainScale scale = gain_scale("ov9281 10-0060", control(16, 248, 1, 16));
  EXPECT_EQ(scale.gain_of(16), 1.0F);
  EXPECT_EQ(scale.gain_of(40), 2.5F);
  EXPECT_EQ(scale.code_of(2.5), 40);
}

TEST(GainScale, OfAnInverseSensor) {
  const GainScale scale = gain_scale("imx219 10-0010", control(0, 232, 1, 0));
  EXPECT_EQ(scale.gain_of(0), 1.0F);
  EXPECT_EQ(scale.gain_of(128), 2.0F);
  EXPECT_EQ(scale.code_of(4), 192);
  EXPECT_EQ(scale.gain_of(256), std::nullopt);
}

TEST(GainScale, OfASensorInDecibels) {
  const GainScale scale = gain_scale("imx296 10-001a", control(0, 480, 1, 0));
  EXPECT_EQ(scale.gain_of(0), 1.0F);
  EXPECT_FLOAT_EQ(scale.gain_of(200).value_or(0), 10.0F);
  EXPECT_NEAR(scale.code_of(10), 200, 1e-9);
}

TEST(GainScale, IsUnknownWhereTheDriverStartsAtNothing) {
  const GainScale scale = gain_scale("webcam", control(0, 255, 1, 0));
  EXPECT_EQ(scale.gain_of(7), std::nullopt);
  EXPECT_EQ(scale.code_of(7), 7);
}

}  // namespace
}  // namespace stereotrack::capture::v4l2
