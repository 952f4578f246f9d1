// Controls of a sensor as the kernel's own framework has them: vimc's, whose exposure, gain and black level show in the
// picture two frames later and whose blank rows make the period (modules/vimc-exposure.h).
#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "drivers/capture/stereo_cameras/stereo_cameras.hpp"
#include "drivers/capture/v4l2/controls.hpp"
#include "tests/system/board/capture/vivid.hpp"

namespace stereotrack::capture::v4l2::test {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using trigger::Side;

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr double kRowUs = (kWidth + 160) / 12.0;
constexpr double kStandardUs = 100 * kRowUs;  ///< at which the picture is the pattern as it is

/// The sensor that the raw video node of the nth vimc is linked with.
std::string sensor_path(int n) {
  for (const auto& entry : std::filesystem::directory_iterator("/sys/class/video4linux")) {
    std::ifstream file(entry.path() / "name");
    std::string name;
    std::getline(file, name);
    if (name != "Sensor A") continue;
    const std::string device = std::filesystem::canonical(entry.path() / "device").filename();
    if (device == "vimc." + std::to_string(n)) return "/dev/" + entry.path().filename().string();
  }
  return {};
}

double brightness(const Picture& picture) {
  double sum = 0;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) sum += picture.row(y)[x];
  }
  return sum / picture.width / picture.height;
}

class Controls : public VividTest {
 protected:
  void SetUp() override { make_standard(); }
  void TearDown() override { make_standard(); }
  static void make_standard() {
    for (const int n : {0, 1}) {
      const Other sensor(sensor_path(n));
      sensor.set("Show Information", 2);
      sensor.set("Vertical Blanking", 20);
      sensor.set("Exposure", 100);
      sensor.set("Analogue Gain", 16);
      sensor.set("Black Level", 0);
    }
    write_file("/sys/module/vimc/parameters/ppm", "0,0");
  }
  static Settings vimc(int n, double fps = 20) {
    Settings wanted;
    wanted.device = "/dev/v4l/by-path/platform-vimc." + std::to_string(n) + "-video-index0";
    wanted.format = "rggb8";
    wanted.width = kWidth;
    wanted.height = kHeight;
    wanted.fps = fps;
    wanted.readout_us = 0;
    return wanted;
  }
  static double brightness_of(Camera& camera) {
    const SensorFrame frame = nth_frame(camera, 4);
    const double value = brightness(camera.picture(frame.buffer));
    camera.give_back(frame.buffer);
    return value;
  }
  static std::int64_t value(int n, std::uint32_t id) {
    const Other sensor(sensor_path(n));
    return read_control(sensor.device(), id).value_or(-1);
  }
  /// Frames, after changes by another program, whose settings are not those that their picture shows.
  static int frames_told_wrongly(Camera& camera, double pattern) {
    const Other sensor(sensor_path(0));
    int wrong = 0;
    SensorFrame frame;
    for (int i = 1; i <= 48; ++i) {
      EXPECT_EQ(wait_take(camera, frame), Camera::Take::kFrame);
      const double shown = brightness(camera.picture(frame.buffer)) / pattern;
      const double told =
          static_cast<double>(frame.settings.exposure->count()) / 1e3 / kStandardUs * *frame.settings.gain;
      if (std::abs(shown - told) > 0.05) ++wrong;
      camera.give_back(frame.buffer);
      // Under what the pattern has, so that nothing is cut off at white.
      if (i % 6 == 0) sensor.set(i % 12 == 0 ? "Analogue Gain" : "Exposure", i % 12 == 0 ? 16 + i % 24 : 20 + i / 2);
    }
    return wrong;
  }
};

TEST_F(Controls, ExposureGainAndBlackLevelAreSetReadBackAndShowInThePicture) {
  double pattern = 0;
  {
    const auto camera = started(vimc(0));
    pattern = brightness_of(*camera);
    ASSERT_GT(pattern, 50);
  }
  struct Wish {
    double exposure_us;
    double gain;
    int black;
    double brightness;
  };
  for (const Wish& wish : {Wish{kStandardUs / 2, 1, 0, pattern / 2}, Wish{kStandardUs / 4, 2, 0, pattern / 2},
                           Wish{kStandardUs / 4, 1, 32, pattern / 4 + 32}}) {
    Settings wanted = vimc(0);
    wanted.exposure_us = wish.exposure_us;
    wanted.gain = wish.gain;
    wanted.black_level = wish.black;
    std::vector<std::string> notes;
    const auto camera = started(wanted, &notes);
    EXPECT_THAT(notes, IsEmpty()) << notes.front();
    EXPECT_EQ(value(0, V4L2_CID_EXPOSURE), std::lround(wish.exposure_us / kRowUs));
    EXPECT_EQ(value(0, V4L2_CID_ANALOGUE_GAIN), 16 * wish.gain);
    EXPECT_EQ(value(0, V4L2_CID_BLACK_LEVEL), wish.black);
    const SensorFrame frame = nth_frame(*camera, 4);
    EXPECT_NEAR(static_cast<double>(frame.settings.exposure.value_or(nanoseconds(0)).count()), wish.exposure_us * 1e3,
                1.0);
    EXPECT_EQ(frame.settings.gain, static_cast<float>(wish.gain));
    EXPECT_NEAR(brightness(camera->picture(frame.buffer)), wish.brightness, 2.0);
  }
}

