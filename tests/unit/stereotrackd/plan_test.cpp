// What of another configuration a running daemon takes over: zones, some of which the pipeline uses.
#include "firmware-app/stereotrackd/plan.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "config/load.hpp"
#include "config/zones.hpp"

namespace stereotrack::daemon {
namespace {

config::Configuration said(const std::string& toml) {
  return config::load(std::vector{config::text_layer("rig.toml", toml)}).configuration;
}

std::string zone(const std::string& name, double to, const std::string& rest = "") {
  return "[[zone]]\nname = \"" + name + "\"\nz_m = [0.5, " + std::to_string(to) + "]\n" + rest;
}
const std::string kIgnore = "targets = \"ignore\"\n";
const std::string kNear = "[[signal]]\nname = \"near\"\nline = \"sim:near\"\nwhen = \"in_zone\"\nzone = \"gate\"\n";

using Refused = std::vector<std::string>;

struct After {
  Difference change;
  config::Configuration configuration;
};
After reloaded(const config::Configuration& running, const std::string& toml) {
  const config::Configuration wanted = said(toml);
  const Difference change = difference(running, wanted);
  return {change, accepted(running, wanted, change)};
}

double end_of(const config::Configuration& c, const std::string& name) {
  for (const config::ZoneConfig& one : c.zones) {
    if (one.name == name) return one.z_m[1];
  }
  return 0;
}

TEST(Reload, TheSameIsNoDifference) {
  const std::string all = zone("gate", 5) + zone("pole", 3, kIgnore) + kNear;
  const After after = reloaded(said(all), all);
  EXPECT_FALSE(after.change.rules);
  EXPECT_EQ(after.change.refused, Refused{});
}

TEST(Reload, AZoneThatOnlySignalsUseIsTakenOver) {
  const After after = reloaded(said(zone("gate", 5) + zone("pole", 3, kIgnore) + kNear),
                               zone("gate", 6) + zone("yard", 2) + zone("pole", 3, kIgnore) + kNear);
  EXPECT_TRUE(after.change.rules);
  EXPECT_EQ(after.change.refused, Refused{});
  EXPECT_EQ(end_of(after.configuration, "gate"), 6);
  EXPECT_EQ(end_of(after.configuration, "yard"), 2);
}

TEST(Reload, AZoneThatThePipelineUsesWaitsAndTheOthersDoNot) {
  const config::Configuration running = said(zone("gate", 5) + zone("pole", 3, kIgnore) + kNear);
  const After after = reloaded(running, zone("gate", 6) + zone("pole", 4, kIgnore) + kNear);
  EXPECT_TRUE(after.change.rules);
  EXPECT_EQ(after.change.refused, Refused{"zone pole"});
  EXPECT_EQ(end_of(after.configuration, "gate"), 6);
  EXPECT_EQ(end_of(after.configuration, "pole"), 3);
  // And it is told again, for it still waits.
  const After again = reloaded(after.configuration, zone("gate", 6) + zone("pole", 4, kIgnore) + kNear);
  EXPECT_FALSE(again.change.rules);
  EXPECT_EQ(again.change.refused, Refused{"zone pole"});
}

TEST(Reload, ARuleThatComesOrGoesWaits) {
  const config::Configuration without = said(zone("gate", 5) + kNear);
  const std::string with = zone("gate", 6, "min_size_m = 1\n") + zone("pole", 3, kIgnore) + kNear;
  const After comes = reloaded(without, with);
  EXPECT_EQ(comes.change.refused, (Refused{"zone gate", "zone pole"}));
  EXPECT_EQ(end_of(comes.configuration, "gate"), 6) << "for the signal, which has no other user";
  EXPECT_FALSE(config::pipeline_of(comes.configuration, 1).zones.any()) << "what runs is what is said to run";
  EXPECT_EQ(reloaded(comes.configuration, with).change.refused, (Refused{"zone gate", "zone pole"}));

  const config::Configuration running = said(with);
  const After goes = reloaded(running, zone("gate", 6) + kNear);
  EXPECT_EQ(goes.change.refused, (Refused{"zone gate", "zone pole"}));
  EXPECT_EQ(config::pipeline_of(goes.configuration, 1).zones.zones.size(), 2U);
}

TEST(Reload, TheWorkingVolumeIsThePipelines) {
  const std::string volume = "[objects]\nvolume = \"gate\"\n";
  const After after = reloaded(said(volume + zone("gate", 5) + kNear), volume + zone("gate", 6) + kNear);
  EXPECT_FALSE(after.change.rules);
  EXPECT_EQ(after.change.refused, Refused{"zone gate"});
  EXPECT_EQ(end_of(after.configuration, "gate"), 5);
  // Another volume is a key as any; the zone that it would name is a signal's until then.
  const After other = reloaded(said(zone("gate", 5) + kNear), volume + zone("gate", 6) + kNear);
  EXPECT_EQ(other.change.refused, Refused{"objects.volume"});
  EXPECT_EQ(end_of(other.configuration, "gate"), 6);
  EXPECT_EQ(other.configuration.objects.volume, "");
}

TEST(Reload, SizesForEverywhereWait) {
  const After after = reloaded(said(""), "[objects]\nmin_size_m = 0.3\n");
  EXPECT_EQ(after.change.refused, Refused{"objects.min_size_m"});
  EXPECT_FALSE(config::pipeline_of(after.configuration, 1).zones.any());
}

TEST(Reload, TheOrderOfThePipelinesZonesCounts) {
  const std::string a = zone("a", 5, "min_size_m = 1\n");
  const std::string b = zone("b", 5, "min_size_m = 2\n");
  EXPECT_EQ(reloaded(said(a + b), b + a).change.refused, Refused{"zone: the order"});
}

}  // namespace
}  // namespace stereotrack::daemon
