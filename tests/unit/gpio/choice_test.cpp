#include "drivers/gpio/choice.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/unit/gpio/support.hpp"

namespace stereotrack::gpio {
namespace {

const std::vector<ChipFacts> kPi = {{"/dev/gpiochip0", "gpiochip0", "pinctrl-bcm2711", 58},
                                    {"/dev/gpiochip1", "gpiochip1", "raspberrypi-exp-gpio", 8}};
const std::vector<LineFacts> kLines = {{"ID_SDA", false, ""}, {"", false, ""}, {"GPIO2", true, "led0"}};

std::string chip_refusal(const std::string& chip, std::span<const ChipFacts> chips) {
  return refusal_of([&] { static_cast<void>(choose_chip({chip, "17"}, chips)); });
}
std::string line_refusal(const std::string& line, std::span<const LineFacts> lines) {
  return refusal_of([&] { static_cast<void>(choose_line({"gpiochip0", line}, kPi[0], lines)); });
}

TEST(ChooseChip, PathNameAndLabelMeanTheSameChip) {
  EXPECT_EQ(&choose_chip({"/dev/gpiochip1", "0"}, kPi), &kPi[1]);
  EXPECT_EQ(&choose_chip({"gpiochip1", "0"}, kPi), &kPi[1]);
  EXPECT_EQ(&choose_chip({"raspberrypi-exp-gpio", "0"}, kPi), &kPi[1]);
}

TEST(ChooseChip, ANameGoesBeforeALabel) {
  const std::vector<ChipFacts> odd = {{"/dev/gpiochip0", "gpiochip0", "gpiochip1", 8},
                                      {"/dev/gpiochip1", "gpiochip1", "other", 8}};
  EXPECT_EQ(&choose_chip({"gpiochip1", "0"}, odd), &odd[1]);
}

TEST(ChooseChip, UnknownOneIsToldWithTheOnesThereAre) {
  EXPECT_EQ(chip_refusal("gpiochip9", kPi),
            "GPIO line gpiochip9:17: no such chip: there are gpiochip0 (label pinctrl-bcm2711, 58 lines), gpiochip1 "
            "(label raspberrypi-exp-gpio, 8 lines)");
  EXPECT_EQ(chip_refusal("gpiochip0", {}),
            "GPIO line gpiochip0:17: no such chip: this machine has no GPIO chip in /dev: load its driver, or write "
            "sim:NAME for a simulated line");
}

TEST(ChooseChip, ALabelThatTwoChipsHaveIsRefused) {
  const std::vector<ChipFacts> twins = {{"/dev/gpiochip0", "gpiochip0", "pcf8574", 8},
                                        {"/dev/gpiochip1", "gpiochip1", "pcf8574", 8}};
  EXPECT_EQ(chip_refusal("pcf8574", twins),
            "GPIO line pcf8574:17: /dev/gpiochip0 and /dev/gpiochip1 both have this label: give the path");
}

TEST(ChooseLine, NumberIsAnOffsetAndTheRestIsAName) {
  EXPECT_EQ(choose_line({"gpiochip0", "1"}, kPi[0], kLines), 1U);
  EXPECT_EQ(choose_line({"gpiochip0", "GPIO2"}, kPi[0], kLines), 2U);
}

TEST(ChooseLine, NumberOutsideTheChipIsRefused) {
  EXPECT_EQ(choose_line({"gpiochip0", "2"}, kPi[0], kLines), 2U);
  const std::string told = "no such line: /dev/gpiochip0 has 3, numbered from 0";
  EXPECT_EQ(line_refusal("3", kLines), "GPIO line gpiochip0:3: " + told);
  EXPECT_EQ(line_refusal("99999999999999999999", kLines), "GPIO line gpiochip0:99999999999999999999: " + told);
  EXPECT_EQ(line_refusal("0", {}), "GPIO line gpiochip0:0: no such line: /dev/gpiochip0 has 0, numbered from 0");
}

TEST(ChooseLine, UnknownNameIsToldWithTheNamesThereAre) {
  EXPECT_EQ(line_refusal("GPIO3", kLines),
            "GPIO line gpiochip0:GPIO3: no such line: /dev/gpiochip0 has ID_SDA, GPIO2, or give the number");
  EXPECT_EQ(line_refusal("-1", std::vector<LineFacts>(2)),
            "GPIO line gpiochip0:-1: no such line: the lines of /dev/gpiochip0 have no names: give the number");
}

TEST(ChooseLine, ManyNamesAreNotAllTold) {
  std::vector<LineFacts> many(54);
  for (std::size_t i = 0; i < many.size(); ++i) many[i].name = numbered("L", i);
  EXPECT_EQ(line_refusal("x", many),
            "GPIO line gpiochip0:x: no such line: /dev/gpiochip0 has L0, L1, L2, L3, L4, L5, L6, L7, L8, L9, L10, L11 "
            "and 42 more, or give the number");
}

TEST(ChooseLine, ANameThatTwoLinesHaveIsRefused) {
  const std::vector<LineFacts> twins = {{"NC", false, ""}, {"A", false, ""}, {"NC", false, ""}};
  EXPECT_EQ(line_refusal("NC", twins),
            "GPIO line gpiochip0:NC: lines 0 and 2 of /dev/gpiochip0 both have this name: give the number");
}

}  // namespace
}  // namespace stereotrack::gpio