TEST_F(Controls, WhatTheKernelClampsOrRoundsIsTold) {
  Settings wanted = vimc(0);
  wanted.exposure_us = 1e6;
  wanted.gain = 100;
  wanted.black_level = 30;
  std::vector<std::string> notes;
  const auto camera = started(wanted, &notes);
  // 20 frames a second are 1250 rows, of which the last four are not exposed.
  EXPECT_EQ(value(0, V4L2_CID_EXPOSURE), 1246);
  EXPECT_EQ(value(0, V4L2_CID_ANALOGUE_GAIN), 256);
  EXPECT_EQ(value(0, V4L2_CID_BLACK_LEVEL), 32);
  EXPECT_THAT(notes, AllOf(Contains(HasSubstr("exposure 1000000 us: the driver made it 49840 us, its range is 40 us to "
                                              "49840 us")),
                           Contains(HasSubstr("gain 100: the driver made it 16")),
                           Contains(HasSubstr("black level 30: the driver made it 32, its range is 0 to 64"))));
  const SensorFrame frame = nth_frame(*camera, 4);
  EXPECT_EQ(frame.settings.exposure, nanoseconds(49'840'000));
  EXPECT_EQ(frame.settings.gain, 16.0F);
  const Picture picture = camera->picture(frame.buffer);
  EXPECT_EQ(*std::min_element(picture.row(9), picture.row(9) + kWidth), 32);
  EXPECT_EQ(*std::max_element(picture.row(9), picture.row(9) + kWidth), 255);
}

TEST_F(Controls, TheyAreTheSameOnBothSensors) {
  std::array<std::unique_ptr<Camera>, 2> cameras;
  for (const int n : {0, 1}) {
    Settings wanted = vimc(n, 10);
    wanted.exposure_us = kStandardUs * 0.7;
    wanted.gain = 1.25;
    wanted.black_level = 16;
    cameras.at(n) = started(wanted);
  }
  std::array<double, 2> light{};
  std::array<SensorSettings, 2> settings;
  for (const int n : {0, 1}) {
    const SensorFrame frame = nth_frame(*cameras.at(n), 4);
    settings.at(n) = frame.settings;
    light.at(n) = brightness(cameras.at(n)->picture(frame.buffer));
  }
  EXPECT_EQ(settings[0].exposure, microseconds(2800));
  EXPECT_EQ(settings[0].exposure, settings[1].exposure);
  EXPECT_EQ(settings[0].gain, 1.25F);
  EXPECT_EQ(settings[0].gain, settings[1].gain);
  EXPECT_EQ(light[0], light[1]);
  for (const std::uint32_t id : {V4L2_CID_EXPOSURE, V4L2_CID_ANALOGUE_GAIN, V4L2_CID_BLACK_LEVEL, V4L2_CID_VBLANK}) {
    EXPECT_EQ(value(0, id), value(1, id)) << id;
  }
}

TEST_F(Controls, EachFrameIsToldWithWhatItWasExposedWithByItsNumber) {
  double pattern = 0;
  {
    const auto camera = started(vimc(0));
    pattern = brightness_of(*camera);
  }
  for (const int delay : {2, 1, 3}) {
    make_standard();
    Settings wanted = vimc(0);
    wanted.control_delay_frames = delay;
    const auto camera = started(wanted);
    const int wrong = frames_told_wrongly(*camera, pattern);
    if (delay == 2) {
      EXPECT_EQ(wrong, 0);
    } else {
      EXPECT_GE(wrong, 5) << "a delay of " << delay << " is another sensor's";  // each change that shows, one frame
    }
  }
}

