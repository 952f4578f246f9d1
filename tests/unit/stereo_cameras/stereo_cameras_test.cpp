#include "drivers/capture/stereo_cameras/stereo_cameras.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/unit/stereo_cameras/rig.hpp"

namespace stereotrack::capture {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;
using test::CameraRig;
using test::kFramePeriod;
using test::number_of;

StereoCameras::Config config() {
  test::simulated_ns.store(1'000'000'000);
  StereoCameras::Config config;
  config.now = &test::simulated_now;
  return config;
}

/// Frames n of [first, last], one each period; what came out, each pair looked at as it comes.
struct Seen {
  std::uint64_t ordinal;
  std::uint64_t left;
  std::uint64_t right;  ///< 0: mono
};
enum class Who { kBoth, kLeft, kRight };
std::vector<Seen> play(CameraRig& rig, std::uint64_t first, std::uint64_t last, Who who = Who::kBoth,
                       std::vector<SourceNote>* notes = nullptr) {
  std::vector<Seen> seen;
  for (std::uint64_t n = first; n <= last; ++n) {
    rig.advance(kFramePeriod);
    const nanoseconds time = kFramePeriod * static_cast<std::int64_t>(n);
    if (who != Who::kRight) (void)rig.left.expose({.number = n, .time = time, .sequence = n});
    if (who != Who::kLeft) (void)rig.right.expose({.number = n, .time = time, .sequence = n});
    rig.step();
    while (const PairLease lease = rig.pool.take_oldest()) {
      seen.push_back({lease->ordinal, number_of(lease->left), lease->right.empty() ? 0 : number_of(lease->right)});
    }
    const std::vector<SourceNote> said = rig.tend();
    if (notes != nullptr) notes->insert(notes->end(), said.begin(), said.end());
  }
  return seen;
}

bool says(const std::vector<SourceNote>& notes, const std::string& cause, const std::string& camera = "") {
  return std::count_if(notes.begin(), notes.end(),
                       [&](const SourceNote& note) { return note.cause == cause && note.camera == camera; }) == 1;
}

TEST(StereoCameras, OneCameraWithBothViewsIsSplitWithinItsBuffer) {
  StereoCameras::Config wanted = config();
  wanted.stereo = false;
  wanted.side_by_side = true;
  CameraRig rig(wanted);
  rig.open();
  EXPECT_TRUE(rig.cameras->info().stereo);
  EXPECT_EQ(rig.cameras->info().width, 8);
  EXPECT_FALSE(rig.right.is_open());
  for (std::uint64_t n = 1; n <= 20; ++n) {
    rig.advance(kFramePeriod);
    (void)rig.left.expose({.number = n, .time = kFramePeriod * static_cast<std::int64_t>(n), .sequence = n});
    rig.step();
    const PairLease lease = rig.pool.take_oldest();
    ASSERT_TRUE(lease) << n;
    EXPECT_EQ(lease->right.data, lease->left.data + 8);
    EXPECT_EQ(lease->right.stride_bytes, 16);
    EXPECT_EQ(number_of(lease->left), n);
    EXPECT_EQ(number_of(lease->right), n);
    EXPECT_FALSE(lease->skew.has_value());
  }
  EXPECT_EQ(rig.cameras->figures().mono_pairs, 0U);
  EXPECT_EQ(rig.left.given_back_wrongly(), 0);
}

TEST(StereoCameras, LeftFramesFromTheFutureAreToldOnceWithTheWayOut) {
  CameraRig rig(config());
  rig.open();
  std::vector<SourceNote> notes;
  (void)play(rig, 1, 3, Who::kBoth, &notes);
  EXPECT_FALSE(says(notes, "camera_ahead", "left"));
  // The simulated clock began at 1 s: frame 60 is of 2.4 s, some 1.2 s ahead.
  (void)play(rig, 60, 63, Who::kBoth, &notes);
  EXPECT_TRUE(says(notes, "camera_ahead", "left"));
  EXPECT_FALSE(says(notes, "camera_ahead", "right")) << "its time is no pair's";
  for (const SourceNote& note : notes) {
    if (std::string(note.cause) != "camera_ahead") continue;
    EXPECT_NE(note.text.find("raise camera.readout_us"), std::string::npos) << note.text;
  }
}

TEST(StereoCameras, APictureThatCannotBeSplitIsRefusedWithTheWayOut) {
  StereoCameras::Config wanted = config();
  wanted.stereo = false;
  wanted.side_by_side = true;
  CameraRig rig(wanted);
  CameraInfo odd = rig.left.info();
  odd.format = PixelFormat::kYuyv;
  odd.width = 10;  // a half of 5, whose colours come in twos
  rig.left.set_info(odd);
  try {
    rig.open();
    FAIL() << "was opened";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("left-device: 10x4 yuyv cannot be split"), std::string::npos)
        << error.what();
  }
}

TEST(StereoCameras, PairsLeaveFromTheDriversOwnBuffersWithSkewAndSettings) {
  CameraRig rig(config());
  rig.open();
  EXPECT_TRUE(rig.cameras->info().stereo);
  EXPECT_EQ(rig.cameras->info().period, kFramePeriod);
  const SensorSettings left{milliseconds(4), 2.0F};
  const SensorSettings right{milliseconds(5), 1.0F};
  (void)rig.left.expose({.number = 7, .time = milliseconds(100), .settings = left});
  (void)rig.right.expose({.number = 7, .time = milliseconds(101), .settings = right});
  rig.step();
  PairNotice notice;
  ASSERT_TRUE(rig.notices.pop(notice));
  EXPECT_EQ(notice.ordinal, 1U);
  EXPECT_EQ(notice.skew, nanoseconds(milliseconds(1)));
  EXPECT_EQ(notice.left.exposure, nanoseconds(milliseconds(4)));
  EXPECT_EQ(notice.right.exposure, nanoseconds(milliseconds(5)));
  PairLease lease = rig.pool.take_oldest();
  ASSERT_TRUE(lease);
  EXPECT_EQ(lease->capture_time, CaptureTime(milliseconds(100)));
  EXPECT_EQ(number_of(lease->left), 7U);
  EXPECT_EQ(number_of(lease->right), 7U);
  EXPECT_EQ(rig.left.held(), 1U);
  lease.release();
  rig.step();
  EXPECT_EQ(rig.left.held() + rig.right.held(), 0U);
  EXPECT_EQ(rig.left.given_back_wrongly() + rig.right.given_back_wrongly(), 0);
}

TEST(StereoCameras, CamerasWithDifferentClocksPairOnTheMonotonicOne) {
  CameraRig rig(config());
  rig.left.set_map(seconds(-500));
  rig.right.set_map(seconds(30));
  rig.open();
  (void)rig.left.expose({.number = 1, .time = seconds(501)});
  (void)rig.right.expose({.number = 1, .time = seconds(-29) + milliseconds(2)});
  rig.step();
  const PairLease lease = rig.pool.take_oldest();
  ASSERT_TRUE(lease);
  EXPECT_EQ(lease->capture_time, CaptureTime(seconds(1)));
  EXPECT_EQ(lease->skew, nanoseconds(milliseconds(2)));
  EXPECT_EQ(rig.cameras->clock_map().offset().count(), 0);
}

TEST(StereoCameras, ADamagedFrameIsGivenBackAndItsPartnerFollows) {
  CameraRig rig(config());
  rig.open();
  (void)rig.left.expose({.number = 1, .time = kFramePeriod, .damaged = true});
  (void)rig.right.expose({.number = 1, .time = kFramePeriod});
  rig.step();
  EXPECT_EQ(rig.left.held(), 0U);
  rig.expose_both(2);
  rig.step();
  EXPECT_EQ(rig.pool.counters().captured, 1U);
  EXPECT_EQ(rig.right.held(), 1U);
  EXPECT_EQ(rig.cameras->figures().cameras[0].damaged, 1U);
  EXPECT_EQ(rig.cameras->figures().missing_left, 1U);
}

TEST(StereoCameras, WithoutTheRightCameraItBeginsInMonoAndSaysSoOnce) {
  CameraRig rig(config());
  rig.right.refuse("right-device: not there: plug it in");
  rig.open();
  const std::vector<SourceNote> notes = rig.tend();
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_NE(notes[0].text.find("right-device: not there: plug it in"), std::string::npos) << notes[0].text;
  EXPECT_NE(notes[0].text.find("mono"), std::string::npos) << notes[0].text;
  EXPECT_STREQ(notes[0].camera, "right");
  EXPECT_TRUE(rig.cameras->info().stereo);
  std::vector<SourceNote> later;
  const std::vector<Seen> seen = play(rig, 1, 60, Who::kLeft, &later);
  ASSERT_EQ(seen.size(), 60U);
  for (const Seen& pair : seen) EXPECT_EQ(pair.right, 0U);
  EXPECT_TRUE(later.empty()) << later[0].text;  // each try fails for the same reason
  EXPECT_GT(rig.cameras->figures().cameras[1].open_failures, 1U);
  EXPECT_EQ(rig.cameras->figures().mono_pairs, 60U);
  EXPECT_TRUE(rig.cameras->figures().cameras[1].silent);
}

TEST(StereoCameras, ACameraThatOpensAndDoesNotStreamIsTriedAgain) {
  CameraRig rig(config());
  rig.right.refuse_start("right-device: does not stream: another program has it");
  rig.open();
  EXPECT_FALSE(rig.right.is_open());
  const std::vector<SourceNote> notes = rig.tend();
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_NE(notes[0].text.find("another program has it"), std::string::npos) << notes[0].text;
  EXPECT_EQ(play(rig, 1, 20, Who::kLeft).size(), 20U);
  rig.right.refuse_start("");
  EXPECT_EQ(play(rig, 21, 100).back().right, 100U);
  EXPECT_FALSE(rig.cameras->figures().cameras[1].silent);
}

TEST(StereoCameras, WithNeitherCameraItDoesNotBegin) {
  CameraRig rig(config());
  rig.left.refuse("left-device: not there");
  rig.right.refuse("right-device: not there");
  try {
    rig.open();
    FAIL() << "it began";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "left-device: not there");
  }
}

