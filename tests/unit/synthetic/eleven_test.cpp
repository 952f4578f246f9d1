#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticEleven, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("eleven", small(), 1), 0xfe0392f9d7c40831ULL);
  EXPECT_EQ(hash_at("eleven", small(), 150), 0xe632de1d154b3d4ULL);
  EXPECT_EQ(hash_at("eleven", small(), 400), 0xe49c4536bd86e29cULL);
}

TEST(SyntheticEleven, SkippingAndTruthChangeNoByte) {
  SyntheticOptions options = small();
  const std::uint64_t skipped = hash_at("eleven", options, 12);
  options.truth = false;
  const auto source = open_synthetic("eleven", options);
  FramePair pair;
  for (int i = 0; i < 12; ++i) ASSERT_EQ(source->next(pair), Next::kPair);
  EXPECT_EQ(hash_of(pair), skipped);
}

TEST(SyntheticEleven, SeedsDrawDifferentScenes) {
  std::set<std::uint64_t> hashes;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) hashes.insert(hash_at("eleven", small(seed), 200));
  EXPECT_EQ(hashes.size(), 3U);
}

TEST(SyntheticEleven, SourceDescribesItself) {
  SyntheticOptions options = small();
  options.frames = 2;
  options.fps = 25;
  const auto source = open_synthetic("eleven", options);
  EXPECT_EQ(source->info().name, "synthetic:eleven");
  EXPECT_EQ(source->info().width, 160);
  EXPECT_EQ(source->info().height, 120);
  EXPECT_EQ(source->info().format, PixelFormat::kBgr8);
  EXPECT_TRUE(source->info().stereo);
  EXPECT_TRUE(source->info().has_time);
  EXPECT_EQ(source->info().period, std::chrono::milliseconds(40));
  EXPECT_EQ(source->info().pairs, 2U);
  FramePair pair;
  ASSERT_EQ(source->next(pair), Next::kPair);
  EXPECT_EQ(pair.ordinal, 1U);
  const CaptureTime first = pair.capture_time;
  ASSERT_EQ(source->next(pair), Next::kPair);
  EXPECT_EQ(pair.ordinal, 2U);
  EXPECT_EQ(pair.capture_time - first, std::chrono::milliseconds(40));
  EXPECT_EQ(source->next(pair), Next::kEnd);
  EXPECT_EQ(source->calibration().left.fx, 150.0);
  EXPECT_EQ(source->calibration().t_right_left.x(), -0.25);
}

TEST(SyntheticEleven, DefaultsAreThoseOfTheContract) {
  const SyntheticOptions options;
  EXPECT_EQ(options.width, 640);
  EXPECT_EQ(options.height, 480);
  EXPECT_GE(options.frames, 600U);
}

std::string refusal(const std::string& name, const SyntheticOptions& options) {
  try {
    (void)open_synthetic(name, options);
  } catch (const SceneError& e) {
    return e.what();
  }
  return "";
}

TEST(SyntheticEleven, WrongWordsAreRefusedWithTheWayOut) {
  EXPECT_NE(refusal("twelve", small()).find("eleven"), std::string::npos);
  SyntheticOptions o = small();
  o.width = 63;
  EXPECT_NE(refusal("eleven", o).find("63x120"), std::string::npos);
  o = small();
  o.height = 3073;
  EXPECT_NE(refusal("eleven", o).find("4096x3072"), std::string::npos);
  o = small();
  o.frames = 0;
  EXPECT_NE(refusal("eleven", o).find("100000"), std::string::npos);
  o = small();
  o.fps = 0;
  EXPECT_NE(refusal("eleven", o).find("frame rate"), std::string::npos);
}

TEST(SyntheticEleven, SmallestAndOddSizesAreDrawn) {
  for (const auto& [width, height] : {std::pair{64, 48}, std::pair{97, 71}}) {
    SyntheticOptions o = small();
    o.width = width;
    o.height = height;
    const auto source = open_synthetic("eleven", o);
    FramePair pair;
    ASSERT_EQ(source->next(pair), Next::kPair);
    EXPECT_EQ(pair.left.width, width);
    EXPECT_EQ(pair.right.height, height);
  }
}