TEST_F(Controls, TheFrameRateIsMadeOfBlankRowsAndFollowsThemWhileItStreams) {
  std::vector<std::string> notes;
  const auto camera = started(vimc(0, 25), &notes);
  EXPECT_THAT(notes, Not(Contains(HasSubstr("frame rate"))));
  EXPECT_EQ(camera->info().period, milliseconds(40));
  EXPECT_EQ(value(0, V4L2_CID_VBLANK), 1000 - kHeight);
  const auto period = [&] {
    SensorFrame frame = nth_frame(*camera, 3);
    const CaptureTime first = frame.mid_exposure;
    const std::uint64_t from = frame.sequence;
    camera->give_back(frame.buffer);
    frame = nth_frame(*camera, 10);
    camera->give_back(frame.buffer);
    return (frame.mid_exposure - first) / static_cast<std::int64_t>(frame.sequence - from);
  };
  EXPECT_EQ(period(), milliseconds(40));
  const auto range = camera->period_range();
  ASSERT_TRUE(range.has_value());
  EXPECT_EQ(range->quantum, microseconds(40));
  EXPECT_EQ(camera->set_period(microseconds(41'010)), microseconds(41'000));
  EXPECT_EQ(period(), microseconds(41'000));
  EXPECT_EQ(value(0, V4L2_CID_VBLANK), 1025 - kHeight);
  EXPECT_EQ(camera->set_period(std::chrono::seconds(10)), range->most);
  EXPECT_EQ(camera->set_period(milliseconds(40)), milliseconds(40));
}

/// Two vimc cameras as the daemon has them.
struct Pairs {
  explicit Pairs(const StereoCameras::Config& config, const std::function<Settings(int)>& settings)
      : cameras([settings](Side side) { return open(settings(side == Side::kLeft ? 0 : 1)); }, config) {}

  /// Each pair that comes within the time, with what is told of it.
  template <class Each>
  void run(std::chrono::seconds time, Each&& each) {
    const auto end = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < end) {
      const auto now = std::chrono::steady_clock::now().time_since_epoch();
      (void)cameras.step(outlet, MonotonicTime(now + milliseconds(50)));
      cameras.tend(notes);
      PairNotice notice;
      while (const PairLease lease = pool.take_oldest()) {
        while (waiting.pop(notice) && notice.ordinal != lease->ordinal) {
        }
        if (!each(*lease, notice)) return;
      }
    }
  }

  FramePool pool{4};
  PairOutlet::Notices waiting;
  Doorbell bell;
  PairOutlet outlet{pool, waiting, bell};
  std::vector<SourceNote> notes;
  StereoCameras cameras;
};

TEST_F(Controls, APairBearsWhatItsOwnTwoFramesWereExposedWith) {
  double pattern = 0;
  {
    const auto camera = started(vimc(0));
    pattern = brightness_of(*camera);
  }
  StereoCameras::Config config;
  config.tolerance = 0.5;
  Pairs pairs(config, [](int n) { return vimc(n, 10); });
  const Other left(sensor_path(0));
  const Other right(sensor_path(1));
  int seen = 0;
  int changed = 0;
  pairs.run(std::chrono::seconds(60), [&](const FramePair& pair, const PairNotice& notice) {
    if (pair.right.empty()) return true;
    for (const auto& [picture, told] : {std::pair(pair.left, notice.left), std::pair(pair.right, notice.right)}) {
      const double exposure = static_cast<double>(told.exposure.value_or(nanoseconds(0)).count()) / 1e3 / kStandardUs;
      EXPECT_NEAR(brightness(picture) / pattern, exposure, 0.05) << "pair " << pair.ordinal;
    }
    if (notice.left.exposure != notice.right.exposure) ++changed;
    // The left one first, so that pairs lie between whose two frames were exposed differently.
    if (++seen % 6 == 0) (seen % 12 == 0 ? right : left).set("Exposure", 40 + seen / 12 * 20);
    return seen < 36;
  });
  EXPECT_EQ(seen, 36);
  EXPECT_GE(changed, 6);
}

TEST_F(Controls, TwoFreeRunningCamerasAreHeldTogetherByBlankRows) {
  write_file("/sys/module/vimc/parameters/ppm", "0,200");
  StereoCameras::Config config;
  config.tolerance = 0.5;
  config.steer = true;
  Pairs pairs(config, [](int n) { return vimc(n, 20); });
  {
    // 300 rows of 40 us more for a frame or two: so far apart they begin.
    const Other right(sensor_path(1));
    const std::int64_t rows = value(1, V4L2_CID_VBLANK);
    right.set("Vertical Blanking", rows + 300);
    std::this_thread::sleep_for(milliseconds(50));
    right.set("Vertical Blanking", rows);
  }
  nanoseconds before{0};
  int seen_before = 0;
  pairs.run(std::chrono::seconds(90), [&](const FramePair& pair, const PairNotice&) {
    if (pair.skew && seen_before++ == 10) before = *pair.skew;
    return pairs.cameras.figures().steering != Steering::kLocked;
  });
  ASSERT_EQ(pairs.cameras.figures().steering, Steering::kLocked);
  EXPECT_GT(std::chrono::abs(before), milliseconds(5));
  nanoseconds largest{0};
  int seen = 0;
  pairs.run(std::chrono::seconds(60), [&](const FramePair& pair, const PairNotice&) {
    if (pair.skew) largest = std::max(largest, nanoseconds(std::chrono::abs(*pair.skew)));
    return ++seen > 0;
  });
  EXPECT_GT(seen, 1000);
  EXPECT_LT(largest, microseconds(500));
  EXPECT_EQ(pairs.cameras.figures().steering, Steering::kLocked);
  for (const SourceNote& note : pairs.notes) std::printf("# %s\n", note.text.c_str());
  std::printf("# first apart %.3f ms, then at most %.3f ms\n", static_cast<double>(before.count()) * 1e-6,
              static_cast<double>(largest.count()) * 1e-6);
}

}  // namespace
}  // namespace stereotrack::capture::v4l2::test
