#include "config/schema.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "config/presets.hpp"

namespace stereotrack::config {
namespace {

using Layers = std::vector<Layer>;

/// Another value than the key has, inside its range.
void change(const Key& key) {
  switch (key.kind) {
    case Kind::kSwitch: key.set(Value{!std::get<bool>(key.get())}); break;
    case Kind::kInteger:
    case Kind::kNumber:  // the bounds of an odd key are odd: NamesAreUniqueAndDefaultsAndBoundsAreAllowed says so
      key.set(Value{std::get<double>(key.get()) == key.max ? key.min : key.max});
      break;
    case Kind::kText:  // of a GPIO line, CHIP:LINE is wanted
      key.set(Value{std::get<std::string>(key.get()) + (key.name.ends_with("line") ? "chip:x" : "x")});
      break;
    case Kind::kChoice:
      key.set(
          Value{std::get<std::string>(key.get()) == key.choices.front() ? key.choices.back() : key.choices.front()});
      break;
    case Kind::kTextList: key.set(Value{std::vector<std::string>{"10.0.0.1:9000", "h:1"}}); break;
    case Kind::kPointList: key.set(Value{std::vector<double>{key.min, 0, key.max, 1}}); break;
    case Kind::kTables: {
      key.set(Value{1.0});
      const std::vector<Key> keys = key.keys(0);
      const std::vector<Key> example = key.example();
      for (std::size_t i = 0; i < keys.size(); ++i) keys[i].set(example[i].get());
      break;
    }
    case Kind::kNumberList: key.set(Value{std::vector<double>(key.length, key.max)}); break;
  }
}

TEST(Schema, SampleFileIsWhatTheTableGives) {
  std::ifstream file(STEREOTRACK_SOURCE_DIR "/config/stereotrack.sample.toml", std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  EXPECT_EQ(text, sample_text()) << "run: cmake --build build/release --target update_sample_config";
}

TEST(Schema, SampleGivesTheDefaultsAndSetsEveryKey) {
  const Loaded loaded = load(Layers{text_layer("sample", sample_text())});
  EXPECT_EQ(to_text(loaded.configuration), to_text(Configuration{}));
  Configuration configuration;
  for (const Key& key : keys_of(configuration)) {
    if (key.kind == Kind::kTables) continue;  // empty by default; see the next test
    ASSERT_TRUE(loaded.origins.contains(key.name)) << key.name;
    EXPECT_EQ(loaded.origins.at(key.name).find("sample:"), 0U) << key.name;
  }
}

TEST(Schema, TablesInTheSampleAreRightWithoutTheirCommentSigns) {
  std::istringstream lines(sample_text());
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    const bool code = line.size() > 1 && line[0] == '#' && line[1] != ' ';
    text += (code ? line.substr(1) : line) + "\n";
  }
  Loaded loaded = load(Layers{text_layer("sample", text)});
  for (const Key& list : keys_of(loaded.configuration)) {
    if (list.kind != Kind::kTables) continue;
    EXPECT_EQ(list.get(), Value{1.0}) << list.name;
    const std::vector<Key> keys = list.keys(0);
    const std::vector<Key> example = list.example();
    for (std::size_t i = 0; i < keys.size(); ++i) {
      EXPECT_TRUE(loaded.origins.contains(keys[i].name)) << keys[i].name;
      EXPECT_EQ(value_text(keys[i]), value_text(example[i])) << keys[i].name;
    }
  }
}

TEST(Schema, EveryKeyOfATableSurvivesTheRoundTripThroughText) {
  Configuration reference;
  for (std::size_t list = 0; list < keys_of(reference).size(); ++list) {
    if (keys_of(reference)[list].kind != Kind::kTables) continue;
    const std::size_t count = keys_of(reference)[list].example().size();
    for (std::size_t i = 0; i < count; ++i) {
      Configuration changed;
      const std::vector<Key> all = keys_of(changed);
      change(all[list]);
      const std::string before = to_text(changed);
      const std::vector<Key> keys = all[list].keys(0);
      if (keys[i].name == "signal[1].line" || keys[i].name == "input[1].line") {
        keys[i].set(Value{std::string("a:b")});
      } else {
        change(keys[i]);
      }
      const std::string text = to_text(changed);
      EXPECT_NE(text, before) << keys[i].name;
      Configuration read;
      Origins origins;
      apply(text_layer("t", text), keys_of(read), origins);
      EXPECT_EQ(to_text(read), text) << keys[i].name;
      EXPECT_EQ(value_text(keys_of(read)[list]), value_text(all[list])) << "on one line, for comparison";
    }
  }
}

TEST(Schema, KeysOfATableWriteDifferentMembers) {
  Configuration reference;
  for (std::size_t list = 0; list < keys_of(reference).size(); ++list) {
    if (keys_of(reference)[list].kind != Kind::kTables) continue;
    keys_of(reference)[list].set(Value{1.0});
    const std::vector<Key> unchanged = keys_of(reference)[list].keys(0);
    for (std::size_t i = 0; i < unchanged.size(); ++i) {
      Configuration configuration;
      keys_of(configuration)[list].set(Value{1.0});
      const std::vector<Key> keys = keys_of(configuration)[list].keys(0);
      change(keys[i]);
      for (std::size_t j = 0; j < keys.size(); ++j) {
        EXPECT_EQ(value_text(keys[j]) == value_text(unchanged[j]), i != j) << keys[i].name << " and " << keys[j].name;
      }
      EXPECT_FALSE(keys[i].doc.empty());
      EXPECT_EQ(keys[i].doc.back(), '.') << keys[i].name;
    }
  }
}

TEST(Schema, EveryKeySurvivesTheRoundTripThroughText) {
  Configuration reference;
  for (std::size_t i = 0; i < keys_of(reference).size(); ++i) {
    Configuration changed;
    const std::vector<Key> keys = keys_of(changed);
    change(keys[i]);
    const std::string text = to_text(changed);
    EXPECT_NE(text, to_text(Configuration{})) << keys[i].name;
    Configuration read;
    Origins origins;
    apply(text_layer("t", text), keys_of(read), origins);
    EXPECT_EQ(to_text(read), text) << keys[i].name;
  }
}

TEST(Schema, LoadedConfigurationSurvivesTheRoundTripThroughText) {
  const Loaded first = load(Layers{text_layer("t",
                                              "preset = \"thesis\"\n[source]\nfps = 29.97\nflip = true\n"
                                              "[telemetry]\ndestinations = [\"[::1]:9000\", \"b:1\"]\n")});
  const Loaded second = load(Layers{text_layer("t", to_text(first.configuration))});
  EXPECT_EQ(second.configuration.source.fps, 29.97);
  EXPECT_EQ(second.configuration.telemetry.destinations, first.configuration.telemetry.destinations);
  EXPECT_EQ(to_text(second.configuration), to_text(first.configuration));
}

TEST(Schema, NamesAreUniqueAndDefaultsAndBoundsAreAllowed) {
  Configuration configuration;
  std::set<std::string> names;
  for (const Key& key : keys_of(configuration)) {
    EXPECT_TRUE(names.insert(key.name).second) << key.name;
    EXPECT_EQ(refusal(key, key.get()), "") << key.name;
    if (key.kind == Kind::kInteger || key.kind == Kind::kNumber) {
      EXPECT_LT(key.min, key.max) << key.name;
      EXPECT_EQ(refusal(key, Value{key.min}), "") << key.name;
      EXPECT_EQ(refusal(key, Value{key.max}), "") << key.name;
    }
    EXPECT_FALSE(key.doc.empty()) << key.name;
    EXPECT_EQ(key.doc.back(), '.') << key.name;
  }
}

TEST(Schema, KeysWriteDifferentMembers) {
  Configuration reference;
  const std::vector<Key> unchanged = keys_of(reference);
  for (std::size_t i = 0; i < unchanged.size(); ++i) {
    Configuration configuration;
    const std::vector<Key> keys = keys_of(configuration);
    change(keys[i]);
    for (std::size_t j = 0; j < keys.size(); ++j) {
      EXPECT_EQ(value_text(keys[j]) == value_text(unchanged[j]), i != j) << keys[i].name << " and " << keys[j].name;
    }
  }
}

TEST(Schema, KeysOthersRelyOnKeepTheirNamesAndDefaults) {
  Configuration configuration;
  std::set<std::string> lines;
  for (const Key& key : keys_of(configuration)) lines.insert(key.name + " = " + value_text(key));
  EXPECT_TRUE(lines.contains("source.fps = 30.0"));
  EXPECT_TRUE(lines.contains("latency.output_ms = 50.0"));
  EXPECT_TRUE(lines.contains("calibration.unit_m = 0.0"));
  EXPECT_TRUE(lines.contains("disparity.mode = \"regions\""));
  EXPECT_TRUE(lines.contains("disparity.reach = 0.7"));
  std::set<std::string> names;
  for (const Key& key : keys_of(configuration)) names.insert(key.name);
  for (const char* name : {"disparity.max", "disparity.block", "background.frames"}) {
    EXPECT_TRUE(names.contains(name)) << name;
  }
}

TEST(Presets, AllLoadAndNameNoPresetThemselves) {
  ASSERT_EQ(preset_names(), (std::vector<std::string>{"robust", "thesis"}));
  for (const Preset& preset : presets()) {
    const std::string name(preset.name);
    EXPECT_EQ(load(Layers{override_layer("preset=" + name)}).configuration.preset, name);
    Configuration configuration;
    Origins origins;
    apply(text_layer(name, std::string(preset.text)), keys_of(configuration), origins);
    EXPECT_FALSE(origins.contains("preset")) << name;
  }
}

TEST(Presets, TextIsTheFilesOwn) {
  for (const Preset& preset : presets()) {
    std::ifstream file(STEREOTRACK_SOURCE_DIR "/config/presets/" + std::string(preset.name) + ".toml",
                       std::ios::binary);
    EXPECT_EQ(preset.text, std::string(std::istreambuf_iterator<char>(file), {})) << preset.name;
  }
}

TEST(Presets, RobustIsTheDefaults) {
  EXPECT_EQ(to_text(load(Layers{override_layer("preset=robust")}).configuration), to_text(Configuration{}));
}

}  // namespace
}  // namespace stereotrack::config