TEST(StereoCameras, CamerasThatDeliverDifferentThingsAreRefusedByName) {
  CameraRig rig(config());
  CameraInfo other = rig.right.info();
  other.width = 32;
  rig.right.set_info(other);
  try {
    rig.open();
    FAIL() << "it began";
  } catch (const std::runtime_error& error) {
    const std::string text = error.what();
    for (const char* part : {"left-device", "right-device", "16x4", "32x4", "camera.width"}) {
      EXPECT_NE(text.find(part), std::string::npos) << text;
    }
  }
}

TEST(StereoCameras, ALostRightCameraLeavesMonoPairsAndComesBackByItself) {
  CameraRig rig(config());
  rig.open();
  std::vector<SourceNote> notes;
  EXPECT_EQ(play(rig, 1, 10, Who::kBoth, &notes).size(), 10U);
  EXPECT_TRUE(notes.empty());
  rig.right.refuse("right-device: no such device");
  rig.right.lose();
  std::vector<Seen> seen = play(rig, 11, 40, Who::kLeft, &notes);
  EXPECT_TRUE(says(notes, "camera_lost", "right"));
  EXPECT_TRUE(says(notes, "camera_open", "right"));
  EXPECT_EQ(notes.size(), 2U);
  ASSERT_EQ(seen.size(), 30U);
  for (const Seen& pair : seen) EXPECT_EQ(pair.right, 0U) << pair.left;
  EXPECT_FALSE(rig.right.is_open());
  rig.right.refuse("");
  notes.clear();
  seen = play(rig, 41, 200, Who::kBoth, &notes);
  EXPECT_TRUE(says(notes, "camera_back", "right"));
  EXPECT_EQ(notes.size(), 1U);
  ASSERT_EQ(seen.size(), 160U);  // none was lost meanwhile
  EXPECT_EQ(seen.back().right, 200U);
  EXPECT_FALSE(rig.cameras->figures().cameras[1].silent);
  EXPECT_EQ(rig.cameras->figures().cameras[1].reopened, 1U);
  EXPECT_EQ(rig.cameras->figures().cameras[1].losses, 1U);
  EXPECT_EQ(rig.right.lost_in_closing() + rig.right.given_back_wrongly(), 0);
}

