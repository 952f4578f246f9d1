// Frames as they come: times, counts, controls in force, leases.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "pipeline/core/checksum.hpp"
#include "tests/rt/heap_watch.hpp"
#include "tests/system/board/capture/vivid.hpp"

namespace stereotrack::capture::v4l2::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using namespace std::chrono_literals;

class Frames : public VividTest {
 protected:
  struct Seen {
    std::vector<SensorFrame> frames;
    [[nodiscard]] double mean_period_ms() const {
      const auto span = frames.back().mid_exposure - frames.front().mid_exposure;
      const auto count = static_cast<double>(frames.back().sequence - frames.front().sequence);
      return static_cast<double>(span.count()) * 1e-6 / count;
    }
    [[nodiscard]] double mean_age_ms() const {
      double sum = 0;
      for (const SensorFrame& frame : frames) {
        sum += static_cast<double>((frame.arrived.time_since_epoch() - frame.mid_exposure.time_since_epoch()).count());
      }
      return sum * 1e-6 / static_cast<double>(frames.size());
    }
  };
  static Seen watch(Camera& camera, int count) {
    Seen seen;
    for (int i = 0; i < count; ++i) {
      seen.frames.push_back(nth_frame(camera));
      camera.give_back(seen.frames.back().buffer);
    }
    return seen;
  }
};

TEST_F(Frames, ComeAtTheRateThatWasAsked) {
  for (const double fps : {50.0, 25.0, 10.0}) {
    Settings wanted = settings();
    wanted.fps = fps;
    const auto camera = started(wanted);
    const Seen seen = watch(*camera, 20);
    EXPECT_NEAR(seen.mean_period_ms(), 1000 / fps, 10 / fps) << fps;
    EXPECT_NEAR(static_cast<double>(camera->info().period.count()) * 1e-6, 1000 / fps, 1e-3);
  }
}

TEST_F(Frames, ComeInOrderAndWhatIsMissingIsCounted) {
  Other(kLeft).set("Timestamp Source", 1);  // its ends of frames lie in the future when they come
  const auto camera = started(settings());
  const Seen seen = watch(*camera, 40);
  std::uint64_t missing = 0;
  for (std::size_t i = 1; i < seen.frames.size(); ++i) {
    missing += seen.frames[i].sequence - seen.frames[i - 1].sequence - 1;
    EXPECT_GT(seen.frames[i].mid_exposure, seen.frames[i - 1].mid_exposure);
    EXPECT_GE(seen.frames[i].arrived, camera->clock_map().to_monotonic(seen.frames[i].mid_exposure));
  }
  EXPECT_EQ(camera->counters().frames, 40U);
  EXPECT_EQ(camera->counters().lost, missing);
  EXPECT_LE(missing, 2U);  // its thread drops a frame where the emulated processor was late
  EXPECT_EQ(camera->counters().damaged, 0U);
  EXPECT_EQ(camera->counters().steps, 0U);
}

TEST_F(Frames, ThatTheDriverDropsAreCountedAsLost) {
  const Other other(kLeft);
  const auto camera = started(settings());
  (void)watch(*camera, 1);
  other.set("Percentage of Dropped Buffers", 40);
  const Seen seen = watch(*camera, 60);
  std::uint64_t gaps = 0;
  for (std::size_t i = 1; i < seen.frames.size(); ++i) {
    gaps += seen.frames[i].sequence - seen.frames[i - 1].sequence - 1;
  }
  EXPECT_GT(gaps, 10U);
  // Between the first frame and those that were watched, too.
  EXPECT_GE(camera->counters().lost, gaps);
  EXPECT_LE(camera->counters().lost, gaps + 10);
  EXPECT_NEAR(seen.mean_period_ms(), 20, 0.5);
}

