#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "drivers/capture/synthetic/scenes/shake.hpp"
#include "drivers/capture/synthetic/still_picture.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

using synthetic::PinholeCamera;
using synthetic::Scene;
using synthetic::StillPicture;
using synthetic::StillRays;
using synthetic::Vec3;

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticShake, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("shake", small(), 1), 0xd10c82a8ea828b53ULL);
  EXPECT_EQ(hash_at("shake", small(), 160), 0x5dd09b194b40a0b5ULL);
}

/// How far what is seen at (u, v) at rest, 8 m away, is from there.
double moved_px(const PinholeCamera& rest, const PinholeCamera& turned, double u, double v) {
  const Vec3 p = turned.to_camera(rest.position + rest.ray(u, v) * 8.0);
  const double du = turned.f * p.x / p.z + turned.cx - u;
  const double dv = turned.f * p.y / p.z + turned.cy - v;
  return std::sqrt(du * du + dv * dv);
}

class SyntheticShakeSeeds : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SyntheticShakeSeeds, PictureSwaysByAboutFourPixelsAndNeverMoreThanFourAndAHalf) {
  const Scene scene = synthetic::make_shake(GetParam());
  double most = 0;
  double most_in_a_frame = 0;
  std::array<double, 2> middle{};
  for (int frame = 0; frame < 2000; ++frame) {
    const synthetic::Sway sway = scene.moment(frame / 30.0).sway;
    double here = 0;
    for (const int camera : {0, 1}) {
      const PinholeCamera rest = scene.rig.camera(camera, 640, 480);
      const PinholeCamera turned = scene.rig.camera(camera, 640, 480, sway);
      for (const double u : {0.0, 320.0, 639.0}) {
        for (const double v : {0.0, 240.0, 479.0}) here = std::max(here, moved_px(rest, turned, u, v));
      }
      if (frame < 400) {
        auto& most_there = middle[static_cast<std::size_t>(camera)];
        most_there = std::max(most_there, moved_px(rest, turned, 320, 240));
      }
    }
    EXPECT_LE(here, 4.5) << "frame " << frame + 1;
    if (frame < 400) most = std::max(most, here);
    const synthetic::Sway next = scene.moment((frame + 1) / 30.0).sway;
    most_in_a_frame = std::max(most_in_a_frame, 600.0 * std::abs(next.yaw - sway.yaw));
  }
  EXPECT_GE(most, 3.7);
  for (const double m : middle) {
    EXPECT_GE(m, 2.7);
    EXPECT_LE(m, 3.4);
  }
  EXPECT_GT(most_in_a_frame, 0.3);
  EXPECT_LT(most_in_a_frame, 1.5);
}

