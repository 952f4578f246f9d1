#include "drivers/gpio/line.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <optional>
#include <thread>
#include <vector>

#include "drivers/gpio/simulated_chip.hpp"
#include "tests/unit/gpio/support.hpp"

namespace stereotrack::gpio {
namespace {

MonotonicTime at(int ms) { return MonotonicTime(std::chrono::milliseconds(ms)); }

LineSpec sim(const std::string& line, bool active_low = false, bool safe = false) {
  return {{"sim", line}, active_low, safe};
}

std::optional<bool> level(const std::string& line) { return simulated_chip::level(line); }

TEST(LineName, ChipAndLineAreDividedByTheLastColon) {
  EXPECT_EQ(parse_line_name("gpiochip0:17"), (LineName{"gpiochip0", "17"}));
  EXPECT_EQ(parse_line_name("/dev/gpiochip0:GPIO17"), (LineName{"/dev/gpiochip0", "GPIO17"}));
  EXPECT_EQ(parse_line_name("platform:1f00:x"), (LineName{"platform:1f00", "x"}));
  EXPECT_EQ(to_string(parse_line_name("sim:near gate")), "sim:near gate");
}

TEST(LineName, HalfANameIsRefused) {
  for (const char* text : {"", ":", "gpiochip0", "gpiochip0:", ":17", " sim:a", "sim:a "}) {
    EXPECT_EQ(refusal_of([&] { static_cast<void>(parse_line_name(text)); }),
              std::string("\"").append(text) +
                  "\" is no GPIO line: write CHIP:LINE, for example gpiochip0:17, pinctrl-bcm2711:GPIO17 or sim:near");
  }
}

TEST(OutputLines, NoneIsGood) {
  OutputLines none;
  EXPECT_EQ(none.size(), 0U);
  EXPECT_EQ(none.set(~LineBits{0}, at(1)).changed, 0U);
  EXPECT_EQ(open_lines({}, "test").size(), 0U);
}

TEST(OutputLines, ShowTheirSafeStateFromTheRequestToTheEnd) {
  const std::vector<LineSpec> specs = {sim("start", false, false), sim("start_safe", false, true),
                                       sim("start_low", true, false), sim("start_low_safe", true, true)};
  const auto expect_safe = [] {
    EXPECT_EQ(level("start"), false);
    EXPECT_EQ(level("start_safe"), true);
    EXPECT_EQ(level("start_low"), true);
    EXPECT_EQ(level("start_low_safe"), false);
  };
  EXPECT_EQ(level("start"), std::nullopt);
  {
    OutputLines lines = open_lines(specs, "test");
    expect_safe();
    EXPECT_FALSE(lines.read(0).active);
    EXPECT_TRUE(lines.read(1).active);
    EXPECT_EQ(lines.set(0b0101, at(1)).changed, 0b1111U);
    EXPECT_EQ(level("start"), true);
    EXPECT_EQ(level("start_safe"), false);
    EXPECT_EQ(level("start_low"), false);
    EXPECT_EQ(level("start_low_safe"), true);
  }
  expect_safe();
}

TEST(OutputLines, NoEdgeIsSeenWhereTheSafeStateWasShownBefore) {
  { const OutputLines lines = open_lines(std::vector{sim("no_edge", true, false)}, "test"); }
  EXPECT_EQ(level("no_edge"), true);
  const std::uint64_t before = simulated_chip::edges("no_edge");
  { const OutputLines lines = open_lines(std::vector{sim("no_edge", true, false)}, "test"); }
  EXPECT_EQ(simulated_chip::edges("no_edge"), before);
}

TEST(OutputLines, SetSafeIsTheSafeState) {
  OutputLines lines = open_lines(std::vector{sim("stop_a"), sim("stop_b", false, true)}, "test");
  lines.set(0b01, at(1));
  EXPECT_EQ(lines.set_safe(at(2)).changed, 0b11U);
  EXPECT_EQ(level("stop_a"), false);
  EXPECT_EQ(level("stop_b"), true);
}

TEST(OutputLines, HeldSafeTheyStaySoWhateverIsAskedFor) {
  const std::vector<LineSpec> specs{sim("held_a"), sim("held_b", false, true)};
  OutputLines lines = open_lines(specs, "test");
  static_cast<void>(lines.set(0b01, at(1)));
  EXPECT_EQ(level("held_a"), true);
  EXPECT_EQ(level("held_b"), false);
  EXPECT_TRUE(lines.hold_safe());
  EXPECT_EQ(level("held_a"), false);
  EXPECT_EQ(level("held_b"), true);
  static_cast<void>(lines.set(0b01, at(2)));
  EXPECT_EQ(level("held_a"), false);
  EXPECT_EQ(level("held_b"), true);
}

TEST(OutputLines, HeldSafeSaysWhereAChipRefuses) {
  const std::vector<LineSpec> specs{sim("held_gone")};
  OutputLines lines = open_lines(specs, "test");
  simulated_chip::set_gone("held_gone", true);
  EXPECT_FALSE(lines.hold_safe());
  simulated_chip::set_gone("held_gone", false);
}

TEST(OutputLines, BitsBeyondTheLinesMeanNothing) {
  OutputLines lines = open_lines(std::vector{sim("beyond")}, "test");
  EXPECT_EQ(lines.set(~LineBits{0}, at(1)).changed, 1U);
  EXPECT_EQ(lines.set(~LineBits{1}, at(2)).changed, 1U);
}

TEST(OutputLines, TransitionsAreCountedWithTheTimeThatWasTold) {
  OutputLines lines = open_lines(std::vector{sim("count_a"), sim("count_b")}, "test");
  lines.set(0b01, at(10));
  lines.set(0b01, at(20));
  lines.set(0b10, at(30));
  lines.set(0b11, at(40));
  EXPECT_EQ(lines.read(0).transitions, 3U);
  EXPECT_EQ(lines.read(0).changed, at(40));
  EXPECT_EQ(lines.read(1).transitions, 1U);
  EXPECT_EQ(lines.read(1).changed, at(30));
  EXPECT_TRUE(lines.read(1).active);
  EXPECT_EQ(simulated_chip::edges("count_a"), 3U);
}

TEST(OutputLines, AChipThatRefusesIsToldAndTriedAgain) {
  OutputLines lines = open_lines(std::vector{sim("gone_a"), sim("gone_b")}, "test");
  simulated_chip::set_refusing("gone_b", EIO);
  OutputLines::SetResult result = lines.set(0b01, at(1));
  EXPECT_EQ(result.changed, 0U);
  EXPECT_EQ(result.failed, 0b11U);
  EXPECT_EQ(lines.last_error(), EIO);
  EXPECT_EQ(lines.failing(), 0b11U);
  EXPECT_EQ(lines.gone(), 0U) << "it is there, and keeps its request";
  EXPECT_EQ(lines.outages(), 0U);
  EXPECT_EQ(lines.read(0).failures, 1U);
  EXPECT_FALSE(lines.read(0).active);
  EXPECT_EQ(level("gone_a"), false);
  // Even without anything new to tell: what the lines show is not known.
  EXPECT_EQ(lines.set(0b00, at(2)).failed, 0b11U);
  EXPECT_EQ(lines.reopen(), 0U) << "it would be busy";
  simulated_chip::set_refusing("gone_b", 0);
  result = lines.set(0b01, at(3));
  EXPECT_EQ(result.changed, 0b01U);
  EXPECT_EQ(result.failed, 0U);
  EXPECT_EQ(lines.failing(), 0U);
  EXPECT_EQ(level("gone_a"), true);
  EXPECT_EQ(lines.read(0).changed, at(3));
  EXPECT_EQ(lines.read(0).failures, 2U);
}

TEST(OutputLines, AChipThatWentIsRequestedAnewAndDrivenAsTheRulesSay) {
  const std::vector<LineSpec> specs{sim("usb_a"), sim("usb_b", false, true), sim("usb_c")};
  OutputLines lines = open_lines(specs, "test");
  static_cast<void>(lines.set(0b101, at(1)));
  simulated_chip::set_gone("usb_b", true);
  EXPECT_EQ(lines.set(0b100, at(2)).failed, 0b111U);
  EXPECT_EQ(lines.gone(), 0b111U);
  EXPECT_EQ(lines.outages(), 1U);
  std::string why;
  EXPECT_EQ(lines.reopen(&why), 0U);
  EXPECT_EQ(why, "GPIO line sim:usb_b: no such chip: the simulated one is gone");
  EXPECT_EQ(lines.set(0b100, at(3)).failed, 0b111U);
  EXPECT_EQ(lines.outages(), 1U) << "the same";

  simulated_chip::set_gone("usb_b", false);
  EXPECT_EQ(lines.set(0b100, at(4)).failed, 0b111U) << "what was requested before it went is dead for good";
  EXPECT_EQ(lines.reopen(), 0b111U);
  EXPECT_EQ(level("usb_b"), true) << "the safe state, from the request on";
  EXPECT_EQ(level("usb_a"), false);
  EXPECT_EQ(lines.gone(), 0b111U) << "until it is driven";
  EXPECT_EQ(lines.reopen(), 0U) << "it is on its way already";
  const OutputLines::SetResult result = lines.set(0b100, at(5));
  EXPECT_EQ(result.failed, 0U);
  EXPECT_EQ(lines.gone(), 0U);
  EXPECT_EQ(lines.failing(), 0U);
  EXPECT_EQ(level("usb_a"), false);
  EXPECT_EQ(level("usb_b"), false);
  EXPECT_EQ(level("usb_c"), true) << "nothing changed for it: it is driven all the same";
  EXPECT_TRUE(lines.read(2).active);
  EXPECT_EQ(lines.reopen(), 0U);
  EXPECT_EQ(open_refusal(std::vector{sim("usb_a")}), "GPIO line sim:usb_a: busy: held by \"test\"");

  // And again: there is a place for what was given up.
  for (int i = 0; i < 3; ++i) {
    simulated_chip::set_gone("usb_c", true);
    EXPECT_EQ(lines.refresh(at(10 + i)).failed, 0b111U) << "though nothing changes";
    simulated_chip::set_gone("usb_c", false);
    EXPECT_EQ(lines.reopen(), 0b111U);
    EXPECT_EQ(lines.refresh(at(20 + i)).failed, 0U);
    EXPECT_EQ(level("usb_c"), true);
  }
  EXPECT_EQ(lines.outages(), 4U);
}

TEST(OutputLines, HeldSafeAfterAChipCameBack) {
  OutputLines lines = open_lines(std::vector{sim("held_back", false, true)}, "test");
  simulated_chip::set_gone("held_back", true);
  static_cast<void>(lines.set(0, at(1)));
  simulated_chip::set_gone("held_back", false);
  EXPECT_EQ(lines.reopen(), 1U);
  static_cast<void>(lines.set(0, at(2)));
  EXPECT_EQ(level("held_back"), false);
  EXPECT_TRUE(lines.hold_safe());
  EXPECT_EQ(level("held_back"), true);
  EXPECT_EQ(lines.reopen(), 0U);
}

TEST(OutputLines, AChipGoesAndComesWhileItIsDriven) {
  OutputLines lines = open_lines(std::vector{sim("flapping"), sim("flapping_too")}, "test");
  std::atomic<bool> stop{false};
  std::thread driver([&] {
    for (int i = 0; !stop.load(); ++i) static_cast<void>(lines.set(static_cast<LineBits>(i & 3), at(i)));
  });
  for (int i = 0; i < 100; ++i) {
    simulated_chip::set_gone("flapping", true);
    while (lines.gone() == 0) std::this_thread::yield();
    simulated_chip::set_gone("flapping", false);
    EXPECT_EQ(lines.reopen(), 0b11U);
    while (lines.gone() != 0) std::this_thread::yield();
  }
  stop = true;
  driver.join();
  EXPECT_EQ(lines.outages(), 100U);
  static_cast<void>(lines.set(0b00, at(1)));
  EXPECT_EQ(lines.set(0b01, at(1)).failed, 0U);
  EXPECT_EQ(level("flapping"), true);
  EXPECT_EQ(level("flapping_too"), false);
}

TEST(OutputLines, MoveWithTheirLines) {
  OutputLines lines;
  lines = open_lines(std::vector{sim("moved")}, "test");
  OutputLines there = std::move(lines);
  there.set(1, at(1));
  EXPECT_EQ(level("moved"), true);
  there = OutputLines();
  EXPECT_EQ(level("moved"), false);
}

TEST(OutputLines, AreReadWhileTheyAreDriven) {
  OutputLines lines = open_lines(std::vector{sim("threads")}, "test");
  std::atomic<bool> stop{false};
  std::uint64_t last = 0;
  std::thread reader([&] {
    while (!stop.load()) {
      const std::uint64_t now = lines.read(0).transitions;
      EXPECT_GE(now, last);
      last = now;
      EXPECT_TRUE(simulated_chip::level("threads").has_value());
    }
  });
  for (int i = 0; i < 20000; ++i) lines.set(static_cast<LineBits>(i & 1), at(i));
  stop = true;
  reader.join();
  EXPECT_EQ(lines.read(0).transitions, 19999U);
}

TEST(OpenLines, ALineNamedTwiceIsRefused) {
  EXPECT_EQ(open_refusal(std::vector{sim("twice"), sim("other"), sim("twice")}),
            "GPIO line sim:twice: named twice: a line has one rule");
  EXPECT_EQ(open_lines(std::vector{sim("twice"), sim("other")}, "test").size(), 2U) << "all were let go";
}

TEST(OpenLines, AsManyAsThereAreBitsAndNoMore) {
  std::vector<LineSpec> specs;
  for (std::size_t i = 0; i < kMaxLines; ++i) specs.push_back(sim(numbered("many", i)));
  {
    OutputLines lines = open_lines(specs, "test");
    EXPECT_EQ(lines.set(LineBits{1} << (kMaxLines - 1), at(1)).changed, LineBits{1} << (kMaxLines - 1));
    EXPECT_EQ(level("many15"), true);
  }
  specs.push_back(sim("one_more"));
  EXPECT_EQ(open_refusal(specs), "GPIO line sim:one_more: one too many: a program drives 16 lines");
}

TEST(OpenLines, ALineInUseIsRefusedWithItsHolder) {
  const OutputLines lines = open_lines(std::vector{sim("held")}, "stereotrackd");
  EXPECT_EQ(open_refusal(std::vector{sim("free"), sim("held")}), "GPIO line sim:held: busy: held by \"stereotrackd\"");
  EXPECT_EQ(open_lines(std::vector{sim("free")}, "test").size(), 1U) << "all or none";
}

TEST(SetLinesSafe, EachIsDrivenAndTold) {
  {
    OutputLines lines = open_lines(std::vector{sim("crash_a"), sim("crash_b", true)}, "test");
    lines.set(0b11, at(1));
    EXPECT_EQ(level("crash_a"), true);
    EXPECT_EQ(level("crash_b"), false);
  }
  const std::vector<LineSpec> specs = {sim("crash_a", false, true), sim("crash_b", true, false)};
  const auto outcomes = set_lines_safe(specs, "test");
  ASSERT_EQ(outcomes.size(), 2U);
  EXPECT_TRUE(outcomes[0].done);
  EXPECT_EQ(outcomes[0].text, "GPIO line sim:crash_a: driven active, its safe state (high), and let go");
  EXPECT_EQ(outcomes[1].text, "GPIO line sim:crash_b: driven inactive, its safe state (high), and let go");
  EXPECT_EQ(level("crash_a"), true);
  EXPECT_EQ(level("crash_b"), true);
}

TEST(SetLinesSafe, GoesOnPastALineThatFails) {
  const OutputLines holder = open_lines(std::vector{sim("fail_held")}, "somebody");
  const std::vector<LineSpec> specs = {sim("fail_a", false, true), sim("fail_held"), sim("fail_b", false, true)};
  const auto outcomes = set_lines_safe(specs, "test");
  ASSERT_EQ(outcomes.size(), 3U);
  EXPECT_TRUE(outcomes[0].done);
  EXPECT_FALSE(outcomes[1].done);
  EXPECT_EQ(outcomes[1].text, "GPIO line sim:fail_held: busy: held by \"somebody\"");
  EXPECT_TRUE(outcomes[2].done);
  EXPECT_EQ(level("fail_b"), true);
}

}  // namespace
}  // namespace stereotrack::gpio
