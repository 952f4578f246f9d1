// The frame loop takes nothing from the heap and gives nothing back: a thousand frames of each preset, kind of source
// format and way of matching, with every stage at work. And the proof that it would show here if it did.
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <memory>
#include <stdexcept>

#include "config/zones.hpp"
#include "pipeline/core/arena.hpp"
#include "pipeline/pipeline.hpp"
#include "tests/rt/heap_watch.hpp"
#include "tests/support/moving_scene.hpp"
#include "tests/support/scene_cases.hpp"

namespace stereotrack::test {
namespace {

// Frames until first pages are touched; heap and pages of the process are compared from then on.
constexpr int kWarmUp = 100;
// A stack or a table of the C library that grows by a few pages is no leak; a leak of a byte a frame is found by heap.
constexpr std::size_t kFewPages = 64 << 10;

// What a run gave, and what it took.
struct Outcome {
  int frames = 0;
  int first_with_heap_calls = 0;  ///< ordinal; 0 = none
  std::uint64_t heap_calls = 0;
  std::array<int, kStages> ended{};
  std::uint64_t detections = 0;
  std::uint64_t reports = 0;
  std::uint64_t reports_with_depth = 0;
  std::uint64_t mask_px = 0;
  std::uint64_t mask_sum = 0;  ///< differs where masks differ
  std::uint32_t flags = 0;
};

class Loop {
 public:
  explicit Loop(const SceneCase& one, const PipelineConfig& config)
      : case_(one), calibration_(MovingScene::calibration()) {
    Pipeline::Setup setup;
    setup.width = MovingScene::kWidth;
    setup.height = MovingScene::kHeight;
    setup.colour = one.format->colour;
    setup.calibration = one.stereo() ? &calibration_ : nullptr;
    setup.observer = {&Loop::ended, this};
    const Result<Pipeline> made = Pipeline::create(config, setup, arena_);
    if (!made.has_value()) throw std::runtime_error(to_string(made.error()));
    pipeline_ = std::make_unique<Pipeline>(*made);
    arena_.seal();
  }

  // Called in the loop at the end of each stage, in addition.
  void (*disturb)(int frame, Stage stage) = nullptr;

  [[nodiscard]] const Arena& arena() const { return arena_; }
  [[nodiscard]] const Pipeline& pipeline() const { return *pipeline_; }

  void run(int frames) {
    for (int i = 0; i < frames; ++i) {
      const FramePair pair = scene_.pair(++outcome.frames, case_.stereo());
      const HeapWatch watch;
      const Result<FrameResult> result = pipeline_->run(pair);
      const std::uint64_t calls = watch.calls();
      if (calls > 0 && outcome.first_with_heap_calls == 0) outcome.first_with_heap_calls = outcome.frames;
      outcome.heap_calls += calls;
      ASSERT_TRUE(result.has_value()) << to_string(result.error());
      count(*result);
    }
  }

  Outcome outcome;

 private:
  static void ended(void* context, Stage stage) noexcept {
    auto& self = *static_cast<Loop*>(context);
    ++self.outcome.ended[static_cast<std::size_t>(stage)];
    if (self.disturb != nullptr) self.disturb(self.outcome.frames, stage);
  }

  void count(const FrameResult& result) {
    outcome.flags |= result.flags;
    outcome.detections += result.detections.size();
    outcome.reports += result.tracks.size();
    for (const TrackReport& track : result.tracks) outcome.reports_with_depth += track.has_depth ? 1 : 0;
    for (int y = 0; y < result.mask.height; ++y) {
      for (int x = 0; x < result.mask.width; ++x) {
        const bool set = result.mask.row(y)[x] != 0;
        outcome.mask_px += set ? 1 : 0;
        outcome.mask_sum = outcome.mask_sum * 31 + (set ? 2 : 1);
      }
    }
  }

