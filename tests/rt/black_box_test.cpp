// What the black box does in the frame loop and in the publisher makes no heap call.
#include "drivers/record/black_box.hpp"

#include <gtest/gtest.h>

#include "tests/rt/heap_watch.hpp"
#include "tests/support/moving_scene.hpp"
#include "tests/support/scene_cases.hpp"
#include "tests/support/temp_dir.hpp"

namespace stereotrack::record {
namespace {

std::uint64_t heap_calls_of_a_run(int reduce) {
  const test::SceneCase one{"robust", test::kSceneFormats.data(), test::SceneMatching::kRegions};
  const test::TempDir folder;
  test::MovingScene scene(*one.format);
  const StereoCalibration calibration = test::MovingScene::calibration();
  Pipeline::Setup setup;
  setup.width = test::MovingScene::kWidth;
  setup.height = test::MovingScene::kHeight;
  setup.colour = one.format->colour;
  setup.calibration = &calibration;
  Arena arena;
  Result<Pipeline> pipeline = Pipeline::create(test::scene_config(one), setup, arena);
  EXPECT_TRUE(pipeline.has_value());
  BlackBox::Config config;
  config.seconds = 1;
  config.seconds_after = 0.3;
  config.reduce = reduce;
  config.directory = folder.path();
  config.max_bytes = 1U << 30U;
  config.spare_bytes = 0;
  BlackBox::Run run;
  run.about.width = setup.width;
  run.about.height = setup.height;
  run.about.format = one.format->format;
  run.about.period_ns = 33'333'333;
  run.calibration = calibration;
  BlackBox box(config, run, *pipeline);
  std::uint64_t calls = 0;
  for (int ordinal = 1; ordinal <= 500; ++ordinal) {
    FramePair pair = scene.pair(ordinal, true);
    {
      const test::HeapWatch watch;
      box.arm(pair);
      const Result<FrameResult> result = pipeline->run(pair);
      box.capture(pair, *result, {});
      while (box.keyframe_step(*pipeline)) {
      }
      OutputNote note;
      note.ordinal = note.state_ordinal = pair.ordinal;
      box.note(note);
      if (ordinal % 100 == 50) box.trigger(kDeadlineMiss);
      if (ordinal % 100 == 70) box.no_frame();
      calls += watch.calls();
    }
    while (ordinal % 3 == 0 && box.service_step()) {
    }
  }
  EXPECT_EQ(box.counters().recordings, 5U) << box.last_error();
  return calls;
}

TEST(BlackBoxRealTime, FrameLoopAndPublisherMakeNoHeapCall) {
  EXPECT_EQ(heap_calls_of_a_run(1), 0U);
  EXPECT_EQ(heap_calls_of_a_run(2), 0U);
}

}  // namespace
}  // namespace stereotrack::record
