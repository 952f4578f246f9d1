#include "drivers/record/black_box.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <thread>
#include <vector>

#include "drivers/record/recording_source.hpp"
#include "tests/support/moving_scene.hpp"
#include "tests/support/result_bytes.hpp"
#include "tests/support/scene_cases.hpp"
#include "tests/support/temp_dir.hpp"

namespace stereotrack::record {
namespace {

namespace fs = std::filesystem;
using test::MovingScene;
using test::ResultBytes;
using test::SceneCase;
using test::TempDir;

constexpr double kFramesASecond = 1e9 / 33'333'333;

/// A pipeline with a black box beside it, as the daemon's frame loop runs them.
class Rig {
 public:
  Rig(const SceneCase& one, const fs::path& folder, BlackBox::Config config = {}) : case_(one), scene_(*one.format) {
    Pipeline::Setup setup;
    setup.width = MovingScene::kWidth;
    setup.height = MovingScene::kHeight;
    setup.colour = one.format->colour;
    setup.calibration = one.stereo() ? &calibration_ : nullptr;
    const Result<Pipeline> made = Pipeline::create(test::scene_config(one), setup, arena_);
    EXPECT_TRUE(made.has_value());
    pipeline_.emplace(*made);
    if (config.seconds == BlackBox::Config().seconds) config.seconds = 20 / kFramesASecond;
    if (config.seconds_after == BlackBox::Config().seconds_after) config.seconds_after = 5 / kFramesASecond;
    config.directory = folder;
    if (config.max_bytes == 0) config.max_bytes = 1U << 30U;
    config.spare_bytes = 0;
    BlackBox::Run run;
    run.about.source = "scene";
    run.about.width = setup.width;
    run.about.height = setup.height;
    run.about.format = one.format->format;
    run.about.stereo = one.stereo();
    run.about.period_ns = 33'333'333;
    run.about.session = 0xABC;
    if (one.stereo()) run.calibration = calibration_;
    run.configuration = "preset = \"" + std::string(one.preset) + "\"\n";
    box_ = std::make_unique<BlackBox>(config, run, *pipeline_);
  }

  /// One frame, and the time after it: none, or as much as a keyframe takes.
  void step(int ordinal, bool idle = true) {
    FramePair pair = scene_.pair(ordinal, case_.stereo());
    box_->arm(pair);
    const Result<FrameResult> result = pipeline_->run(pair);
    ASSERT_TRUE(result.has_value());
    box_->capture(pair, *result, {.shed = static_cast<std::uint8_t>(ordinal % 7)});
    results_[pair.ordinal] = ResultBytes::of(*result);
    while (idle && box_->keyframe_step(*pipeline_)) {
    }
  }
  /// One frame that is run and finds no room.
  void step_without_slot(int ordinal) {
    const FramePair pair = scene_.pair(ordinal, case_.stereo());
    const Result<FrameResult> result = pipeline_->run(pair);
    ASSERT_TRUE(result.has_value());
    box_->capture(pair, *result, {});
  }
  void serve() {
    while (box_->service_step()) {
    }
  }

  /// Replays a recording and compares each frame with the run's. How many there were.
  int replay(const std::string& path) {
    RecordingSource source(path);
    EXPECT_EQ(source.warning(), "");
    EXPECT_TRUE(source.about().exact);
    Pipeline::Setup setup;
    setup.width = source.info().width;
    setup.height = source.info().height;
    setup.colour = has_colour(source.info().format);
    setup.calibration = source.info().stereo ? &*source.calibration() : nullptr;
    Arena arena;
    Result<Pipeline> pipeline = Pipeline::create(test::scene_config(case_), setup, arena);
    EXPECT_TRUE(pipeline.has_value() && pipeline->restore_state(source.keyframe()).has_value());
    int frames = 0;
    for (FramePair pair; source.next(pair) == capture::Next::kPair; ++frames) {
      const Result<FrameResult> result = pipeline->run(pair);
      EXPECT_TRUE(result.has_value() && ResultBytes::of(*result) == results_[pair.ordinal]) << "frame " << pair.ordinal;
      EXPECT_EQ(source.decisions().shed, pair.ordinal % 7);
      EXPECT_EQ(source.track_notes().size(), std::min(result->tracks.size(), kMostTrackNotes));
    }
    return frames;
  }

