#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <vector>

#include "drivers/capture/synthetic/scenes/stop_and_go.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticStopAndGo, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("stop-and-go", small(), 1), 0x88be0db3171d83dfULL);
  EXPECT_EQ(hash_at("stop-and-go", small(), 300), 0x59d846263ed8524dULL);
}

class SyntheticStopAndGoSeeds : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SyntheticStopAndGoSeeds, EachStopsInThePictureForAsLongAsTheHeaderSays) {
  constexpr std::array<std::array<double, 2>, 7> kStops_s{
      {{2, 4}, {4, 8}, {12, 15}, {6, 10}, {5, 8}, {10, 15}, {8, 12}}};
  const synthetic::Scene scene = synthetic::make_stop_and_go(GetParam());
  const std::vector<synthetic::Actor> cast = scene.cast(0);
  ASSERT_EQ(cast.size(), 8U);
  const synthetic::PinholeCamera camera = scene.rig.camera(0, 640, 480);
  for (std::size_t i = 0; i < cast.size(); ++i) {
    constexpr double kStep_s = 0.01;
    double stood_s = 0;
    synthetic::Vec3 place;
    for (double t = cast[i].path.start_s(); t < cast[i].path.end_s(); t += kStep_s) {
      const synthetic::Place3 p = cast[i].path.at(t);
      if (p.pace > 0) continue;
      if (stood_s > 0) {
        EXPECT_LT(length(p.position - place), 1e-12) << "id " << i + 1 << " at " << t;
      }
      place = p.position;
      stood_s += kStep_s;
    }
    if (i == 7) {
      EXPECT_EQ(stood_s, 0);
      continue;
    }
    EXPECT_GE(stood_s, kStops_s[i][0] - 0.02) << "id " << i + 1;
    EXPECT_LE(stood_s, kStops_s[i][1] + 0.02) << "id " << i + 1;
    const synthetic::Vec3 p = camera.to_camera(place);
    const double reach_px = camera.f * 0.3 / p.z;
    EXPECT_GT(camera.f * p.x / p.z + camera.cx, reach_px) << "id " << i + 1;
    EXPECT_LT(camera.f * p.x / p.z + camera.cx, 640 - reach_px) << "id " << i + 1;
    EXPECT_LT(camera.f * p.y / p.z + camera.cy, 480) << "id " << i + 1;
  }
}

TEST_P(SyntheticStopAndGoSeeds, WhoStandsIsAnObjectAtOnePlaceAllTheTime) {
  SyntheticOptions options = small(GetParam());
  options.fps = 5;
  options.frames = 195;
  const auto source = open_synthetic("stop-and-go", options);
  std::map<std::uint32_t, Rect> box;
  std::map<std::uint32_t, int> same;
  std::map<std::uint32_t, int> longest;
  FramePair pair;
  while (source->next(pair) == Next::kPair) {
    const GroundTruth& truth = source->truth();
    int objects = 0;
    for (const TrueObject& o : truth.objects) {
      objects += o.visible_px;
      EXPECT_FALSE(o.undecided);
      same[o.id] = box.count(o.id) != 0 && box[o.id] == o.box ? same[o.id] + 1 : 0;
      longest[o.id] = std::max(longest[o.id], same[o.id]);
      box[o.id] = o.box;
    }
    EXPECT_EQ(objects, std::count(truth.labels.begin(), truth.labels.end(), GroundTruth::kMoving));
    EXPECT_EQ(0, std::count(truth.labels.begin(), truth.labels.end(), GroundTruth::kUnknown));
  }
  ASSERT_EQ(box.size(), 8U);
  int for_two_seconds = 0;
  for (const auto& [id, frames] : longest) for_two_seconds += frames >= 9 ? 1 : 0;
  // Somebody who passes behind or before may change a box meanwhile.
  EXPECT_GE(for_two_seconds, 6);
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticStopAndGoSeeds, testing::Range<std::uint64_t>(1, 6));

}  // namespace
}  // namespace stereotrack::capture
