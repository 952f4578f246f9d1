#include <gtest/gtest.h>

#include <vector>

#include "drivers/gpio/gpiod.hpp"
#include "drivers/gpio/simulated_chip.hpp"
#include "tests/unit/gpio/support.hpp"

namespace stereotrack::gpio {
namespace {

TEST(WithoutGpiod, ARealChipIsRefusedWithTheWayOut) {
  EXPECT_EQ(gpiod::interface(), "none");
  const std::vector<LineSpec> specs = {{{"gpiochip0", "17"}, false, false}};
  EXPECT_EQ(
      open_refusal(specs),
      "GPIO line gpiochip0:17: this build has no libgpiod: install libgpiod-dev and build anew, or write sim:NAME "
      "for a simulated line");
}

TEST(WithoutGpiod, AnInputOfARealChipIsRefusedAlike) {
  const std::vector<InputSpec> specs = {{.name = {"gpiochip0", "17"}}};
  EXPECT_NE(refusal_of([&] { static_cast<void>(open_inputs(specs, "test")); }).find("this build has no libgpiod"),
            std::string::npos);
}

TEST(WithoutGpiod, NoChipIsListed) { EXPECT_TRUE(gpiod::list_chips().empty()); }

TEST(WithoutGpiod, TheSimulatedChipWorks) {
  OutputLines lines = open_lines(std::vector{LineSpec{{"sim", "a"}, false, false}}, "test");
  lines.set(1, MonotonicTime{});
  EXPECT_EQ(simulated_chip::level("a"), true);
}

}  // namespace
}  // namespace stereotrack::gpio
