// What a machine without GPIO chips can show of them: how they are missed. Lines that move are the business of the
// emulated board.
#include "drivers/gpio/gpiod.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/unit/gpio/support.hpp"

namespace stereotrack::gpio::gpiod {
namespace {

std::string refusal(const std::string& chip, const std::string& line = "17") {
  return refusal_of([&] { static_cast<void>(find({chip, line})); });
}

TEST(Gpiod, ChipThatIsNotThereIsNamedWithTheWayOut) {
  for (const std::string chip : {"gpiochip77", "/dev/gpiochip77", "no-such-label", "../dev/gpiochip77"}) {
    const std::string told = refusal(chip);
    EXPECT_TRUE(told.starts_with("GPIO line " + chip + ":17: no such chip: ") ||
                told.find("no permission") != told.npos)
        << told;
    EXPECT_EQ(told.find('\n'), std::string::npos);
  }
}

TEST(Gpiod, WhatIsNoGpioChipIsNamed) {
  EXPECT_EQ(refusal("/dev/null"), "GPIO line /dev/null:17: /dev/null is not a GPIO chip: gpiodetect lists them");
  EXPECT_EQ(refusal("/dev"), "GPIO line /dev:17: /dev is not a GPIO chip: gpiodetect lists them");
}

TEST(Gpiod, ALinkIsFollowed) {
  const auto link = std::filesystem::path(testing::TempDir()) / "chip_link";
  std::filesystem::remove(link);
  std::filesystem::create_symlink("/dev/null", link);
  EXPECT_EQ(refusal(link), "GPIO line " + link.string() + ":17: /dev/null is not a GPIO chip: gpiodetect lists them");
}

TEST(Gpiod, RequestOfAChipThatWentIsRefused) {
  const WantedLine line{{"gpiochip77", "3"}, 3, false};
  const std::string told = refusal_of([&] { static_cast<void>(request("/dev/gpiochip77", {&line, 1}, "test")); });
  EXPECT_EQ(told, "GPIO line gpiochip77:3: /dev/gpiochip77 cannot be opened: No such file or directory");
}

// Also where there are none: each is asked, or says why it could not be.
TEST(Gpiod, EveryChipIsListedOnce) {
  std::size_t nodes = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/dev")) {
    nodes += entry.path().filename().string().starts_with("gpiochip") && !entry.is_symlink() ? 1 : 0;
  }
  const std::vector<ChipListing> chips = list_chips();
  EXPECT_EQ(chips.size(), nodes);
  for (const ChipListing& chip : chips)
    EXPECT_EQ(chip.problem.empty(), chip.lines.size() == chip.chip.lines) << chip.problem;
}

TEST(Gpiod, InputsAreRefusedAlike) {
  const WantedInput line{{.name = {"gpiochip77", "3"}}, 3};
  EXPECT_EQ(refusal_of([&] {
              static_cast<void>(request_inputs("/dev/gpiochip77", {&line, 1}, "test"));
            }),
            "GPIO line gpiochip77:3: /dev/gpiochip77 cannot be opened: No such file or directory");
  const std::vector<InputSpec> specs = {{.name = {"sim", "beside_in"}}, {.name = {"/dev/null", "17"}}};
  EXPECT_EQ(refusal_of([&] { static_cast<void>(open_inputs(specs, "test")); }),
            "GPIO line /dev/null:17: /dev/null is not a GPIO chip: gpiodetect lists them");
  EXPECT_EQ(open_inputs(std::vector{specs[0]}, "test").size(), 1U);
}

// A silently undebounced input would count each bounce.
TEST(Gpiod, DebouncingIsRefusedWhereTheLibraryHasNone) {
  const std::vector<InputSpec> specs = {{.name = {"gpiochip0", "3"}, .debounce = std::chrono::milliseconds(5)}};
  EXPECT_EQ(refusal_of([&] { check_inputs(specs); }),
            interface() == "2" ? ""
                               : "GPIO line gpiochip0:3: libgpiod 1.x, which this build has, debounces nothing: leave "
                                 "it out, or build with libgpiod 2.x");
}

TEST(Gpiod, OpenLinesTellsItAndLetsTheOthersGo) {
  const std::vector<LineSpec> specs = {{{"sim", "beside"}, false, false}, {{"/dev/null", "17"}, false, false}};
  EXPECT_EQ(open_refusal(specs), "GPIO line /dev/null:17: /dev/null is not a GPIO chip: gpiodetect lists them");
  EXPECT_EQ(open_lines(std::vector{specs[0]}, "test").size(), 1U);
}

}  // namespace
}  // namespace stereotrack::gpio::gpiod
