#include "config/load.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "config/schema.hpp"

namespace stereotrack::config {
namespace {

using Layers = std::vector<Layer>;

/// What load() refuses the layers with; empty if it does not.
std::string refused(const Layers& layers) {
  try {
    (void)load(layers);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

std::string refused(const std::string& toml) { return refused(Layers{text_layer("rig.toml", toml)}); }
std::string override_refused(const std::string& text) { return refused(Layers{override_layer(text)}); }

std::string file_refused(const std::string& path) {
  try {
    (void)file_layer(path);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

/// A folder that goes away with the test.
class LoadFile : public testing::Test {
 public:
  ~LoadFile() override { std::filesystem::remove_all(folder_); }

 protected:
  LoadFile() { std::filesystem::create_directories(folder_); }
  [[nodiscard]] std::string write(const std::string& name, const std::string& text) const {
    const std::string path = folder_ / name;
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }
  const std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) /
      ("stereotrack_config_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
};

TEST(Load, NothingSaidGivesTheDefaults) {
  const Loaded loaded = load(Layers{});
  EXPECT_EQ(to_text(loaded.configuration), to_text(Configuration{}));
  EXPECT_EQ(loaded.configuration.preset, "robust");
}

TEST(Load, LaterLayersWin) {
  const Loaded loaded = load(Layers{text_layer("a.toml", "[source]\nfps = 10\nflip = true\nshift_rows = 4\n"),
                                    text_layer("b.toml", "source.fps = 20\nsource.shift_rows = 5"),
                                    override_layer("source.fps=40"), override_layer("source.fps=50.5")});
  EXPECT_EQ(loaded.configuration.source.fps, 50.5);
  EXPECT_EQ(loaded.configuration.source.shift_rows, 5);
  EXPECT_TRUE(loaded.configuration.source.flip);
  EXPECT_FALSE(loaded.configuration.source.swap);
}

TEST(Load, RemembersWhereAKeyWasLastSet) {
  const Loaded loaded =
      load(Layers{text_layer("a.toml", "[source]\nfps = 10\n  flip = true\n"), override_layer("source.fps = 40")});
  EXPECT_EQ(loaded.origins.at("source.fps"), "--set source.fps=40");
  EXPECT_EQ(loaded.origins.at("source.flip"), "a.toml:3:10");
  EXPECT_FALSE(loaded.origins.contains("source.swap"));
  EXPECT_STREQ(error_at(loaded.origins, "source.flip", "bad: do good").what(),
               "a.toml:3:10: source.flip: bad: do good");
  EXPECT_STREQ(error_at(loaded.origins, "source.swap", "bad: do good").what(), "default: source.swap: bad: do good");
}

TEST(Load, PresetIsTakenFromTheLastLayerThatNamesOne) {
  EXPECT_EQ(load(Layers{text_layer("a", "preset = \"thesis\"")}).configuration.preset, "thesis");
  EXPECT_EQ(load(Layers{text_layer("a", "preset = \"robust\""), override_layer("preset=thesis")}).configuration.preset,
            "thesis");
}

TEST(Load, PresetComesBeforeAllLayersWhereverItIsNamed) {
  const Loaded loaded = load(Layers{text_layer("a", "latency.output_ms = 77"), override_layer("preset=thesis")});
  EXPECT_EQ(loaded.configuration.latency.output_ms, 77);
}

TEST(Load, UnknownPresetListsThePresets) {
  EXPECT_EQ(refused("preset = \"robustt\""),
            "rig.toml:1:10: preset: \"robustt\" is not known: give one of \"robust\", \"thesis\"");
}

TEST(Load, UnknownKeyNamesItsPlaceAndTheNearestKey) {
  EXPECT_EQ(refused("[source]\n  fsp = 30\n"), "rig.toml:2:3: source.fsp: unknown key: did you mean source.fps?");
  EXPECT_EQ(refused("[latency]\n\noutputms = 30\n"),
            "rig.toml:3:1: latency.outputms: unknown key: did you mean latency.output_ms?");
}

TEST(Load, KeyInTheWrongSectionIsFoundByItsLastPart) {
  EXPECT_EQ(refused("fps = 30"), "rig.toml:1:1: fps: unknown key: did you mean source.fps?");
  EXPECT_EQ(refused("[calibration]\nshift_rows = 3"),
            "rig.toml:2:1: calibration.shift_rows: unknown key: did you mean source.shift_rows?");
}

TEST(Load, DottedKeyInQuotesIsNoKey) {
  EXPECT_EQ(refused("\"source.fps\" = 30"),
            "rig.toml:1:1: \"source.fps\": unknown key: write dotted keys without quotes");
}

TEST(Load, KeyLikeNoOtherPointsToTheSample) {
  EXPECT_EQ(refused("[source]\nzzzzzzzzzzzzzz = 1"),
            "rig.toml:2:1: source.zzzzzzzzzzzzzz: unknown key: config/stereotrack.sample.toml lists all keys");
  EXPECT_EQ(refused(std::string(100000, 'x') + " = 1").find("rig.toml:1:1: "), 0U);
}

TEST(Load, UnknownSectionNamesTheNearestSection) {
  EXPECT_EQ(refused("\n[sorce]\nfps = 30\n"), "rig.toml:2:2: sorce: unknown section: did you mean source?");
  EXPECT_EQ(refused("[source.fast]\nfps = 30\n"),
            "rig.toml:1:9: source.fast: unknown section: config/stereotrack.sample.toml lists all keys");
}

TEST(Load, ValueOrListInPlaceOfASectionIsRefused) {
  EXPECT_EQ(refused("source = 3"),
            "rig.toml:1:1: source: a section of keys is expected, not an integer: write [source] and its keys below");
  EXPECT_EQ(refused("[[source]]\nfps = 30"),
            "rig.toml:1:3: source: a section of keys is expected, not a list: write [source] and its keys below");
}

TEST(Load, SectionInPlaceOfAValueIsRefused) {
  EXPECT_EQ(refused("[source.fps]\nx = 1"), "rig.toml:1:1: source.fps: a number such as 30.0 is expected, not a table");
}

TEST(Load, OutOfRangeNamesPlaceAndRange) {
  EXPECT_EQ(refused("[source]\nfps = 0"), "rig.toml:2:7: source.fps: 0 is out of range: give 0.1 to 1000 1/s");
  EXPECT_EQ(refused("[source]\nshift_rows = 101"),
            "rig.toml:2:14: source.shift_rows: 101 is out of range: give -100 to 100 px");
}

TEST(Load, TheFirstThingWrongInTheTextIsTold) {
  EXPECT_EQ(refused("[telemetry]\nrig_id = -1\n[source]\nfps = 0"),
            "rig.toml:2:10: telemetry.rig_id: -1 is out of range: give 0 to 4294967295");
}

TEST(Load, AWrongValueIsToldEvenWhereALaterLayerReplacesIt) {
  EXPECT_EQ(refused(Layers{text_layer("rig.toml", "source.fps = 0"), override_layer("source.fps=30")}),
            "rig.toml:1:14: source.fps: 0 is out of range: give 0.1 to 1000 1/s");
}

TEST(Load, SyntaxErrorNamesLineAndColumn) {
  EXPECT_EQ(refused("[source]\nfps = \n").find("rig.toml:2:7: not valid TOML: "), 0U) << refused("[source]\nfps = \n");
  EXPECT_EQ(refused("preset = robust").find("rig.toml:1:10: not valid TOML: "), 0U) << refused("preset = robust");
  EXPECT_EQ(refused("a = \"\xff\"").find("rig.toml:1:"), 0U);
}

TEST(Load, KeyGivenTwiceNamesTheSecondPlace) {
  const std::string key = refused("[source]\nfps = 30\nfps = 31\n");
  EXPECT_EQ(key.find("rig.toml:3:"), 0U) << key;
  EXPECT_NE(key.find("cannot redefine existing integer 'fps'"), std::string::npos) << key;
  const std::string section = refused("[source]\nfps = 30\n\n[source]\nflip = true\n");
  EXPECT_EQ(section.find("rig.toml:4:1: "), 0U) << section;
}

TEST(Load, EveryRefusalIsOneLine) {
  for (const std::string& message :
       {refused("\"a\\nb\" = 1"), refused("preset = \"a\\nb\""), refused("fps =\n"), override_refused("preset=a\nb"),
        override_refused("a\nb=1"), override_refused("source.fps=1\nsource.flip=true"), override_refused("\n")}) {
    EXPECT_FALSE(message.empty());
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
}

TEST(LoadOverride, TextsNeedNoQuotes) {
  EXPECT_EQ(load(Layers{override_layer("preset=thesis")}).configuration.preset, "thesis");
  EXPECT_EQ(load(Layers{override_layer("preset=\"thesis\"")}).configuration.preset, "thesis");
  EXPECT_EQ(load(Layers{override_layer("preset='thesis'")}).configuration.preset, "thesis");
}

TEST(LoadOverride, ListsOfTextsNeedNoBrackets) {
  const std::vector<std::string> two{"10.0.0.1:9000", "[::1]:9001"};
  EXPECT_EQ(load(Layers{override_layer("telemetry.destinations=10.0.0.1:9000")}).configuration.telemetry.destinations,
            std::vector<std::string>{"10.0.0.1:9000"});
  EXPECT_EQ(load(Layers{override_layer("telemetry.destinations=10.0.0.1:9000,[::1]:9001")})
                .configuration.telemetry.destinations,
            two);
  EXPECT_EQ(load(Layers{override_layer("telemetry.destinations=['10.0.0.1:9000', '[::1]:9001']")})
                .configuration.telemetry.destinations,
            two);
  EXPECT_TRUE(load(Layers{override_layer("telemetry.destinations=[]")}).configuration.telemetry.destinations.empty());
}

TEST(LoadOverride, BlanksAroundKeyAndValueDoNotCount) {
  EXPECT_EQ(load(Layers{override_layer("  source.fps =  12 ")}).configuration.source.fps, 12);
}

TEST(LoadOverride, WithoutKeyOrEqualsSignIsRefused) {
  EXPECT_EQ(override_refused("source.fps"), "--set source.fps: no KEY=VALUE: write it like --set source.fps=25");
  EXPECT_EQ(override_refused("=3"), "--set \"=3\": no KEY=VALUE: write it like --set source.fps=25");
  EXPECT_EQ(override_refused(""), "--set \"\": no KEY=VALUE: write it like --set source.fps=25");
}

TEST(LoadOverride, UnknownKeyNamesTheNearest) {
  EXPECT_EQ(override_refused("source.fsp=3"), "--set source.fsp: unknown key: did you mean source.fps?");
  EXPECT_EQ(override_refused("source=3"), "--set source: it is a section, not a key: write --set source.KEY=VALUE");
}

TEST(LoadOverride, WrongValuesAreRefused) {
  EXPECT_EQ(override_refused("source.fps=fast"),
            "--set source.fps=fast: source.fps: a number such as 30.0 is expected");
  EXPECT_EQ(override_refused("source.fps="), "--set source.fps=: source.fps: a number such as 30.0 is expected");
  EXPECT_EQ(override_refused("source.fps=true"),
            "--set source.fps=true: source.fps: a number such as 30.0 is expected, not true or false");
  EXPECT_EQ(override_refused("source.flip=yes"), "--set source.flip=yes: source.flip: true or false is expected");
  EXPECT_EQ(override_refused("source.fps=5000"),
            "--set source.fps=5000: source.fps: 5000 is out of range: give 0.1 to 1000 1/s");
}

TEST(LoadOverride, CannotSmuggleASecondKeyIn) { EXPECT_NE(override_refused("source.fps=25\nsource.flip=true"), ""); }

TEST(LoadDestinations, FormIsChecked) {
  for (const char* good : {"10.0.0.1:9000", "host.local:1", "[fe80::1]:65535"}) {
    EXPECT_EQ(override_refused(std::string("telemetry.destinations=['") + good + "']"), "") << good;
  }
  for (const char* bad : {"", "10.0.0.1", ":9000", "a:", "a:0", "a:65536", "a:9x", "a:-1", "fe80::1:9000", "[]:9000",
                          "a b:9000", "udp://a:9000", "a:000009000"}) {
    EXPECT_EQ(override_refused(std::string("telemetry.destinations=['") + bad + "']").empty(), false) << bad;
  }
  EXPECT_EQ(refused("[telemetry]\ndestinations = [\"10.0.0.1\"]"),
            "rig.toml:2:16: telemetry.destinations: \"10.0.0.1\" is not ADDR:PORT: write it like \"192.168.1.10:9000\" "
            "or \"[fe80::1]:9000\"");
}

TEST(LoadTelemetry, KeyFileAndMulticastTtlAreTaken) {
  const auto telemetry = load(Layers{text_layer("rig.toml",
                                                "[telemetry]\nkey_file = \"/etc/stereotrack/telemetry.key\"\n"
                                                "multicast_ttl = 8\n")})
                             .configuration.telemetry;
  EXPECT_EQ(telemetry.key_file, "/etc/stereotrack/telemetry.key");
  EXPECT_EQ(telemetry.multicast_ttl, 8);
  const auto defaults = load(Layers{}).configuration.telemetry;
  EXPECT_EQ(defaults.key_file, "") << "not signed";
  EXPECT_EQ(defaults.multicast_ttl, 1) << "stays in the local network";
  EXPECT_EQ(override_refused("telemetry.multicast_ttl=255"), "");
  EXPECT_EQ(override_refused("telemetry.multicast_ttl=256"),
            "--set telemetry.multicast_ttl=256: telemetry.multicast_ttl: 256 is out of range: give 1 to 255 hops");
  EXPECT_NE(override_refused("telemetry.multicast_ttl=0"), "");
}

TEST_F(LoadFile, IsReadAndNamedInErrors) {
  const std::string path = write("rig.toml", "\xEF\xBB\xBF[source]\r\nfps = 12\r\n");  // byte-order mark and CRLF
  EXPECT_EQ(load(Layers{file_layer(path)}).configuration.source.fps, 12);
  const std::string wrong = write("wrong.toml", "[source]\nfps = 0\n");
  EXPECT_EQ(refused(Layers{file_layer(wrong)}), wrong + ":2:7: source.fps: 0 is out of range: give 0.1 to 1000 1/s");
}

TEST_F(LoadFile, EmptyFileSaysNothing) {
  EXPECT_EQ(to_text(load(Layers{file_layer(write("empty.toml", ""))}).configuration), to_text(Configuration{}));
}

TEST_F(LoadFile, MissingFileOrFolderIsRefused) {
  const std::string missing = folder_ / "none.toml";
  EXPECT_EQ(file_refused(missing), missing + ": No such file or directory: give --config a readable TOML file");
  EXPECT_EQ(file_refused(folder_), folder_.string() + ": Is a directory: give --config a readable TOML file");
}

TEST_F(LoadFile, OverAMebibyteIsRefused) {
  const std::string path = write("big.toml", std::string((1 << 20) + 1, '#'));
  EXPECT_EQ(file_refused(path), path + ": over 1 MiB, not a configuration: give --config a readable TOML file");
  EXPECT_EQ(file_refused(write("limit.toml", std::string(1 << 20, '#'))), "");
}

}  // namespace
}  // namespace stereotrack::config
