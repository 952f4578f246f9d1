#include "firmware-app/signals/set_up.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "config/signals.hpp"
#include "drivers/gpio/simulated_chip.hpp"
#include "tests/unit/signals/targets.hpp"

namespace stereotrack::signals {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kStale{1000};

config::Configuration said(const std::string& toml) {
  return config::load(std::vector{config::text_layer("rig.toml", toml)}).configuration;
}

MonotonicTime at(double ms) { return MonotonicTime(std::chrono::nanoseconds(static_cast<std::int64_t>(ms * 1e6))); }

SignalRules::Inputs seen(const std::vector<TrackReport>& tracks) {
  return {.tracks = tracks, .tracks_known = true, .depth_known = true, .deadline_missed = false, .healthy = true};
}

/// Every condition once, in the order of the enumeration.
const std::string kAll = R"(
[[zone]]
name = "unused"
z_m = [1, 2]
[[zone]]
name = "picture"
picture = [[0, 0], [10, 0], [10, 10], [0, 10]]
[[zone]]
name = "gate"
x_m = [1, 2]
[[signal]]
name = "any"
line = "sim:any"
[[signal]]
name = "in"
line = "sim:in"
when = "in_zone"
zone = "gate"
[[signal]]
name = "near"
line = "sim:close"
when = "distance_below"
limit_m = 3
[[signal]]
name = "soon"
line = "sim:soon"
when = "time_to_reach_below"
limit_s = 2
[[signal]]
name = "beat"
line = "sim:beat"
when = "heartbeat"
period_ms = 50
[[signal]]
name = "missed"
line = "sim:missed"
when = "deadline_missed"
)";

TEST(SetUp, EachConditionIsTheOneThatWasSaid) {
  SignalRules rules = make_rules(said(kAll), 1, kStale);
  ASSERT_EQ(rules.size(), 6U);
  EXPECT_EQ(rules.decide(seen({}), at(0)), 0b010000U);
  EXPECT_EQ(rules.advance(at(24.9)), 0b010000U);
  EXPECT_EQ(rules.advance(at(25)), 0b000000U) << "half of the period";
  EXPECT_EQ(rules.decide(seen({target_at(0, 0, 9)}), at(26)), 0b000001U);
  EXPECT_EQ(rules.decide(seen({target_at(1.5, 0, 9)}), at(27)), 0b000011U) << "the other axes: anywhere";
  EXPECT_EQ(rules.decide(seen({target_at(0, 0, 2.9)}), at(28)), 0b000101U);
  TrackReport target = target_at(0, 0, 9);
  target.velocity = {0, 0, -5};
  EXPECT_EQ(rules.decide(seen({target}), at(29)), 0b001001U);
  SignalRules::Inputs missed = seen({});
  missed.deadline_missed = true;
  EXPECT_EQ(rules.decide(missed, at(30)), 0b100000U);
}

TEST(SetUp, UnitOfTheCalibrationIsTaken) {
  SignalRules rules = make_rules(said(kAll), 0.0254, kStale);
  EXPECT_EQ(rules.decide(seen({target_at(0, 0, 118)}), at(0)), 0b010101U);
  EXPECT_EQ(rules.decide(seen({target_at(0, 0, 119)}), at(1)), 0b010001U);
}

TEST(SetUp, ZonesOfThePictureAndTheirAnchor) {
  const std::string zone = "[[zone]]\nname = \"p\"\npicture = [[0, 100], [200, 100], [200, 200], [0, 200]]\n";
  const std::string signal = "[[signal]]\nname = \"s\"\nline = \"sim:s\"\nwhen = \"in_zone\"\nzone = \"p\"\n";
  SignalRules by_centre = make_rules(said(zone + signal), 0, kStale);
  SignalRules by_bottom = make_rules(said(zone + "anchor = \"bottom\"\n" + signal), 0, kStale);
  const std::vector<TrackReport> tracks{target_in_picture(50, 95)};
  EXPECT_EQ(by_centre.decide(seen(tracks), at(0)), 0U);
  EXPECT_EQ(by_bottom.decide(seen(tracks), at(0)), 1U);
}

TEST(SetUp, PulseHoldAndStaleness) {
  SignalRules rules =
      make_rules(said("[[signal]]\nname = \"p\"\nline = \"sim:p\"\nmode = \"pulse\"\npulse_ms = 0.5\n"
                      "[[signal]]\nname = \"h\"\nline = \"sim:h\"\nhold_ms = 20.25\nsafe = \"active\"\n"),
                 0, kStale);
  EXPECT_EQ(rules.safe_lines(), 0b10U);
  EXPECT_EQ(rules.decide(seen({target_at(0, 0, 1)}), at(0)), 0b11U);
  EXPECT_EQ(rules.next_change(), at(0.5));
  EXPECT_EQ(rules.decide(seen({}), at(1)), 0b10U);
  EXPECT_EQ(rules.next_change(), at(20.25));
  EXPECT_EQ(rules.advance(at(20.25)), 0b00U);
  EXPECT_EQ(rules.next_change(), at(1001));
  EXPECT_EQ(rules.advance(at(1001)), 0b10U);
}

