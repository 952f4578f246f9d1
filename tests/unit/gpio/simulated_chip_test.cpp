#include "drivers/gpio/simulated_chip.hpp"

#include <gtest/gtest.h>

#include <cerrno>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "tests/unit/gpio/support.hpp"

namespace stereotrack::gpio::simulated_chip {
namespace {

TEST(SimulatedChip, KnowsNothingOfALineThatNobodyAskedFor) {
  EXPECT_FALSE(level("nobody").has_value());
  EXPECT_FALSE(level("").has_value());
  EXPECT_EQ(edges("nobody"), 0U);
  set_gone("nobody", true);
  EXPECT_FALSE(level("nobody").has_value());
}

TEST(SimulatedChip, DrivesLevelsAndCountsEdges) {
  const std::vector<WantedLine> lines = {{{"sim", "p"}, 0, true}, {{"sim", "q"}, 0, false}};
  auto lease = request(lines, "test");
  EXPECT_EQ(level("p"), true);
  EXPECT_EQ(level("q"), false);
  EXPECT_EQ(edges("p"), 0U) << "the first level is no edge";
  EXPECT_EQ(lease->set(0b10), 0);
  EXPECT_EQ(level("p"), false);
  EXPECT_EQ(level("q"), true);
  EXPECT_EQ(lease->set(0b10), 0);
  EXPECT_EQ(edges("p"), 1U);
  lease.reset();
  EXPECT_EQ(level("q"), true) << "let go as it was";
}

TEST(SimulatedChip, GoneIsRefusedForAllLinesOfTheRequest) {
  const std::vector<WantedLine> lines = {{{"sim", "here"}, 0, false}, {{"sim", "away"}, 0, false}};
  auto lease = request(lines, "test");
  set_gone("away", true);
  EXPECT_EQ(lease->set(0b11), ENODEV);
  EXPECT_EQ(level("here"), false);
  EXPECT_EQ(refusal_of([&] { static_cast<void>(request(lines, "test")); }),
            "GPIO line sim:away: no such chip: the simulated one is gone");
  set_gone("away", false);
  EXPECT_EQ(lease->set(0b11), ENODEV) << "it was requested of the chip that went";
  auto again = request(lines, "test");
  lease.reset();
  EXPECT_EQ(again->set(0b11), 0);
  EXPECT_EQ(level("here"), true);
  EXPECT_NE(refusal_of([&] { static_cast<void>(request(lines, "test")); }), "") << "the dead one let nothing go";
}

/// Takes names until there are no more, lets them go, and says what it was told at the end and whether the first may be
/// taken again.
void use_all_names() {
  std::string told;
  for (std::size_t i = 0; i <= kLines && told.empty(); ++i) {
    const WantedLine line{{"sim", numbered("end", i)}, 0, false};
    told = refusal_of([&] { static_cast<void>(request({&line, 1}, "test")); });
  }
  const WantedLine again{{"sim", "end0"}, 0, false};
  std::cerr << told << (request({&again, 1}, "test") ? "; end0 is free" : "");
}

// In a process of its own: names stay used.
TEST(SimulatedChipDeathTest, HasAnEnd) {
  EXPECT_EXIT((use_all_names(), std::exit(0)), testing::ExitedWithCode(0),
              "the simulated chip has but 64 lines: take fewer names; end0 is free");
}

}  // namespace
}  // namespace stereotrack::gpio::simulated_chip
