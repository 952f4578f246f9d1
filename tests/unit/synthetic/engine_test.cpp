#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "drivers/capture/synthetic/actor.hpp"
#include "drivers/capture/synthetic/path.hpp"
#include "drivers/capture/synthetic/random.hpp"
#include "drivers/capture/synthetic/scene.hpp"
#include "drivers/capture/synthetic/sensor.hpp"
#include "drivers/capture/synthetic/shape.hpp"

namespace stereotrack::capture::synthetic {
namespace {

double depth_along(const Shape& shape, Vec3 origin, Vec3 direction) {
  const Caster caster(shape);
  return caster.hit(caster.origin(origin), caster.direction(direction));
}

TEST(SyntheticRandom, NumberDependsOnKeyAndCountAlone) {
  Random a(7);
  Random b(7);
  Random c(8);
  const std::uint64_t first = a.bits();
  EXPECT_EQ(first, b.bits());
  EXPECT_NE(first, c.bits());
  EXPECT_NE(first, a.bits());
}

TEST(SyntheticRandom, SplitMixGivesThePublishedFirstNumber) {
  EXPECT_EQ(mix_bits(0), 0xe220a8397b1dcdafULL);  // SplitMix64 seeded with 0, first output
}

TEST(SyntheticRandom, QuantilesAreThoseOfTheNormalDistribution) {
  const auto& q = normal_quantiles();
  // Tables: probability 0.841345 lies at 1 sigma, 0.97725 at 2, 0.99865 at 3.
  const auto at = [&](double p) { return q[static_cast<std::size_t>(p * 4096.0)] / 4096.0; };
  EXPECT_NEAR(at(0.5), 0.0, 2e-3);
  EXPECT_NEAR(at(0.841345), 1.0, 3e-3);
  EXPECT_NEAR(at(0.97725), 2.0, 6e-3);
  EXPECT_NEAR(at(0.99865), 3.0, 0.06);
  double square = 0;
  for (std::size_t i = 0; i < q.size(); ++i) {
    EXPECT_EQ(q[i], -q[q.size() - 1 - i]);
    square += q[i] * q[i] / (4096.0 * 4096.0);
  }
  EXPECT_NEAR(square / 4096.0, 1.0, 2e-3);
}

TEST(SyntheticShape, RaysMeetEachKindWhereGeometrySays) {
  const Vec3 ahead{0, 0, 1};
  EXPECT_DOUBLE_EQ(depth_along(ellipsoid({0, 0, 10}, {}, {1, 2, 3}, 0), {}, ahead), 7.0);
  EXPECT_DOUBLE_EQ(depth_along(box({0, 0, 10}, {}, {1, 1, 2}, 0), {}, ahead), 8.0);
  EXPECT_DOUBLE_EQ(depth_along(cylinder({0, -1, 10}, {0, 1, 10}, 0.5, {1, 0, 0}, 0), {}, ahead), 9.5);
  EXPECT_DOUBLE_EQ(depth_along(cylinder({0, 0, 8}, {0, 0, 12}, 0.5, {1, 0, 0}, 0), {}, ahead), 8.0);  // its flat end
  EXPECT_DOUBLE_EQ(depth_along(capsule({0, 0, 8}, {0, 0, 12}, 0.5, {1, 0, 0}, 0), {}, ahead), 7.5);   // its round end
  EXPECT_DOUBLE_EQ(depth_along(capsule({0, -1, 10}, {0, 1, 10}, 0.5, {1, 0, 0}, 0), {}, ahead), 9.5);
}

TEST(SyntheticShape, AxesAreUprightToEachOtherWhereverTheSidePoints) {
  for (const Vec3 side : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}, normalized({1, 1e-9, 0})}) {
    for (const Vec3 end : {Vec3{2, 0, 0}, Vec3{0, 3, 0}, Vec3{0, 0, 1}, Vec3{1, 1, 1}}) {
      const Axes a = capsule({}, end, 0.1, side, 0).axes;
      for (const Vec3 axis : {a.x, a.y, a.z}) EXPECT_NEAR(length(axis), 1.0, 1e-12);
      EXPECT_NEAR(dot(a.x, a.y), 0.0, 1e-12);
      EXPECT_NEAR(dot(a.y, a.z), 0.0, 1e-12);
      EXPECT_NEAR(dot(a.z, a.x), 0.0, 1e-12);
    }
  }
}

