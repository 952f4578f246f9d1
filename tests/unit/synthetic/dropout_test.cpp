#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <map>
#include <vector>

#include "drivers/capture/synthetic/scenes/dropout.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

constexpr double kPeriod_ns = 1e9 / 30;

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticDropout, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("dropout", small(), 1), 0xaf6b7470f93cb720ULL);
  EXPECT_EQ(hash_at("dropout", small(), 150), 0x94e3afe010caa1feULL);
}

class SyntheticDropoutSeeds : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SyntheticDropoutSeeds, EachHundredFramesHaveOneFaultOfEachKind) {
  const synthetic::Scene scene = synthetic::make_dropout(GetParam());
  for (std::uint64_t frame = 1; frame < 41; ++frame) {
    const synthetic::Delivery d = scene.delivery(frame);
    EXPECT_TRUE(d.left && d.right && d.right_off == 0);
  }
  for (std::uint64_t first = 41; first < 41 + 2000; first += 100) {
    std::array<int, 5> frames{};
    int faults = 0;
    bool before = false;
    for (std::uint64_t frame = first; frame < first + 100; ++frame) {
      const synthetic::Delivery d = scene.delivery(frame);
      const auto skew = static_cast<double>(std::abs(d.skew_ns));
      const bool wrong = d.right_off != 0;
      const bool fault = wrong || !d.left || !d.right;
      faults += fault && !before ? 1 : 0;
      before = fault;
      frames[0] += !d.left && d.right ? 1 : 0;
      frames[1] += d.left && !d.right ? 1 : 0;
      frames[2] += !d.left && !d.right ? 1 : 0;
      frames[3] += wrong && skew <= 3e5 ? 1 : 0;
      frames[4] += wrong && skew > 3e5 ? 1 : 0;
      if (wrong) {
        EXPECT_EQ(std::abs(d.right_off), 1);
        EXPECT_TRUE(d.left && d.right);
      }
      if (wrong && skew > 3e5) {
        EXPECT_EQ(d.skew_ns > 0, d.right_off > 0);
        EXPECT_GT(skew, 0.28 * kPeriod_ns);
        EXPECT_LT(skew, 0.47 * kPeriod_ns);  // or a replay would not pair them
      } else {
        EXPECT_LE(skew, 3e5);
      }
    }
    EXPECT_EQ(faults, 5) << "from frame " << first;
    constexpr std::array<int, 5> kMost{3, 3, 5, 8, 4};
    for (std::size_t i = 0; i < frames.size(); ++i) {
      EXPECT_GE(frames[i], 1) << "fault " << i << " from frame " << first;
      EXPECT_LE(frames[i], kMost[i]) << "fault " << i << " from frame " << first;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticDropoutSeeds, testing::Range<std::uint64_t>(1, 6));

TEST(SyntheticDropout, OrdinalsTimesAndPicturesAreThoseOfTheDelivery) {
  const synthetic::Scene scene = synthetic::make_dropout(1);
  SyntheticOptions options = small();
  options.frames = 160;
  const auto source = open_synthetic("dropout", options);
  EXPECT_TRUE(source->delivers());
  // Of each frame the right picture as it belongs to it; wrong ones are told by where they are from.
  std::map<std::uint64_t, std::uint64_t> right_hash;
  std::map<std::uint64_t, std::uint64_t> wrong_hash;
  std::uint64_t ordinal = 0;
  FramePair pair;
  for (std::uint64_t frame = 1; frame <= options.frames; ++frame) {
    const synthetic::Delivery d = scene.delivery(frame);
    if (!d.left && !d.right) continue;
    const Next next = source->next(pair);
    EXPECT_EQ(pair.ordinal, ++ordinal);
    EXPECT_NEAR(static_cast<double>(pair.capture_time.time_since_epoch().count()),
                static_cast<double>(frame - 1) * kPeriod_ns, 1.0);
    EXPECT_EQ(next == Next::kPair, d.left && d.right) << "frame " << frame;
    EXPECT_EQ(source->picture(0).empty(), !d.left);
    EXPECT_EQ(source->picture(1).empty(), !d.right);
    if (next == Next::kSkipped) {
      EXPECT_NE(source->skip_reason().find(d.left ? "right" : "left"), std::string::npos);
      EXPECT_TRUE(pair.left.empty() && pair.right.empty());
      continue;
    }
    ASSERT_TRUE(pair.skew.has_value());
    EXPECT_EQ(pair.skew->count(), d.skew_ns);
    const std::uint64_t hash = fnv1a(pair.right, 0);
    if (d.right_off == 0) {
      right_hash[frame] = hash;
    } else {
      wrong_hash[frame + static_cast<std::uint64_t>(static_cast<std::int64_t>(d.right_off))] = hash;
    }
  }
  EXPECT_EQ(source->next(pair), Next::kEnd);
  EXPECT_EQ(*source->info().pairs, ordinal);
  ASSERT_FALSE(wrong_hash.empty());
  int compared = 0;
  for (const auto& [frame, hash] : wrong_hash) {
    if (right_hash.count(frame) == 0) continue;
    EXPECT_EQ(hash, right_hash[frame]) << "frame " << frame;
    ++compared;
  }
  EXPECT_GT(compared, 0);
}

}  // namespace
}  // namespace stereotrack::capture
