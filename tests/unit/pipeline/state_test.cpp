// What one pipeline saved and another restores goes on to the byte: in each preset, format and way of matching, from
// many moments of a scene, into a new pipeline and into one that has seen something else meanwhile.
#include <gtest/gtest.h>

#include <cctype>
#include <string>
#include <vector>

#include "config/zones.hpp"
#include "pipeline/core/state_block.hpp"
#include "pipeline/pipeline.hpp"
#include "tests/support/moving_scene.hpp"
#include "tests/support/result_bytes.hpp"
#include "tests/support/scene_cases.hpp"

namespace stereotrack::test {
namespace {

struct StateCase {
  SceneCase scene;
  std::vector<std::string> set;  // keys beyond those of the case

  [[nodiscard]] std::string name() const {
    std::string name = scene.name();
    for (const std::string& key : set) {
      name += "_";
      for (const char c : key) name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
    }
    return name;
  }
};
void PrintTo(const StateCase& one, std::ostream* out) { *out << one.name(); }

std::vector<StateCase> state_cases() {
  std::vector<StateCase> cases;
  for (const SceneCase& scene : scene_cases()) cases.push_back({scene, {}});
  for (const SceneFormat* format : {&kSceneFormats[0], &kSceneFormats[1]}) {
    const SceneCase robust{"robust", format, SceneMatching::kRegions};
    cases.push_back({robust, {"equalise.mode=frozen"}});
    cases.push_back({robust, {"level_set.on=true", "shape.hole_px=4000"}});
    cases.push_back({robust, {"background.frames=3", "background.absorb_frames=20"}});
    cases.push_back({robust, {"objects.min_size_m=0.3", "objects.max_size_m=1"}});
    cases.push_back({{"robust", format, SceneMatching::kMono}, {"equalise.mode=frame"}});
    cases.push_back({{"thesis", format, SceneMatching::kRegions}, {"background.frames=500"}});
  }
  return cases;
}

PipelineConfig config_of(const StateCase& one) {
  std::vector<config::Layer> layers{
      config::override_layer(std::string("preset=") + one.scene.preset), config::override_layer("disparity.max=48"),
      config::override_layer(std::string("disparity.mode=") +
                             (one.scene.matching == SceneMatching::kDense ? "dense" : "regions"))};
  for (const std::string& key : one.set) layers.push_back(config::override_layer(key));
  return config::pipeline_of(config::load(layers).configuration, 1);
}

// The moments at which something begins or ends, in turn.
std::vector<int> moments() {
  std::vector<int> ordinals;
  constexpr int kParts[][2] = {{1, 8}, {38, 80}, {299, 304}, {359, 364}, {398, 440}, {698, 706}, {749, 770}};
  for (const auto& part : kParts) {
    for (int ordinal = part[0]; ordinal <= part[1]; ++ordinal) ordinals.push_back(ordinal);
  }
  return ordinals;
}

class ScenePipeline {
 public:
  explicit ScenePipeline(const StateCase& one) : stereo_(one.scene.stereo()), scene_(*one.scene.format) {
    Pipeline::Setup setup;
    setup.width = MovingScene::kWidth;
    setup.height = MovingScene::kHeight;
    setup.colour = one.scene.format->colour;
    setup.calibration = stereo_ ? &calibration_ : nullptr;
    const Result<Pipeline> made = Pipeline::create(config_of(one), setup, arena_);
    EXPECT_TRUE(made.has_value());
    if (made.has_value()) pipeline_.emplace(*made);
  }

  std::string step(int ordinal) {
    const bool right_is_gone = ordinal >= 410 && ordinal < 418;  // its camera was unplugged
    const Result<FrameResult> result = pipeline_->run(scene_.pair(ordinal, stereo_ && !right_is_gone));
    EXPECT_TRUE(result.has_value());
    if (!result.has_value()) return {};
    tracks_ += result->tracks.size();
    return ResultBytes::of(*result);
  }
  [[nodiscard]] std::vector<std::byte> save() const {
    std::vector<std::byte> block(pipeline_->state_bytes());
    const Result<std::size_t> bytes = pipeline_->save_state(block);
    EXPECT_TRUE(bytes.has_value());
    block.resize(bytes.has_value() ? *bytes : 0);
    return block;
  }
  [[nodiscard]] Pipeline& pipeline() { return *pipeline_; }
  [[nodiscard]] std::size_t tracks() const { return tracks_; }