TEST(SyntheticShape, RaysThatPassBesideOrPointAwayMiss) {
  for (const Shape& s :
       {ellipsoid({0, 0, 10}, {}, {1, 1, 1}, 0), box({0, 0, 10}, {}, {1, 1, 1}, 0),
        cylinder({0, -1, 10}, {0, 1, 10}, 1, {1, 0, 0}, 0), capsule({0, -1, 10}, {0, 1, 10}, 1, {1, 0, 0}, 0)}) {
    EXPECT_EQ(depth_along(s, {5, 0, 0}, {0, 0, 1}), kMiss);
    EXPECT_EQ(depth_along(s, {0, 0, 0}, {0, 0, -1}), kMiss);
    EXPECT_TRUE(blocks(s, {0, 0, 0}, {0, 0, 1}));
    EXPECT_FALSE(blocks(s, {0, 0, 20}, {0, 0, 1}));
  }
}

TEST(SyntheticShape, NormalsAndDistancesAgree) {
  // The normal is the direction in which the distance grows: a step along it is the distance.
  for (const Shape& s : {box({0, 0, 10}, {}, {1, 1, 1}, 0), cylinder({0, -1, 10}, {0, 1, 10}, 1, {1, 0, 0}, 0),
                         capsule({0, -1, 10}, {0, 1, 10}, 1, {1, 0, 0}, 0), ellipsoid({0, 0, 10}, {}, {1, 1, 1}, 0)}) {
    const Vec3 direction = normalized({0.03, 0.05, 1});
    const Vec3 point = direction * depth_along(s, {}, direction);
    const Vec3 normal = s.axes.to_world(local_normal(s, s.axes.to_local(point - s.center)));
    EXPECT_NEAR(distance(s, point), 0.0, 1e-9);
    EXPECT_NEAR(distance(s, point + normal * 0.25), 0.25, 1e-9);
  }
}

TEST(SyntheticCamera, BoxOnTheScreenHoldsEveryRayThatHits) {
  Rig rig;
  const PinholeCamera camera = rig.camera(1, 160, 120);
  const Rect frame{0, 0, 160, 120};
  constexpr std::array<Offset, 1> kCenter{};
  for (const Shape& s :
       {ellipsoid({-1, 0.5, 7}, {}, {0.5, 0.2, 0.4}, 0), box({1, 0.6, 6}, {}, {0.5, 0.6, 0.3}, 0),
        cylinder({0.3, 0, 8}, {0.8, 1, 7}, 0.2, {0, 0, 1}, 0), capsule({-2, 0.3, 8}, {-1, 1, 9}, 0.3, {0, 0, 1}, 0)}) {
    int inside = 0;
    int everywhere = 0;
    cast(camera, s, intersect(screen_box(camera, s), frame), kCenter, [&](int, int, std::size_t, double) { ++inside; });
    cast(camera, s, frame, kCenter, [&](int, int, std::size_t, double) { ++everywhere; });
    EXPECT_GT(inside, 20);
    EXPECT_EQ(inside, everywhere);
  }
}

TEST(SyntheticPath, KeepsItsSpeedAndEndsWhereItShould) {
  Path::Timing timing;
  timing.start_s = 2;
  timing.speed_m_s = 1.5;
  const Path path({{0, 0, 5}, {1, 0, 6}, {3, 0, 6}, {5, 0, 5}}, timing);
  EXPECT_NEAR(path.end_s(), 2 + path.length_m() / 1.5, 1e-12);
  EXPECT_NEAR(path.at(2).position.x, 0, 1e-12);
  EXPECT_NEAR(path.at(path.end_s()).position.x, 5, 1e-9);
  for (double t = 2; t + 0.1 < path.end_s(); t += 0.1) {
    EXPECT_NEAR(length(path.at(t + 0.1).position - path.at(t).position) / 0.1, 1.5, 0.05);
    EXPECT_NEAR(length(path.at(t).heading), 1.0, 1e-12);
  }
}

TEST(SyntheticPath, StandsStillInItsPauseAndGoesOn) {
  Path::Timing timing;
  timing.speed_m_s = 1;
  timing.pause_at_s = 3;
  timing.pause_s = 2;
  const Path path({{0, 0, 0}, {5, 0, 0}, {10, 0, 0}}, timing);
  EXPECT_NEAR(path.at(4.0).position.x, path.at(4.9).position.x, 1e-9);
  EXPECT_EQ(path.at(4.5).pace, 0.0);
  EXPECT_NEAR(path.at(8).position.x - path.at(7).position.x, 1.0, 0.02);
  EXPECT_NEAR(path.end_s(), 12.0, 1e-9);
  EXPECT_NEAR(path.at(path.end_s()).position.x, 10.0, 1e-6);
}