TEST(StereoCameras, WithoutTheLeftCameraNoPairComesAndTheRightOneIsKept) {
  CameraRig rig(config());
  rig.open();
  EXPECT_EQ(play(rig, 1, 10).size(), 10U);
  rig.left.refuse("left-device: no such device");
  rig.left.lose();
  std::vector<SourceNote> notes;
  EXPECT_EQ(play(rig, 11, 40, Who::kRight, &notes).size(), 0U);
  EXPECT_TRUE(says(notes, "camera_lost", "left"));
  EXPECT_EQ(rig.right.held(), 0U);
  EXPECT_TRUE(rig.cameras->figures().cameras[0].silent);
  EXPECT_FALSE(rig.cameras->figures().cameras[1].silent);
  rig.left.refuse("");
  const std::vector<Seen> seen = play(rig, 41, 100);
  ASSERT_FALSE(seen.empty());
  EXPECT_EQ(seen.back().left, 100U);
  EXPECT_EQ(seen.back().right, 100U);
}

TEST(StereoCameras, BothLostTheSourceLivesOnAndBothComeBack) {
  CameraRig rig(config());
  rig.open();
  EXPECT_EQ(play(rig, 1, 10).size(), 10U);
  for (test::SensorScript* sensor : {&rig.left, &rig.right}) {
    sensor->refuse("gone");
    sensor->lose();
  }
  EXPECT_EQ(play(rig, 11, 100).size(), 0U);
  EXPECT_FALSE(rig.left.is_open() || rig.right.is_open());
  for (test::SensorScript* sensor : {&rig.left, &rig.right}) sensor->refuse("");
  const std::vector<Seen> seen = play(rig, 101, 500);
  ASSERT_FALSE(seen.empty());
  EXPECT_EQ(seen.back().right, 500U);
  EXPECT_TRUE(rig.cameras->failure().empty());
}

