#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "drivers/capture/synthetic/scenes/flicker.hpp"
#include "drivers/capture/synthetic/synthetic_source.hpp"
#include "tests/unit/synthetic/scene_support.hpp"

namespace stereotrack::capture {
namespace {

// These bytes are the same on every machine; they change only when the drawing does.
TEST(SyntheticFlicker, BytesAreThoseOfEveryOtherMachine) {
  EXPECT_EQ(hash_at("flicker", small(), 1), 0xd74152753f94285ULL);
  EXPECT_EQ(hash_at("flicker", small(), 400), 0xd8528105e157d237ULL);
}

/// Mean levels of eight bands of the picture, as light: where nobody is.
std::vector<double> bands(const Picture& p) {
  std::vector<double> light(8, 0.0);
  for (int band = 0; band < 8; ++band) {
    double sum = 0;
    for (int y = 15 * band; y < 15 * (band + 1); ++y) {
      for (int x = 0; x < p.width; ++x) sum += luma(p, x, y);
    }
    light[static_cast<std::size_t>(band)] = std::pow(sum / (15.0 * p.width), 64.0 / 29.0);
  }
  return light;
}

class SyntheticFlickerSeeds : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SyntheticFlickerSeeds, LightPulsesWithTheBeatAtOnceOrInBands) {
  SyntheticOptions options = small(GetParam());
  options.truth = false;
  options.frames = 3600;
  struct Case {
    std::uint64_t first;
    bool pulses;
    bool rolls;
  };
  for (const Case& c : {Case{33, false, false}, Case{1095, true, false}, Case{2580, true, true}}) {
    const auto source = open_synthetic("flicker", options);
    source->skip_to(c.first - 1);
    FramePair pair;
    std::vector<std::vector<double>> light;
    for (int i = 0; i < 12; ++i) {
      ASSERT_EQ(source->next(pair), Next::kPair);
      light.push_back(bands(pair.left));
    }
    // Peak to peak over the mean: of a band in time, and of one frame's bands, each over its own mean.
    double in_time = 0;
    double between_bands = 0;
    std::vector<double> mean(8, 0.0);
    for (std::size_t b = 0; b < 8; ++b) {
      double low = 1e18;
      double high = 0;
      for (const auto& frame : light) {
        low = std::min(low, frame[b]);
        high = std::max(high, frame[b]);
        mean[b] += frame[b] / 12.0;
      }
      in_time = std::max(in_time, (high - low) / mean[b]);
    }
    for (const auto& frame : light) {
      double low = 1e18;
      double high = 0;
      for (std::size_t b = 0; b < 8; ++b) {
        low = std::min(low, frame[b] / mean[b]);
        high = std::max(high, frame[b] / mean[b]);
      }
      between_bands = std::max(between_bands, high - low);
    }
    if (c.pulses) {
      EXPECT_GT(in_time, 0.18) << "frame " << c.first;
      EXPECT_LT(in_time, 0.33) << "frame " << c.first;
    } else {
      EXPECT_LT(in_time, 0.06) << "frame " << c.first;
    }
    if (c.rolls) {
      EXPECT_GT(between_bands, 0.15) << "frame " << c.first;
    } else {
      EXPECT_LT(between_bands, 0.08) << "frame " << c.first;
    }
  }
}

TEST_P(SyntheticFlickerSeeds, LightStepsAndFewPass) {
  const synthetic::Scene scene = synthetic::make_flicker(GetParam());
  int steps = 0;
  int switches = 0;
  int busy = 0;
  std::vector<synthetic::Actor> cast;
  synthetic::PosedActor posed;
  const synthetic::PinholeCamera camera = scene.rig.camera(0, 640, 480);
  for (int frame = 1; frame < 3600; ++frame) {
    const double t = frame / 30.0;
    const synthetic::Moment before = scene.moment((frame - 1) / 30.0);
    const synthetic::Moment now = scene.moment(t);
    if (now.exposure != before.exposure) {
      ++steps;
      const double factor = now.exposure / before.exposure;
      EXPECT_TRUE((factor >= 0.75 && factor <= 0.85) || (factor >= 1 / 0.85 && factor <= 1 / 0.75)) << factor;
    }
    switches += now.lamp != before.lamp ? 1 : 0;
    if (frame % 30 != 0) continue;
    cast = scene.cast(static_cast<std::uint32_t>((t + scene.prelude_s) / scene.act_s));
    EXPECT_GE(cast.size(), 2U);
    EXPECT_LE(cast.size(), 3U);
    bool anybody = false;
    for (const synthetic::Actor& actor : cast) {
      if (!pose(actor, t, posed)) continue;
      anybody =
          anybody || !intersect(synthetic::screen_box(camera, posed.center, posed.radius), {0, 0, 640, 480}).empty();
    }
    busy += anybody ? 1 : 0;
  }
  EXPECT_EQ(steps, 8);
  EXPECT_EQ(switches, 6);
  EXPECT_GE(busy, 12);
  EXPECT_LE(busy, 60);
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyntheticFlickerSeeds, testing::Range<std::uint64_t>(1, 6));

}  // namespace
}  // namespace stereotrack::capture