TEST(SyntheticActor, WalkersAlwaysStandOnTheFloor) {
  Actor walker;
  walker.kind = ActorKind::kWalker;
  walker.size = {1.8, 0, 0};
  Path::Timing timing;
  timing.speed_m_s = 1.3;
  walker.path = Path({{0, 0, 5}, {3, 0, 5}, {6, 0, 6}}, timing);
  PosedActor posed;
  for (double t = 0.5; t < 4; t += 0.05) {
    ASSERT_TRUE(pose(walker, t, posed));
    double lowest = 10;
    double highest = 0;
    for (const Shape& s : posed.shapes) {
      const double half = s.kind == ShapeKind::kCapsule ? std::abs(s.axes.y.y) * s.half.y + s.half.x : s.half.y;
      lowest = std::min(lowest, s.center.y - half);
      highest = std::max(highest, s.center.y + half);
    }
    EXPECT_NEAR(lowest, 0.0, 0.04);
    EXPECT_NEAR(highest, 1.8, 0.08);
  }
  EXPECT_FALSE(pose(walker, -0.1, posed));
  EXPECT_FALSE(pose(walker, walker.path.end_s() + 0.1, posed));
}

TEST(SyntheticSensor, NoiseIsAtLeastThreeLevelsAndWithoutBias) {
  Sensor::Config config;
  config.width = 256;
  config.height = 64;
  config.vignetting = 0;
  const Sensor sensor(config);
  const std::vector<float> light(3 * 256, 0.2F);
  std::vector<std::uint8_t> row(3 * 256);
  double sum = 0;
  double square = 0;
  double channel_square = 0;
  double channel_sum = 0;
  int count = 0;
  for (int y = 0; y < 64; ++y) {
    sensor.expose(light.data(), y, 3, row.data());
    for (std::size_t x = 0; x < 256; ++x) {
      const double luma = 0.114 * row[3 * x] + 0.587 * row[3 * x + 1] + 0.299 * row[3 * x + 2];
      sum += luma;
      square += luma * luma;
      channel_sum += row[3 * x + 1];
      channel_square += row[3 * x + 1] * row[3 * x + 1];
      ++count;
    }
  }
  const double mean = sum / count;
  EXPECT_NEAR(mean, 255.0 * std::pow(0.2, 29.0 / 64.0), 0.2);
  const double sigma = std::sqrt(square / count - mean * mean);
  EXPECT_GT(sigma, 3.1);
  EXPECT_LT(sigma, 4.0);
  EXPECT_GT(std::sqrt(channel_square / count - channel_sum / count * channel_sum / count), 3.4);
}

TEST(SyntheticSensor, NoiseDiffersByFrameCameraAndSeed) {
  const std::vector<float> light(3 * 64, 0.3F);
  const auto expose = [&](std::uint64_t seed, int camera, std::uint64_t frame) {
    Sensor::Config config;
    config.seed = seed;
    config.camera = camera;
    config.width = 64;
    config.height = 1;
    std::vector<std::uint8_t> row(3 * 64);
    Sensor(config).expose(light.data(), 0, frame, row.data());
    return row;
  };
  EXPECT_EQ(expose(1, 0, 1), expose(1, 0, 1));
  EXPECT_NE(expose(1, 0, 1), expose(1, 0, 2));
  EXPECT_NE(expose(1, 0, 1), expose(1, 1, 1));
  EXPECT_NE(expose(1, 0, 1), expose(2, 0, 1));
}

TEST(SyntheticSensor, EndsOfTheRangeAreClipped) {
  Sensor::Config config;
  config.width = 64;
  config.height = 1;
  const Sensor sensor(config);
  std::vector<std::uint8_t> row(3 * 64);
  sensor.expose(std::vector<float>(3 * 64, 50.0F).data(), 0, 1, row.data());
  for (const std::uint8_t v : row) EXPECT_GT(v, 230);
  sensor.expose(std::vector<float>(3 * 64, 0.0F).data(), 0, 1, row.data());
  for (const std::uint8_t v : row) EXPECT_LT(v, 25);
}

}  // namespace
}  // namespace stereotrack::capture::synthetic