 private:
  StereoCalibration calibration_ = MovingScene::calibration();
  bool stereo_;
  MovingScene scene_;
  Arena arena_;
  std::optional<Pipeline> pipeline_;
  std::size_t tracks_ = 0;
};

class PipelineState : public testing::TestWithParam<StateCase> {};

TEST_P(PipelineState, SavedAnywhereGoesOnToTheByteInANewPipelineAndInOneThatSawSomethingElse) {
  const std::vector<int> ordinals = moments();
  constexpr std::size_t kEvery = 9;   // frames between two saves
  constexpr std::size_t kAfter = 20;  // frames that are compared
  ScenePipeline whole(GetParam());
  ScenePipeline other(GetParam());
  std::vector<std::string> results;
  std::vector<std::vector<std::byte>> blocks;
  for (std::size_t i = 0; i < ordinals.size(); ++i) {
    if (i % kEvery == 0) blocks.push_back(whole.save());
    results.push_back(whole.step(ordinals[i]));
  }
  ASSERT_GT(whole.tracks(), 100U) << "nothing moved: the test says nothing";
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    ScenePipeline fresh(GetParam());
    ASSERT_TRUE(fresh.pipeline().restore_state(blocks[k]).has_value());
    // Something else: later boards on another wall, then earlier ones.
    for (const int ordinal : {771, 774, 777, 780, 430, 433, 436, 439, 442}) (void)other.step(ordinal);
    ASSERT_TRUE(other.pipeline().restore_state(blocks[k]).has_value());
    ASSERT_EQ(other.save(), blocks[k]);
    const std::size_t first = k * kEvery;
    for (std::size_t i = first; i < std::min(first + kAfter, ordinals.size()); ++i) {
      ASSERT_TRUE(fresh.step(ordinals[i]) == results[i]) << "saved before frame " << first << ", differs at " << i;
      ASSERT_TRUE(other.step(ordinals[i]) == results[i]) << "saved before frame " << first << ", differs at " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Everywhere, PipelineState, testing::ValuesIn(state_cases()),
                         [](const auto& one) { return one.param.name(); });

StateCase robust() { return {{"robust", kSceneFormats.data(), SceneMatching::kRegions}, {}}; }

TEST(PipelineStateBlock, IsOfTheSameRulesOnly) {
  StateCase sized = robust();
  sized.set = {"objects.max_size_m=1"};
  StateCase other = robust();
  other.set = {"objects.max_size_m=2"};
  ScenePipeline without(robust());
  ScenePipeline one(sized);
  ScenePipeline two(other);
  const std::vector<std::byte> block = one.save();
  EXPECT_TRUE(one.pipeline().restore_state(block).has_value());
  EXPECT_EQ(two.pipeline().restore_state(block).error(), Fault::kBadState);
  EXPECT_EQ(without.pipeline().restore_state(block).error(), Fault::kBadState);
  EXPECT_EQ(one.pipeline().restore_state(without.save()).error(), Fault::kBadState);
}

TEST(PipelineStateBlock, PartsJoinToTheWhole) {
  ScenePipeline run(robust());
  for (int ordinal = 401; ordinal < 420; ++ordinal) (void)run.step(ordinal);
  const std::vector<std::byte> block = run.save();
  EXPECT_LE(block.size(), run.pipeline().state_bytes());
  for (const std::size_t part : {4096U, 65536U, 1U << 24}) {
    std::vector<std::byte> joined(run.pipeline().state_bytes());
    std::size_t first = 0;
    for (;;) {
      const std::span<std::byte> room = std::span(joined).subspan(first, std::min(part, joined.size() - first));
      const std::size_t copied = run.pipeline().copy_state_part(first, room);
      first += copied;
      if (copied < part) break;
    }
    joined.resize(first);
    ASSERT_TRUE(seal_state(joined).has_value());
    EXPECT_TRUE(joined == block) << part;
  }
}

// A disc has more corners than a hull has room for, and each such hull is counted since create().
TEST(PipelineStateBlock, CountersGoOn) {
  constexpr int kSide = 320;
  std::vector<std::uint8_t> picture(std::size_t{kSide} * kSide);
  const auto frame = [&](int ordinal) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const int dx = x - 150 - ordinal;
        const int dy = y - 160;
        picture[static_cast<std::size_t>(y) * kSide + x] = ordinal > 4 && dx * dx + dy * dy < 120 * 120 ? 200 : 60;
      }
    }
    FramePair pair;
    pair.ordinal = static_cast<std::uint64_t>(ordinal);
    pair.capture_time = CaptureTime(std::chrono::milliseconds(33 * ordinal));
    pair.left = {picture.data(), kSide, kSide, kSide, PixelFormat::kGrey8};
    return pair;
  };
  const std::vector<config::Layer> layers{config::override_layer("level_set.on=true")};
  const PipelineConfig config = config::load(layers).configuration.pipeline;
  Arena arena;
  Pipeline::Setup setup;
  setup.width = setup.height = kSide;
  Result<Pipeline> one = Pipeline::create(config, setup, arena);
  Result<Pipeline> two = Pipeline::create(config, setup, arena);
  ASSERT_TRUE(one.has_value() && two.has_value());
  std::uint64_t reduced = 0;
  for (int ordinal = 1; ordinal <= 8; ++ordinal) {
    const Result<FrameResult> result = one->run(frame(ordinal));
    ASSERT_TRUE(result.has_value());
    reduced = result->hulls_reduced;
  }
  ASSERT_GE(reduced, 6U) << "of the level set's hulls and of the detector's";
  std::vector<std::byte> block(one->state_bytes());
  const Result<std::size_t> bytes = one->save_state(block);
  ASSERT_TRUE(bytes.has_value());
  ASSERT_TRUE(two->restore_state(std::span<const std::byte>(block).first(*bytes)).has_value());
  const Result<FrameResult> first = one->run(frame(9));
  const Result<FrameResult> second = two->run(frame(9));
  ASSERT_TRUE(first.has_value() && second.has_value());
  EXPECT_EQ(second->hulls_reduced, first->hulls_reduced);
}