// One object in the picture: its box is that of the moving label, its place that of the disparity.
TEST(SyntheticEleven, TruthAgreesWithItselfWhereOneObjectIsAlone) {
  const auto source = open_synthetic("eleven", small());
  const CameraModel& camera = source->calibration().left;
  const double fb = -camera.fx * source->calibration().t_right_left.x();
  FramePair pair;
  int compared = 0;
  for (int i = 0; i < 60; ++i) {
    ASSERT_EQ(source->next(pair), Next::kPair);
    const GroundTruth& truth = source->truth();
    if (truth.objects.size() != 1) continue;
    const TrueObject& object = truth.objects[0];
    Rect box;
    int count = 0;
    double x_sum = 0;
    double z_sum = 0;
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 160; ++x) {
        const std::size_t p = static_cast<std::size_t>(y * 160 + x);
        if (truth.labels[p] != GroundTruth::kMoving) continue;
        box = unite(box, {x, y, 1, 1});
        const double z = fb / (truth.disparity[p] / 256.0);
        x_sum += (x - camera.cx) / camera.fx * z;
        z_sum += z;
        ++count;
      }
    }
    EXPECT_EQ(box, object.box);
    EXPECT_EQ(count, object.visible_px);
    EXPECT_NEAR(object.z, z_sum / count, 0.003 * object.z);
    EXPECT_NEAR(object.x, x_sum / count, 0.01);
    const double u = camera.fx * object.x / object.z + camera.cx;
    const double v = camera.fy * object.y / object.z + camera.cy;
    EXPECT_TRUE(u >= box.left && u < box.right() && v >= box.top && v < box.bottom());
    EXPECT_LE(object.visible_px, object.whole_px);
    ++compared;
  }
  EXPECT_GT(compared, 20);
}

TEST(SyntheticEleven, FloorHasTheDisparityOfItsPlane) {
  const auto source = open_synthetic("eleven", small());
  FramePair pair;
  ASSERT_EQ(source->next(pair), Next::kPair);
  // Rig 3 m up, looking down by asin 0.28; floor where 3 = Z (0.28 + 0.96 (v - cy) / f).
  for (const int y : {100, 110, 119}) {
    const double z = 3.0 / (0.28 + 0.96 * (y - 59.5) / 150.0);
    EXPECT_NEAR(source->truth().disparity[static_cast<std::size_t>(y * 160 + 80)] / 256.0, 150.0 * 0.25 / z, 0.02);
  }
}

TEST(SyntheticEleven, RightPictureShowsWhatTheDisparitySays) {
  SyntheticOptions options = small();
  options.width = 320;
  options.height = 240;
  const auto source = open_synthetic("eleven", options);
  FramePair pair;
  source->skip_to(299);
  ASSERT_EQ(source->next(pair), Next::kPair);
  // Correlation of the pictures, the right one looked up at the true disparity and beside it.
  const auto correlation = [&](double off) {
    double ab = 0, aa = 0, bb = 0, a_sum = 0, b_sum = 0;
    int n = 0;
    for (int y = 0; y < 240; ++y) {
      for (int x = 60; x < 300; ++x) {
        const double d = source->truth().disparity[static_cast<std::size_t>(y * 320 + x)] / 256.0;
        const int right = static_cast<int>(std::floor(x - d - off + 0.5));
        if (d == 0 || right < 0 || right > 319) continue;
        const double a = luma(pair.left, x, y);
        const double b = luma(pair.right, right, y);
        ab += a * b, aa += a * a, bb += b * b, a_sum += a, b_sum += b;
        ++n;
      }
    }
    return (ab - a_sum * b_sum / n) / std::sqrt((aa - a_sum * a_sum / n) * (bb - b_sum * b_sum / n));
  };
  EXPECT_GT(correlation(0), 0.9);
  EXPECT_GT(correlation(0), correlation(2) + 0.1);
  EXPECT_GT(correlation(0), correlation(-2) + 0.1);
}

TEST(SyntheticEleven, CamerasAreExposedDifferently) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const auto source = open_synthetic("eleven", small(seed));
    FramePair pair;
    ASSERT_EQ(source->next(pair), Next::kPair);
    double left = 0;
    double right = 0;
    for (int y = 60; y < 120; ++y) {
      for (int x = 20; x < 140; ++x) {
        left += luma(pair.left, x, y);
        right += luma(pair.right, x, y);
      }
    }
    const double difference = std::abs(right / left - 1.0);
    EXPECT_GT(difference, 0.03) << "seed " << seed;
    EXPECT_LT(difference, 0.08) << "seed " << seed;
  }
}

TEST(SyntheticEleven, NoiseOfWhatStandsStillIsAtLeastThreeLevels) {
  SyntheticOptions options = small();
  options.fps = 1000;  // the light does not change meanwhile
  const auto source = open_synthetic("eleven", options);
  constexpr int kFrames = 24;
  std::vector<double> sum(160 * 120, 0.0);
  std::vector<double> square(160 * 120, 0.0);
  std::vector<bool> still(160 * 120, true);
  FramePair pair;
  for (int i = 0; i < kFrames; ++i) {
    ASSERT_EQ(source->next(pair), Next::kPair);
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 160; ++x) {
        const auto p = static_cast<std::size_t>(y * 160 + x);
        const double v = luma(pair.left, x, y);
        sum[p] += v;
        square[p] += v * v;
        still[p] = still[p] && source->truth().labels[p] == GroundTruth::kStill;
      }
    }
  }
  double variance = 0;
  int count = 0;
  for (std::size_t p = 0; p < sum.size(); ++p) {
    if (!still[p]) continue;
    variance += (square[p] - sum[p] * sum[p] / kFrames) / (kFrames - 1);
    ++count;
  }
  ASSERT_GT(count, 15000);
  EXPECT_GT(std::sqrt(variance / count), 3.0);
  EXPECT_LT(std::sqrt(variance / count), 4.5);
}

