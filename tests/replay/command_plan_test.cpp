// Which lens and baseline a range and an accuracy ask for.
#include <gmock/gmock.h>

#include <cmath>

#include "firmware-app/stereotrack/plan.hpp"
#include "tests/replay/command_support.hpp"

namespace stereotrack::test {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(PlanLens, ByHand) {
  PlanArguments wanted;
  wanted.range_m = 20;
  wanted.accuracy_m = 0.1;
  const PlannedLens lens = plan_lens(wanted, 640, 90);
  EXPECT_NEAR(lens.focal_px, 320, 1e-9);
  EXPECT_NEAR(lens.baseline_m, 3.125, 1e-9);        // 400 / 4 / 0.1 = 1000 px m
  EXPECT_NEAR(lens.accuracy_m, 0.1, 1e-12);         // as wanted
  EXPECT_NEAR(lens.nearest_m, 1000 / 448.0, 1e-9);  // 0.7 of 640 px
  EXPECT_NEAR(lens.overlap_m, 1.5625, 1e-9);        // half the baseline to either side
  EXPECT_NEAR(lens.target_px, 8, 1e-9);             // 320 x 0.5 / 20
  EXPECT_NEAR(lens.skew_ms, 7.8125, 1e-9);          // 2 m/s are 32 px/s
  EXPECT_NEAR(lens.turn_deg, 0.0447623, 1e-6);      // 1/4 of 320 px
}

TEST(PlanLens, AccuracyIsWhatAnErrorOfTheDisparityMakesOfTheDistance) {
  for (const double view_deg : {25.0, 60.0, 100.0}) {
    for (const double baseline_m : {0.06, 0.25, 1.0}) {
      PlanArguments wanted;
      wanted.range_m = 12;
      wanted.accuracy_m = 0.5;
      wanted.baseline_m = baseline_m;
      wanted.disparity_error_px = 0.01;  // small: to compare with the slope
      const PlannedLens lens = plan_lens(wanted, 1280, view_deg);
      const double disparity = lens.focal_px * baseline_m / 12;
      const auto distance = [&](double off) { return lens.focal_px * baseline_m / (disparity + off); };
      EXPECT_NEAR(lens.accuracy_m, (distance(-0.01) - distance(0.01)) / 2, 1e-3 * lens.accuracy_m);
      EXPECT_EQ(lens.baseline_m, baseline_m);
    }
  }
}

std::string plan(std::vector<std::string> more) {
  more.insert(more.begin(), "plan");
  const ProgramResult result = stereotrack_command(more);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.err, "");
  return result.out;
}

TEST(CommandPlan, WhatTheRigsPageShowsIsWhatItPrints) {
  const std::string page = read_text(fs::path(STEREOTRACK_SOURCE_DIR) / "docs/RIG.md");
  std::istringstream table(plan({"--range", "20", "--accuracy", "0.1", "--size", "1280x800"}));
  for (std::string line; std::getline(table, line);) {
    EXPECT_THAT(page, HasSubstr(line.empty() ? "\n" : "    " + line + "\n"));
  }
}

TEST(CommandPlan, WhatARigCannotDoIsSaid) {
  const std::vector<std::string> small{"--range", "20", "--accuracy", "0.1", "--baseline", "0.06", "--view", "60"};
  EXPECT_THAT(plan(small), HasSubstr("too coarse"));
  EXPECT_THAT(plan(small), Not(HasSubstr("too small")));
  EXPECT_THAT(plan({"--range", "20", "--accuracy", "10", "--target", "0.1", "--view", "60"}),
              testing::AllOf(HasSubstr("target too small"), Not(HasSubstr("too coarse"))));
  EXPECT_THAT(plan({"--range", "1", "--accuracy", "0.1", "--baseline", "2", "--view", "60"}),
              HasSubstr("nothing is near enough"));
}

TEST(CommandPlan, WhatIsNoPlanIsRefusedInOneLine) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> bad{
      {{"--range", "20"}, "--accuracy"},
      {{"--accuracy", "1"}, "--range"},
      {{"--range", "0", "--accuracy", "1"}, "--range"},
      {{"--range", "20", "--accuracy", "-1"}, "--accuracy"},
      {{"--range", "20", "--accuracy", "nan"}, "--accuracy"},
      {{"--range", "20", "--accuracy", "1", "--view", "180"}, "--view"},
      {{"--range", "20", "--accuracy", "1", "--size", "640"}, "--size 640"},
      {{"--range", "20", "--accuracy", "1", "--size", "0x480"}, "--size 0x480"},
  };
  for (const auto& [words, named] : bad) {
    std::vector<std::string> all = words;
    all.insert(all.begin(), "plan");
    const ProgramResult result = stereotrack_command(all);
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_EQ(result.out, "");
    EXPECT_TRUE(is_one_line(result.err));
    EXPECT_THAT(result.err, HasSubstr(named));
  }
}

}  // namespace
}  // namespace stereotrack::test