  const SceneCase& case_;
  StereoCalibration calibration_;
  MovingScene scene_{*case_.format};
  Arena arena_;
  std::unique_ptr<Pipeline> pipeline_;
};

class FrameLoop : public testing::TestWithParam<SceneCase> {};

TEST_P(FrameLoop, ThousandFramesWithoutHeapCallAndWithFlatMemory) {
  ASSERT_TRUE(allocations_are_counted()) << "not to be built with a sanitizer";
  Loop loop(GetParam(), scene_config(GetParam()));
  const std::size_t arena_bytes = loop.arena().bytes_used();
  const MemoryUse planned = loop.pipeline().memory();
  loop.run(kWarmUp);
  const ProcessMemory before = ProcessMemory::now();
  loop.run(MovingScene::kFrames - kWarmUp);
  const ProcessMemory after = ProcessMemory::now();

  const Outcome& outcome = loop.outcome;
  ASSERT_EQ(outcome.frames, MovingScene::kFrames);
  EXPECT_EQ(outcome.heap_calls, 0U) << "first in frame " << outcome.first_with_heap_calls;
  EXPECT_EQ(after.heap, before.heap);
  EXPECT_LE(after.anonymous, before.anonymous + kFewPages);

  EXPECT_FALSE(loop.arena().failed()) << "a stage asked for memory in the loop";
  EXPECT_EQ(loop.arena().bytes_used(), arena_bytes);
  EXPECT_EQ(planned.total(), arena_bytes);
  for (std::size_t i = 0; i < kMemoryParts; ++i) {
    const auto part = static_cast<MemoryPart>(i);
    EXPECT_EQ(loop.pipeline().memory().bytes(part), planned.bytes(part)) << to_string(part);
  }

  // All of it ran. Boards are seen in two thirds of the frames, by two thirds of the time more than one.
  for (std::size_t i = 0; i < kStages; ++i) {
    EXPECT_EQ(outcome.ended[i], MovingScene::kFrames) << to_string(static_cast<Stage>(i));
  }
  EXPECT_GT(outcome.detections, 500U);
  EXPECT_GT(outcome.reports, 500U);
  EXPECT_GT(outcome.mask_px, 500U * 300U);
  if (GetParam().stereo()) {
    EXPECT_GT(outcome.reports_with_depth, 250U);
  }
  EXPECT_EQ((outcome.flags & kFlagMono) != 0, !GetParam().stereo());
  EXPECT_EQ((outcome.flags & kFlagNoColour) != 0, !GetParam().format->colour);
  EXPECT_EQ((outcome.flags & kFlagLightChange) != 0, GetParam().is_robust());
  EXPECT_EQ(loop.pipeline().memory().bytes(MemoryPart::kLevelSet) > 0, !GetParam().is_robust());
}

INSTANTIATE_TEST_SUITE_P(Cases, FrameLoop, testing::ValuesIn(scene_cases()),
                         [](const auto& instance) { return instance.param.name(); });

// The thousand frames of the thesis preset do go through the level set: without it they look different.
TEST(FrameLoopStages, LevelSetWorksOnTheSceneInTheThesisPreset) {
  const SceneCase one{"thesis", &kSceneFormats[0], SceneMatching::kRegions};
  PipelineConfig config = scene_config(one);
  ASSERT_TRUE(config.shape.level_set);
  Loop with(one, config);
  config.shape.level_set = false;
  Loop without(one, config);
  with.run(kWarmUp);
  without.run(kWarmUp);
  ASSERT_GT(with.outcome.mask_px, 0U);
  EXPECT_NE(with.outcome.mask_sum, without.outcome.mask_sum);
}

// With rules about places and sizes at work, too: boards pass through each of them.
TEST(FrameLoopStages, RulesAboutZonesTakeNothingFromTheHeap) {
  const SceneCase one{"robust", &kSceneFormats[0], SceneMatching::kRegions};
  config::Configuration said =
      config::load(std::vector{config::override_layer("disparity.max=48"), config::text_layer("rig.toml", R"(
[objects]
volume = "hall"
min_size_m = 0.1
max_size_m = 0.8
[[zone]]
name = "hall"
z_m = [1, 3]
[[zone]]
name = "pole"
picture = [[60, -1], [75, -1], [80, 200], [55, 200]]
targets = "ignore"
[[zone]]
name = "door"
picture = [[-1, -1], [40, -1], [40, 200], [-1, 200]]
targets = "none_begin"
)")})
          .configuration;
  Loop with(one, config::pipeline_of(said, 1));
  said.zones.clear();
  said.objects.volume.clear();
  said.pipeline.zones = {};
  Loop without(one, config::pipeline_of(said, 1));
  with.run(500);
  without.run(500);
  EXPECT_EQ(with.outcome.heap_calls, 0U);
  EXPECT_EQ(with.pipeline().memory().total(), with.arena().bytes_used());
  EXPECT_GT(with.arena().bytes_used(), without.arena().bytes_used()) << "a mask";
  EXPECT_GT(with.outcome.detections, 100U);
  EXPECT_LT(with.outcome.detections, without.outcome.detections);
}

// The guard stands around the whole of Pipeline::run: what is done in the midst of it, in one frame, is found there.
class FrameLoopGuard : public testing::Test {
 protected:
  static constexpr int kFrame = 57;
  static Outcome disturbed(void (*disturb)(int frame, Stage stage)) {
    const SceneCase one{"robust", &kSceneFormats[0], SceneMatching::kRegions};
    Loop loop(one, scene_config(one));
    loop.disturb = disturb;
    loop.run(kFrame + 3);
    return loop.outcome;
  }
};

TEST_F(FrameLoopGuard, UndisturbedLoopPasses) {
  const Outcome outcome = disturbed([](int, Stage) {});
  EXPECT_EQ(outcome.heap_calls, 0U);
  EXPECT_EQ(outcome.first_with_heap_calls, 0);
}

TEST_F(FrameLoopGuard, AllocationInOneStageOfOneFrameIsFound) {
  static void* kept = nullptr;
  const Outcome outcome = disturbed([](int frame, Stage stage) {
    if (frame == kFrame && stage == Stage::kObjects) kept = std::malloc(1);
  });
  std::free(kept);
  EXPECT_EQ(outcome.heap_calls, 1U);
  EXPECT_EQ(outcome.first_with_heap_calls, kFrame);
}

TEST_F(FrameLoopGuard, FreeInOneStageOfOneFrameIsFound) {
  static void* kept = nullptr;
  kept = std::malloc(1);
  const Outcome outcome = disturbed([](int frame, Stage stage) {
    if (frame == kFrame && stage == Stage::kIngest) std::free(kept);
  });
  EXPECT_EQ(outcome.heap_calls, 1U);
  EXPECT_EQ(outcome.first_with_heap_calls, kFrame);
}

TEST_F(FrameLoopGuard, ArenaThatIsAskedAgainIsFound) {
  static Arena* arena = nullptr;
  const SceneCase one{"robust", &kSceneFormats[0], SceneMatching::kMono};
  Loop loop(one, scene_config(one));
  arena = const_cast<Arena*>(&loop.arena());
  loop.disturb = [](int frame, Stage stage) {
    if (frame == 2 && stage == Stage::kObjects) (void)arena->array<int>(1);
  };
  loop.run(1);
  EXPECT_FALSE(loop.arena().failed());
  loop.run(1);
  EXPECT_TRUE(loop.arena().failed());
}

}  // namespace
}  // namespace stereotrack::test
