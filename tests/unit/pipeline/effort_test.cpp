#include "pipeline/effort.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <vector>

#include "config/load.hpp"
#include "pipeline/pipeline.hpp"
#include "tests/support/moving_scene.hpp"

namespace stereotrack {
namespace {

constexpr int kFrames = 140;

// What a frame said, as far as it can be compared.
struct Said {
  std::vector<std::uint8_t> mask;
  std::vector<std::int64_t> numbers;
  bool operator==(const Said&) const = default;
};

Said said_by(const FrameResult& result) {
  Said said;
  for (int y = 0; y < result.mask.height; ++y) {
    said.mask.insert(said.mask.end(), result.mask.row(y), result.mask.row(y) + result.mask.width);
  }
  for (const TrackReport& track : result.tracks) {
    for (const double value : {static_cast<double>(track.id), track.image_x, track.image_y, track.position.x(),
                               track.position.y(), track.position.z(), track.velocity.z(), track.confidence}) {
      said.numbers.push_back(std::bit_cast<std::int64_t>(value));
    }
  }
  for (const std::uint32_t rejected : result.rejections) said.numbers.push_back(rejected);
  return said;
}

PipelineConfig preset(const char* name) {
  const std::vector<config::Layer> layers{config::override_layer(std::string("preset=") + name)};
  return config::load(layers).configuration.pipeline;
}

// `shed` says what each frame leaves out.
std::vector<Said> run(const PipelineConfig& config, const std::function<EffortBits(int)>& shed, int frames = kFrames) {
  test::MovingScene scene(test::kSceneFormats[0]);
  const StereoCalibration calibration = test::MovingScene::calibration();
  Arena arena;
  Result<Pipeline> pipeline = Pipeline::create(config,
                                               {.width = test::MovingScene::kWidth,
                                                .height = test::MovingScene::kHeight,
                                                .colour = true,
                                                .calibration = &calibration,
                                                .observer = {}},
                                               arena);
  std::vector<Said> out;
  for (int i = 1; i <= frames; ++i) {
    const Result<FrameResult> result = pipeline->run(scene.pair(i, true), shed(i));
    EXPECT_TRUE(result.has_value());
    EXPECT_EQ(result->left_out, shed(i));
    out.push_back(said_by(*result));
  }
  return out;
}

std::function<EffortBits(int)> always(EffortBits bits) {
  return [bits](int) { return bits; };
}

bool tracked_something(const std::vector<Said>& frames) {
  return std::any_of(frames.begin(), frames.end(), [](const Said& said) { return said.numbers.size() > kRejections; });
}

TEST(Effort, WithoutTheDenseMapAFrameIsThatOfRegions) {
  PipelineConfig dense = preset("robust");
  dense.disparity.mode = DisparityMode::kDense;
  dense.disparity.max = 32;
  PipelineConfig regions = dense;
  regions.disparity.mode = DisparityMode::kRegions;
  const auto shed = run(dense, always(bit_of(Effort::kDenseMap)));
  EXPECT_TRUE(tracked_something(shed));
  EXPECT_EQ(shed, run(regions, always(0)));
  EXPECT_NE(shed, run(dense, always(0)));
}

TEST(Effort, WithoutTheLevelSetAFrameIsThatOfAConfigurationWithoutIt) {
  PipelineConfig with = preset("thesis");
  with.shadow.method = ShadowMethod::kOff;  // the test of chroma leaves little of these boards
  PipelineConfig without = with;
  without.shape.level_set = false;
  const auto shed = run(with, always(bit_of(Effort::kLevelSet)));
  EXPECT_TRUE(tracked_something(shed));
  EXPECT_EQ(shed, run(without, always(0)));
  EXPECT_NE(shed, run(with, always(0)));
}

TEST(Effort, WithoutCornersTargetsMoveByTheirBoxesAlone) {
  const PipelineConfig with = preset("robust");
  PipelineConfig without = with;
  without.features.corner_quality = 1'000'000;  // no corner is so strong
  const auto shed = run(with, always(bit_of(Effort::kCorners)));
  EXPECT_TRUE(tracked_something(shed));
  EXPECT_EQ(shed, run(without, always(0)));
}

// Corners of before the pause must not be searched where they were then: they are dropped with the first frame of it.
TEST(Effort, CornersThatWereLeftOutForAWhileAreFoundAnew) {
  const PipelineConfig config = preset("robust");
  const auto pause = run(config, [](int i) { return i > 60 && i <= 70 ? bit_of(Effort::kCorners) : EffortBits{0}; });
  EXPECT_TRUE(tracked_something(pause));
  const auto whole = run(config, always(0));
  // The board is followed by one and the same target, with pause and without.
  ASSERT_GT(pause.back().numbers.size(), kRejections);
  EXPECT_EQ(pause.back().numbers.front(), whole.back().numbers.front());
}

TEST(Effort, WithoutTheBackgroundsDisparityItsAgeIsAllThatChanges) {
  const PipelineConfig config = preset("robust");
  const EffortBits bit = bit_of(Effort::kBackgroundDisparity);
  const auto whole = run(config, always(0));
  // Once it is known it can rest: nothing moves before frame 41, and the wall stays as it is.
  EXPECT_EQ(run(config, [bit](int i) { return i > 40 ? bit : EffortBits{0}; }), whole);
  // Never known, the boards are found all the same, but what comes after the light has changed (701) is told otherwise.
  constexpr int kUntilTheLightHasChanged = 900;
  const auto never = run(config, always(bit), kUntilTheLightHasChanged);
  EXPECT_TRUE(tracked_something(never));
  EXPECT_NE(never, run(config, always(0), kUntilTheLightHasChanged));
}

TEST(Effort, EachHasItsBitAndItsName) {
  EffortBits seen = 0;
  for (std::size_t i = 0; i < kEfforts; ++i) {
    const auto effort = static_cast<Effort>(i);
    EXPECT_EQ(seen & bit_of(effort), 0);
    EXPECT_TRUE(leaves_out(bit_of(effort), effort));
    EXPECT_FALSE(leaves_out(static_cast<EffortBits>(~bit_of(effort)), effort));
    EXPECT_NE(to_string(effort)[0], '\0');
    seen = static_cast<EffortBits>(seen | bit_of(effort));
  }
}

}  // namespace
}  // namespace stereotrack
