// The driver of GPIO lines on a chip of the kernel: gpio-sim, as guest/devices makes it. What a line shows is read
// where the kernel says it, in sysfs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "drivers/gpio/gpiod.hpp"
#include "drivers/gpio/line.hpp"
#include "tests/unit/gpio/support.hpp"

namespace stereotrack::gpio {
namespace {

namespace fs = std::filesystem;

const fs::path kChip = "/run/rig";
const fs::path kLive = "/sys/kernel/config/gpio-sim/rig/live";

MonotonicTime at(int ms) { return MonotonicTime{std::chrono::milliseconds(ms)}; }

std::string level(int line) {
  std::string text;
  std::ifstream(kChip / numbered("sim_gpio", static_cast<std::size_t>(line)) / "value") >> text;
  return text;
}

LineSpec rig(const std::string& line, bool active_low = false, bool safe = false) {
  return {{"rig", line}, active_low, safe};
}

TEST(GpioBoard, LinesShowTheirSafeStatesFromTheRequestToTheEnd) {
  const std::vector<LineSpec> specs = {rig("NEAR"), rig("ZONE", false, true), rig("HEALTH", true),
                                       rig("5", true, true)};
  const auto levels = [] { return level(2) + level(3) + level(4) + level(5); };
  {
    OutputLines lines = open_lines(specs, "test");
    EXPECT_EQ(levels(), "0110");
    EXPECT_EQ(lines.set(0b0101, at(1)).changed, 0b1111U);
    EXPECT_EQ(levels(), "1001");
    EXPECT_EQ(lines.set_safe(at(2)).changed, 0b1111U);
    EXPECT_EQ(levels(), "0110");
    EXPECT_EQ(lines.set(0b1111, at(3)).failed, 0U);
    EXPECT_EQ(levels(), "1100");
  }
  // gpio-sim gives an output that is let go the level of its pull, as a board's resistor does: nothing to be seen here.
}

TEST(GpioBoard, PathNameAndLabelAreTheSameLine) {
  const std::string name = fs::read_symlink(kChip).filename();
  for (const std::string& chip : {std::string("rig"), name, "/dev/" + name}) {
    OutputLines lines = open_lines(std::vector<LineSpec>{{{chip, "NEAR"}, false, false}}, "test");
    EXPECT_EQ(lines.set(1, at(1)).changed, 1U);
    EXPECT_EQ(level(2), "1") << chip;
  }
}

TEST(GpioBoard, ChipsAreListedWithTheirLinesAndWhoHoldsThem) {
  const OutputLines held = open_lines(std::vector<LineSpec>{rig("NEAR")}, "test");
  const std::vector<gpiod::ChipListing> chips = gpiod::list_chips();
  const auto found =
      std::find_if(chips.begin(), chips.end(), [](const gpiod::ChipListing& one) { return one.chip.label == "rig"; });
  ASSERT_NE(found, chips.end());
  EXPECT_EQ(found->problem, "");
  ASSERT_EQ(found->lines.size(), 8U);
  EXPECT_EQ(found->lines[2].name, "NEAR");
  EXPECT_EQ(found->lines[2].consumer, "test");
  EXPECT_TRUE(found->lines[2].used);
  EXPECT_FALSE(found->lines[3].used);
}

TEST(GpioBoard, ALineInUseIsRefusedWithItsHolder) {
  const OutputLines held = open_lines(std::vector<LineSpec>{rig("NEAR")}, "the-holder");
  const std::string told = open_refusal(std::vector<LineSpec>{rig("NEAR")});
  EXPECT_NE(told.find("rig:NEAR"), std::string::npos) << told;
  EXPECT_NE(told.find("the-holder"), std::string::npos) << told;
}

TEST(GpioBoard, AnUnknownLineIsToldWithThoseThereAre) {
  const std::string told = open_refusal(std::vector<LineSpec>{rig("FAR")});
  EXPECT_NE(told.find("NEAR"), std::string::npos) << told;
  EXPECT_NE(open_refusal(std::vector<LineSpec>{rig("8")}), "");
}

TEST(GpioBoard, LinesAreSetSafeByThemselves) {
  const std::vector<SafeOutcome> done =
      set_lines_safe(std::vector<LineSpec>{rig("NEAR"), rig("FAR"), rig("ZONE")}, "test");
  ASSERT_EQ(done.size(), 3U);
  EXPECT_TRUE(done[0].done) << done[0].text;
  EXPECT_FALSE(done[1].done);
  EXPECT_TRUE(done[2].done) << done[2].text;
}

// Last: the chip is gone after it.
TEST(GpioBoard, ZAChipThatGoesRefusesAndIsToldAsGone) {
  OutputLines lines = open_lines(std::vector<LineSpec>{rig("NEAR"), rig("ZONE")}, "test");
  EXPECT_EQ(lines.set(0b01, at(1)).failed, 0U);
  std::ofstream(kLive) << "0" << std::flush;
  EXPECT_EQ(lines.set(0b10, at(2)).failed, 0b11U);
  EXPECT_EQ(lines.last_error(), ENODEV);
  EXPECT_FALSE(lines.hold_safe());
}

}  // namespace
}  // namespace stereotrack::gpio