TEST(StereoCameras, ADeadCameraIsKeptWhileALeaseReadsItsBuffer) {
  CameraRig rig(config());
  rig.open();
  rig.advance(kFramePeriod);
  rig.expose_both(1);
  rig.step();
  PairLease lease = rig.pool.take_oldest();
  ASSERT_TRUE(lease);
  rig.right.lose();
  for (int i = 0; i < 20; ++i) {
    rig.step();
    (void)rig.tend();
    rig.advance(milliseconds(100));
  }
  EXPECT_TRUE(rig.right.is_open());
  EXPECT_EQ(rig.right.opened(), 1);
  EXPECT_EQ(number_of(lease->right), 1U);
  lease.release();
  rig.step();
  for (int side = 0; side < 2; ++side) (void)rig.tend();
  EXPECT_FALSE(rig.right.is_open());
  EXPECT_EQ(rig.right.lost_in_closing(), 0);
}

// Each keeps the service thread for as long as its device takes: signals and the watchdog have their turn between.
TEST(StereoCameras, TwoThatAreLostAtOnceAreClosedAndOpenedOneACall) {
  CameraRig rig(config());
  rig.open();
  EXPECT_EQ(play(rig, 1, 10).size(), 10U);
  rig.left.lose();
  rig.right.lose();
  for (int i = 0; i < 3; ++i) rig.step();
  const auto open = [&] { return (rig.left.is_open() ? 1 : 0) + (rig.right.is_open() ? 1 : 0); };
  const auto opened = [&] { return rig.left.opened() + rig.right.opened(); };
  ASSERT_EQ(open(), 2);
  for (int calls = 1; calls <= 2; ++calls) {
    (void)rig.tend();
    EXPECT_EQ(open(), 2 - calls);
  }
  const int first = opened();
  rig.advance(std::chrono::seconds(5));
  for (int calls = 1; calls <= 2; ++calls) {
    (void)rig.tend();
    EXPECT_EQ(opened(), first + calls);
  }
}

TEST(StereoCameras, OneSilentSideIsGivenUpAndOpenedAnew) {
  CameraRig rig(config());
  rig.open();
  EXPECT_EQ(play(rig, 1, 10).size(), 10U);
  std::vector<SourceNote> notes;
  // 0.5 s are 12.5 periods; what waited meanwhile is lost, what comes later goes on in mono.
  const std::vector<Seen> seen = play(rig, 11, 30, Who::kLeft, &notes);
  EXPECT_TRUE(says(notes, "camera_silent", "right"));
  EXPECT_GE(seen.size(), 7U);
  EXPECT_LE(seen.size(), 12U);
  (void)play(rig, 31, 60, Who::kLeft);
  EXPECT_EQ(rig.right.opened(), 2);
  EXPECT_EQ(play(rig, 61, 70).back().right, 70U);
}