TEST_P(SyntheticShakeSeeds, RigIsStiff) {
  const Scene scene = synthetic::make_shake(GetParam());
  for (int frame = 0; frame < 400; frame += 7) {
    const synthetic::Sway sway = scene.moment(frame / 30.0).sway;
    const PinholeCamera left = scene.rig.camera(0, 640, 480, sway);
    const PinholeCamera right = scene.rig.camera(1, 640, 480, sway);
    const Vec3 base = left.to_camera(right.position);
    EXPECT_NEAR(base.x, scene.rig.baseline_m, 1e-12);
    EXPECT_NEAR(base.y, 0, 1e-12);
    EXPECT_NEAR(base.z, 0, 1e-12);
    for (const auto axis : {&synthetic::Axes::x, &synthetic::Axes::y, &synthetic::Axes::z}) {
      EXPECT_NEAR(length(left.axes.*axis), 1.0, 1e-12);
      EXPECT_EQ(dot(left.axes.*axis, right.axes.*axis), dot(left.axes.*axis, left.axes.*axis));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticShakeSeeds, testing::Values(1, 2, 3, 4, 5));

struct Difference {
  double light = 0;  ///< mean of |a - b| over the mean of b
  double depth = 0;  ///< share of pixels whose depths differ by more than a quarter pixel of far floor does: 1 in 80
};

Difference difference(const StillPicture& a, const StillPicture& b) {
  double off = 0;
  double sum = 0;
  int deep = 0;
  for (std::size_t i = 0; i < a.sun_light.size(); ++i) {
    off += std::abs(static_cast<double>(a.sun_light[i] + a.sky_light[i] - b.sun_light[i] - b.sky_light[i]));
    sum += static_cast<double>(b.sun_light[i] + b.sky_light[i]);
  }
  for (std::size_t i = 0; i < a.center_depth.size(); ++i) {
    deep += std::abs(a.center_depth[i] / b.center_depth[i] - 1.0F) > 0.0125F ? 1 : 0;
  }
  return {off / sum, static_cast<double>(deep) / static_cast<double>(a.center_depth.size())};
}

// What is read for a turned camera is what that camera casts itself.
TEST(SyntheticShake, TurnedPictureIsThatOfTheTurnedCamera) {
  const Scene scene = synthetic::make_shake(1);
  const PinholeCamera rest = scene.rig.camera(0, 160, 120);
  const synthetic::TurnableStill turnable(scene, rest);
  StillPicture unturned;
  synthetic::cast_still(scene, rest, StillRays::kThirteen, unturned);
  StillPicture read;
  read.resize(scene, rest);
  for (const synthetic::Sway& sway :
       {synthetic::Sway{0, 0, 0}, synthetic::Sway{0.0052, 0, 0}, synthetic::Sway{0, -0.004, 0},
        synthetic::Sway{0.0052, 0.0014, 0.0005}, synthetic::Sway{0.001, 0.001, 0.006}}) {
    const PinholeCamera turned = scene.rig.camera(0, 160, 120, sway);
    turnable.read(turned, read);
    StillPicture expected;
    synthetic::cast_still(scene, turned, StillRays::kThirteen, expected);
    const Difference d = difference(read, expected);
    EXPECT_LT(d.light, 0.045);
    EXPECT_LT(d.depth, 0.03);
    if (sway.yaw != 0 || sway.pitch != 0) {
      EXPECT_GT(difference(unturned, expected).light, 1.25 * d.light);
    }
  }
}

// The floor under the turned camera: 3 m below it along the world's y.
TEST(SyntheticShake, TruthIsThatOfTheTurnedCamera) {
  const Scene scene = synthetic::make_shake(1);
  const auto source = open_synthetic("shake", small());
  FramePair pair;
  for (const std::uint64_t ordinal : {40U, 137U, 180U, 222U}) {
    source->skip_to(ordinal - 1);
    ASSERT_EQ(source->next(pair), Next::kPair);
    const GroundTruth& truth = source->truth();
    const PinholeCamera camera =
        scene.rig.camera(0, 160, 120, scene.moment(static_cast<double>(ordinal - 1) / 30.0).sway);
    int compared = 0;
    for (const int y : {100, 110, 119}) {
      for (const int x : {5, 80, 155}) {
        const auto p = static_cast<std::size_t>(y * 160 + x);
        if (truth.labels[p] == GroundTruth::kMoving) continue;
        const double z = -camera.position.y / camera.ray(x, y).y;
        EXPECT_NEAR(truth.disparity[p] / 256.0, 150.0 * 0.25 / z, 0.03);
        ++compared;
      }
    }
    EXPECT_GE(compared, 5);
    int objects = 0;
    for (const TrueObject& o : truth.objects) {
      objects += o.visible_px;
      const double u = camera.f * o.x / o.z + camera.cx;
      const double v = camera.f * o.y / o.z + camera.cy;
      EXPECT_TRUE(u >= o.box.left - 1 && u <= o.box.right() && v >= o.box.top - 1 && v <= o.box.bottom());
    }
    EXPECT_EQ(objects, std::count(truth.labels.begin(), truth.labels.end(), GroundTruth::kMoving));
    EXPECT_GT(objects, 0);
  }
}

}  // namespace
}  // namespace stereotrack::capture