TEST(SetUp, MetresWithoutAUnitAreRefused) {
  try {
    (void)make_rules(said(kAll), 0, kStale);
    FAIL();
  } catch (const config::Error& error) {
    EXPECT_STREQ(
        error.what(),
        "zones and signals: contradicting configuration: give calibration.unit_m if they are in metres, or see "
        "docs/SIGNALS.md");
  }
}

TEST(SetUp, TheMostThatLoadTakesFits) {
  std::string text;
  for (int i = 0; i < 16; ++i) {
    std::string corners;
    for (int k = 0; k < 16; ++k)
      corners += (k == 0 ? "[" : ", [") + std::to_string(k) + ", " + std::to_string(k * k) + "]";
    const std::string number = std::to_string(i);
    text.append("[[zone]]\nname = \"z").append(number).append("\"\npicture = [").append(corners).append("]\n");
    text.append("[[signal]]\nname = \"s").append(number).append("\"\nline = \"sim:most").append(number);
    text.append("\"\nwhen = \"in_zone\"\nzone = \"z").append(number).append("\"\n");
  }
  const config::Configuration most = said(text);
  EXPECT_EQ(make_rules(most, 0, kStale).size(), 16U);
  EXPECT_EQ(gpio::open_lines(line_specs(most), "test").size(), 16U);
}

TEST(SetUp, LinesHaveTheirPolarityAndSafeState) {
  const auto specs =
      line_specs(said("[[signal]]\nname = \"a\"\nline = \"gpiochip0:17\"\n"
                      "[[signal]]\nname = \"b\"\nline = \"/dev/gpiochip1:GPIO4\"\nactive = \"low\"\n"
                      "[[signal]]\nname = \"c\"\nline = \"sim:c\"\nsafe = \"active\"\n"));
  ASSERT_EQ(specs.size(), 3U);
  EXPECT_EQ(specs[0].name, (gpio::LineName{"gpiochip0", "17"}));
  EXPECT_FALSE(specs[0].active_low);
  EXPECT_FALSE(specs[0].safe);
  EXPECT_EQ(specs[1].name, (gpio::LineName{"/dev/gpiochip1", "GPIO4"}));
  EXPECT_TRUE(specs[1].active_low);
  EXPECT_FALSE(specs[1].safe);
  EXPECT_TRUE(specs[2].safe);
}

TEST(SetUp, WhatLoadTakesForALineTheDriverTakesToo) {
  // The two do not know each other; neither may take what the other refuses.
  for (const std::string line : {"a:b", "a:b:c", "a b:c", ":b", "a:", "a", "", " a:b", "a:b ", "a: b", "::", "a::b"}) {
    bool loads = true;
    bool parses = true;
    try {
      (void)said("[[signal]]\nname = \"s\"\nline = \"" + line + "\"\n");
    } catch (const config::Error&) {
      loads = false;
    }
    try {
      (void)gpio::parse_line_name(line);
    } catch (const std::runtime_error&) {
      parses = false;
    }
    EXPECT_EQ(loads, parses) << '"' << line << '"';
  }
}

TEST(SetUp, ExamplesOfThePageAreRight) {
  std::ifstream page(STEREOTRACK_SOURCE_DIR "/docs/SIGNALS.md");
  const std::string text{std::istreambuf_iterator<char>(page), {}};
  const std::string fence = "```toml\n";
  std::size_t examples = 0;
  for (std::size_t at = text.find(fence); at != text.npos; at = text.find(fence, at + 1)) {
    const std::size_t begin = at + fence.size();
    const config::Configuration example = said(text.substr(begin, text.find("```", begin) - begin));
    EXPECT_EQ(make_rules(example, 1, kStale).size(), line_specs(example).size());
    ++examples;
  }
  EXPECT_GE(examples, 1U);
}

TEST(SetUp, FromTheFileToThePin) {
  const config::Configuration configuration =
      said("[[signal]]\nname = \"a\"\nline = \"sim:pin\"\nwhen = \"distance_below\"\nlimit_m = 3\nactive = \"low\"\n");
  SignalRules rules = make_rules(configuration, 1, kStale);
  gpio::OutputLines lines = gpio::open_lines(line_specs(configuration), "test");
  EXPECT_EQ(gpio::simulated_chip::level("pin"), true);
  lines.set(rules.decide(seen({target_at(0, 0, 2)}), at(0)), at(0));
  EXPECT_EQ(gpio::simulated_chip::level("pin"), false);
  lines.set(rules.decide(seen({target_at(0, 0, 4)}), at(33)), at(33));
  EXPECT_EQ(gpio::simulated_chip::level("pin"), true);
}

}  // namespace
}  // namespace stereotrack::signals
