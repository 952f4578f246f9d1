#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <chrono>
#include <cstdint>

#include "drivers/capture/v4l2/controls.hpp"
#include "drivers/capture/v4l2/device.hpp"

namespace stereotrack::capture::v4l2 {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

/// As the kernel's drivers for these sensors have it.
struct Sensor {
  const char* name;
  double pixel_rate;  ///< [px/s]
  int line_px;        ///< with the blank ones
  int rows;           ///< that are read out
  std::int64_t least_blank;
  std::int64_t most_rows;  ///< with the blank ones
  std::int64_t blank;      ///< that the driver starts with
  double fps;              ///< then
  double line_us;
};

constexpr Sensor kSensors[] = {
    {"imx219 1640x1232", 182.4e6, 3448, 1232, 4, 0xffff, 1763 - 1232, 30.006, 18.904},
    {"imx219 640x480", 182.4e6, 3448, 480, 4, 0xffff, 1763 - 480, 30.006, 18.904},
    {"ov9281 1280x800", 160e6, 1456, 800, 110, 0x7fff, 110, 120.758, 9.1},
    {"ov9281 1280x720", 160e6, 1456, 720, 41, 0x7fff, 41, 144.402, 9.1},
    {"imx296 1456x1088", 118.8e6, 1760, 1088, 30, 0xfffff, 30, 60.376, 14.815},
};

RowPeriod row_period_of(const Sensor& sensor) {
  RowPeriod made;
  made.blank.id = V4L2_CID_VBLANK;
  made.blank.minimum = sensor.least_blank;
  made.blank.maximum = sensor.most_rows - sensor.rows;
  made.timing = {std::chrono::duration<double, std::micro>(1e6 * sensor.line_px / sensor.pixel_rate), sensor.rows};
  return made;
}

TEST(RowPeriod, IsThatOfTheSensorsThatThereAre) {
  for (const Sensor& sensor : kSensors) {
    SCOPED_TRACE(sensor.name);
    const RowPeriod period = row_period_of(sensor);
    EXPECT_NEAR(1e9 / static_cast<double>(period.period_of(sensor.blank).count()), sensor.fps, 0.001);
    EXPECT_NEAR(static_cast<double>(period.range().quantum.count()), 1e3 * sensor.line_us, 1.0);
    EXPECT_EQ(period.range().least, period.period_of(sensor.least_blank));
    EXPECT_EQ(period.range().most, period.period_of(sensor.most_rows - sensor.rows));
  }
}

TEST(RowPeriod, ComesNearestToWhatIsWantedAndIsToldAsItIs) {
  for (const Sensor& sensor : kSensors) {
    SCOPED_TRACE(sensor.name);
    const RowPeriod period = row_period_of(sensor);
    for (const nanoseconds wanted : {nanoseconds(33'333'333), nanoseconds(40'000'000), nanoseconds(66'666'667)}) {
      const std::int64_t blank = period.blank_of(wanted);
      EXPECT_LE(std::chrono::abs(period.period_of(blank) - wanted), period.range().quantum / 2 + nanoseconds(1));
      EXPECT_EQ(period.blank_of(period.period_of(blank)), blank);
      EXPECT_EQ(period.blank_of(wanted + period.range().quantum), blank + 1);
      EXPECT_EQ(period.blank_of(wanted - period.range().quantum), blank - 1);
    }
  }
}

TEST(RowPeriod, StaysWithinTheRangeOfTheControl) {
  const RowPeriod period = row_period_of(kSensors[2]);
  EXPECT_EQ(period.blank_of(milliseconds(1)), 110);
  EXPECT_EQ(period.blank_of(std::chrono::seconds(100)), 0x7fff - 800);
}

TEST(RowPeriod, ADeviceWithoutBlankRowsHasNone) {
  Device device;
  ASSERT_EQ(device.open("/dev/null"), 0);
  Device again;
  ASSERT_EQ(again.open_beside(device), 0);
  EXPECT_NE(again.descriptor(), device.descriptor());
  EXPECT_FALSE(row_period(again, {std::chrono::duration<double, std::micro>(18.9), 480}).has_value());
  EXPECT_FALSE(row_period(again, {}).has_value());
}

TEST(RowPeriod, NoNodeHasNoOtherBesideIt) {
  const Device none;
  Device again;
  EXPECT_NE(again.open_beside(none), 0);
  EXPECT_FALSE(again.is_open());
}

}  // namespace
}  // namespace stereotrack::capture::v4l2
