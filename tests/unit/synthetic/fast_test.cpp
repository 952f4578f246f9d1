#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <vector>

#include "drivers/capture/synthetic/scenes/fast.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

constexpr std::uint32_t kBalls = 10;  ///< ids 1 .. 10; 11 and 12 walk

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticFast, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("fast", small(), 1), 0x4c00d7a84139c174ULL);
  EXPECT_EQ(hash_at("fast", small(), 117), 0x45cd791c2ff1996eULL);
}

class SyntheticFastSeeds : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SyntheticFastSeeds, BallsGoByAtFortyPixelsAFrameAndBounceInView) {
  const synthetic::Scene scene = synthetic::make_fast(GetParam());
  const std::vector<synthetic::Actor> cast = scene.cast(0);
  ASSERT_EQ(cast.size(), 12U);
  const synthetic::PinholeCamera camera = scene.rig.camera(0, 640, 480);
  int bounced = 0;
  for (std::size_t i = 0; i < kBalls; ++i) {
    synthetic::PosedActor posed;
    double u_before = -1;
    double lowest_before = -1;
    bool falls = false;
    bool bounces = false;
    int frames = 0;
    for (int frame = 0; frame < 30 * 25; ++frame) {
      const bool on = pose(cast[i], frame / 30.0, posed);
      const synthetic::Vec3 p = on ? camera.to_camera(posed.center) : synthetic::Vec3{};
      const double u = on ? camera.f * p.x / p.z + camera.cx : -1;
      const double v = on ? camera.f * p.y / p.z + camera.cy : -1;
      const bool inside = on && u >= 0 && u < 640 && v >= 0 && v < 480;
      if (!inside) {
        u_before = lowest_before = -1;
        continue;
      }
      ++frames;
      if (u_before >= 0) {
        EXPECT_GE(std::abs(u - u_before), 38) << "ball " << i + 1 << " frame " << frame;
        EXPECT_LE(std::abs(u - u_before), 52) << "ball " << i + 1 << " frame " << frame;
        bounces = bounces || (falls && posed.center.y > lowest_before);
        falls = posed.center.y < lowest_before;
      }
      u_before = u;
      lowest_before = posed.center.y;
    }
    EXPECT_GE(frames, 12) << "ball " << i + 1;
    EXPECT_LE(frames, 18) << "ball " << i + 1;
    bounced += bounces ? 1 : 0;
  }
  EXPECT_EQ(bounced, 4);
}

TEST_P(SyntheticFastSeeds, TruthIsTheStreak) {
  SyntheticOptions options;
  options.seed = GetParam();
  options.truth = true;
  options.frames = 700;
  const synthetic::Scene scene = synthetic::make_fast(GetParam());
  const std::vector<synthetic::Actor> cast = scene.cast(0);
  const synthetic::PinholeCamera camera = scene.rig.camera(0, 640, 480);
  // The first ball alone, about in the middle of the picture.
  synthetic::PosedActor posed;
  std::uint64_t ordinal = 0;
  for (std::uint64_t frame = 1; frame < 200 && ordinal == 0; ++frame) {
    if (!pose(cast[0], static_cast<double>(frame - 1) / 30.0, posed)) continue;
    const synthetic::Vec3 p = camera.to_camera(posed.center);
    if (std::abs(p.x / p.z) < 0.04) ordinal = frame;
  }
  ASSERT_GT(ordinal, 0U);
  const auto source = open_synthetic("fast", options);
  source->skip_to(ordinal - 1);
  FramePair pair;
  ASSERT_EQ(source->next(pair), Next::kPair);
  const synthetic::Vec3 middle = camera.to_camera(posed.center);
  const double width_px = 2 * posed.radius * camera.f / middle.z;
  int found = 0;
  for (const TrueObject& o : source->truth().objects) {
    if (o.id != 1) continue;
    ++found;
    EXPECT_TRUE(o.scored());
    // As high as the ball; as wide as it and the most of half a frame's way.
    EXPECT_NEAR(o.box.height, width_px, 2.5);
    EXPECT_GT(o.box.width, width_px + 4);
    EXPECT_LT(o.box.width, width_px + 26);
    EXPECT_NEAR(o.x, middle.x, 0.03);
    EXPECT_NEAR(o.y, middle.y, 0.03);
    EXPECT_NEAR(o.z, middle.z - 0.7 * posed.radius, 0.06);
    EXPECT_EQ(o.visible_px, std::count(source->truth().labels.begin(), source->truth().labels.end(), 255));
  }
  EXPECT_EQ(found, 1);
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticFastSeeds, testing::Range<std::uint64_t>(1, 6));

}  // namespace
}  // namespace stereotrack::capture
