#include "config/zones.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "config/rules.hpp"
#include "config/schema.hpp"

namespace stereotrack::config {
namespace {

using Layers = std::vector<Layer>;

Loaded loaded(const std::string& toml) { return load(Layers{text_layer("rig.toml", toml)}); }

std::string refused(const std::string& toml, double unit_m = 1) {
  try {
    check_metres(loaded(toml), unit_m);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

PipelineConfig told(const std::string& toml, double unit_m = 1) {
  return pipeline_of(loaded(toml).configuration, unit_m);
}

const std::string kHall = "[[zone]]\nname = \"hall\"\nx_m = [-3, 3]\nz_m = [1, 9]\n";
const std::string kPole = "[[zone]]\nname = \"pole\"\npicture = [[0, 0], [10, 0], [10, 99]]\n";

TEST(ZoneRulesSaid, WithoutAnyThePipelineIsToldNothing) {
  EXPECT_FALSE(told("").zones.any());
  EXPECT_FALSE(told(kHall + kPole).zones.any()) << "zones of signals alone";
}

TEST(GravitySaid, ArrivesInUnitsOfTheCalibrationWhichMustBeKnown) {
  const std::string level = "[track]\ngravity_m_s2 = [0, 9.81, 0]\n";
  EXPECT_NEAR(told(level, 0.0254).track.gravity.y(), 386.2, 0.1) << "inches";
  EXPECT_TRUE(told("").track.gravity.isZero());
  EXPECT_NE(refused(level, 0).find("track.gravity_m_s2: it is in metres, and the calibration's unit is not known"),
            std::string::npos);
  EXPECT_EQ(refused("[track]\ngravity_m_s2 = [0, 0, 0]\n", 0), "");
}

TEST(ZoneRulesSaid, AllThatCanBeSaidArrives) {
  const ZoneRules::Config zones =
      told("[objects]\nmin_size_m = 0.2\nmax_size_m = 4\nvolume = \"hall\"\n" + kHall + kPole +
               "targets = \"ignore\"\n"
               "[[zone]]\nname = \"door\"\npicture = [[1, 2], [3, 4], [5, 7.5]]\n"
               "anchor = \"bottom\"\ntargets = \"none_begin\"\nmin_size_m = 1\n"
               "[[zone]]\nname = \"far\"\nz_m = [6, 9]\nmax_size_m = 3\n",
           0.5)
          .zones;
  EXPECT_EQ(zones.unit_m, 0.5);
  EXPECT_EQ(zones.min_size_m, 0.2);
  EXPECT_EQ(zones.max_size_m, 4);
  ASSERT_TRUE(zones.volume.has_value());
  EXPECT_EQ(zones.volume->z_m, (Zone::Range{1, 9}));
  EXPECT_LT(zones.volume->y_m.from, -1e5) << "anywhere";
  ASSERT_EQ(zones.zones.size(), 3U) << "the hall has no rule of its own";
  EXPECT_EQ(zones.zones[0].targets, ZoneRules::Targets::kIgnore);
  EXPECT_EQ(zones.zones[0].zone.kind, Zone::Kind::kPicture);
  EXPECT_EQ(zones.zones[1].targets, ZoneRules::Targets::kNoneBegin);
  EXPECT_EQ(zones.zones[1].min_size_m, 1);
  EXPECT_EQ(zones.zones[1].zone.anchor, Zone::Anchor::kBottom);
  ASSERT_EQ(zones.zones[1].zone.corners.size(), 3U);
  EXPECT_EQ(zones.zones[1].zone.corners[2].y, 7.5);
  EXPECT_EQ(zones.zones[2].targets, ZoneRules::Targets::kAll);
  EXPECT_EQ(zones.zones[2].max_size_m, 3);
  EXPECT_EQ(zones.zones[2].zone.kind, Zone::Kind::kSpace);
}

TEST(ZoneRulesSaid, SurviveTheRoundTripThroughText) {
  const Configuration first =
      loaded("objects.volume = \"hall\"\n" + kHall + "targets = \"none_begin\"\n").configuration;
  const Configuration second = loaded(to_text(first)).configuration;
  EXPECT_EQ(second.zones, first.zones);
  EXPECT_EQ(second.objects.volume, "hall");
}

TEST(ZoneRulesSaid, WhichZonesThePipelineUses) {
  const Configuration c = loaded(kHall + kPole + "targets = \"ignore\"\n").configuration;
  EXPECT_FALSE(is_for_pipeline(c.zones[0], ""));
  EXPECT_TRUE(is_for_pipeline(c.zones[0], "hall"));
  EXPECT_TRUE(is_for_pipeline(c.zones[1], ""));
}

TEST(ZoneRulesSaid, WrongOnesAreToldWhereTheyStand) {
  EXPECT_EQ(refused(kPole + "targets = \"none\"\n"),
            "rig.toml:4:11: zone[1].targets: \"none\" is not known: give one of \"all\", \"none_begin\", \"ignore\"");
  EXPECT_EQ(refused(kPole + "min_size_m = -1\n"),
            "rig.toml:4:14: zone[1].min_size_m: -1 is out of range: give 0 to 1000 m");
  EXPECT_EQ(refused(kPole + "targets = \"ignore\"\nmax_size_m = 1\n"),
            "rig.toml:5:14: zone[1].max_size_m: nothing is tracked in an ignored zone: leave the size out");
  const std::string no_size =
      ": no size is left between the zone's limits and those of [objects]: give min_size_m <= max_size_m";
  EXPECT_EQ(refused(kPole + "min_size_m = 2\nmax_size_m = 1\n"), "rig.toml:4:14: zone[1].min_size_m" + no_size);
  EXPECT_EQ(refused("objects.max_size_m = 1\n" + kPole + "min_size_m = 2\n"),
            "rig.toml:5:14: zone[1].min_size_m" + no_size);
  EXPECT_EQ(refused("objects.min_size_m = 2\n" + kPole + "max_size_m = 1\n"),
            "rig.toml:5:14: zone[1].max_size_m" + no_size);
  EXPECT_EQ(refused("objects.min_size_m = 2\n" + kPole + "min_size_m = 0.5\nmax_size_m = 1\n"), "");
  EXPECT_EQ(refused("[objects]\nmin_size_m = 2\nmax_size_m = 1\n"),
            "rig.toml:2:14: objects.min_size_m: min_size_m is above max_size_m, no object has such a size: give "
            "min_size_m <= max_size_m; objects.max_size_m is from rig.toml:3:14");
}

TEST(ZoneRulesSaid, TheVolumeIsABoxThatThereIs) {
  EXPECT_EQ(refused("objects.volume = \"hall\"\n" + kHall), "");
  EXPECT_EQ(refused("objects.volume = \"hall\"\n"),
            "rig.toml:1:18: objects.volume: there is no zone \"hall\": write a [[zone]] of this name");
  EXPECT_EQ(refused("objects.volume = \"yard\"\n" + kHall + kPole),
            "rig.toml:1:18: objects.volume: there is no zone \"yard\": there are \"hall\", \"pole\"");
  EXPECT_EQ(refused("objects.volume = \"pole\"\n" + kPole),
            "rig.toml:1:18: objects.volume: zone \"pole\" is a polygon in the picture: name one with x_m, y_m or z_m");
  EXPECT_EQ(refused("objects.volume = \"hall\"\n" + kHall + "targets = \"ignore\"\n"),
            "rig.toml:1:18: objects.volume: zone \"hall\" is ignored, nothing would be tracked: name another, or leave "
            "its targets out");
  EXPECT_NE(refused("objects.volume = \"a b\"\n").find("is no name"), std::string::npos);
}

TEST(ZoneRulesSaid, MetresNeedAKnownUnitAndPixelsDoNot) {
  const std::string told =
      ": it is in metres, and the calibration's unit is not known: set calibration.unit_m to the metres in one unit of "
      "T";
  EXPECT_EQ(refused("objects.min_size_m = 0.2\n", 0), "rig.toml:1:22: objects.min_size_m" + told);
  EXPECT_EQ(refused("objects.max_size_m = 2\n", 0), "rig.toml:1:22: objects.max_size_m" + told);
  EXPECT_EQ(refused(kPole + "max_size_m = 2\n", 0), "rig.toml:4:14: zone[1].max_size_m" + told);
  EXPECT_EQ(refused("objects.volume = \"hall\"\n" + kHall, 0), "rig.toml:4:7: zone[1].x_m" + told);
  EXPECT_EQ(refused(kPole + "targets = \"ignore\"\n", 0), "");
}

TEST(ZoneRulesSaid, ExamplesOfThePageAreRight) {
  std::ifstream page(STEREOTRACK_SOURCE_DIR "/docs/TRACKING.md");
  const std::string text{std::istreambuf_iterator<char>(page), {}};
  const std::string fence = "```toml\n";
  std::size_t examples = 0;
  for (std::size_t at = text.find(fence); at != text.npos; at = text.find(fence, at + 1)) {
    const std::size_t begin = at + fence.size();
    const std::string example = text.substr(begin, text.find("```", begin) - begin);
    Arena arena;
    const ZoneRules::Config zones = told(example).zones;
    EXPECT_EQ(refused(example), "");
    EXPECT_TRUE(zones.any());
    EXPECT_TRUE(ZoneRules::create(zones, 640, 480, arena).has_value());
    ++examples;
  }
  EXPECT_GE(examples, 1U);
}

}  // namespace
}  // namespace stereotrack::config