  [[nodiscard]] BlackBox& box() { return *box_; }
  [[nodiscard]] const BlackBox::Counters& counters() const { return box_->counters(); }
  [[nodiscard]] Pipeline& pipeline() { return *pipeline_; }

 private:
  SceneCase case_;
  StereoCalibration calibration_ = MovingScene::calibration();
  MovingScene scene_;
  Arena arena_;
  std::optional<Pipeline> pipeline_;
  std::unique_ptr<BlackBox> box_;
  std::map<std::uint64_t, std::string> results_;
};

std::vector<fs::path> recordings_in(const fs::path& folder) {
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(folder)) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  return paths;
}

SceneCase robust() { return {"robust", test::kSceneFormats.data(), test::SceneMatching::kRegions}; }

class BlackBoxRun : public testing::TestWithParam<SceneCase> {};

TEST_P(BlackBoxRun, ReplayOfItsRecordingGivesTheRunsBytes) {
  const TempDir folder;
  Rig rig(GetParam(), folder.path());
  for (int ordinal = 401; ordinal <= 450; ++ordinal) {
    rig.step(ordinal);
    if (ordinal == 440) rig.box().trigger(kDeadlineMiss);
  }
  rig.serve();
  EXPECT_EQ(rig.counters().recordings, 1U) << rig.box().last_error();
  const std::vector<fs::path> paths = recordings_in(folder.path());
  ASSERT_EQ(paths.size(), 1U);
  EXPECT_EQ(paths[0].filename().string(), "stereotrack-0000000000000abc-0000000446-deadline.strec");
  EXPECT_EQ(paths[0].string(), rig.box().last_recording());
  const int frames = rig.replay(paths[0].string());
  EXPECT_GE(frames, 10 + 5) << "half the seconds before, and those after";
  EXPECT_LE(frames, 20 + 6);
}

INSTANTIATE_TEST_SUITE_P(Everywhere, BlackBoxRun, testing::ValuesIn(test::scene_cases(true)),
                         [](const auto& one) { return one.param.name(); });

TEST(BlackBox, WithoutTriggerNothingIsWritten) {
  const TempDir folder;
  Rig rig(robust(), folder.path());
  for (int ordinal = 1; ordinal <= 60; ++ordinal) rig.step(ordinal);
  rig.serve();
  EXPECT_TRUE(fs::is_empty(folder.path()));
  EXPECT_EQ(rig.counters().frames, 60U);
}

TEST(BlackBox, TriggerRightAtTheStartRecordsWhatThereIs) {
  const TempDir folder;
  Rig rig(robust(), folder.path());
  while (rig.box().keyframe_step(rig.pipeline())) {
  }
  rig.box().trigger(kDemand);
  for (int ordinal = 1; ordinal <= 8; ++ordinal) rig.step(ordinal);
  rig.serve();
  EXPECT_EQ(rig.replay(rig.box().last_recording()), 6);
}

TEST(BlackBox, TriggersInTheSecondsAfterOneAreMerged) {
  const TempDir folder;
  Rig rig(robust(), folder.path());
  for (int ordinal = 1; ordinal <= 40; ++ordinal) {
    rig.step(ordinal);
    if (ordinal == 30) rig.box().trigger(kTargetInZone);
    if (ordinal == 32) rig.box().trigger(kSignal);
  }
  rig.serve();
  EXPECT_EQ(rig.counters().triggers, 1U);
  EXPECT_EQ(rig.counters().merged, 1U);
  EXPECT_NE(rig.box().last_recording().find("-zone-signal.strec"), std::string::npos);
}

TEST(BlackBox, SlowDiskCostsFramesAndTriggersOfTheNextRecordingWhichIsExactAgain) {
  const TempDir folder;
  Rig rig(robust(), folder.path());
  int ordinal = 1;
  const auto run_to = [&](int last) {
    for (; ordinal <= last; ++ordinal) rig.step(ordinal);
  };
  run_to(40);
  rig.box().trigger(kDeadlineMiss);
  run_to(60);
  rig.box().trigger(kDeadlineMiss);  // nobody has served the first
  run_to(100);
  EXPECT_EQ(rig.counters().triggers, 1U);
  EXPECT_EQ(rig.counters().triggers_dropped, 1U);
  EXPECT_GT(rig.counters().frames_dropped, 20U);
  rig.serve();
  const std::string first = rig.box().last_recording();
  EXPECT_GE(rig.replay(first), 15);
  run_to(140);
  rig.box().trigger(kGpioInput);
  run_to(150);
  rig.serve();
  EXPECT_NE(rig.box().last_recording(), first);
  EXPECT_GE(rig.replay(rig.box().last_recording()), 15);
}

TEST(BlackBox, LongSecondsAfterDoNotCostTheSecondsBefore) {
  const TempDir folder;
  BlackBox::Config config;
  config.seconds = 20 / kFramesASecond;
  config.seconds_after = 60 / kFramesASecond;
  Rig rig(robust(), folder.path(), config);
  for (int ordinal = 1; ordinal <= 110; ++ordinal) {
    rig.step(ordinal);
    if (ordinal == 45) rig.box().trigger(kDeadlineMiss);
  }
  rig.serve();
  EXPECT_GE(rig.replay(rig.box().last_recording()), 10 + 60);
}

// What the first recording gave back belongs to the second, too, as long as it is in memory.
TEST(BlackBox, RecordingsThatOverlapAreBothExact) {
  const TempDir folder;
  Rig rig(robust(), folder.path());
  int ordinal = 1;
  const auto run_to = [&](int last) {
    for (; ordinal <= last; ++ordinal) rig.step(ordinal);
  };
  run_to(40);
  rig.box().trigger(kDeadlineMiss);
  run_to(50);
  rig.serve();
  const std::string first = rig.box().last_recording();
  rig.box().trigger(kDeadlineMiss);
  run_to(80);  // long after it was frozen
  rig.serve();
  EXPECT_EQ(rig.counters().recordings, 2U);
  EXPECT_GE(rig.replay(first), 15);
  EXPECT_GE(rig.replay(rig.box().last_recording()), 15);
}

// Each frame is given back once it is written: the next recording fills up meanwhile.
TEST(BlackBox, FramesAreKeptAgainWhileARecordingIsStillWritten) {
  const TempDir folder;
  Rig rig(robust(), folder.path());
  for (int ordinal = 1; ordinal <= 60; ++ordinal) {
    if (ordinal == 40) rig.box().trigger(kDeadlineMiss);
    rig.step(ordinal);
    if (ordinal > 49) (void)rig.box().service_step();
  }
  EXPECT_EQ(rig.counters().frames_dropped, 0U);
  rig.serve();
  EXPECT_GE(rig.replay(rig.box().last_recording()), 15);
}

TEST(BlackBox, KeyframeThatAPairOvertakesIsGivenUpAndNoStateIsTorn) {
  const TempDir folder;
  Rig rig(robust(), folder.path());
  ASSERT_GT(rig.pipeline().state_bytes(), 2 * BlackBox::kPart) << "the scene is too small to be overtaken";
  for (int ordinal = 401; ordinal <= 470; ++ordinal) {
    // Time for one part alone in most gaps.
    rig.step(ordinal, false);
    while (rig.box().keyframe_step(rig.pipeline()) && ordinal % 9 == 0) {
    }
    if (ordinal == 460) rig.box().trigger(kDeadlineMiss);
  }
  rig.serve();
  EXPECT_GT(rig.counters().keyframes_given_up, 10U);
  EXPECT_GE(rig.counters().keyframes, 3U);
  EXPECT_GE(rig.replay(rig.box().last_recording()), 10);
}

TEST(BlackBox, WithoutTimeForKeyframesARecordingIsWrittenThatDoesNotClaimToBeExact) {
  const TempDir folder;
  Rig rig(robust(), folder.path());
  for (int ordinal = 1; ordinal <= 50; ++ordinal) {
    rig.step(ordinal, false);
    if (ordinal == 40) rig.box().trigger(kDeadlineMiss);
  }
  rig.serve();
  const RecordingSource source(rig.box().last_recording());
  EXPECT_FALSE(source.about().exact);
  EXPECT_TRUE(source.keyframe().empty());
}

// Who runs a frame and does not keep it, has no exact row over it, wherever the last keyframe was taken.
TEST(BlackBox, NoExactRecordingReachesOverAFrameThatWasNotKept) {
  for (int lost = 435; lost <= 446; ++lost) {
    const TempDir folder;
    Rig rig(robust(), folder.path());
    for (int ordinal = 401; ordinal <= lost + 12; ++ordinal) {
      if (ordinal == lost) {
        rig.step_without_slot(ordinal);
      } else {
        rig.step(ordinal);
      }
      if (ordinal == lost + 6) rig.box().trigger(kDeadlineMiss);
    }
    rig.serve();
    const std::string path = rig.box().last_recording();
    RecordingSource source(path);
    FramePair first;
    ASSERT_EQ(source.next(first), capture::Next::kPair);
    ASSERT_TRUE(source.about().exact) << "from the keyframe after it on";
    EXPECT_GT(first.ordinal, static_cast<std::uint64_t>(lost));
    EXPECT_GE(rig.replay(path), 10) << lost;
  }
}

TEST(BlackBox, LostFramesDoNotHoldUpARecording) {
  const TempDir folder;
  Rig rig(robust(), folder.path());
  for (int ordinal = 1; ordinal <= 30; ++ordinal) rig.step(ordinal);
  rig.box().trigger(kDeadlineMiss);
  for (int i = 0; i < 10; ++i) rig.box().no_frame();
  rig.serve();
  EXPECT_EQ(rig.counters().recordings, 1U);
}

TEST(BlackBox, FullDiskIsCountedAndTheNextRecordingIsWritten) {
  const TempDir folder;
  Rig rig(robust(), folder / "later");
  const auto record = [&](int from) {
    for (int ordinal = from; ordinal < from + 40; ++ordinal) {
      rig.step(ordinal);
      if (ordinal == from + 30) rig.box().trigger(kDeadlineMiss);
    }
    rig.serve();
  };
  record(1);  // no such folder
  EXPECT_EQ(rig.counters().recordings_failed, 1U);
  EXPECT_NE(rig.box().last_error(), "");
  fs::create_directory(folder / "later");
  fs::create_symlink("/dev/full", folder / "later" / "stereotrack-0000000000000abc-0000000077-deadline.strec.part");
  record(41);
  EXPECT_EQ(rig.counters().recordings_failed, 2U);
  EXPECT_NE(rig.box().last_error().find("No space left on device"), std::string::npos) << rig.box().last_error();
  record(81);
  EXPECT_EQ(rig.counters().recordings, 1U);
  EXPECT_EQ(rig.counters().frames_dropped, 0U);
  EXPECT_GE(rig.replay(rig.box().last_recording()), 15);
  EXPECT_EQ(rig.box().last_error(), "") << "a failure like the one before would not be news";
}

TEST(BlackBox, TheOldestRecordingsGoWhereThereAreTooMany) {
  const TempDir folder;
  (void)folder.write("somebody-elses.strec", std::string(10'000'000, 'x'));
  BlackBox::Config config;
  config.max_bytes = 12U << 20U;
  Rig rig(robust(), folder.path(), config);
  int ordinal = 1;
  std::vector<std::string> written;
  for (int i = 0; i < 5; ++i) {
    for (const int last = ordinal + 40; ordinal < last; ++ordinal) {
      rig.step(ordinal);
      if (ordinal == last - 10) rig.box().trigger(kDeadlineMiss);
    }
    rig.serve();
    written.push_back(rig.box().last_recording());
  }
  EXPECT_EQ(rig.counters().recordings, 5U) << rig.box().last_error();
  EXPECT_TRUE(fs::exists(folder / "somebody-elses.strec"));
  EXPECT_TRUE(fs::exists(written[4]));
  EXPECT_FALSE(fs::exists(written[0]));
}

// A board without a battery starts in the past.
TEST(BlackBox, WhichIsTheOldestIsNotAskedOfTheClock) {
  const TempDir folder;
  BlackBox::Config config;
  config.max_bytes = 12U << 20U;
  // Of the session before 0xABC, and written "tomorrow".
  const fs::path before =
      folder.write("stereotrack-0000000000000abb-0000000900-demand.strec", std::string(6'000'000, 'x'));
  fs::last_write_time(before, fs::file_time_type::clock::now() + std::chrono::hours(24));
  Rig rig(robust(), folder.path(), config);
  std::vector<std::string> written;
  for (int ordinal = 1; ordinal <= 80; ++ordinal) {
    rig.step(ordinal);
    if (ordinal % 40 == 30) rig.box().trigger(kDeadlineMiss);
    if (ordinal % 40 != 0) continue;
    rig.serve();
    written.push_back(rig.box().last_recording());
  }
  EXPECT_EQ(rig.counters().recordings, 2U) << rig.box().last_error();
  EXPECT_FALSE(fs::exists(before));
  EXPECT_TRUE(fs::exists(written[0]));
}

TEST(BlackBox, ReducedKeepsTheMeanOfLumaOfEverySecondFrameAndIsNotExact) {
  const TempDir folder;
  BlackBox::Config config;
  config.reduce = 2;
  config.every = 2;
  for (const test::SceneFormat& format : test::kSceneFormats) {
    const SceneCase one{"robust", &format, test::SceneMatching::kRegions};
    Rig rig(one, folder.path(), config);
    EXPECT_FALSE(rig.box().keyframe_step(rig.pipeline()));
    for (int ordinal = 1; ordinal <= 80; ++ordinal) {
      rig.step(ordinal);
      if (ordinal == 60) rig.box().trigger(kDeadlineMiss);
    }
    rig.serve();
    RecordingSource source(rig.box().last_recording());
    EXPECT_FALSE(source.about().exact);
    EXPECT_TRUE(source.keyframe().empty());
    EXPECT_EQ(source.info().width, MovingScene::kWidth / 2);
    EXPECT_EQ(source.info().format, PixelFormat::kGrey8);
    EXPECT_EQ(source.info().period.count(), 2 * 33'333'333);
    EXPECT_EQ(source.calibration()->left.fx, 75);
    EXPECT_EQ(source.calibration()->left.cx, (MovingScene::kWidth / 2 - 1) / 2.0) << "the middle stays the middle";
    FramePair pair;
    std::uint64_t before = 0;
    MovingScene scene(format);
    while (source.next(pair) == capture::Next::kPair) {
      EXPECT_TRUE(before == 0 || pair.ordinal == before + 2) << pair.ordinal;
      before = pair.ordinal;
      // Luma bytes of this format, by hand, for one pixel. Of a square of a mosaic, green counts twice.
      const Picture raw = scene.pair(static_cast<int>(pair.ordinal), true).right;
      const auto luma = [&](int x, int y) -> int {
        const std::uint8_t* row = raw.row(y);
        switch (raw.format) {
          case PixelFormat::kBgr8:
          case PixelFormat::kRgb8: return row[3 * x + 1];
          case PixelFormat::kYuyv: return row[2 * x];
          case PixelFormat::kUyvy: return row[2 * x + 1];
          case PixelFormat::kBayerRggb8:
          case PixelFormat::kBayerBggr8: return row[x % 2 == y % 2 ? x ^ 1 : x];
          case PixelFormat::kBayerGrbg8:
          case PixelFormat::kBayerGbrg8: return row[x % 2 == y % 2 ? x : x ^ 1];
          case PixelFormat::kBayerRggb10Packed:
          case PixelFormat::kBayerBggr10Packed: return row[(x % 2 == y % 2 ? x ^ 1 : x) * 5 / 4];
          case PixelFormat::kBayerGrbg10Packed:
          case PixelFormat::kBayerGbrg10Packed: return row[(x % 2 == y % 2 ? x : x ^ 1) * 5 / 4];
          default: break;
        }
        if (!is_bayer(raw.format)) return sample_of(sample_layout(raw.format), row, x);
        const bool red_or_blue_first =
            raw.format == PixelFormat::kBayerRggb10 || raw.format == PixelFormat::kBayerBggr10;
        const int green = (x % 2 == y % 2) == red_or_blue_first ? x ^ 1 : x;
        return (row[2 * green] + 256 * row[2 * green + 1]) / 4;
      };
      EXPECT_EQ(pair.right.row(10)[7], (luma(14, 20) + luma(15, 20) + luma(14, 21) + luma(15, 21) + 2) / 4);
    }
    EXPECT_GT(before, 0U);
  }
}

TEST(BlackBox, MessagesOfTheRecordedFramesAreKept) {
  const TempDir folder;
  Rig rig(robust(), folder.path());
  for (int ordinal = 1; ordinal <= 50; ++ordinal) {
    rig.step(ordinal);
    if (ordinal == 40) rig.box().trigger(kDeadlineMiss);
    if (ordinal > 2 && ordinal != 42) {
      // Of pair 44 nothing came in time: the state of 43 left once more; and one slot had no pair and no state at all.
      OutputNote note;
      note.ordinal = static_cast<std::uint64_t>(ordinal) - 2;
      note.state_ordinal = note.ordinal == 44 ? 43 : note.ordinal;
      if (note.ordinal == 46) note.ordinal = note.state_ordinal = 0;
      note.sequence = static_cast<std::uint64_t>(ordinal);
      note.send_ns = ordinal * 10;
      rig.box().note(note);
    }
  }
  rig.serve();
  const RecordingSource source(rig.box().last_recording());
  std::uint64_t before = 0;
  for (const OutputNote& note : source.outputs()) {
    EXPECT_GT(note.sequence, before) << "in the order in which they left";
    before = note.sequence;
    EXPECT_EQ(note.send_ns, static_cast<std::int64_t>(note.sequence) * 10);
    EXPECT_NE(note.ordinal, 40U) << "none left for it";
  }
  const auto with_sequence = [&](std::uint64_t sequence) {
    return std::count_if(source.outputs().begin(), source.outputs().end(),
                         [&](const OutputNote& note) { return note.sequence == sequence; });
  };
  EXPECT_EQ(with_sequence(47), 1);  // pair 45
  EXPECT_EQ(with_sequence(46), 1);  // pair 44, with the state of 43
  EXPECT_EQ(with_sequence(48), 1);  // the slot without a pair
  FramePair first;
  RecordingSource again(rig.box().last_recording());
  ASSERT_EQ(again.next(first), capture::Next::kPair);
  ASSERT_FALSE(source.outputs().empty());
  EXPECT_EQ(source.outputs().front().state_ordinal, first.ordinal);
}

TEST(BlackBox, WaitsForTheLastFramesMessagesButNotForEver) {
  const TempDir folder;
  Rig rig(robust(), folder.path());
  for (int ordinal = 1; ordinal <= 50; ++ordinal) {
    rig.step(ordinal);
    if (ordinal == 1) rig.box().note({.ordinal = 1, .sequence = 1});
    if (ordinal == 40) rig.box().trigger(kDeadlineMiss);
  }
  rig.serve();
  EXPECT_EQ(rig.counters().recordings, 0U);
  for (int i = 0; i < 30; ++i) rig.serve();
  EXPECT_EQ(rig.counters().recordings, 1U);
}

TEST(BlackBox, MoreMemoryThanThereIsIsOneLine) {
  const TempDir folder;
  BlackBox::Config config;
  config.seconds = 1e9;
  EXPECT_THROW(Rig(robust(), folder.path(), config), std::runtime_error);
}

// A system of 32 bits may have more memory than a program of it can address.
#if SIZE_MAX == UINT32_MAX
TEST(BlackBox, MoreMemoryThanAProgramCanAddressIsOneLine) {
  const TempDir folder;
  const auto pair_bytes =
      static_cast<double>(2 * picture_bytes(robust().format->format, MovingScene::kWidth, MovingScene::kHeight));
  for (const double times : {1.05, 1.2, 1.5}) {
    BlackBox::Config config;
    config.seconds = times * 0x1p32 / pair_bytes / kFramesASecond;
    EXPECT_THROW(Rig(robust(), folder.path(), config), std::runtime_error) << times;
  }
}
#endif

// Frame loop and service thread as they are in the daemon: for the sanitizers, and for torn frames.
TEST(BlackBox, TwoThreadsGiveWholeRecordings) {
  const TempDir folder;
  Rig rig(robust(), folder.path());
  std::atomic<bool> stop{false};
  std::thread service([&] {
    while (!stop.load()) {
      if (!rig.box().service_step()) std::this_thread::yield();
    }
    while (rig.box().service_step()) {
    }
  });
  for (int ordinal = 1; ordinal <= 400; ++ordinal) {
    rig.step(ordinal, ordinal % 3 != 0);
    if (ordinal % 25 == 20) rig.box().trigger(kSignal);
  }
  stop = true;
  service.join();
  EXPECT_GE(rig.counters().recordings, 2U) << rig.box().last_error();
  EXPECT_EQ(rig.counters().recordings_failed, 0U);
  for (const fs::path& path : recordings_in(folder.path())) EXPECT_GE(rig.replay(path.string()), 5) << path;
}

}  // namespace
}  // namespace stereotrack::record
