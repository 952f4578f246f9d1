#include "config/rules.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "config/schema.hpp"

namespace stereotrack::config {
namespace {

std::string refused(const std::vector<Layer>& layers) {
  try {
    (void)load(layers);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(Rules, LookAtKeysThatExistAndHaveNamesOfTheirOwn) {
  Configuration configuration;
  std::set<std::string> keys;
  for (const Key& key : keys_of(configuration)) keys.insert(key.name);
  std::set<std::string_view> names;
  for (const Rule& rule : rules()) {
    EXPECT_TRUE(names.insert(rule.name).second) << rule.name;
    EXPECT_FALSE(rule.keys.empty()) << rule.name;
    for (const std::string_view key : rule.keys) EXPECT_TRUE(keys.contains(std::string(key))) << key;
  }
}

TEST(Rules, DestinationNamedTwiceIsRefusedWhereItWasSet) {
  const Layer file = text_layer("rig.toml", "[telemetry]\ndestinations = [\"a:1\", \"b:1\", \"a:1\"]\n");
  EXPECT_EQ(refused({file}),
            "rig.toml:2:16: telemetry.destinations: \"a:1\" stands there twice, its receiver would take every second "
            "datagram for a replay: name it once");
  EXPECT_EQ(refused({file, override_layer("telemetry.destinations=a:1")}), "");  // checked after all layers
  EXPECT_EQ(refused({text_layer("rig.toml", "telemetry.rig_id = 3"), override_layer("telemetry.destinations=a:1,a:1")})
                .find("--set telemetry.destinations=\"a:1,a:1\": telemetry.destinations: "),
            0U);
}

TEST(Rules, BrokenRuleTellsWhereEachOfItsKeysCameFrom) {
  const Layer file = text_layer("rig.toml", "[foreground]\nlow_sd = 12.0\nhigh_sd = 10.0\n");
  EXPECT_EQ(refused({file}),
            "rig.toml:2:10: foreground.low_sd: low_sd is above high_sd, a seed must also be a candidate: give low_sd "
            "<= high_sd; foreground.high_sd is from rig.toml:3:11");
  EXPECT_EQ(refused({override_layer("foreground.low_sd=6"), override_layer("foreground.high_sd=6")}), "");
}

TEST(Rules, TheLineStartsWhereTheUserSpokeNotAtADefault) {
  EXPECT_EQ(refused({override_layer("foreground.high_sd=1")}),
            "--set foreground.high_sd=1: foreground.high_sd: low_sd is above high_sd, a seed must also be a candidate: "
            "give low_sd <= high_sd; foreground.low_sd is from the defaults");
}

TEST(Rules, ATriggerHasWhatItsModeNeedsAndALineOfItsOwn) {
  const Layer cameras =
      text_layer("rig.toml", "[source]\nname = \"cameras\"\n[camera]\nleft.device = \"/dev/video0\"\n");
  const auto with = [&](const std::string& text) { return refused({cameras, text_layer("trigger.toml", text)}); };
  EXPECT_EQ(with(""), "");
  EXPECT_EQ(with("trigger.mode = \"unseen\""), "");
  for (const std::string mode : {"gpio", "external"}) {
    const std::string text = "trigger.mode = \"" + mode + "\"\n";
    EXPECT_EQ(
        with(text),
        "trigger.toml:1:16: trigger.mode: trigger.line is missing, gpio and external need it: give CHIP:LINE, for "
        "example \"gpiochip0:17\"; trigger.line is from the defaults");
    EXPECT_EQ(with(text + "trigger.line = \"sim:t\""), "");
    EXPECT_NE(with(text + "trigger.line = \"t\"").find("is no GPIO line"), std::string::npos);
    EXPECT_NE(with(text + "trigger.line = \"sim:t\"\n[[input]]\nname = \"door\"\nline = \"sim:t\"\n")
                  .find("trigger.line: \"sim:t\" is that of input door, too"),
              std::string::npos);
    EXPECT_NE(with(text + "trigger.line = \"sim:t\"\n[[signal]]\nname = \"near\"\nline = \"sim:t\"\n")
                  .find("trigger.line: \"sim:t\" is that of signal near, too"),
              std::string::npos);
  }
  EXPECT_NE(with("trigger.mode = \"pwm\"").find("trigger.pwm_chip is missing"), std::string::npos);
  EXPECT_EQ(with("trigger.mode = \"pwm\"\ntrigger.pwm_chip = \"0\""), "");
  // Who watches no cameras may say what he likes of their trigger.
  EXPECT_EQ(refused({override_layer("trigger.mode=gpio")}), "");
}

TEST(Rules, APulseIsOverBeforeTheNextOneIsDue) {
  const auto with = [&](const std::string& mode, const std::string& more) {
    return refused({text_layer("rig.toml",
                               "[source]\nname = \"cameras\"\n[camera]\nleft.device = \"/dev/video0\"\n"
                               "fps = 50.0\n[trigger]\nline = \"sim:t\"\npwm_chip = \"0\"\nmode = \"" +
                                   mode + "\"\n" + more)});
  };
  EXPECT_EQ(with("gpio", "pulse_us = 18999.0"), "");
  EXPECT_NE(with("gpio", "pulse_us = 19000.0").find("not over when the next one is due"), std::string::npos);
  EXPECT_EQ(with("gpio", "pulse_us = 19000.0\nlate_us = 500.0"), "");
  EXPECT_EQ(with("pwm", "pulse_us = 19999.0"), "");
  EXPECT_NE(with("pwm", "pulse_us = 20000.0").find("longer than there is time between two"), std::string::npos);
  EXPECT_EQ(with("external", "pulse_us = 20000.0"), "");  // somebody else's
}

TEST(Rules, CamerasNeedDevicesOfTheirOwn) {
  const Layer cameras = override_layer("source.name=cameras");
  EXPECT_NE(refused({cameras}).find("camera.left.device"), std::string::npos);
  const Layer left = override_layer("camera.left.device=/dev/video0");
  EXPECT_EQ(refused({cameras, left}), "");
  EXPECT_NE(refused({cameras, left, override_layer("camera.right.device=/dev/video0")}).find("both cameras"),
            std::string::npos);
  EXPECT_EQ(refused({cameras, left, override_layer("camera.right.device=/dev/video2")}), "");
  EXPECT_NE(refused({cameras, left, override_layer("camera.right.device=/dev/video2"),
                     override_layer("camera.side_by_side=true")})
                .find("a third"),
            std::string::npos);
  EXPECT_EQ(refused({cameras, left, override_layer("camera.side_by_side=true")}), "");
  // Who watches no cameras may say what he likes of them.
  EXPECT_EQ(refused({left, override_layer("camera.right.device=/dev/video0")}), "");
}

TEST(Rules, LibcameraDoesByItselfWhatV4l2IsTold) {
  const Layer cameras = override_layer("source.name=cameras");
  const Layer left = override_layer("camera.left.device=0");
  const Layer driver = override_layer("camera.driver=libcamera");
  EXPECT_EQ(refused({cameras, left, driver}), "");
  EXPECT_EQ(refused({cameras, left, driver, override_layer("camera.right.sensor=imx219")})
                .find("--set camera.right.sensor=imx219: "),
            0U);
  EXPECT_EQ(
      refused({cameras, left, driver, override_layer("camera.black_level=64")}).find("--set camera.black_level=64: "),
      0U);
  EXPECT_EQ(
      refused({cameras, left, override_layer("camera.right.sensor=imx219"), override_layer("camera.black_level=64")}),
      "");
}

TEST(Rules, AnExposureFitsBetweenTwoFrames) {
  EXPECT_EQ(refused({override_layer("camera.exposure_us=33000")}), "");
  EXPECT_EQ(refused({override_layer("camera.exposure_us=33334")}).find("--set camera.exposure_us=33334: "), 0U);
  EXPECT_EQ(refused({override_layer("camera.exposure_us=33334"), override_layer("camera.fps=25")}), "");
}

TEST(Rules, LevelSetWithoutIterationsIsRefused) {
  EXPECT_EQ(refused({override_layer("level_set.on=false"), override_layer("level_set.iterations=0")}), "");
  EXPECT_EQ(refused({override_layer("level_set.on=true"), override_layer("level_set.iterations=1")}), "");
  EXPECT_EQ(refused({override_layer("level_set.on=true"), override_layer("level_set.iterations=0")})
                .find("--set level_set.iterations=0: level_set.iterations: the level set is on"),
            0U);
}

TEST(Rules, MergingWhatWasSplitIsRefused) {
  EXPECT_EQ(refused({override_layer("objects.merge_depth=0.2"), override_layer("objects.split_depth=0.2")}), "");
  EXPECT_EQ(refused({override_layer("objects.merge_depth=0.21"), override_layer("objects.split_depth=0.2")})
                .find("--set objects.merge_depth=0.21: objects.merge_depth: merge_depth is above split_depth"),
            0U);
}

TEST(Rules, EffortsAreNamedAsTheyAreCalledAndOnce) {
  EXPECT_EQ(refused({override_layer("shed.order=corners,dense_map")}), "");
  EXPECT_EQ(refused({override_layer("shed.order=[]")}), "");
  EXPECT_EQ(refused({text_layer("rig.toml", "shed.order = [\"corner\"]")}),
            "rig.toml:1:14: shed.order: \"corner\" is no effort: there are level_set, corners, background_disparity, "
            "dense_map");
  EXPECT_NE(refused({override_layer("shed.order=corners,corners")}).find("\"corners\" stands there twice"),
            std::string::npos);
}

TEST(Rules, ShedFractionsMustLeaveAGap) {
  EXPECT_EQ(refused({override_layer("shed.below=0.5"), override_layer("shed.above=0.51")}), "");
  EXPECT_NE(refused({override_layer("shed.below=0.9")}).find("shed.below is not under shed.above"), std::string::npos);
}

TEST(Rules, WhatLeavesIsDecidedAfterItsPictureIsTaken) {
  EXPECT_EQ(refused({override_layer("latency.output_ms=1")}), "");
  EXPECT_NE(refused({override_layer("latency.output_ms=1"), override_layer("latency.lead_ms=1")})
                .find("lead_ms is not under output_ms"),
            std::string::npos);
}

TEST(Metres, KeyInMetresNeedsAKnownUnit) {
  struct {
    double reach = 0;
    double speed = 0;
    double unit = 0;
  } value;
  const std::vector<Key> keys{key("unit", value.unit, 0, 9, "m per unit of T", "d"),
                              key("reach", value.reach, 0, 9, "m", "d"), key("speed", value.speed, 0, 9, "m/s", "d")};
  const auto refusal_of = [&](double unit_m) -> std::string {
    Origins origins;
    origins["speed"] = "rig.toml:1:9";
    try {
      check_metres(keys, origins, unit_m);
    } catch (const Error& error) {
      return error.what();
    }
    return {};
  };
  EXPECT_EQ(refusal_of(0), "");  // nothing stated in metres
  value.unit = 2;
  EXPECT_EQ(refusal_of(0), "");  // the unit itself is no such key
  value.speed = 3;
  EXPECT_EQ(refusal_of(0),
            "rig.toml:1:9: speed: it is in metres, and the calibration's unit is not known: set calibration.unit_m to "
            "the metres in one unit of T");
  EXPECT_EQ(refusal_of(0.0254), "");
  value.reach = 1;
  EXPECT_EQ(refusal_of(0).find("default: reach: "), 0U);
}

}  // namespace
}  // namespace stereotrack::config