TEST(StereoCameras, ACameraThatComesBackButStaysSilentIsToldOnceAndTriedWithBackOff) {
  CameraRig rig(config());
  rig.open();
  EXPECT_EQ(play(rig, 1, 10).size(), 10U);
  std::vector<SourceNote> notes;
  const std::vector<Seen> seen = play(rig, 11, 11 + 25 * 120, Who::kLeft, &notes);  // two minutes
  EXPECT_EQ(notes.size(), 1U);
  EXPECT_GE(rig.cameras->figures().cameras[1].reopened, 8U);
  EXPECT_LE(rig.cameras->figures().cameras[1].reopened, 14U);
  EXPECT_GE(seen.size(), 25U * 120U - 20U);
}

TEST(StereoCameras, NoTriggerIsNoFault) {
  StereoCameras::Config triggered = config();
  triggered.triggered = true;
  CameraRig rig(triggered);
  rig.open();
  // Before the first frame: for ever.
  for (int i = 0; i < 100; ++i) {
    rig.advance(milliseconds(100));
    rig.step();
    EXPECT_TRUE(rig.tend().empty());
  }
  EXPECT_EQ(play(rig, 1, 10).size(), 10U);
  // After it: told, nobody is given up.
  std::vector<SourceNote> notes;
  for (int i = 0; i < 100; ++i) {
    rig.advance(milliseconds(100));
    rig.step();
    for (const SourceNote& note : rig.tend()) notes.push_back(note);
  }
  EXPECT_TRUE(says(notes, "cameras_silent"));
  EXPECT_EQ(notes.size(), 1U);
  EXPECT_TRUE(rig.cameras->figures().cameras[0].silent && rig.cameras->figures().cameras[1].silent);
  notes.clear();
  const std::vector<Seen> seen = play(rig, 300, 310, Who::kBoth, &notes);
  ASSERT_EQ(seen.size(), 11U);
  EXPECT_EQ(seen.front().right, 300U);
  EXPECT_TRUE(says(notes, "cameras_heard"));
  EXPECT_EQ(rig.left.opened() + rig.right.opened(), 2);
  // One alone that misses them is at fault.
  (void)play(rig, 311, 340, Who::kLeft, &notes);
  EXPECT_TRUE(says(notes, "camera_silent", "right"));
}

TEST(StereoCameras, FreeRunningBothSilentAreOpenedAnew) {
  CameraRig rig(config());
  rig.open();
  EXPECT_EQ(play(rig, 1, 10).size(), 10U);
  for (int i = 0; i < 30; ++i) {
    rig.advance(milliseconds(100));
    rig.step();
    (void)rig.tend();
  }
  EXPECT_GE(rig.left.opened(), 2);
  EXPECT_GE(rig.right.opened(), 2);
}

TEST(StereoCameras, ACameraThatComesBackWithAnotherSizeIsRefusedWithALine) {
  CameraRig rig(config());
  rig.open();
  EXPECT_EQ(play(rig, 1, 10).size(), 10U);
  CameraInfo other = rig.right.info();
  other.height = 8;
  rig.right.set_info(other);
  rig.right.lose();
  std::vector<SourceNote> notes;
  (void)play(rig, 11, 100, Who::kLeft, &notes);
  ASSERT_EQ(notes.size(), 2U);
  EXPECT_NE(notes[1].text.find("16x8"), std::string::npos) << notes[1].text;
  EXPECT_NE(notes[1].text.find("16x4"), std::string::npos) << notes[1].text;
  EXPECT_NE(notes[1].text.find("right-device"), std::string::npos) << notes[1].text;
  EXPECT_FALSE(rig.right.is_open());
  other.height = 4;
  rig.right.set_info(other);
  EXPECT_EQ(play(rig, 101, 400).back().right, 400U);
}

