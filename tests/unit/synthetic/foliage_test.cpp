#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "drivers/capture/synthetic/scenes/foliage.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "drivers/capture/synthetic/view.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

using synthetic::PinholeCamera;
using synthetic::PosedFoliage;
using synthetic::Scene;
using synthetic::Vec3;

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticFoliage, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("foliage", small(), 1), 0xb2b6e00157721714ULL);
  EXPECT_EQ(hash_at("foliage", small(), 170), 0xe04f6bc458e38f57ULL);
}

double middle(std::vector<double> values) {
  const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), half, values.end());
  return *half;
}

class SyntheticFoliageSeeds : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SyntheticFoliageSeeds, LeavesWaveBySeveralPixelsAndShowBothSides) {
  const Scene scene = synthetic::make_foliage(GetParam());
  const PinholeCamera camera = scene.rig.camera(0, 640, 480);
  struct Seen {
    double left = 1e9, right = -1e9, largest_step = 0, u = 0;
    int upper = 0, under = 0;
  };
  std::vector<Seen> seen;
  PosedFoliage foliage;
  constexpr int kFrames = 400;
  for (int frame = 0; frame < kFrames; ++frame) {
    scene.foliage->pose(frame / 30.0, foliage);
    ASSERT_LE(foliage.leaves.size(), synthetic::Foliage::kMostLeaves);
    seen.resize(foliage.leaves.size());
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const synthetic::PosedLeaf& leaf = foliage.leaves[i];
      const Vec3 p = camera.to_camera(leaf.shape.center);
      const double u = camera.f * p.x / p.z + camera.cx;
      Seen& s = seen[i];
      if (frame > 0) s.largest_step = std::max(s.largest_step, std::abs(u - s.u));
      s.u = u;
      s.left = std::min(s.left, u);
      s.right = std::max(s.right, u);
      ++(dot(leaf.shape.axes.y, camera.position - leaf.shape.center) > 0 ? s.upper : s.under);
    }
  }
  EXPECT_GT(seen.size(), 4000U);
  std::vector<double> ranges;
  std::size_t turning = 0;
  double largest_step = 0;
  for (const Seen& s : seen) {
    ranges.push_back(s.right - s.left);
    largest_step = std::max(largest_step, s.largest_step);
    turning += s.upper > kFrames / 20 && s.under > kFrames / 20 ? 1U : 0U;
  }
  EXPECT_GT(middle(ranges), 3.0);
  EXPECT_LT(middle(ranges), 8.0);
  EXPECT_LT(*std::max_element(ranges.begin(), ranges.end()), 16.0);
  EXPECT_LT(largest_step, 3.0);
  EXPECT_GT(turning, seen.size() / 10);
}

// Without anybody about: everything is background, and nearer where leaves are.
TEST_P(SyntheticFoliageSeeds, LeavesAreBackgroundAtTheirOwnDepth) {
  const Scene scene = synthetic::make_foliage(GetParam());
  const PinholeCamera camera = scene.rig.camera(0, 160, 120);
  synthetic::View view(scene, camera);
  view.cast_actors({}, {});
  std::vector<double> bare;
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) bare.push_back(view.owner(x, y).inverse_depth);
  }
  PosedFoliage foliage;
  scene.foliage->pose(3.0, foliage);
  view.cast_actors({}, foliage);
  int nearer = 0;
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) {
      const synthetic::View::Owner owner = view.owner(x, y);
      EXPECT_EQ(owner.actor, -1);
      EXPECT_EQ(view.darkening(x, y), 0.0);
      nearer += owner.inverse_depth > 1.02 * bare[static_cast<std::size_t>(y * 160 + x)] ? 1 : 0;
    }
  }
  EXPECT_GT(nearer, 1200);
  EXPECT_LT(nearer, 6000);
}

