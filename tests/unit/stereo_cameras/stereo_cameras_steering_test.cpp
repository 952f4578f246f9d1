#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

#include "tests/unit/stereo_cameras/rig.hpp"

namespace stereotrack::capture {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;
using test::kFramePeriod;

constexpr PeriodRange kRows{milliseconds(20), milliseconds(400), microseconds(20)};

StereoCameras::Config config() {
  test::simulated_ns.store(1'000'000'000);
  StereoCameras::Config config;
  config.tolerance = 0.5;
  config.steer = true;
  config.now = &test::simulated_now;
  return config;
}

/// Two sensors by crystals of their own, in simulated time; a frame is heard as it is exposed.
struct FreeRunning {
  FreeRunning(const StereoCameras::Config& wanted, double slow, nanoseconds phase) : rig(wanted, true), drift(slow) {
    left_next = nanoseconds(test::simulated_ns.load()) + kFramePeriod;
    right_next = left_next + phase;
  }

  void run(seconds span) {
    const nanoseconds end = nanoseconds(test::simulated_ns.load()) + span;
    while (std::min(left_next, right_next) < end) {
      const nanoseconds at = std::min({left_next, right_next, tend_next});
      test::simulated_ns.store(std::max(test::simulated_ns.load(), at.count()));
      if (at == tend_next) {
        for (SourceNote& note : rig.tend()) notes.push_back(std::move(note));
        tend_next = at + milliseconds(100);
        continue;
      }
      if (at == left_next) {
        ++left_number;
        (void)rig.left.expose({.number = left_number, .time = at, .sequence = left_number});
        left_next += kFramePeriod;
      } else {
        ++right_number;
        (void)rig.right.expose({.number = right_number, .time = at, .sequence = right_number});
        const auto kept = static_cast<double>(in_force.front().count());
        in_force.pop_front();
        in_force.push_back(rig.right.is_open() ? rig.right.period() : kFramePeriod);
        right_next += nanoseconds(std::llround(kept * (1 + drift)));
      }
      rig.step();
      look();
    }
  }
  void look() {
    while (const auto pair = rig.pool.take_oldest()) {
      ++pairs;
      if (!pair->skew) {
        ++mono;
        continue;
      }
      worst = std::max(worst, std::chrono::abs(*pair->skew));
      // The right frame is the one that was exposed nearest to the left one.
      if (std::chrono::abs(*pair->skew) > kFramePeriod / 2 + milliseconds(1)) ++wrong;
    }
  }
  [[nodiscard]] std::ptrdiff_t told(std::string_view cause) const {
    return std::count_if(notes.begin(), notes.end(), [&](const SourceNote& note) { return note.cause == cause; });
  }

  test::CameraRig rig;
  double drift;
  nanoseconds left_next{0};
  nanoseconds right_next{0};
  nanoseconds tend_next{0};
  std::deque<nanoseconds> in_force{kFramePeriod, kFramePeriod};
  std::uint64_t left_number = 0;
  std::uint64_t right_number = 0;
  std::vector<SourceNote> notes;
  nanoseconds worst{0};
  int pairs = 0;
  int mono = 0;
  int wrong = 0;
};

TEST(StereoCamerasSteering, TheRightCameraComesToTheLeftOneAndStays) {
  for (const double slow : {-100e-6, 20e-6, 200e-6}) {
    SCOPED_TRACE(slow);
    FreeRunning two(config(), slow, milliseconds(13));
    two.rig.right.allow_periods(kRows);
    two.rig.open();
    two.run(seconds(30));
    EXPECT_EQ(two.rig.cameras->figures().steering, Steering::kLocked);
    EXPECT_EQ(two.told("camera_steered"), 1);
    EXPECT_EQ(two.told("camera_on_rate"), 1);
    two.worst = {};
    const int before = two.pairs;
    const std::uint64_t left_before = two.left_number;
    two.run(seconds(600));
    EXPECT_LT(two.worst, microseconds(110));
    EXPECT_EQ(two.wrong, 0);
    EXPECT_EQ(two.mono, 0);
    EXPECT_NEAR(two.pairs - before, static_cast<double>(two.left_number - left_before), 1);
    EXPECT_EQ(two.notes.size(), 2U) << two.notes.back().text;
    const SourceFigures figures = two.rig.cameras->figures();
    ASSERT_TRUE(figures.phase && figures.drift && figures.steered_period);
    EXPECT_LT(std::chrono::abs(*figures.phase), microseconds(60));
    EXPECT_NEAR(*figures.drift, 0, 5e-6);
    EXPECT_LT(std::chrono::abs(*figures.steered_period - kFramePeriod), kFramePeriod / 200);
    EXPECT_EQ(two.rig.left.periods_set(), 0);
  }
}

TEST(StereoCamerasSteering, ADriverThatCannotIsToldOnceAndLeftAlone) {
  FreeRunning two(config(), 20e-6, milliseconds(5));
  two.rig.open();
  two.run(seconds(20));
  EXPECT_EQ(two.rig.cameras->figures().steering, Steering::kCannot);
  EXPECT_FALSE(two.rig.cameras->figures().steered_period.has_value());
  ASSERT_EQ(two.notes.size(), 1U);
  EXPECT_EQ(two.notes[0].text,
            "right camera: its rate does not follow the left one's: its driver cannot set its rate while it streams");
  EXPECT_GT(two.worst, milliseconds(4));
}

TEST(StereoCamerasSteering, ADriverThatDoesNothingIsGivenUpAtItsOwnPeriod) {
  FreeRunning two(config(), 20e-6, milliseconds(5));
  two.rig.right.allow_periods(kRows);
  two.rig.right.ignore_periods(true);
  two.rig.open();
  two.run(seconds(60));
  EXPECT_EQ(two.rig.cameras->figures().steering, Steering::kGivenUp);
  EXPECT_EQ(two.rig.cameras->figures().steered_period, kFramePeriod);
  EXPECT_EQ(two.told("camera_not_steered"), 1);
  const int set = two.rig.right.periods_set();
  two.run(seconds(60));
  EXPECT_EQ(two.rig.right.periods_set(), set);
  EXPECT_EQ(two.told("camera_not_steered"), 1);
  EXPECT_EQ(two.wrong, 0);
}

TEST(StereoCamerasSteering, IsNotDoneWhereItIsNotWantedOrSomebodyTriggers) {
  for (const bool triggered : {false, true}) {
    SCOPED_TRACE(triggered);
    StereoCameras::Config quiet = config();
    quiet.steer = triggered;
    quiet.triggered = triggered;
    FreeRunning two(quiet, 20e-6, milliseconds(5));
    two.rig.right.allow_periods(kRows);
    two.rig.open();
    two.run(seconds(20));
    EXPECT_EQ(two.rig.right.periods_set(), 0);
    EXPECT_EQ(two.rig.cameras->figures().steering, Steering::kOff);
    EXPECT_TRUE(two.notes.empty());
  }
}

TEST(StereoCamerasSteering, ARightCameraThatIsLostAndComesBackIsSteeredAnew) {
  FreeRunning two(config(), 60e-6, milliseconds(2));
  two.rig.right.allow_periods(kRows);
  two.rig.open();
  two.run(seconds(30));
  ASSERT_EQ(two.rig.cameras->figures().steering, Steering::kLocked);
  two.rig.right.refuse("right-device: is not there");
  two.rig.right.lose();
  two.run(seconds(5));
  EXPECT_EQ(two.rig.cameras->figures().steering, Steering::kOff);
  EXPECT_EQ(two.told("camera_not_steered"), 0);
  two.rig.right.refuse("");
  two.right_next += milliseconds(9);
  two.drift = -60e-6;
  two.run(seconds(60));
  EXPECT_EQ(two.rig.cameras->figures().steering, Steering::kLocked);
  EXPECT_EQ(two.told("camera_on_rate"), 2);
  two.worst = {};
  two.run(seconds(60));
  EXPECT_LT(two.worst, microseconds(110));
  EXPECT_EQ(two.wrong, 0);
}

TEST(StereoCamerasSteering, WithoutTheLeftCameraTheRightOneGoesAtItsOwnPeriod) {
  FreeRunning two(config(), 200e-6, milliseconds(12));
  two.rig.right.allow_periods(kRows);
  two.rig.open();
  two.run(seconds(8));
  ASSERT_NE(two.rig.right.period(), kFramePeriod);  // on its way
  two.rig.left.refuse("left-device: is not there");
  two.rig.left.lose();
  two.run(seconds(3));
  EXPECT_EQ(two.rig.right.period(), kFramePeriod);
  EXPECT_EQ(two.rig.cameras->figures().steering, Steering::kOff);
  two.rig.left.refuse("");
  two.run(seconds(60));
  EXPECT_EQ(two.rig.cameras->figures().steering, Steering::kLocked);
}

}  // namespace
}  // namespace stereotrack::capture