TEST(StereoCameras, FramesThatNeverFitGoOnInMonoAndFitAgainLater) {
  CameraRig rig(config());
  rig.open();
  std::vector<SourceNote> notes;
  std::uint64_t mono = 0;
  const auto run = [&](std::uint64_t first, std::uint64_t last, nanoseconds skew) {
    std::uint64_t paired = 0;
    for (std::uint64_t n = first; n <= last; ++n) {
      rig.advance(kFramePeriod);
      rig.expose_both(n, skew);
      rig.step();
      while (const PairLease lease = rig.pool.take_oldest()) ++(lease->right.empty() ? mono : paired);
      for (const SourceNote& note : rig.tend()) notes.push_back(note);
    }
    return paired;
  };
  EXPECT_EQ(run(1, 10, {}), 10U);
  EXPECT_EQ(run(11, 60, milliseconds(16)), 0U);  // 0.4 of a period, and 0.25 is the tolerance
  EXPECT_GE(mono, 35U);
  EXPECT_TRUE(says(notes, "cameras_do_not_fit"));
  EXPECT_NE(notes[0].text.find("16000 us"), std::string::npos) << notes[0].text;
  EXPECT_GE(run(61, 80, milliseconds(2)), 19U);
  EXPECT_TRUE(says(notes, "cameras_fit"));
  EXPECT_EQ(notes.size(), 2U);
}

TEST(StereoCameras, ARightCameraThatIsAPeriodLateFindsItsPartnersAfterALoss) {
  CameraRig rig(config(), false, 4, 12);
  rig.open();
  std::uint64_t mono = 0;
  std::uint64_t paired = 0;
  const auto run = [&](std::uint64_t first, std::uint64_t last) {
    for (std::uint64_t n = first; n <= last; ++n) {
      rig.advance(kFramePeriod);
      (void)rig.left.expose({.number = n, .time = kFramePeriod * static_cast<std::int64_t>(n)});
      const std::uint64_t before = n - 2;  // its frames take two periods longer
      (void)rig.right.expose({.number = before, .time = kFramePeriod * static_cast<std::int64_t>(before)});
      rig.step();
      while (const PairLease lease = rig.pool.take_oldest()) ++(lease->right.empty() ? mono : paired);
      (void)rig.tend();
    }
  };
  run(3, 30);
  EXPECT_EQ(mono, 0U);
  rig.right.lose();
  run(31, 80);
  EXPECT_GT(mono, 5U);
  paired = 0;
  run(81, 100);
  EXPECT_EQ(paired, 20U);
}

TEST(StereoCameras, OneCameraAloneIsAMonoSource) {
  StereoCameras::Config mono = config();
  mono.stereo = false;
  CameraRig rig(mono);
  rig.open();
  EXPECT_FALSE(rig.cameras->info().stereo);
  EXPECT_EQ(play(rig, 1, 20, Who::kLeft).size(), 20U);
  EXPECT_EQ(rig.right.opened(), 0);
  EXPECT_EQ(rig.cameras->figures().mono_pairs, 0U);
  EXPECT_TRUE(rig.tend().empty());
}

TEST(StereoCameras, AFrameLoopThatHoldsAllSlotsCostsPairsAndNoBuffer) {
  CameraRig rig(config(), false, 2, 5);
  rig.open();
  std::vector<PairLease> leases;
  for (std::uint64_t n = 1; n <= 2; ++n) {
    rig.advance(kFramePeriod);
    rig.expose_both(n);
    rig.step();
    leases.push_back(rig.pool.take_oldest());
  }
  for (std::uint64_t n = 3; n <= 20; ++n) {
    rig.advance(kFramePeriod);
    rig.expose_both(n);
    rig.step();
  }
  EXPECT_EQ(rig.pool.counters().starved, 18U);
  EXPECT_EQ(rig.left.held(), 2U);
  EXPECT_EQ(number_of(leases[0]->left), 1U);
  EXPECT_EQ(number_of(leases[1]->right), 2U);
  leases.clear();
  rig.step();
  EXPECT_EQ(rig.left.held() + rig.right.held(), 0U);
}

