// What is tracked where, through the whole pipeline. The scene's board is 30 px wide at Z = 150 x 0.2 / 12 = 2.5 units,
// half a unit, and goes from column 0 to the right from frame 41 on, 3 px a frame, in rows 40 to 69.
#include <gtest/gtest.h>

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "config/zones.hpp"
#include "pipeline/pipeline.hpp"
#include "tests/support/moving_scene.hpp"
#include "tests/support/result_bytes.hpp"

namespace stereotrack::test {
namespace {

constexpr int kLast = 80;  // the board's left edge is at column 117

struct Seen {
  std::vector<std::string> bytes;  ///< of each frame's result
  std::vector<std::vector<TrackReport>> tracks;
  std::vector<int> last_column;  ///< of the mask, -1: empty
  RejectionCounts rejections{};

  [[nodiscard]] std::set<std::uint32_t> ids() const {
    std::set<std::uint32_t> all;
    for (const auto& frame : tracks) {
      for (const TrackReport& track : frame) all.insert(track.id);
    }
    return all;
  }
  [[nodiscard]] std::uint32_t rejected(Rejection why) const { return rejections[static_cast<std::size_t>(why)]; }
};

Seen run(const std::string& toml, const char* preset = "robust", bool stereo = true) {
  const std::vector<config::Layer> layers{config::override_layer(std::string("preset=") + preset),
                                          config::override_layer("disparity.max=48"),
                                          config::text_layer("rig.toml", toml)};
  const StereoCalibration calibration = MovingScene::calibration();
  Pipeline::Setup setup;
  setup.width = MovingScene::kWidth;
  setup.height = MovingScene::kHeight;
  setup.colour = true;
  setup.calibration = stereo ? &calibration : nullptr;
  Arena arena;
  Result<Pipeline> pipeline =
      Pipeline::create(config::pipeline_of(config::load(layers).configuration, 1), setup, arena);
  EXPECT_TRUE(pipeline.has_value());
  Seen seen;
  if (!pipeline.has_value()) return seen;
  MovingScene scene(kSceneFormats[0]);
  for (int ordinal = 1; ordinal <= kLast; ++ordinal) {
    const Result<FrameResult> result = pipeline->run(scene.pair(ordinal, stereo));
    EXPECT_TRUE(result.has_value());
    if (!result.has_value()) return seen;
    seen.bytes.push_back(ResultBytes::of(*result));
    seen.tracks.emplace_back(result->tracks.begin(), result->tracks.end());
    int last = -1;
    for (int y = 0; y < result->mask.height; ++y) {
      for (int x = 0; x < result->mask.width; ++x) last = result->mask.at(x, y) != 0 ? std::max(last, x) : last;
    }
    seen.last_column.push_back(last);
    for (std::size_t i = 0; i < kRejections; ++i) seen.rejections[i] += result->rejections[i];
  }
  return seen;
}

/// Columns `from` to the right border, or up to `to`.
std::string columns(int from, int to, const std::string& targets) {
  const std::string a = std::to_string(from) + ".5";
  const std::string b = std::to_string(to) + ".5";
  return "[[zone]]\nname = \"z\"\ntargets = \"" + targets + "\"\npicture = [[" + a + ", -9], [" + b + ", -9], [" + b +
         ", 999], [" + a + ", 999]]\n";
}
std::string depth(const std::string& range, const std::string& targets = "all") {
  return "[[zone]]\nname = \"z\"\ntargets = \"" + targets + "\"\nz_m = " + range + "\n";
}

class Zones : public testing::TestWithParam<std::tuple<const char*, bool>> {
 protected:
  [[nodiscard]] Seen seen(const std::string& toml) const {
    return run(toml, std::get<0>(GetParam()), std::get<1>(GetParam()));
  }
};

TEST_P(Zones, IgnoredPixelsAreNeverForegroundAndElsewhereNothingChanges) {
  const Seen all = seen("");
  const Seen some = seen(columns(79, 999, "ignore"));
  ASSERT_EQ(some.bytes.size(), static_cast<std::size_t>(kLast));
  ASSERT_FALSE(all.ids().empty());
  EXPECT_FALSE(some.ids().empty());
  int reached = 0;
  for (int i = 0; i < kLast; ++i) {
    const auto frame = static_cast<std::size_t>(i);
    EXPECT_LT(some.last_column[frame], 80) << i + 1;
    const int right_edge = 3 * (i + 1 - 41) + 29;
    if (right_edge < 74) {
      EXPECT_TRUE(some.bytes[frame] == all.bytes[frame]) << i + 1;
    }
    reached += all.last_column[frame] >= 80 ? 1 : 0;
    for (const TrackReport& track : some.tracks[frame]) {
      EXPECT_FALSE(track.measured && track.box.left >= 80) << i + 1;
    }
  }
  EXPECT_GT(reached, 15) << "the test says nothing";
}

TEST_P(Zones, WhereAllIsIgnoredThereIsNothing) {
  const Seen none = seen(columns(-9, 999, "ignore"));
  EXPECT_TRUE(none.ids().empty());
  for (const int last : none.last_column) EXPECT_EQ(last, -1);
}

INSTANTIATE_TEST_SUITE_P(Presets, Zones,
                         testing::Combine(testing::Values("robust", "thesis"), testing::Values(true, false)),
                         [](const auto& one) {
                           return std::string(std::get<0>(one.param)) + (std::get<1>(one.param) ? "_stereo" : "_mono");
                         });

TEST(ZonesInSpace, AVolumeThatHoldsEverythingChangesNothing) {
  const Seen all = run("");
  const Seen some = run("objects.volume = \"z\"\n" + depth("[0.1, 900]"));
  EXPECT_TRUE(all.bytes == some.bytes);
}

TEST(ZonesInSpace, OutsideOfTheVolumeNothingIsTracked) {
  EXPECT_FALSE(run("objects.volume = \"z\"\n" + depth("[2.2, 2.8]")).ids().empty());
  const Seen none = run("objects.volume = \"z\"\n" + depth("[3, 9]"));
  EXPECT_TRUE(none.ids().empty());
  EXPECT_GT(none.rejected(Rejection::kOutside), 20U);
}

TEST(ZonesInSpace, InAnIgnoredBoxNothingIsTracked) {
  EXPECT_FALSE(run(depth("[3, 9]", "ignore")).ids().empty());
  const Seen none = run(depth("[2, 3]", "ignore"));
  EXPECT_TRUE(none.ids().empty());
  EXPECT_GT(none.rejected(Rejection::kIgnored), 20U);
}

TEST(ZonesInSpace, SizesAreInMetres) {
  EXPECT_FALSE(run("objects.min_size_m = 0.35\nobjects.max_size_m = 0.7\n").ids().empty());
  const Seen large = run("objects.max_size_m = 0.35\n");
  EXPECT_GT(large.rejected(Rejection::kOverSize), 20U);
  const Seen small = run("objects.min_size_m = 0.7\n");
  EXPECT_GT(small.rejected(Rejection::kUnderSize), 20U);
  for (const Seen& seen : {large, small}) {
    for (const auto& frame : seen.tracks) {
      for (const TrackReport& track : frame) EXPECT_FALSE(track.box.left > 30) << "nobody inside of the picture";
    }
  }
}

TEST(ZonesInSpace, ASizeOfAZoneOverridesThatOfAll) {
  const std::string zone = columns(-9, 70, "all") + "max_size_m = 0.7\n";
  const Seen seen = run("objects.max_size_m = 0.35\n" + zone);
  EXPECT_FALSE(seen.ids().empty()) << "it began in the zone";
  EXPECT_TRUE(std::any_of(seen.tracks.back().begin(), seen.tracks.back().end(), [](const TrackReport& track) {
    return track.measured && track.box.left > 100;
  })) << "and a target that is known is not measured again";
}

TEST(NoneBegin, WhatIsSeenThereBeginsWhereItLeaves) {
  const Seen seen = run(columns(-9, 70, "none_begin"));
  EXPECT_GT(seen.rejected(Rejection::kNoneBegin), 5U);
  ASSERT_FALSE(seen.ids().empty());
  for (std::size_t i = 0; i < seen.tracks.size(); ++i) {
    const int centre = 3 * (static_cast<int>(i) + 1 - 41) + 14;
    if (centre < 66) {
      EXPECT_TRUE(seen.tracks[i].empty()) << i + 1;
    }
  }
}

TEST(NoneBegin, WhatBeganElsewhereGoesOn) {
  const Seen all = run("");
  const Seen some = run(columns(70, 999, "none_begin"));
  EXPECT_EQ(all.ids(), some.ids());
  const auto at_end = [](const Seen& seen) {
    return std::count_if(seen.tracks.back().begin(), seen.tracks.back().end(),
                         [](const TrackReport& track) { return track.measured && track.box.left > 100; });
  };
  EXPECT_EQ(at_end(some), at_end(all));
  EXPECT_GE(at_end(some), 1);
}

}  // namespace
}  // namespace stereotrack::test
