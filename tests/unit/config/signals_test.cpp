#include "config/signals.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "config/rules.hpp"
#include "config/schema.hpp"

namespace stereotrack::config {
namespace {

using Layers = std::vector<Layer>;

std::string refused(const Layers& layers) {
  try {
    (void)load(layers);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}
std::string refused(const std::string& toml) { return refused(Layers{text_layer("rig.toml", toml)}); }
Configuration loaded(const std::string& toml) { return load(Layers{text_layer("rig.toml", toml)}).configuration; }

/// A zone and a signal that are good; what follows is the rest of the signal.
const std::string kGate = "[[zone]]\nname = \"gate\"\nz_m = [0, 5]\n";
std::string signal(const std::string& rest) { return "[[signal]]\nname = \"near\"\nline = \"sim:near\"\n" + rest; }

TEST(Signals, AllThatCanBeSaid) {
  const Configuration c = loaded(R"(
[[zone]]
name = "gate"
x_m = [-1, 1]
y_m = [-2.5, 2]
z_m = [0, 5]
[[zone]]
name = "floor"
picture = [[0, 0], [100, 0.5], [100, 480]]
anchor = "bottom"
[[signal]]
name = "near"
line = "gpiochip0:17"
when = "distance_below"
limit_m = 3.0
zone = "gate"
active = "low"
mode = "pulse"
pulse_ms = 50
hold_ms = 200
safe = "active"
[[signal]]
name = "beat"
line = "sim:beat"
when = "heartbeat"
period_ms = 1000
)");
  ASSERT_EQ(c.zones.size(), 2U);
  EXPECT_EQ(c.zones[0].name, "gate");
  EXPECT_EQ(c.zones[0].y_m, (std::array<double, 2>{-2.5, 2}));
  EXPECT_EQ(c.zones[1].picture, (std::vector<std::array<double, 2>>{{0, 0}, {100, 0.5}, {100, 480}}));
  EXPECT_EQ(c.zones[1].anchor, ZoneAnchor::kBottom);
  ASSERT_EQ(c.signals.size(), 2U);
  EXPECT_EQ(c.signals[0].line, "gpiochip0:17");
  EXPECT_EQ(c.signals[0].when, SignalWhen::kDistanceBelow);
  EXPECT_EQ(c.signals[0].zone, "gate");
  EXPECT_EQ(c.signals[0].limit_m, 3.0);
  EXPECT_EQ(c.signals[0].active, ActiveLevel::kLow);
  EXPECT_EQ(c.signals[0].mode, SignalMode::kPulse);
  EXPECT_EQ(c.signals[0].pulse_ms, 50);
  EXPECT_EQ(c.signals[0].hold_ms, 200);
  EXPECT_EQ(c.signals[0].safe, SafeState::kActive);
  EXPECT_EQ(c.signals[1].when, SignalWhen::kHeartbeat);
  EXPECT_EQ(c.signals[1].period_ms, 1000);
  EXPECT_EQ(c.signals[1].safe, SafeState::kInactive) << "what is not said has its default";
}

TEST(Signals, LoadedOnesSurviveTheRoundTripThroughText) {
  const Configuration first =
      loaded(kGate + "[[zone]]\nname = \"p\"\npicture = [[0, 0], [1, 0], [0.1, 1]]\n" + signal("zone = \"gate\"\n"));
  const Configuration second = loaded(to_text(first));
  EXPECT_EQ(to_text(second), to_text(first));
  EXPECT_EQ(second.zones[1].picture, first.zones[1].picture);
}

TEST(Signals, InlineTablesAndNoneAtAllAreGood) {
  EXPECT_EQ(loaded("zone = [{name = \"a\", z_m = [0, 1]}, {name = \"b\", z_m = [0, 1]}]").zones.size(), 2U);
  EXPECT_EQ(loaded("zone = []").zones.size(), 0U);
}

TEST(Signals, ALaterLayersListTakesThePlaceOfTheEarlierOne) {
  const Layer first = text_layer("a.toml", kGate + signal("zone = \"gate\"\nhold_ms = 10\n"));
  const Layer second = text_layer("b.toml", "[[signal]]\nname = \"other\"\nline = \"sim:o\"\n");
  const Loaded both = load(Layers{first, second});
  ASSERT_EQ(both.configuration.signals.size(), 1U);
  EXPECT_EQ(both.configuration.signals[0].name, "other");
  EXPECT_EQ(both.configuration.signals[0].hold_ms, 0);
  EXPECT_EQ(both.configuration.zones.size(), 1U) << "another list";
  EXPECT_EQ(both.origins.at("signal[1].name"), "b.toml:2:8");
  EXPECT_FALSE(both.origins.contains("signal[1].hold_ms"));
  EXPECT_EQ(load(Layers{first, text_layer("b.toml", "signal = []")}).configuration.signals.size(), 0U);
  // What is missing in the second is not taken from the first.
  EXPECT_EQ(refused(Layers{first, text_layer("b.toml", "[[signal]]\nname = \"other\"\n")}),
            "b.toml:1:1: signal[1].line: it is missing: give a text in quotes");
}

TEST(Signals, UnknownKeyNamesItsPlaceAndTheNearest) {
  EXPECT_EQ(refused(signal("holdms = 3")),
            "rig.toml:4:1: signal[1].holdms: unknown key: did you mean signal[1].hold_ms?");
  EXPECT_EQ(refused(kGate + kGate + "q = 3").substr(0, 36), "rig.toml:7:1: zone[2].q: unknown key");
  EXPECT_EQ(refused(signal("when.x = 3")).substr(0, 30), "rig.toml:4:1: signal[1].when: ");
}

TEST(Signals, WrongTypeAndRangeNamePlaceAndWhatIsExpected) {
  EXPECT_EQ(refused(signal("hold_ms = \"3\"")),
            "rig.toml:4:11: signal[1].hold_ms: a number such as 0.0 is expected, not a text");
  EXPECT_EQ(refused(signal("hold_ms = -1")),
            "rig.toml:4:11: signal[1].hold_ms: -1 is out of range: give 0 to 60000 ms");
  EXPECT_EQ(refused(signal("limit_m = nan")), "rig.toml:4:11: signal[1].limit_m: nan is not finite: give 0 to 1000 m");
  EXPECT_EQ(refused(signal("mode = \"edge\"")),
            "rig.toml:4:8: signal[1].mode: \"edge\" is not known: give one of \"level\", \"pulse\"");
  EXPECT_EQ(refused("[[zone]]\nname = \"a\"\nx_m = [1, 2, 3]"), "rig.toml:3:7: zone[1].x_m: 3 numbers given: give 2");
  EXPECT_EQ(refused("[[zone]]\nname = \"a\"\nx_m = [1, 1e9]"),
            "rig.toml:3:7: zone[1].x_m: 1e+09 is out of range: give -1000 to 1000 m");
}

TEST(Signals, PointsAreListsOfTwoNumbers) {
  const std::string head = "[[zone]]\nname = \"a\"\npicture = ";
  const std::string expected =
      "rig.toml:3:11: zone[1].picture: a list of points such as [[0, 0], [100, 0], [100, 480]] is expected, not ";
  EXPECT_EQ(refused(head + "3"), expected + "an integer");
  for (const char* bad : {"[0, 0, 100, 0, 100, 480]", "[[0, 0], [1, 0], [1]]", "[[0, 0], [1, 0], [1, 2, 3]]",
                          "[[0, 0], [1, 0], [1, \"a\"]]", "[[0, 0], [1, 0], {x = 1}]"}) {
    EXPECT_EQ(refused(head + bad), expected + "another list") << bad;
  }
  EXPECT_EQ(refused(head + "[[0, 0], [1, 0], [1e6, 0]]"),
            "rig.toml:3:11: zone[1].picture: 1e+06 is out of range: give -100000 to 100000 px");
  std::string many;
  for (int i = 0; i < 16; ++i) many += (i == 0 ? "[" : ", [") + std::to_string(i) + ", " + std::to_string(i * i) + "]";
  EXPECT_EQ(refused(head + "[" + many + "]"), "");
  EXPECT_EQ(refused(head + "[" + many + ", [0, 9]]"),
            "rig.toml:3:11: zone[1].picture: 17 points given: give at most 16");
}

TEST(Signals, WhatIsNoListOfTablesIsRefused) {
  const std::string expected = "signal: a list of tables, [[signal]] and its keys below each, is expected, not ";
  EXPECT_EQ(refused("[signal]\nname = \"a\""), "rig.toml:1:1: " + expected + "a table");
  EXPECT_EQ(refused("signal = 3"), "rig.toml:1:10: " + expected + "an integer");
  EXPECT_EQ(refused("signal = [3]"), "rig.toml:1:10: " + expected + "another list");
  EXPECT_EQ(refused("[[signals]]\nname = \"a\""), "rig.toml:1:3: signals: unknown key: did you mean signal?");
}

TEST(Signals, WhatHasToBeGivenIsMissed) {
  EXPECT_EQ(refused("[[zone]]\nz_m = [0, 1]"), "rig.toml:1:1: zone[1].name: it is missing: give a text in quotes");
  EXPECT_EQ(refused(signal("") + "[[signal]]\nname = \"b\"\n"),
            "rig.toml:4:1: signal[2].line: it is missing: give a text in quotes");
}

TEST(Signals, NamesAndLinesHaveTheirForm) {
  for (const char* bad : {"", "a b", "a\\\"b", "ä", "123456789012345678901234567890123"}) {
    EXPECT_NE(refused("[[signal]]\nname = \"" + std::string(bad) + "\"\nline = \"a:b\"")
                  .find("is no name: give 1 to 32 letters, digits, _ and -"),
              std::string::npos)
        << bad;
  }
  for (const char* bad : {"", "gpiochip0", ":17", "gpiochip0:", " a:b", "a:b "}) {
    EXPECT_EQ(refused("[[signal]]\nname = \"a\"\nline = \"" + std::string(bad) + "\""),
              "rig.toml:3:8: signal[1].line: \"" + std::string(bad) +
                  "\" is no GPIO line: write CHIP:LINE, for example \"gpiochip0:17\", \"pinctrl-bcm2711:GPIO17\" or "
                  "\"sim:near\"");
  }
}

TEST(Signals, AsManyAsThereMayBe) {
  std::string text;
  for (int i = 0; i < 16; ++i) {
    text += "[[signal]]\nname = \"s" + std::to_string(i) + "\"\nline = \"sim:" + std::to_string(i) + "\"\n";
  }
  EXPECT_EQ(refused(text), "");
  EXPECT_EQ(refused(text + "[[signal]]\nname = \"x\"\nline = \"sim:x\"\n"),
            "rig.toml:49:1: signal: there may be 16: leave one out");
}

TEST(Signals, CannotBeSetOnTheCommandLine) {
  for (const char* text : {"signal=3", "signal.limit_m=3", "signal[1].limit_m=3"}) {
    const std::string told = refused(Layers{override_layer(text)});
    EXPECT_NE(told.find("signal is a list of tables: write [[signal]] into a file and give it to --config"),
              std::string::npos)
        << told;
    EXPECT_TRUE(told.starts_with("--set ")) << told;
  }
}

TEST(Signals, ZoneThatThereIsNotIsRefusedWithTheOnesThereAre) {
  EXPECT_EQ(refused(kGate + signal("zone = \"gate\"")), "");
  EXPECT_EQ(refused(kGate + signal("zone = \"yard\"")),
            "rig.toml:7:8: signal[1].zone: there is no zone \"yard\": there are \"gate\"");
  EXPECT_EQ(refused(signal("zone = \"yard\"")),
            "rig.toml:4:8: signal[1].zone: there is no zone \"yard\": write a [[zone]] of this name");
}

TEST(Signals, WhatAConditionNeedsIsMissed) {
  EXPECT_EQ(refused(signal("when = \"in_zone\"")), "rig.toml:1:1: signal[1]: zone: it is missing: in_zone needs it");
  EXPECT_EQ(refused(signal("when = \"distance_below\"")),
            "rig.toml:1:1: signal[1]: limit_m: distance_below needs it: give a distance above 0");
  EXPECT_EQ(refused(signal("when = \"time_to_reach_below\"\nlimit_s = 0")),
            "rig.toml:5:11: signal[1].limit_s: time_to_reach_below needs it: give a time above 0");
  EXPECT_EQ(refused(signal("mode = \"pulse\"")),
            "rig.toml:1:1: signal[1]: pulse_ms: a pulse needs it: give a width above 0");
  EXPECT_EQ(refused(signal("when = \"distance_below\"\nlimit_m = 0.1")), "");
  EXPECT_EQ(refused(signal("when = \"time_to_reach_below\"\nlimit_s = 0.1")), "");
  EXPECT_EQ(refused(signal("mode = \"pulse\"\npulse_ms = 0.1")), "");
}

TEST(Signals, WhatContradictsAConditionIsRefused) {
  EXPECT_EQ(refused(kGate + signal("when = \"heartbeat\"\nzone = \"gate\"")),
            "rig.toml:8:8: signal[1].zone: heartbeat and deadline_missed are not about targets: leave the zone out");
  EXPECT_EQ(refused(signal("when = \"heartbeat\"\nmode = \"pulse\"\npulse_ms = 9")),
            "rig.toml:5:8: signal[1].mode: a heartbeat toggles: leave the mode out, and give period_ms");
}

TEST(Signals, ZonesAreEitherInSpaceOrInThePicture) {
  EXPECT_EQ(
      refused("[[zone]]\nname = \"a\"\nz_m = [0, 1]\npicture = [[0, 0], [1, 0], [0, 1]]"),
      "rig.toml:4:11: zone[1].picture: the zone has metres, too: give a box in space or a polygon in the picture");
  EXPECT_EQ(refused("[[zone]]\nname = \"a\""),
            "rig.toml:2:8: zone[1].name: the zone is everywhere: give x_m, y_m or z_m, or the corners of picture");
  EXPECT_EQ(refused("[[zone]]\nname = \"a\"\npicture = [[0, 0], [1, 0]]"),
            "rig.toml:3:11: zone[1].picture: a polygon has at least 3 corners: give more");
  EXPECT_EQ(refused("[[zone]]\nname = \"a\"\ny_m = [2, 1]"),
            "rig.toml:3:7: zone[1].y_m: it ends before it begins: give [FROM, TO]");
}

TEST(Signals, NamesAndLinesAreGivenOnce) {
  EXPECT_EQ(refused(kGate + kGate),
            "rig.toml:5:8: zone[2].name: \"gate\" is that of zone[1], too (rig.toml:2:8): give each zone its own name");
  EXPECT_EQ(refused(signal("") + "[[signal]]\nname = \"near\"\nline = \"sim:b\""),
            "rig.toml:5:8: signal[2].name: \"near\" is that of signal[1], too (rig.toml:2:8): give each signal its own "
            "name");
  EXPECT_EQ(refused(signal("") + "[[signal]]\nname = \"b\"\nline = \"sim:near\""),
            "rig.toml:6:8: signal[2].line: \"sim:near\" is that of signal[1], too (rig.toml:3:8): a line has one rule");
}

std::string refused_without_unit(const std::string& toml) {
  try {
    check_metres(load(Layers{text_layer("rig.toml", toml)}), 0);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(Signals, MetresNeedAKnownUnit) {
  const std::string told =
      ": it is in metres, and the calibration's unit is not known: set calibration.unit_m to the metres in one unit of "
      "T";
  EXPECT_EQ(refused_without_unit(kGate), "rig.toml:3:7: zone[1].z_m" + told);
  EXPECT_EQ(refused_without_unit(signal("when = \"distance_below\"\nlimit_m = 3")),
            "rig.toml:5:11: signal[1].limit_m" + told);
  EXPECT_EQ(refused_without_unit("[[zone]]\nname = \"a\"\npicture = [[0, 0], [1, 0], [0, 1]]\n" +
                                 signal("when = \"time_to_reach_below\"\nlimit_s = 3\nzone = \"a\"")),
            "");
}

/// An input that is good; what follows is the rest of it.
std::string input(const std::string& rest) { return "[[input]]\nname = \"door\"\nline = \"sim:door\"\n" + rest; }

TEST(Inputs, AllThatCanBeSaid) {
  const Configuration c = loaded(R"(
[[input]]
name = "door"
line = "pinctrl-bcm2711:GPIO5"
edge = "both"
active = "low"
bias = "pull_up"
debounce_ms = 5
apart_ms = 250.5
[[input]]
name = "other"
line = "sim:/tmp/other"
[record]
on_input = false
)");
  ASSERT_EQ(c.inputs.size(), 2U);
  const InputConfig& door = c.inputs[0];
  EXPECT_EQ(door.name, "door");
  EXPECT_EQ(door.line, "pinctrl-bcm2711:GPIO5");
  EXPECT_EQ(door.edge, InputEdge::kBoth);
  EXPECT_EQ(door.active, ActiveLevel::kLow);
  EXPECT_EQ(door.bias, InputBias::kPullUp);
  EXPECT_EQ(door.debounce_ms, 5);
  EXPECT_EQ(door.apart_ms, 250.5);
  EXPECT_EQ(c.inputs[1], (InputConfig{.name = "other", .line = "sim:/tmp/other"}));
  EXPECT_FALSE(c.record.on_input);
  EXPECT_TRUE(loaded(input("")).record.on_input);
}

TEST(Inputs, ContradictionsAreToldAtTheKeyThatSaysThem) {
  EXPECT_EQ(refused("[[input]]\nname = \"door\"\n"),
            "rig.toml:1:1: input[1].line: it is missing: give a text in quotes");
  EXPECT_EQ(
      refused("[[input]]\nname = \"door\"\nline = \"gpiochip0\"\n"),
      "rig.toml:3:8: input[1].line: \"gpiochip0\" is no GPIO line: write CHIP:LINE, for example \"gpiochip0:17\", "
      "\"pinctrl-bcm2711:GPIO17\" or \"sim:near\"");
  EXPECT_EQ(refused(input("bias = \"up\"\n")),
            "rig.toml:4:8: input[1].bias: \"up\" is not known: give one of \"as_is\", \"none\", \"pull_up\", "
            "\"pull_down\"");
  EXPECT_EQ(refused(input("apart_ms = -1\n")),
            "rig.toml:4:12: input[1].apart_ms: -1 is out of range: give 0 to 3600000 ms");
  EXPECT_EQ(
      refused(input("") + "[[input]]\nname = \"door\"\nline = \"sim:b\"\n"),
      "rig.toml:5:8: input[2].name: \"door\" is that of input[1], too (rig.toml:2:8): give each input its own name");
  EXPECT_EQ(refused(input("") + "[[input]]\nname = \"b\"\nline = \"sim:door\"\n"),
            "rig.toml:6:8: input[2].line: \"sim:door\" is that of input[1], too (rig.toml:3:8): give each input its "
            "own line");
  EXPECT_EQ(
      refused(signal("") + "[[input]]\nname = \"door\"\nline = \"sim:near\"\n"),
      "rig.toml:6:8: input[1].line: \"sim:near\" is driven by signal[1] (rig.toml:3:8): a line is read or driven");
}

TEST(Inputs, SixteenAndNoMore) {
  std::string toml;
  for (std::size_t i = 0; i <= kMaxInputs; ++i) {
    if (i == kMaxInputs) {
      EXPECT_EQ(refused(toml), "");
    }
    toml += "[[input]]\nname = \"n" + std::to_string(i) + "\"\nline = \"sim:l" + std::to_string(i) + "\"\n";
  }
  EXPECT_EQ(refused(toml), "rig.toml:49:1: input: there may be 16: leave one out");
}

}  // namespace
}  // namespace stereotrack::config