TEST_P(SyntheticFoliageSeeds, ObjectsAreMarkedWhereTheyAreBeforeLeavesAndNowhereElse) {
  const Scene scene = synthetic::make_foliage(GetParam());
  const PinholeCamera camera = scene.rig.camera(0, 160, 120);
  const auto source = open_synthetic("foliage", small(GetParam()));
  PosedFoliage foliage;
  FramePair pair;
  int before = 0;
  int free = 0;
  for (std::uint64_t ordinal = 1; ordinal <= 391; ordinal += 13) {
    source->skip_to(ordinal - 1);
    ASSERT_EQ(source->next(pair), Next::kPair);
    const GroundTruth& truth = source->truth();
    int objects = 0;
    for (const TrueObject& o : truth.objects) objects += o.visible_px;
    EXPECT_EQ(objects, std::count(truth.labels.begin(), truth.labels.end(), GroundTruth::kMoving));
    // The core of a clump fills the pixel where its middle is seen.
    scene.foliage->pose(static_cast<double>(ordinal - 1) / 30.0, foliage);
    for (const std::size_t end : foliage.clump_ends) {
      const synthetic::Shape& core = foliage.leaves[end - 1].shape;
      if (core.kind != synthetic::ShapeKind::kEllipsoid) continue;  // the flag
      const Vec3 p = camera.to_camera(core.center);
      const int x = static_cast<int>(std::floor(camera.f * p.x / p.z + camera.cx + 0.5));
      const int y = static_cast<int>(std::floor(camera.f * p.y / p.z + camera.cy + 0.5));
      if (x < 0 || y < 0 || x >= 160 || y >= 120) continue;
      const auto i = static_cast<std::size_t>(y * 160 + x);
      const double leaf_disparity = 150.0 * 0.25 / p.z;
      if (truth.labels[i] == GroundTruth::kMoving) {
        EXPECT_GT(truth.disparity[i] / 256.0, leaf_disparity) << "frame " << ordinal << " at " << x << ", " << y;
        ++before;
      } else {
        EXPECT_EQ(truth.labels[i], GroundTruth::kStill) << "frame " << ordinal << " at " << x << ", " << y;
        EXPECT_GT(truth.disparity[i] / 256.0, leaf_disparity - 0.05);
        ++free;
      }
    }
  }
  EXPECT_GT(before, 4);
  EXPECT_GT(free, 500);
}

// Grey levels under the leaves change more than noise makes them change.
TEST_P(SyntheticFoliageSeeds, LeavesFlicker) {
  SyntheticOptions options = small(GetParam());
  options.truth = false;
  const Scene scene = synthetic::make_foliage(GetParam());
  const PinholeCamera camera = scene.rig.camera(0, 160, 120);
  const auto source = open_synthetic("foliage", options);
  constexpr int kFrames = 30;
  std::vector<double> sum(160 * 120, 0.0);
  std::vector<double> square(160 * 120, 0.0);
  FramePair pair;
  for (int k = 0; k < kFrames; ++k) {
    source->skip_to(static_cast<std::uint64_t>(60 + 3 * k));
    ASSERT_EQ(source->next(pair), Next::kPair);
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 160; ++x) {
        const double v = luma(pair.left, x, y);
        sum[static_cast<std::size_t>(y * 160 + x)] += v;
        square[static_cast<std::size_t>(y * 160 + x)] += v * v;
      }
    }
  }
  const auto deviation = [&](std::size_t p) {
    return std::sqrt(std::max(0.0, square[p] - sum[p] * sum[p] / kFrames) / (kFrames - 1));
  };
  std::vector<double> leaves;
  for (const Vec3& clump : scene.foliage->clumps()) {
    const Vec3 p = camera.to_camera(clump);
    const int x = static_cast<int>(camera.f * p.x / p.z + camera.cx + 0.5);
    const int y = static_cast<int>(camera.f * p.y / p.z + camera.cy + 0.5);
    if (x >= 0 && y >= 0 && x < 160 && y < 45) leaves.push_back(deviation(static_cast<std::size_t>(y * 160 + x)));
  }
  std::vector<double> floor;
  floor.reserve(100);
  for (int x = 0; x < 100; ++x) floor.push_back(deviation(static_cast<std::size_t>(112 * 160 + x + 30)));
  ASSERT_GT(leaves.size(), 10U);
  EXPECT_GT(middle(leaves), 2.0 * middle(floor));
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticFoliageSeeds, testing::Values(1, 2));

}  // namespace
}  // namespace stereotrack::capture