TEST(StereoCameras, ExposuresThatAPulseDidNotAskForOrOneMissedMakeNoWrongPair) {
  StereoCameras::Config pulsed = config();
  pulsed.pulse_delay = milliseconds(2);
  CameraRig rig(pulsed);
  test::ScriptedTrigger& trigger = rig.open_with_trigger();
  std::uint64_t pairs = 0;
  for (std::uint64_t n = 1; n <= 60; ++n) {
    rig.advance(kFramePeriod);
    const nanoseconds pulse = kFramePeriod * static_cast<std::int64_t>(n);
    trigger.give(n, pulse);
    const nanoseconds middle = pulse + milliseconds(2);
    (void)rig.left.expose({.number = n, .time = middle});
    if (n != 20) (void)rig.right.expose({.number = n, .time = middle});
    // A second exposure of 30, and one between 40 and 41.
    if (n == 30) (void)rig.right.expose({.number = 1030, .time = middle + milliseconds(5)});
    if (n == 40) (void)rig.left.expose({.number = 1040, .time = middle + milliseconds(20)});
    if (n == 40) (void)rig.right.expose({.number = 2040, .time = middle + milliseconds(20)});
    rig.step();
    // Found within two frames.
    if (n == 22) {
      EXPECT_EQ(rig.cameras->figures().cameras[1].missed, 1U);
    }
    if (n == 30) {
      EXPECT_EQ(rig.cameras->figures().cameras[1].doubled, 1U);
    }
    if (n == 40) {
      EXPECT_EQ(rig.cameras->figures().cameras[0].stray + rig.cameras->figures().cameras[1].stray, 2U);
    }
    while (const PairLease lease = rig.pool.take_oldest()) {
      EXPECT_EQ(number_of(lease->left), number_of(lease->right));
      EXPECT_LE(number_of(lease->left), 60U);
      ++pairs;
    }
  }
  EXPECT_EQ(pairs, 57U);  // two to learn that numbers agree, and the 20th
  EXPECT_EQ(rig.cameras->figures().pulses, 60U);
  EXPECT_EQ(rig.cameras->figures().cameras[0].missed, 0U);
  rig.step();
  EXPECT_EQ(rig.left.held() + rig.right.held(), 0U);
}

TEST(StereoCameras, WithoutPulsesFramesPairByTheirTimesAndItIsTold) {
  CameraRig rig(config());
  test::ScriptedTrigger& trigger = rig.open_with_trigger();
  std::vector<SourceNote> notes;
  std::uint64_t pairs = 0;
  for (std::uint64_t n = 1; n <= 120; ++n) {
    rig.advance(kFramePeriod);
    if (n < 40 || n >= 80) trigger.give(n, kFramePeriod * static_cast<std::int64_t>(n));
    rig.expose_both(n);
    rig.step();
    while (const PairLease lease = rig.pool.take_oldest()) {
      EXPECT_EQ(number_of(lease->left), number_of(lease->right));
      ++pairs;
    }
    for (const SourceNote& note : rig.tend()) notes.push_back(note);
    if (n == 79) {
      EXPECT_TRUE(rig.cameras->figures().trigger_silent);
    }
  }
  EXPECT_TRUE(says(notes, "trigger_silent"));
  EXPECT_TRUE(says(notes, "trigger_back"));
  EXPECT_EQ(notes.size(), 2U) << notes.back().text;
  EXPECT_FALSE(rig.cameras->figures().trigger_silent);
  EXPECT_GE(pairs, 120U - 2U - 14U - 2U);  // what was lost until it was found, and learning twice
}

TEST(StereoCameras, PulsesThatNeitherCameraAnswersAreTheirFault) {
  CameraRig rig(config());
  test::ScriptedTrigger& trigger = rig.open_with_trigger();
  for (std::uint64_t n = 1; n <= 100; ++n) {
    rig.advance(kFramePeriod);
    trigger.give(n, kFramePeriod * static_cast<std::int64_t>(n));
    if (n <= 10) rig.expose_both(n);
    rig.step();
    while (rig.pool.take_oldest()) {
    }
    (void)rig.tend();
  }
  EXPECT_GE(rig.left.opened(), 2);
  EXPECT_GE(rig.right.opened(), 2);
}

TEST(StereoCameras, PhaseAndDriftOfFreeRunningCamerasAreTold) {
  StereoCameras::Config free = config();
  free.tolerance = 0.5;
  CameraRig rig(free);
  rig.open();
  for (std::uint64_t n = 1; n <= 500; ++n) {
    rig.advance(kFramePeriod);
    rig.expose_both(n, milliseconds(3) + nanoseconds(4000) * static_cast<std::int64_t>(n));  // 100e-6
    rig.step();
    while (rig.pool.take_oldest()) {
    }
    (void)rig.tend();
  }
  const SourceFigures figures = rig.cameras->figures();
  ASSERT_TRUE(figures.phase && figures.drift);
  // 5 ms with the last frame; what is told is of the middle of the last whole second.
  EXPECT_NEAR(static_cast<double>(figures.phase->count()), 4.9e6, 0.1e6);
  EXPECT_NEAR(*figures.drift, 100e-6, 2e-6);
}

}  // namespace
}  // namespace stereotrack::capture
