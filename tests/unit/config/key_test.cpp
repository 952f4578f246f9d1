#include "config/key.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "config/load.hpp"

namespace stereotrack::config {
namespace {

enum class Mode : unsigned char { kRegions, kDense };

/// A member of every kind, so that kinds are tested whatever keys the product has at the moment.
struct Members {
  bool on = false;
  int rows = 2;
  std::uint8_t small = 7;
  double gain = 0.1;
  float ratio = 0.1F;
  std::string name = "a \"b\"\n";
  Mode mode = Mode::kDense;
  std::vector<std::string> words{"x", "y"};
  std::array<double, 2> pair{1, 2.5};

  std::vector<Key> keys() {
    return {
        key("on", on, "d"),
        key("rows", rows, -3, 9, "px", "d"),
        key("small", small, 0, 255, "", "d"),
        key("gain", gain, 0, 1, "", "d"),
        key("ratio", ratio, 0, 1, "", "d"),
        key("name", name, nullptr, "d"),
        key("mode", mode, {{"regions", Mode::kRegions}, {"dense", Mode::kDense}}, "d"),
        key("words", words, nullptr, "d"),
        key("pair", pair, 0, 5, "m", "d"),
    };
  }
};

/// What apply() refuses it with; empty if it does not.
std::string refused(const Layer& layer) {
  Members members;
  Origins origins;
  try {
    apply(layer, members.keys(), origins);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(Key, EveryKindPrintsAsToml) {
  Members members;
  std::vector<std::string> texts;
  for (const Key& key : members.keys()) texts.push_back(value_text(key));
  EXPECT_EQ(texts, (std::vector<std::string>{"false", "2", "7", "0.1", "0.1", "\"a \\\"b\\\"\\u000A\"", "\"dense\"",
                                             "[\"x\", \"y\"]", "[1.0, 2.5]"}));
}

TEST(Key, EveryKindIsReadFromToml) {
  Members members;
  Origins origins;
  apply(text_layer("t",
                   "on = true\nrows = -3\nsmall = 255\ngain = 1\nratio = 0.3\nname = 'n'\nmode = \"regions\"\n"
                   "words = []\npair = [0, 0.5]\n"),
        members.keys(), origins);
  EXPECT_TRUE(members.on);
  EXPECT_EQ(members.rows, -3);
  EXPECT_EQ(members.small, 255);
  EXPECT_EQ(members.gain, 1.0);  // an integer where a number is wanted
  EXPECT_EQ(members.ratio, 0.3F);
  EXPECT_EQ(members.name, "n");
  EXPECT_EQ(members.mode, Mode::kRegions);
  EXPECT_TRUE(members.words.empty());
  EXPECT_EQ(members.pair, (std::array<double, 2>{0, 0.5}));
}

TEST(Key, PrintedNumbersReadBackBitForBit) {
  for (const double value : {0.1, 1.0 / 3, 1e-300, 1.7976931348623157e308, 5e-324, 123456789.0, -0.5}) {
    double member = value;
    const double top = std::numeric_limits<double>::max();
    const std::vector<Key> keys{key("v", member, -top, top, "", "d")};
    const std::string text = "v = " + value_text(keys[0]);
    member = 77;
    Origins origins;
    apply(text_layer("t", text), keys, origins);
    EXPECT_EQ(member, value) << text;
  }
}

TEST(Key, WrongTypeNamesPlaceAndWhatIsExpected) {
  EXPECT_EQ(refused(text_layer("t", "on = 1")), "t:1:6: on: true or false is expected, not an integer");
  EXPECT_EQ(refused(text_layer("t", "\nrows = 1.0")),
            "t:2:8: rows: an integer such as 2 is expected, not a number with a point");
  EXPECT_EQ(refused(text_layer("t", "gain = \"1\"")), "t:1:8: gain: a number such as 0.1 is expected, not a text");
  EXPECT_EQ(refused(text_layer("t", "gain = true")),
            "t:1:8: gain: a number such as 0.1 is expected, not true or false");
  EXPECT_EQ(refused(text_layer("t", "name = 2020-01-01")),
            "t:1:8: name: a text in quotes is expected, not a date or time");
  EXPECT_EQ(refused(text_layer("t", "mode = 1")),
            "t:1:8: mode: one of \"regions\", \"dense\" is expected, not an integer");
  EXPECT_EQ(refused(text_layer("t", "words = 'x'")),
            "t:1:9: words: a list of texts such as [\"a\", \"b\"] is expected, not a text");
  EXPECT_EQ(refused(text_layer("t", "words = ['x', 1]")),
            "t:1:9: words: a list of texts such as [\"a\", \"b\"] is expected, not another list");
  EXPECT_EQ(refused(text_layer("t", "[rows]\nx = 1")), "t:1:1: rows: an integer such as 2 is expected, not a table");
}

TEST(Key, RangeIncludesItsEnds) {
  EXPECT_EQ(refused(text_layer("t", "rows = -3")), "");
  EXPECT_EQ(refused(text_layer("t", "rows = 9")), "");
  EXPECT_EQ(refused(text_layer("t", "rows = -4")), "t:1:8: rows: -4 is out of range: give -3 to 9 px");
  EXPECT_EQ(refused(text_layer("t", "rows = 10")), "t:1:8: rows: 10 is out of range: give -3 to 9 px");
  EXPECT_EQ(refused(text_layer("t", "rows = 9223372036854775807")).find("t:1:8: rows: "), 0U);
  EXPECT_EQ(refused(text_layer("t", "small = 256")), "t:1:9: small: 256 is out of range: give 0 to 255");
  EXPECT_EQ(refused(text_layer("t", "pair = [1, 6]")), "t:1:8: pair: 6 is out of range: give 0 to 5 m");
  EXPECT_EQ(refused(text_layer("t", "pair = [1]")), "t:1:8: pair: 1 numbers given: give 2");
}

TEST(Key, OddKeyRefusesEvenValues) {
  int block = 9;
  const std::vector<Key> keys{odd(key("block", block, 3, 21, "px", "d"))};
  Origins origins;
  apply(text_layer("t", "block = 21"), keys, origins);
  EXPECT_EQ(block, 21);
  try {
    apply(text_layer("t", "block = 8"), keys, origins);
    FAIL() << "8 was taken";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "t:1:9: block: 8 is even: give 3 to 21 px, odd");
  }
}

TEST(Key, ValuesMustBeFinite) {
  EXPECT_EQ(refused(text_layer("t", "gain = nan")), "t:1:8: gain: nan is not finite: give 0 to 1");
  EXPECT_EQ(refused(text_layer("t", "gain = -inf")), "t:1:8: gain: -inf is not finite: give 0 to 1");
  EXPECT_EQ(refused(override_layer("gain=inf")), "--set gain=inf: gain: inf is not finite: give 0 to 1");
}

TEST(Key, UnknownChoiceListsTheChoices) {
  EXPECT_EQ(refused(text_layer("t", "mode = \"dens\"")),
            "t:1:8: mode: \"dens\" is not known: give one of \"regions\", \"dense\"");
}

TEST(Key, ARefusedValueLeavesItsMemberAlone) {
  Members members;
  Origins origins;
  EXPECT_THROW(apply(text_layer("t", "rows = 10"), members.keys(), origins), Error);
  EXPECT_EQ(members.rows, 2);
}

TEST(Key, QuotedTextStaysOnOneLine) {
  EXPECT_EQ(quoted("a\tb\\\x7F"), "\"a\\u0009b\\\\\\u007F\"");
  EXPECT_EQ(quoted("\xC3\xA9"), "\"\xC3\xA9\"");
}

}  // namespace
}  // namespace stereotrack::config
