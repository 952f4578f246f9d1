// Two cameras before the whole daemon, in real time: what is asserted holds however late its threads are.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <string>
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

/// Runs until `done`, for a minute at most.
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

}  // namespace
}  // namespace stereotrack::daemon
