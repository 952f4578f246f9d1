#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <thread>

#include "drivers/capture/libcamera/libcamera.hpp"
#include "drivers/capture/stereo_cameras/stereo_cameras.hpp"
#include "tests/unit/libcamera/support.hpp"

namespace stereotrack::capture::libcamera {
namespace {

using namespace std::chrono_literals;
using std::chrono::nanoseconds;
using ::testing::HasSubstr;
using Take = Camera::Take;
using test::monotonic_now;

class LibcameraCamera : public test::Scripted {
 protected:
  /// A frame whose exposure began `age` ago, by a clock that is `ahead` of the monotonic one.
  static LibcameraFrame frame(std::uint32_t sequence, nanoseconds age = 20ms, nanoseconds ahead = 0ns) {
    LibcameraFrame made{};
    made.sequence = sequence;
    made.known = kLibcameraKnowsStart;
    made.completed_time = monotonic_now().count();
    made.sensor_time = made.completed_time - age.count() + ahead.count();
    return made;
  }
  std::unique_ptr<Camera> started(const Settings& wish) {
    auto camera = open(wish);
    camera->start();
    return camera;
  }
};

TEST_F(LibcameraCamera, IsFoundByItsIdItsPlaceAndWhatOnlyItsIdHas) {
  EXPECT_EQ(open(settings("/base/i2c@1/imx219@10"))->info().name, "/base/i2c@1/imx219@10");
  EXPECT_EQ(open(settings("1"))->info().name, "1 (/base/i2c@1/imx219@10)");
  EXPECT_EQ(open(settings("i2c@0"))->info().name, "i2c@0 (/base/i2c@0/imx219@10)");
  EXPECT_EQ(open(settings("0"))->info().model, "imx219, libcamera v9.1-scripted");
  EXPECT_THAT(refusal(settings("imx219")), HasSubstr("camera imx219: libcamera has several of that name"));
  EXPECT_THAT(refusal(settings("imx477")), HasSubstr("libcamera has none of that name; it knows 0: /base/i2c@0"));
  EXPECT_THAT(refusal(settings("2")), HasSubstr("libcamera has no camera of that place"));
  script_->cameras = 0;
  EXPECT_THAT(refusal(settings("0")), HasSubstr("it knows none: is one connected"));
}

TEST_F(LibcameraCamera, WhatLibcameraComplainsOfIsToldWhereACameraIsMissed) {
  std::strcpy(script_->complaint, "V4L2 cannot open /dev/media0");
  EXPECT_THAT(refusal(settings("imx477")), HasSubstr("(imx219), and complains of \"V4L2 cannot open /dev/media0\""));
  EXPECT_TRUE(list_cameras().problems.empty());
  script_->cameras = 0;
  EXPECT_THAT(refusal(settings("0")), HasSubstr("knows none, and complains of \"V4L2 cannot open /dev/media0\": is"));
  ASSERT_EQ(list_cameras().problems.size(), 1U);
  EXPECT_THAT(list_cameras().problems[0], HasSubstr("cannot open /dev/media0"));
}

TEST_F(LibcameraCamera, AsksForWhatIsWanted) {
  Settings wish = settings("0");
  wish.exposure_us = 4000;
  wish.gain = 2;
  wish.buffers = 7;
  std::vector<std::string> notes;
  const auto camera = open(wish, &notes);
  const LibcameraWish& asked = script_->eyes[0].wish;
  EXPECT_EQ(asked.fourcc, 0x20203852U);  // auto: grey first
  EXPECT_EQ(asked.is_raw, 1U);
  EXPECT_EQ(asked.width, 640);
  EXPECT_EQ(asked.height, 480);
  EXPECT_EQ(asked.buffers, 7U);
  EXPECT_EQ(asked.duration, 33'333'333);
  EXPECT_EQ(asked.exposure, 4'000'000);
  EXPECT_EQ(asked.gain, 2.0F);
  EXPECT_TRUE(notes.empty()) << notes.front();
  EXPECT_EQ(camera->info().format, PixelFormat::kGrey8);
  EXPECT_EQ(camera->info().period, nanoseconds(33'333'333));
  EXPECT_EQ(camera->info().buffers, 7U);
  EXPECT_FALSE(camera->info().counts_lost);
}

TEST_F(LibcameraCamera, AutoTakesAFormatThatHasTheSize) {
  Settings wish = settings("0");
  wish.width = 320;
  wish.height = 240;
  EXPECT_EQ(open(wish)->info().format, PixelFormat::kNv12);
  wish.format = "grey8";
  script_->eyes[0].adjusts = 1;
  EXPECT_THAT(refusal(wish), HasSubstr("cannot deliver 320x240 grey8, libcamera would make 160x240 grey8 of it; it "
                                       "offers 640x480, 1280x800"));
  wish.format = "rggb10";
  EXPECT_THAT(refusal(wish), HasSubstr("has no format rggb10; it has nv12, pBAA/0x123 (of no use), grey8"));
}

TEST_F(LibcameraCamera, ThatClampsOrLacksAControlIsTold) {
  Settings wish = settings("0");
  wish.exposure_us = 30'000;
  wish.gain = 20;
  wish.fps = 200;
  std::vector<std::string> notes;
  EXPECT_EQ(open(wish, &notes)->info().period, 10ms);
  ASSERT_EQ(notes.size(), 3U);
  EXPECT_THAT(notes[0], HasSubstr("camera 0 (/base/i2c@0/imx219@10): delivers 100 frames/s, not 200"));
  EXPECT_THAT(notes[1], HasSubstr("exposure is 2e+04 us, not 3e+04 us"));
  EXPECT_THAT(notes[2], HasSubstr("gain is 8, not 20"));

  script_->eyes[0].has_no_controls = script_->eyes[0].holds_no_rate = 1;
  script_->eyes[0].buffers = 4;
  notes.clear();
  EXPECT_EQ(open(wish, &notes)->info().period, 5ms);
  ASSERT_EQ(notes.size(), 4U);
  EXPECT_THAT(notes[0], HasSubstr("cannot hold it to a frame rate: it is taken to deliver 200 frames/s"));
  EXPECT_THAT(notes[1], HasSubstr("exposure cannot be set"));
  EXPECT_THAT(notes[2], HasSubstr("gain cannot be set"));
  EXPECT_THAT(notes[3], HasSubstr("4 buffers, not 8"));
  wish.fps = 0;
  EXPECT_THAT(refusal(wish), HasSubstr("set it (fps)"));
}

TEST_F(LibcameraCamera, ThatIsBusyOrDoesNotStartSaysSoAndLeavesNothingOpen) {
  script_->eyes[0].refuses_open = 1;
  EXPECT_THAT(refusal(settings("0")), HasSubstr("another program has it"));
  script_->eyes[0].refuses_open = 0;
  script_->eyes[0].refuses_start = 1;
  try {
    open(settings("0"))->start();
    FAIL() << "it started";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "camera 0 (/base/i2c@0/imx219@10): does not start to stream (scripted)");
  }
  EXPECT_EQ(script_->eyes[0].is_open, 0);
  EXPECT_EQ(script_->managers_opened, 2);
  EXPECT_EQ(script_->managers_closed, 2);
}

TEST_F(LibcameraCamera, BothShareOneManagerWhichTheLastOneCloses) {
  auto left = open(settings("0"));
  auto right = open(settings("1"));
  EXPECT_EQ(list_cameras().cameras.size(), 2U);
  EXPECT_EQ(script_->managers_opened, 1);
  left.reset();
  left = open(settings("0"));
  EXPECT_EQ(script_->managers_opened, 1);
  left.reset();
  EXPECT_EQ(script_->managers_closed, 0);
  right.reset();
  EXPECT_EQ(script_->managers_closed, 1);
}

TEST_F(LibcameraCamera, OneThatCameLateMakesTheOthersEndSoThatLibcameraCanLookAnew) {
  script_->cameras = 1;
  auto left = started(settings("0"));
  EXPECT_EQ(refusal(settings("1")).find("plugged in"), std::string::npos);
  SensorFrame at;
  EXPECT_EQ(left->take(at), Take::kNothing);  // nothing was: it goes on
  script_->plugged_in = 1;
  EXPECT_THAT(refusal(settings("1")), HasSubstr("no camera of that place; it knows 0: /base/i2c@0/imx219@10 (imx219); "
                                                "devices were plugged in meanwhile"));
  EXPECT_EQ(left->take(at), Take::kLost);
  left.reset();
  script_->cameras = 2;
  left = open(settings("0"));
  EXPECT_EQ(open(settings("1"))->info().width, 640);
  EXPECT_EQ(script_->managers_opened, 2);
}

TEST_F(LibcameraCamera, ThatIsGoneIsToldAndNotListed) {
  script_->eyes[1].is_gone = 1;
  EXPECT_EQ(refusal(settings("1")),
            "camera 1 (/base/i2c@1/imx219@10): is not connected any more: check its plug and power");
  EXPECT_EQ(script_->eyes[1].wish.width, 0);  // it was left alone
  ASSERT_EQ(list_cameras().cameras.size(), 1U);
  EXPECT_EQ(list_cameras().cameras[0].id, "/base/i2c@0/imx219@10");
}

TEST_F(LibcameraCamera, FramesAreLeasedAndGoBackInAnyOrder) {
  Settings wish = settings("0");
  wish.buffers = 4;
  script_->eyes[0].stride = 704;
  const auto camera = started(wish);
  SensorFrame at;
  EXPECT_EQ(camera->take(at), Take::kNothing);
  EXPECT_FALSE(is_readable(*camera));
  for (std::uint32_t n = 1; n <= 4; ++n) ASSERT_GE(script_->expose(0, frame(n), static_cast<std::uint8_t>(n)), 0);
  EXPECT_LT(script_->expose(0, frame(5), 5), 0);  // all are ours or wait for us
  std::vector<std::uint32_t> leased;
  for (std::uint32_t n = 1; n <= 4; ++n) {
    EXPECT_TRUE(is_readable(*camera));
    ASSERT_EQ(camera->take(at), Take::kFrame);
    EXPECT_EQ(at.sequence, n);
    EXPECT_FALSE(at.damaged);
    const Picture picture = camera->picture(at.buffer);
    EXPECT_EQ(picture.stride_bytes, 704);
    EXPECT_EQ(picture.row(479)[639], n);
    leased.push_back(at.buffer);
  }
  camera->give_back(leased[2]);
  EXPECT_EQ(script_->expose(0, frame(7), 7), static_cast<int>(leased[2]));
  ASSERT_EQ(camera->take(at), Take::kFrame);
  EXPECT_EQ(camera->picture(leased[0]).row(0)[0], 1);  // untouched
  camera->give_back(99);                               // is nobody's
  EXPECT_EQ(script_->eyes[0].returned, 1U);
  EXPECT_EQ(camera->counters().frames, 5U);
  EXPECT_EQ(camera->counters().lost, 2U);  // 5 and 6
  EXPECT_EQ(camera->counters().late, 2U);  // nobody had a buffer for them
  for (const std::size_t i : {0U, 1U}) camera->give_back(leased[i]);
  for (const std::uint32_t n : {8U, 10U}) {
    ASSERT_GE(script_->expose(0, frame(n), static_cast<std::uint8_t>(n)), 0);
    ASSERT_EQ(camera->take(at), Take::kFrame);
  }
  EXPECT_EQ(camera->counters().lost, 3U);
  EXPECT_EQ(camera->counters().late, 2U);  // there was one for 9
}

TEST_F(LibcameraCamera, ExposureAndGainInForceComeWithTheFrameAndTheMiddleOfItIsItsTime) {
  Settings wish = settings("0");
  wish.exposure_us = 4000;
  const auto camera = started(wish);
  LibcameraFrame told = frame(1);
  ASSERT_GE(script_->expose(0, told, 0), 0);
  SensorFrame at;
  ASSERT_EQ(camera->take(at), Take::kFrame);
  EXPECT_EQ(at.settings.exposure, nanoseconds(4ms));  // as asked: the frame does not say
  EXPECT_FALSE(at.settings.gain.has_value());
  EXPECT_EQ(at.mid_exposure.time_since_epoch(), nanoseconds(told.sensor_time) + 2ms);

  told = frame(2);
  told.known |= kLibcameraKnowsExposure | kLibcameraKnowsGain;
  told.exposure = 6'000'000;
  told.gain = 1.5F;
  ASSERT_GE(script_->expose(0, told, 0), 0);
  ASSERT_EQ(camera->take(at), Take::kFrame);
  EXPECT_EQ(at.settings.exposure, nanoseconds(6ms));
  EXPECT_EQ(at.settings.gain, 1.5F);
  EXPECT_EQ(at.mid_exposure.time_since_epoch(), nanoseconds(told.sensor_time) + 3ms);
}

TEST_F(LibcameraCamera, ItsClockIsFoundWhateverItsOffset) {
  for (const nanoseconds ahead : {nanoseconds(0), nanoseconds(7200s), nanoseconds(-30s)}) {
    Settings wish = settings("0");
    wish.readout_us = 15'000;
    const auto camera = started(wish);
    SensorFrame at;
    for (std::uint32_t n = 1; n <= 10; ++n) {
      // The quickest one takes its readout, the others longer.
      ASSERT_GE(script_->expose(0, frame(n, n == 5 ? 15ms : 25ms, ahead), 0), 0);
      ASSERT_EQ(camera->take(at), Take::kFrame);
      camera->give_back(at.buffer);
      std::this_thread::sleep_for(12ms);  // stamps advance
    }
    EXPECT_EQ(camera->clock_map().offset(), -ahead);
    EXPECT_EQ(camera->counters().steps, 0U);
  }
}

TEST_F(LibcameraCamera, WithoutAStartOfExposureTheDriversStampOrTheArrivalCounts) {
  Settings wish = settings("0");
  wish.readout_us = 15'000;
  wish.exposure_us = 4000;
  const auto camera = started(wish);
  LibcameraFrame told = frame(1);
  told.known = kLibcameraKnowsStamp;
  told.buffer_time = told.completed_time - 1'000'000;
  ASSERT_GE(script_->expose(0, told, 0), 0);
  SensorFrame at;
  ASSERT_EQ(camera->take(at), Take::kFrame);
  EXPECT_EQ(at.mid_exposure.time_since_epoch(), nanoseconds(told.buffer_time) - 17ms);
  told = frame(2);
  told.known = 0;
  ASSERT_GE(script_->expose(0, told, 0), 0);
  ASSERT_EQ(camera->take(at), Take::kFrame);
  EXPECT_EQ(at.mid_exposure.time_since_epoch(), nanoseconds(told.completed_time) - 17ms);
  EXPECT_EQ(camera->clock_map().offset(), 0ns);
}

TEST_F(LibcameraCamera, FramesThatFailedOrAreShortAreDamaged) {
  const auto camera = started(settings("0"));
  LibcameraFrame told = frame(1);
  told.is_damaged = 1;
  ASSERT_GE(script_->expose(0, told, 0), 0);
  told = frame(2);
  told.bytes = 640 * 480 - 1;
  ASSERT_GE(script_->expose(0, told, 0), 0);
  told = frame(3);
  told.bytes = 640 * 480;
  ASSERT_GE(script_->expose(0, told, 0), 0);
  SensorFrame at;
  for (const bool damaged : {true, true, false}) {
    ASSERT_EQ(camera->take(at), Take::kFrame);
    EXPECT_EQ(at.damaged, damaged) << at.sequence;
  }
  EXPECT_EQ(camera->counters().damaged, 2U);
}

TEST_F(LibcameraCamera, ThatIsLostSaysWhyAndStaysLost) {
  const auto camera = started(settings("0"));
  ASSERT_GE(script_->expose(0, frame(1), 0), 0);
  script_->lose(0);
  SensorFrame at;
  ASSERT_EQ(camera->take(at), Take::kFrame);
  EXPECT_EQ(camera->failure(), "");
  EXPECT_TRUE(is_readable(*camera));
  EXPECT_EQ(camera->take(at), Take::kLost);
  EXPECT_EQ(camera->take(at), Take::kLost);
  EXPECT_EQ(
      camera->failure(),
      "camera 0 (/base/i2c@0/imx219@10) (imx219, libcamera v9.1-scripted): after 1 frames it was unplugged: check its "
      "plug and power");
  camera->give_back(at.buffer);  // of a stream that is over: nothing
  EXPECT_EQ(script_->eyes[0].returned, 0U);
}

TEST_F(LibcameraCamera, ABufferThatThereIsNotIsTheModulesFault) {
  const auto camera = started(settings("0"));
  LibcameraFrame told = frame(1);
  told.buffer = 8;
  script_->expose_raw(0, told);
  SensorFrame at;
  EXPECT_EQ(camera->take(at), Take::kLost);
  EXPECT_THAT(camera->failure(), HasSubstr("has a buffer that there is not"));
}

TEST_F(LibcameraCamera, PlanesThatLieApartAndRowsThatAreTooNearAreRefused) {
  Settings wish = settings("0");
  wish.format = "nv12";
  EXPECT_EQ(open(wish)->info().format, PixelFormat::kNv12);
  script_->eyes[0].splits_planes = 1;
  EXPECT_THAT(refusal(wish), HasSubstr("brightness and colours of its pictures lie apart"));
  script_->eyes[0].stride = 600;
  EXPECT_THAT(refusal(wish), HasSubstr("its rows are 600 bytes apart and 640 long"));
  EXPECT_EQ(script_->eyes[0].is_open, 0);
}

TEST_F(LibcameraCamera, ListTellsWhatEachCanDo) {
  const Listing listing = list_cameras();
  EXPECT_EQ(listing.module, "libcamera v9.1-scripted, " + (folder_ / "stereotrack-libcamera-9.1.so").string());
  EXPECT_TRUE(listing.problems.empty());
  ASSERT_EQ(listing.cameras.size(), 2U);
  const CameraFacts& facts = listing.cameras[1];
  EXPECT_EQ(facts.id, "/base/i2c@1/imx219@10");
  EXPECT_EQ(facts.model, "imx219");
  EXPECT_EQ(facts.location, "external");
  ASSERT_EQ(facts.formats.size(), 3U);
  EXPECT_EQ(facts.formats[0].name, "nv12");
  EXPECT_EQ(facts.formats[0].sizes[0].max_width, 1920);
  EXPECT_EQ(facts.formats[1].name, "");
  EXPECT_EQ(facts.formats[2].sizes.size(), 2U);
  ASSERT_TRUE(facts.exposure_us && facts.gain && facts.fps);
  EXPECT_EQ(facts.exposure_us->most, 20'000);
  EXPECT_EQ(facts.gain->most, 8);
  EXPECT_EQ(facts.fps->least, 1);
  EXPECT_EQ(facts.fps->most, 100);
  EXPECT_EQ(script_->managers_closed, 1);

  script_->cameras = 0;
  (void)add("10.0", "other_version");
  const Listing none = list_cameras();
  EXPECT_FALSE(none.module.empty());
  ASSERT_EQ(none.problems.size(), 2U);
  EXPECT_THAT(none.problems[0], HasSubstr("interface version 3"));
  EXPECT_THAT(none.problems[1], HasSubstr("it knows none"));
}

// ---- Pairs of two of them, one of which stalls: libcamera does not tell.

struct Pairs {
  FramePool pool{4};
  PairOutlet::Notices notices;
  Doorbell bell;
  PairOutlet outlet{pool, notices, bell};
};

TEST_F(LibcameraCamera, ThatStopsSilentlyIsNoticedByTheTimeoutAndOpenedAnew) {
  StereoCameras::Config config;
  config.timeout = 200ms;
  config.back_off_first = 1ms;
  config.tolerance = 0.5;
  StereoCameras cameras([](trigger::Side side) { return open(settings(side == trigger::Side::kLeft ? "0" : "1")); },
                        config);
  Pairs behind;
  std::vector<SourceNote> notes;
  std::uint32_t number = 0;
  // Exposes on the cameras that are said to live until `done`, half a minute at most.
  const auto run = [&](bool right_lives, const auto& done) {
    for (const nanoseconds end = monotonic_now() + 30s; !done();) {
      if (monotonic_now() > end) return false;
      ++number;
      const LibcameraFrame told = frame(number);
      (void)script_->expose(0, told, 1);
      if (right_lives) (void)script_->expose(1, told, 2);
      (void)cameras.step(behind.outlet, MonotonicTime(monotonic_now() + 30ms));
      (void)cameras.step(behind.outlet, MonotonicTime(monotonic_now() + 3ms));
      cameras.tend(notes);
      (void)behind.pool.take_newest();
    }
    return true;
  };
  ASSERT_TRUE(run(true, [&] { return cameras.figures().paired > 5; }));
  ASSERT_TRUE(run(false, [&] { return cameras.figures().cameras[1].silent; }));
  EXPECT_EQ(cameras.figures().cameras[1].losses, 1U);
  ASSERT_TRUE(run(false, [&] { return cameras.figures().cameras[1].reopened > 0; }));
  ASSERT_FALSE(notes.empty());
  EXPECT_STREQ(notes.front().cause, "camera_silent");
  EXPECT_THAT(notes.front().text, HasSubstr("right camera: 1 (/base/i2c@1/imx219@10): no frame for 0."));
  const std::uint64_t paired = cameras.figures().paired;
  ASSERT_TRUE(run(true, [&] { return cameras.figures().paired > paired + 5; }));
  EXPECT_EQ(script_->managers_opened, 1);
  EXPECT_GT(cameras.figures().mono_pairs, 0U);
}

}  // namespace
}  // namespace stereotrack::capture::libcamera
