// Two cameras before the whole daemon, in real time: what is asserted holds however late its threads are.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/gpio/simulated_chip.hpp"
#include "firmware-app/runtime/allocation_count.hpp"
#include "firmware-app/stereotrackd/metrics.hpp"
#include "tests/support/camera_scene.hpp"
#include "tests/support/live_rig.hpp"

namespace stereotrack::daemon {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using telemetry::Pair;
using test::CameraScene;
using test::kSceneFormats;
using test::LiveRig;
using trigger::Side;

constexpr milliseconds kPeriod{20};
const std::vector<std::string> kLatency{"latency.output_ms=40", "latency.missing_limit=10"};

bool has(const Pair& pair, telemetry::Flag flag) { return (pair.header.flags & flag) != 0; }

/// Runs until `done`, for a minute at most: a busy machine needs some seconds.
template <class Done>
void run(LiveRig& rig, Done done) {
  const auto begun = std::chrono::steady_clock::now();
  rig.run([&] {
    if (std::chrono::steady_clock::now() - begun > std::chrono::minutes(1)) {
      ADD_FAILURE() << "nothing came of it";
      return true;
    }
    return done();
  });
}

std::uint32_t health(const LiveRig& rig) { return static_cast<std::uint32_t>(rig.daemon->vitals().health.get()); }

bool said(const LiveRig& rig, const std::string& cause, const std::string& camera) {
  return std::any_of(rig.notes.begin(), rig.notes.end(),
                     [&](const capture::SourceNote& note) { return note.cause == cause && note.camera == camera; });
}

TEST(CamerasDaemon, PairsAreTrackedAndToldWithSkewAndExposures) {
  CameraScene scene(kSceneFormats[0], kPeriod);
  scene.set_skew(microseconds(700));
  LiveRig rig(scene.open(20), kLatency);
  run(rig, [&] { return rig.ear.pairs().size() > 100; });
  EXPECT_GT(rig.outputs("on_time"), 0U);
  std::size_t targets = 0;
  for (const Pair& pair : rig.ear.pairs()) {
    targets += pair.targets.size();
    if (pair.header.ordinal == 0) continue;
    ASSERT_TRUE(pair.live.has_value());
    EXPECT_EQ(pair.live->pair_skew, microseconds(700));
    EXPECT_EQ(pair.live->exposure_left_us, 4000U);
    EXPECT_EQ(pair.live->exposure_right_us, 4000U);
  }
  EXPECT_GT(targets, 0U);
  EXPECT_EQ(rig.daemon->vitals().skew_max_us.get(), 700U);
  EXPECT_TRUE(rig.notes.empty()) << rig.notes[0].text;
  if (allocations_are_counted()) {
    EXPECT_EQ(rig.daemon->vitals().allocations(), 0U);
  }
}

TEST(CamerasDaemon, AnUnpluggedRightCameraIsToldMonoGoesOnAndItComesBack) {
  CameraScene scene(kSceneFormats[2], kPeriod);
  signals::Signal heart;
  heart.when = signals::Condition::kHeartbeat;
  heart.half_period = milliseconds(40);
  LiveRig rig(scene.open(20), kLatency, {}, {{.name = {"sim", "heart-mono"}}}, {heart});
  int stage = 0;
  std::size_t mono = 0;
  std::uint64_t beats = 0;
  run(rig, [&] {
    const std::vector<Pair>& pairs = rig.ear.pairs();
    switch (stage) {
      case 0:
        if (pairs.size() < 30) break;
        scene.unplug(Side::kRight);
        ++stage;
        break;
      case 1:
        mono = static_cast<std::size_t>(
            std::count_if(pairs.begin(), pairs.end(), [](const Pair& pair) { return has(pair, telemetry::kMono); }));
        if (mono < 20 || (health(rig) & telemetry::kHealthRightSilent) == 0) break;
        beats = rig.daemon->lines().read(0).transitions;
        scene.plug_in(Side::kRight);
        ++stage;
        break;
      default:
        return health(rig) != 0 && (health(rig) & telemetry::kHealthRightSilent) == 0 && !pairs.empty() &&
               !has(pairs.back(), telemetry::kMono) && pairs.back().header.ordinal != 0;
    }
    return false;
  });
  EXPECT_EQ(stage, 2);
  EXPECT_GT(beats, 4U);  // mono is healthy enough for the heart
  EXPECT_TRUE(said(rig, "camera_lost", "right"));
  EXPECT_TRUE(said(rig, "camera_back", "right"));
  EXPECT_TRUE(rig.daemon->failure().empty());
  EXPECT_EQ(rig.daemon->figures().cameras[1].reopened, 1U);
  const std::string metrics = metrics_text(*rig.daemon, 3);
  for (const char* line :
       {"stereotrack_camera_losses_total{camera=\"right\"} 1", "stereotrack_camera_reopened_total{camera=\"right\"} 1",
        "stereotrack_camera_silent{camera=\"right\"} 0", "stereotrack_pairing_total{verdict=\"paired\"} "}) {
    EXPECT_NE(metrics.find(line), std::string::npos) << line;
  }
  if (allocations_are_counted()) {
    EXPECT_EQ(rig.daemon->vitals().allocations(), 0U);
  }
}

TEST(CamerasDaemon, WithoutTheLeftCameraSlotsLeaveAsMissingThenStatusAloneAndTheHeartStops) {
  CameraScene scene(kSceneFormats[1], kPeriod);
  signals::Signal heart;
  heart.when = signals::Condition::kHeartbeat;
  heart.half_period = milliseconds(40);
  LiveRig rig(scene.open(20), kLatency, {}, {{.name = {"sim", "heart-left"}}}, {heart});
  int stage = 0;
  std::size_t statuses = 0;
  std::uint64_t beats = 0;
  run(rig, [&] {
    switch (stage) {
      case 0:
        if (rig.ear.pairs().size() < 30) break;
        scene.unplug(Side::kLeft);
        ++stage;
        break;
      case 1: {
        const std::uint32_t wanted = telemetry::kHealthLeftSilent | telemetry::kHealthNoPairs;
        if ((health(rig) & wanted) != wanted || rig.outputs("outages") == 0) break;
        statuses = rig.ear.statuses().size();
        ++stage;
        break;
      }
      case 2:
        if (rig.ear.statuses().size() < statuses + 2) break;  // another second
        beats = rig.daemon->lines().read(0).transitions;
        ++stage;
        break;
      case 3:
        if (rig.ear.statuses().size() < statuses + 3) break;
        EXPECT_EQ(rig.daemon->lines().read(0).transitions, beats) << "the heart beats without pairs";
        scene.plug_in(Side::kLeft);
        ++stage;
        break;
      default: return rig.daemon->lines().read(0).transitions > beats + 2;
    }
    return false;
  });
  EXPECT_EQ(stage, 4);
  const std::vector<Pair>& pairs = rig.ear.pairs();
  EXPECT_TRUE(
      std::any_of(pairs.begin(), pairs.end(), [](const Pair& pair) { return has(pair, telemetry::kPairMissing); }));
  EXPECT_TRUE(said(rig, "camera_lost", "left"));
  EXPECT_TRUE(said(rig, "camera_back", "left"));
}

TEST(CamerasDaemon, SkewAndExposuresBeyondTheirLimitsAreAlarms) {
  CameraScene scene(kSceneFormats[1], kPeriod);
  LiveRig rig(scene.open(1), {"latency.output_ms=40", "camera.skew_limit_ms=1"});
  const std::uint32_t alarms = telemetry::kHealthSkew | telemetry::kHealthExposuresDiffer;
  int stage = 0;
  std::size_t statuses = 0;
  run(rig, [&] {
    switch (stage) {
      case 0:
        if (rig.ear.statuses().size() < 2 || rig.ear.pairs().empty()) break;
        EXPECT_EQ(rig.ear.statuses().back().health & alarms, 0U);
        scene.set_skew(microseconds(1500));
        scene.set_right_exposure(milliseconds(5));
        ++stage;
        break;
      case 1:
        if ((rig.ear.statuses().back().health & alarms) != alarms) break;
        EXPECT_EQ(rig.ear.statuses().back().skew_max_us, 1500U);
        scene.set_skew(microseconds(900));
        scene.set_right_exposure(microseconds(4100));
        statuses = rig.ear.statuses().size();
        ++stage;
        break;
      default: return rig.ear.statuses().size() > statuses && (rig.ear.statuses().back().health & alarms) == 0;
    }
    return false;
  });
  EXPECT_EQ(stage, 2);
  EXPECT_GT(rig.daemon->vitals().skew_over.get(), 0U);
  EXPECT_GT(rig.daemon->vitals().exposures_differ.get(), 0U);
}

TEST(CamerasDaemon, PairsWhoseTimesAreStillToComeAreAnAlarm) {
  CameraScene scene(kSceneFormats[0], kPeriod);
  LiveRig rig(scene.open(20), kLatency);
  // The first messages settle the cadence, which goes on without pairs.
  int stage = 0;
  run(rig, [&] {
    if (rig.ear.pairs().empty() || rig.ear.statuses().empty()) return false;
    const bool is_told = (rig.ear.statuses().back().health & telemetry::kHealthNoPairs) != 0;
    switch (stage) {
      case 0:
        if (rig.ear.pairs().size() < 50 || is_told) break;
        scene.set_ahead(milliseconds(200));
        ++stage;
        break;
      case 1:
        if (!is_told || !has(rig.ear.pairs().back(), telemetry::kPairMissing)) break;
        scene.set_ahead(milliseconds(0));
        ++stage;
        break;
      default: return !is_told && rig.ear.pairs().back().header.ordinal != 0;
    }
    return false;
  });
  EXPECT_EQ(stage, 2);
  EXPECT_TRUE(said(rig, "camera_ahead", "left"));
}

std::unique_ptr<trigger::PulseTrain> train_on(const std::string& line) {
  const gpio::LineSpec spec{.name = {"sim", line}};
  auto train = trigger::PulseTrain::create({.period = kPeriod, .width = milliseconds(1), .late = milliseconds(5)},
                                           gpio::open_lines({&spec, 1}, "test"));
  EXPECT_TRUE(train.has_value());
  return std::move(*train);
}

TEST(CamerasDaemon, ItsOwnPulsesAskForFramesAndAMissedExposureIsTold) {
  CameraScene scene(kSceneFormats[0], kPeriod);
  auto train = train_on("daemon-trigger");
  auto source = scene.open_triggered(20, train->trigger());
  LiveRig rig(std::move(source), kLatency, {}, {}, {}, std::move(train));
  int stage = 0;
  run(rig, [&] {
    switch (stage) {
      case 0:
        if (rig.ear.pairs().size() < 50) break;
        scene.miss_one();
        ++stage;
        break;
      case 1:
        if (rig.daemon->figures().cameras[1].missed == 0) break;
        ++stage;
        break;
      default:
        return rig.ear.pairs().size() > 100 && !rig.ear.statuses().empty() &&
               rig.ear.statuses().back().exposures_missed_right > 0;
    }
    return false;
  });
  scene.stop();
  const trigger::PulseTrain::Counters& pulses = rig.daemon->train()->counters();
  EXPECT_EQ(gpio::simulated_chip::edges("daemon-trigger"), 2 * pulses.given.get());
  EXPECT_EQ(gpio::simulated_chip::level("daemon-trigger"), false);
  EXPECT_EQ(rig.daemon->vitals().trigger_set.count(), pulses.given.get());
  EXPECT_EQ(pulses.failed.get(), 0U);
  EXPECT_GT(rig.outputs("on_time"), 0U);
  EXPECT_GT(rig.ear.statuses().back().trigger_pulses, 50U);
  const std::string metrics = metrics_text(*rig.daemon, 3);
  for (const std::string& line :
       {"stereotrack_trigger_train_total{fate=\"given\"} " + std::to_string(pulses.given.get()),
        std::string("stereotrack_trigger_train_total{fate=\"skipped\"} "),
        std::string("stereotrack_camera_exposures_total{camera=\"right\",fault=\"missed\"} "),
        "stereotrack_trigger_set_seconds_count " + std::to_string(pulses.given.get())}) {
    EXPECT_NE(metrics.find(line + (line.back() == ' ' ? "" : "\n")), std::string::npos) << line;
  }
  if (allocations_are_counted()) {
    EXPECT_EQ(rig.daemon->vitals().allocations(), 0U);
  }
}

TEST(CamerasDaemon, ACameraWhoseTriggerWireIsOffIsAnAlarmWithItsName) {
  CameraScene scene(kSceneFormats[0], kPeriod);
  auto train = train_on("daemon-trigger-wire");
  auto source = scene.open_triggered(20, train->trigger());
  LiveRig rig(std::move(source), kLatency, {}, {}, {}, std::move(train));
  // A pulse that is late on a busy machine raises the trigger's own alarm, too.
  const std::uint32_t left_astray = telemetry::kHealthLeftAstray;
  const std::uint32_t right_astray = telemetry::kHealthRightAstray;
  const std::uint32_t all = left_astray | right_astray;
  int stage = 0;
  std::size_t mark = 0;
  std::string astray_metrics;
  run(rig, [&] {
    const std::vector<Pair>& pairs = rig.ear.pairs();
    if (pairs.empty() || rig.ear.statuses().empty()) return false;
    const std::uint32_t health_told = rig.ear.statuses().back().health;
    const bool is_stereo = !has(pairs.back(), telemetry::kMono) && pairs.back().header.ordinal != 0;
    switch (stage) {
      case 0:
        if (pairs.size() < 50 || !is_stereo) break;
        EXPECT_EQ(health_told & all, 0U);
        scene.unwire(Side::kRight, true);
        ++stage;
        break;
      case 1:
        if ((health_told & all) != right_astray || !has(pairs.back(), telemetry::kMono)) break;
        if ((pairs.back().live->health & all) != right_astray) break;  // it leaves with the pairs, too
        EXPECT_NE(health_told & telemetry::kHealthTriggerFailed, 0U);
        astray_metrics = metrics_text(*rig.daemon, 3);
        scene.unwire(Side::kRight, false);
        ++stage;
        break;
      case 2:
        if ((health_told & all) != 0 || !is_stereo) break;
        scene.unwire(Side::kLeft, true);
        ++stage;
        break;
      case 3:
        if ((health_told & all) != left_astray || (health_told & telemetry::kHealthNoPairs) == 0) break;
        mark = pairs.size();
        scene.unwire(Side::kLeft, false);
        ++stage;
        break;
      default: return (health_told & all) == 0 && pairs.size() > mark + 20 && is_stereo;
    }
    return false;
  });
  scene.stop();
  EXPECT_EQ(stage, 4);
  for (const char* camera : {"right", "left"}) {
    for (const char* cause : {"camera_astray", "camera_follows"}) {
      EXPECT_EQ(std::count_if(rig.notes.begin(), rig.notes.end(),
                              [&](const capture::SourceNote& note) {
                                return note.camera == std::string(camera) && note.cause == std::string(cause);
                              }),
                1)
          << camera << ' ' << cause;
    }
  }
  EXPECT_FALSE(said(rig, "cameras_do_not_fit", ""));
  for (const char* line :
       {"stereotrack_camera_astray{camera=\"right\"} 1\n", "stereotrack_camera_astray{camera=\"left\"} 0\n",
        "stereotrack_camera_strayings_total{camera=\"right\"} 1\n", "stereotrack_trigger_unanswered 0\n"}) {
    EXPECT_NE(astray_metrics.find(line), std::string::npos) << line;
  }
  for (const Pair& pair : rig.ear.pairs()) {
    if (pair.live && pair.live->pair_skew) {
      EXPECT_EQ(*pair.live->pair_skew, microseconds(0));  // a wrong pair is half a period apart
    }
  }
  if (allocations_are_counted()) {
    EXPECT_EQ(rig.daemon->vitals().allocations(), 0U);
  }
}

TEST(CamerasDaemon, InAFaultItsPulsesStopAtOnce) {
  CameraScene scene(kSceneFormats[0], kPeriod);
  auto train = train_on("daemon-trigger-fault");
  auto source = scene.open_triggered(20, train->trigger());
  LiveRig rig(std::move(source), kLatency, {}, {}, {}, std::move(train));
  bool safe = false;
  std::uint64_t edges = 0;
  std::uint64_t beats = 0;
  run(rig, [&] {
    if (rig.daemon->train()->counters().given.get() < 20) return false;
    if (!safe) {
      safe = rig.daemon->make_lines_safe();
      EXPECT_TRUE(safe);
      // A set() that was under way in the trigger thread is over a moment later: as the handler asks for it twice.
      std::this_thread::sleep_for(milliseconds(20));
      (void)rig.daemon->make_lines_safe();
      edges = gpio::simulated_chip::edges("daemon-trigger-fault");
      beats = rig.daemon->vitals().trigger_beats.get();
    }
    return rig.daemon->vitals().trigger_beats.get() > beats + 10;
  });
  scene.stop();
  EXPECT_EQ(gpio::simulated_chip::edges("daemon-trigger-fault"), edges);
  EXPECT_EQ(gpio::simulated_chip::level("daemon-trigger-fault"), false);
}

}  // namespace
}  // namespace stereotrack::daemon