TEST(SyntheticEleven, LightDriftsSlowly) {
  SyntheticOptions options = small();
  options.fps = 2;
  const auto source = open_synthetic("eleven", options);
  FramePair pair;
  double lowest = 1e9;
  double highest = 0;
  double last = 0;
  for (int i = 0; i < 40; ++i) {
    ASSERT_EQ(source->next(pair), Next::kPair);
    double sum = 0;
    for (int y = 2; y < 12; ++y) {  // sky and roofs: nobody goes there
      for (int x = 0; x < 160; ++x) sum += luma(pair.left, x, y);
    }
    sum /= 1600;
    lowest = std::min(lowest, sum);
    highest = std::max(highest, sum);
    if (i > 0) {
      EXPECT_NEAR(sum / last, 1.0, 0.015);  // in half a second
    }
    last = sum;
  }
  EXPECT_GT(highest / lowest, 1.03);
  EXPECT_LT(highest / lowest, 1.15);
}

/// What item 5 of the issue promises, for each seed. Twenty seconds at half size, six pictures a second.
class SyntheticElevenPromise : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SyntheticElevenPromise, SizesOcclusionsAndShadowsAreThere) {
  SyntheticOptions options = small(GetParam());
  options.width = 320;
  options.height = 240;
  options.fps = 6;
  options.frames = 120;
  const auto source = open_synthetic("eleven", options);
  constexpr double kFullSize = 4.0;  // pixels of 640 x 480 a pixel here
  std::map<std::uint32_t, double> largest;
  std::map<std::uint32_t, int> seen;
  std::map<std::uint32_t, int> last_hidden;
  double smallest_whole = 1e9;
  int occlusions = 0;
  int shadow_frames = 0;
  double shaded = 0;
  double lit = 0;
  std::vector<double> before(320 * 240, -1.0);
  FramePair pair;
  for (int i = 0; i < 120; ++i) {
    ASSERT_EQ(source->next(pair), Next::kPair);
    const GroundTruth& truth = source->truth();
    for (const TrueObject& o : truth.objects) {
      largest[o.id] = std::max(largest[o.id], kFullSize * o.visible_px);
      ++seen[o.id];
      EXPECT_GT(o.visible_px, 0);
      EXPECT_FALSE(o.box.empty());
      EXPECT_EQ(intersect(o.box, {0, 0, 320, 240}), o.box);
      EXPECT_GT(o.z, 3.0);
      EXPECT_LT(o.z, 15.0);
      const bool inside = o.box.left > 1 && o.box.right() < 319 && o.hidden_px == 0;
      if (inside && o.scored() && o.visible_px > 0.9 * o.whole_px) {
        smallest_whole = std::min(smallest_whole, kFullSize * o.visible_px);
      }
      if (4 * o.hidden_px >= o.hidden_px + o.visible_px) {
        if (last_hidden.count(o.id) == 0 || i - last_hidden[o.id] > 6) ++occlusions;
        last_hidden[o.id] = i;
      }
    }
    int shadow = 0;
    for (int y = 0; y < 240; ++y) {
      for (int x = 0; x < 320; ++x) {
        const auto p = static_cast<std::size_t>(y * 320 + x);
        const double v = luma(pair.left, x, y);
        if (truth.labels[p] == GroundTruth::kShadow) {
          ++shadow;
          if (before[p] >= 0) {
            shaded += v;
            lit += before[p];
          }
        }
        before[p] = truth.labels[p] == GroundTruth::kStill ? v : -1.0;
      }
    }
    if (shadow > 40) ++shadow_frames;
  }
  EXPECT_EQ(largest.size(), 11U);
  EXPECT_EQ(largest.begin()->first, 1U);
  EXPECT_EQ(largest.rbegin()->first, 11U);
  for (const auto& [id, frames] : seen) EXPECT_GT(frames, 10) << "object " << id;
  EXPECT_LE(smallest_whole, 60.0);
  double most = 0;
  for (const auto& [id, area] : largest) most = std::max(most, area);
  EXPECT_GE(most, 20000.0);
  EXPECT_GE(occlusions, 6);
  EXPECT_GT(shadow_frames, 90);
  EXPECT_LT(shaded / lit, 0.92);
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticElevenPromise, testing::Range<std::uint64_t>(1, 6));

TEST(SyntheticEleven, LongSequencesCallNewCasts) {
  SyntheticOptions options = small();
  options.frames = 2000;
  const auto source = open_synthetic("eleven", options);
  source->skip_to(1199);  // 40 s: the second act
  FramePair pair;
  ASSERT_EQ(source->next(pair), Next::kPair);
  ASSERT_FALSE(source->truth().objects.empty());
  for (const TrueObject& o : source->truth().objects) EXPECT_GT(o.id, 11U);
}

}  // namespace
}  // namespace stereotrack::capture