TEST_F(Frames, GoOnBeingCountedWhenTheCountComesRound) {
  Other(kLeft).set("Wrap Sequence Number", 1);
  Settings wanted = settings();
  const auto camera = started(wanted);
  const Seen seen = watch(*camera, 200);  // the driver begins 128 before its 32 bits are used up
  EXPECT_GT(seen.frames.front().sequence, 0xFFFF'0000U);
  EXPECT_GT(seen.frames.back().sequence, 0xFFFF'FFFFU);
  std::uint64_t missing = 0;
  for (std::size_t i = 1; i < seen.frames.size(); ++i) {
    ASSERT_GT(seen.frames[i].sequence, seen.frames[i - 1].sequence);
    missing += seen.frames[i].sequence - seen.frames[i - 1].sequence - 1;
  }
  EXPECT_EQ(camera->counters().lost, missing);
  EXPECT_LE(missing, 5U);
}

TEST_F(Frames, TimesGoOnWhenTheStampsComeRound) {
  for (const int bits : {1, 2}) {  // of the driver's menu: 64, 32
    Other(kLeft).set("Wrap Timestamp", bits);
    Settings wanted = settings();
    wanted.fps = 10;
    const auto camera = started(wanted);
    const Seen seen = watch(*camera, 180);  // it comes round after 16 s
    for (std::size_t i = 1; i < seen.frames.size(); ++i) {
      const auto step = seen.frames[i].mid_exposure - seen.frames[i - 1].mid_exposure;
      const auto count = static_cast<double>(seen.frames[i].sequence - seen.frames[i - 1].sequence);
      ASSERT_NEAR(static_cast<double>(step.count()) * 1e-6, 100 * count, 10) << bits << ", frame " << i;
    }
    // The stamps are not the clock's that they promise: the first one is told from its arrival, and counted.
    EXPECT_EQ(camera->counters().steps, 1U) << bits;
    EXPECT_LT(std::abs(seen.mean_age_ms()), 20) << bits;
  }
}

TEST_F(Frames, StampsOfTheEndAndOfTheBeginningGiveTheSameMiddle) {
  const Other other(kLeft);
  Settings wanted = settings();
  wanted.fps = 25;
  const double end = watch(*started(wanted), 10).mean_age_ms();
  other.set("Timestamp Source", 1);
  wanted.readout_us = std::nullopt;
  double start = 0;
  {
    const auto camera = started(wanted);
    EXPECT_FALSE(camera->info().readout);
    start = watch(*camera, 10).mean_age_ms();
  }
  // The driver lays its start of exposure nine tenths of a period before the end of the frame.
  EXPECT_NEAR(start - end, 36, 2);
  other.set("Timestamp Source", 0);
  wanted.readout_us = 36000;
  EXPECT_NEAR(watch(*started(wanted), 10).mean_age_ms(), start, 2);
}

/// The shortest time between frames that the camera offers: newer kernels' vivid has higher rates. [us]
double shortest_period_us(const Settings& wanted) {
  const Other other(kLeft);
  double shortest = 1e6;
  v4l2_frmivalenum asked{};
  asked.pixel_format = V4L2_PIX_FMT_GREY;
  asked.width = static_cast<std::uint32_t>(wanted.width);
  asked.height = static_cast<std::uint32_t>(wanted.height);
  for (; other.device().ask(VIDIOC_ENUM_FRAMEINTERVALS, asked) == 0; ++asked.index) {
    shortest = std::min(shortest, 1e6 * asked.discrete.numerator / asked.discrete.denominator);
  }
  return shortest;
}

TEST_F(Frames, AReadoutThatNobodyTellsIsRequiredByItsKey) {
  Settings wanted = settings();
  wanted.readout_us = std::nullopt;
  EXPECT_THAT([&] { (void)open(wanted); },
              ThrowsMessage<std::runtime_error>(AllOf(HasSubstr(wanted.device), HasSubstr("set camera.readout_us"))));
}

TEST_F(Frames, WhoMeasuresMayGuessIt) {
  Settings wanted = settings();
  wanted.readout_us = std::nullopt;
  wanted.guesses_readout = true;
  wanted.fps = 25;
  const double shortest_us = shortest_period_us(wanted);
  ASSERT_LT(shortest_us, 20000);
  double age = 0;
  {
    const auto camera = started(wanted);
    EXPECT_TRUE(camera->info().readout_is_guessed);
    EXPECT_NEAR(static_cast<double>(camera->info().readout.value_or(0ns).count()) * 1e-3, shortest_us, 1);
    age = watch(*camera, 10).mean_age_ms();
  }
  wanted.readout_us = 0;
  EXPECT_NEAR(age - watch(*started(wanted), 10).mean_age_ms(), shortest_us * 1e-3, 2);
}

TEST_F(Frames, AGainThatAnotherProgramSetsTravelsWithTheFramesThatHaveIt) {
  const Other other(kLeft);
  Settings wanted = settings();
  wanted.gain = 1;
  wanted.control_delay_frames = 3;
  const auto camera = started(wanted);
  const Seen before = watch(*camera, 3);
  other.set("Gain", 150);
  const Seen after = watch(*camera, 8);
  EXPECT_EQ(before.frames.back().settings.gain, 1.0F);
  std::vector<float> gains;
  for (const SensorFrame& frame : after.frames) gains.push_back(frame.settings.gain.value_or(0));
  EXPECT_EQ(gains, (std::vector<float>{1.0F, 1.0F, 1.5F, 1.5F, 1.5F, 1.5F, 1.5F, 1.5F}));
  other.set("Gain, Automatic", 1);
  EXPECT_EQ(watch(*camera, 5).frames.back().settings.gain, std::nullopt);
}

TEST_F(Frames, ThatAreLeasedStayAsTheyAreAndComeBackInAnyOrder) {
  Other(kLeft).set("OSD Text Mode", 0);  // a counter and a clock, so that no two frames are alike
  const auto camera = started(settings());
  const auto sum = [&](const SensorFrame& frame) {
    const Picture picture = camera->picture(frame.buffer);
    return checksum({reinterpret_cast<const std::byte*>(picture.data), 320 * 180});
  };
  std::vector<SensorFrame> held;
  std::vector<std::uint64_t> sums;
  for (int i = 0; i < 5; ++i) {
    held.push_back(nth_frame(*camera));
    sums.push_back(sum(held.back()));
  }
  for (std::size_t i = 1; i < sums.size(); ++i) EXPECT_NE(sums[i], sums[i - 1]);
  (void)watch(*camera, 30);
  for (std::size_t i = 0; i < held.size(); ++i) EXPECT_EQ(sum(held[i]), sums[i]) << i;
  for (const std::size_t i : {3U, 0U, 4U, 1U, 2U}) camera->give_back(held[i].buffer);
  std::vector<std::uint32_t> buffers;
  for (int i = 0; i < 8; ++i) buffers.push_back(nth_frame(*camera).buffer);
  std::sort(buffers.begin(), buffers.end());
  EXPECT_EQ(buffers, (std::vector<std::uint32_t>{0, 1, 2, 3, 4, 5, 6, 7}));
}

TEST_F(Frames, WhenAllAreLeasedThereIsNothingUntilOneComesBack) {
  const auto camera = started(settings());
  std::vector<SensorFrame> held;
  for (int i = 0; i < 8; ++i) held.push_back(nth_frame(*camera));
  SensorFrame frame;
  EXPECT_EQ(wait_take(*camera, frame, 200), Camera::Take::kNothing);
  camera->give_back(held[2].buffer);
  EXPECT_EQ(wait_take(*camera, frame), Camera::Take::kFrame);
  EXPECT_EQ(frame.buffer, held[2].buffer);
  EXPECT_GE(camera->counters().lost, 5U);  // the sensor went on
  EXPECT_EQ(camera->counters().late, camera->counters().lost);
}

TEST_F(Frames, OfTwoCamerasComeFromEach) {
  const auto left = started(settings());
  const auto right = started(settings(kRight));
  for (int i = 0; i < 10; ++i) {
    left->give_back(nth_frame(*left).buffer);
    right->give_back(nth_frame(*right).buffer);
  }
  EXPECT_EQ(left->counters().frames, 10U);
  EXPECT_EQ(right->counters().frames, 10U);
}

// Of v4l2loopback, which hands on what another program writes.
TEST_F(Frames, OfADriverThatPromisesNoClockAreStampedAsTheyAreTaken) {
  // With the two buffers that it has if nothing is said, a camera is refused.
  const std::string again = "modprobe -r v4l2loopback && modprobe v4l2loopback video_nr=2,3 exclusive_caps=0,0 ";
  ASSERT_EQ(std::system((again + "card_label=loop-left,loop-right max_buffers=8 && udevadm settle").c_str()), 0);
  const Other writer("/dev/video2");
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  format.fmt.pix.width = 320;
  format.fmt.pix.height = 240;
  format.fmt.pix.pixelformat = V4L2_PIX_FMT_GREY;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  ASSERT_EQ(writer.device().ask(VIDIOC_S_FMT, format), 0);
  const std::jthread writing([&](const std::stop_token& done) {
    const std::vector<std::uint8_t> frame(320 * 240, 77);
    while (!done.stop_requested()) {
      EXPECT_EQ(::write(writer.device().descriptor(), frame.data(), frame.size()), 320 * 240);
      std::this_thread::sleep_for(20ms);
    }
  });
  std::this_thread::sleep_for(100ms);
  std::vector<std::string> notes;
  Settings wanted = settings("/dev/video2");
  wanted.width = wanted.height = 0;
  const auto camera = started(wanted, &notes);
  EXPECT_EQ(camera->info().width, 320);
  const Seen seen = watch(*camera, 10);
  EXPECT_THAT(notes, Contains(HasSubstr("does not promise stamps of the monotonic clock")));
  EXPECT_EQ(seen.mean_age_ms(), 0);
  EXPECT_EQ(camera->counters().steps, 0U);
}

TEST_F(Frames, TakeNoHeap) {
  const auto camera = started(settings());
  const Other other(kLeft);
  (void)nth_frame(*camera);
  SensorFrame frame;
  const stereotrack::test::HeapWatch watch;
  int taken = 0;
  pollfd waiting{camera->descriptor(), POLLIN, 0};
  while (taken < 100) {
    const Camera::Take take = camera->take(frame);
    if (take == Camera::Take::kLost) break;
    if (take == Camera::Take::kNothing) {
      (void)::poll(&waiting, 1, 1000);
      continue;
    }
    ++taken;
    (void)camera->picture(frame.buffer);
    (void)camera->counters();
    camera->give_back(frame.buffer);
    if (taken == 50) {
      v4l2_control gain{V4L2_CID_GAIN, 180};
      (void)other.device().ask(VIDIOC_S_CTRL, gain);
    }
  }
  EXPECT_EQ(watch.calls(), 0U);
  EXPECT_EQ(taken, 100);
  EXPECT_EQ(frame.settings.gain, 1.8F);
}

}  // namespace
}  // namespace stereotrack::capture::v4l2::test