TEST(PipelineStateBlock, NoRoomIsAFaultAndNothingIsWritten) {
  ScenePipeline run(robust());
  std::vector<std::byte> small(run.save().size() - 1, std::byte{9});
  const Result<std::size_t> bytes = run.pipeline().save_state(small);
  ASSERT_FALSE(bytes.has_value());
  EXPECT_EQ(bytes.error(), Fault::kBadSize);
  EXPECT_EQ(small, std::vector<std::byte>(small.size(), std::byte{9}));
}

TEST(PipelineStateBlock, AnotherConfigurationOrADamagedBlockIsRefusedAndTheStateKept) {
  ScenePipeline run(robust());
  for (int ordinal = 401; ordinal < 420; ++ordinal) (void)run.step(ordinal);
  const std::vector<std::byte> mine = run.save();
  for (const StateCase& one : {StateCase{{"thesis", kSceneFormats.data(), SceneMatching::kRegions}, {}},
                               StateCase{{"robust", &kSceneFormats[1], SceneMatching::kRegions}, {}},
                               StateCase{{"robust", kSceneFormats.data(), SceneMatching::kMono}, {}}}) {
    const Result<void> outcome = run.pipeline().restore_state(ScenePipeline(one).save());
    ASSERT_FALSE(outcome.has_value()) << one.name();
    EXPECT_EQ(outcome.error(), Fault::kBadState);
  }
  for (const std::size_t at : {std::size_t{0}, std::size_t{8}, std::size_t{100}, mine.size() - 1}) {
    std::vector<std::byte> damaged = ScenePipeline(robust()).save();
    damaged[std::min(at, damaged.size() - 1)] ^= std::byte{1};
    EXPECT_FALSE(run.pipeline().restore_state(damaged).has_value()) << at;
  }
  EXPECT_FALSE(run.pipeline().restore_state({}).has_value());
  EXPECT_TRUE(run.save() == mine);
}

}  // namespace
}  // namespace stereotrack::test
