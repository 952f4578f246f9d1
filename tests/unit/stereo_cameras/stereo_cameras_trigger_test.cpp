#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "drivers/gpio/simulated_chip.hpp"
#include "drivers/trigger/edges.hpp"
#include "drivers/trigger/pulse_train.hpp"
#include "tests/unit/stereo_cameras/rig.hpp"

// Triggers and the frames that answer them, in simulated time.
namespace stereotrack::capture {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using test::CameraRig;
using test::kFramePeriod;
using test::number_of;
using trigger::Side;

constexpr milliseconds kDelay{2};

StereoCameras::Config config() {
  test::simulated_ns.store(1'000'000'000);
  StereoCameras::Config config;
  config.now = &test::simulated_now;
  config.pulse_delay = kDelay;
  return config;
}

bool says(const std::vector<SourceNote>& notes, const std::string& cause) {
  return std::any_of(notes.begin(), notes.end(), [&](const SourceNote& note) { return note.cause == cause; });
}

/// One drawn stream: pulses, and what each camera makes of them.
class Stream {
 public:
  explicit Stream(std::uint32_t seed) : random_(seed), rig_(config(), seed % 2 == 0) {
    trigger_ = &rig_.open_with_trigger();
  }

  void run(std::uint64_t pulses) {
    for (std::uint64_t n = 1; n <= pulses; ++n) ask(n);
    std::stable_sort(arrivals_.begin(), arrivals_.end(),
                     [](const Arrival& a, const Arrival& b) { return a.at < b.at; });
    for (const Arrival& arrival : arrivals_) {
      test::simulated_ns.store(arrival.at.count());
      if (arrival.pulse != 0) {
        trigger_->give(arrival.pulse, arrival.exposure.time);
        pulse_ = arrival.pulse;
      } else {
        ASSERT_TRUE(rig_.sensor(arrival.side).expose(arrival.exposure));
      }
      rig_.step();
      look();
    }
    const SourceFigures figures = rig_.cameras->figures();
    for (std::size_t s = 0; s < 2; ++s) {
      EXPECT_EQ(figures.cameras[s].missed, missed_at_[s].size()) << "side " << s;
      EXPECT_EQ(figures.cameras[s].doubled, doubled_[s]) << "side " << s;
      EXPECT_EQ(figures.cameras[s].stray, stray_[s]) << "side " << s;
    }
    EXPECT_EQ(figures.pulses, pulses);
    EXPECT_EQ(rig_.left.given_back_wrongly() + rig_.right.given_back_wrongly(), 0);
    // Two are lost to learning that numbers agree.
    EXPECT_EQ(paired_ + 2, whole_);
    rig_.step();
    EXPECT_EQ(rig_.left.held() + rig_.right.held(), 0U);
  }

  [[nodiscard]] std::uint64_t faults() const {
    return missed_at_[0].size() + missed_at_[1].size() + doubled_[0] + doubled_[1] + stray_[0] + stray_[1];
  }

 private:
  struct Arrival {
    nanoseconds at{0};
    std::uint64_t pulse = 0;  ///< else a frame
    Side side = Side::kLeft;
    test::SensorScript::Exposure exposure;
  };

  std::int64_t between(std::int64_t low, std::int64_t high) {
    return std::uniform_int_distribution<std::int64_t>(low, high)(random_);
  }
  bool chance(double part) { return std::uniform_real_distribution<double>(0, 1)(random_) < part; }

  void answer(Side side, std::uint64_t number, nanoseconds begin, nanoseconds exposure) {
    const auto s = static_cast<std::size_t>(side);
    // In their order, and before the second pulse after theirs.
    last_[s] = std::max(last_[s] + nanoseconds(1), begin + milliseconds(between(8, side == Side::kLeft ? 14 : 45)));
    Arrival arrival{last_[s], 0, side, {.number = number, .time = begin + exposure / 2, .sequence = ++count_[s]}};
    arrival.exposure.settings.exposure = exposure;
    arrivals_.push_back(arrival);
  }

  void ask(std::uint64_t n) {
    const nanoseconds pulse =
        std::chrono::seconds(2) + kFramePeriod * static_cast<std::int64_t>(n) + microseconds(between(0, 900));
    arrivals_.push_back({pulse, n, Side::kLeft, {.time = pulse}});
    bool whole = true;
    for (const Side side : {Side::kLeft, Side::kRight}) {
      const auto s = static_cast<std::size_t>(side);
      const nanoseconds begin = pulse + kDelay + microseconds(between(-500, 500));
      // Automatic exposure, of each camera by itself: the middles are apart, the beginnings are not.
      const nanoseconds exposure = microseconds(between(100, 12'000));
      // The last ones are whole, so that all is found at the end.
      const bool settles = n + 3 > kPulses;
      if (!settles && chance(0.08)) {
        missed_at_[s].push_back(n);
        whole = false;
      } else {
        answer(side, n, begin, exposure);
        if (!settles && chance(0.06)) {
          answer(side, 1000 + n, begin + milliseconds(between(3, 8)), exposure);
          ++doubled_[s];
        }
      }
      if (!settles && chance(0.04)) {
        answer(side, 2000 + n, pulse + milliseconds(between(15, 26)), milliseconds(1));
        ++stray_[s];
      }
    }
    if (whole) ++whole_;
  }

  void look() {
    while (const PairLease lease = rig_.pool.take_oldest()) {
      ASSERT_FALSE(lease->right.empty());
      ASSERT_EQ(number_of(lease->left), number_of(lease->right)) << "a wrong pair";
      ASSERT_LT(number_of(lease->left), 1000U) << "an exposure that nobody asked for";
      ++paired_;
    }
    // Whatever was missed is found once the second pulse after it was given, at the latest.
    const SourceFigures figures = rig_.cameras->figures();
    for (std::size_t s = 0; s < 2; ++s) {
      const auto until = std::count_if(missed_at_[s].begin(), missed_at_[s].end(),
                                       [&](std::uint64_t n) { return n + trigger::PulseMatcher::kPatience < pulse_; });
      ASSERT_GE(figures.cameras[s].missed, static_cast<std::uint64_t>(until));
    }
  }

 public:
  static constexpr std::uint64_t kPulses = 25;

 private:
  std::mt19937 random_;
  CameraRig rig_;
  test::ScriptedTrigger* trigger_ = nullptr;
  std::vector<Arrival> arrivals_;
  std::array<nanoseconds, 2> last_{};
  std::array<std::uint64_t, 2> count_{};
  std::array<std::vector<std::uint64_t>, 2> missed_at_;
  std::array<std::uint64_t, 2> doubled_{};
  std::array<std::uint64_t, 2> stray_{};
  std::uint64_t pulse_ = 0;
  std::uint64_t whole_ = 0;
  std::uint64_t paired_ = 0;
};

TEST(TriggerProperty, InTenThousandStreamsMissedAndDoubledExposuresAreFoundInTwoFramesAndNoPairIsWrong) {
  std::uint64_t faults = 0;
  for (std::uint32_t seed = 1; seed <= 10'000 && !::testing::Test::HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    Stream stream(seed);
    stream.run(Stream::kPulses);
    faults += stream.faults();
  }
  EXPECT_GT(faults, 40'000U);
}

TEST(Trigger, CamerasThatFollowNoPulseAreToldPairWithoutAndAreBelievedOnceTheyDo) {
  CameraRig rig(config());
  test::ScriptedTrigger& trigger = rig.open_with_trigger();
  std::vector<SourceNote> notes;
  std::uint64_t pairs = 0;
  std::uint64_t before = 0;
  for (std::uint64_t n = 1; n <= 150; ++n) {
    rig.advance(kFramePeriod);
    const nanoseconds pulse = kFramePeriod * static_cast<std::int64_t>(n);
    trigger.give(n, pulse);
    const nanoseconds begin = pulse + (n < 100 ? kDelay + milliseconds(15) : kDelay);
    for (const Side side : {Side::kLeft, Side::kRight}) {
      (void)rig.sensor(side).expose({.number = n, .time = begin});
    }
    rig.step();
    while (const PairLease lease = rig.pool.take_oldest()) {
      EXPECT_EQ(number_of(lease->left), number_of(lease->right));
      ++pairs;
    }
    for (const SourceNote& note : rig.tend()) notes.push_back(note);
    if (n == 13) {
      EXPECT_EQ(pairs, 0U);
      EXPECT_TRUE(notes.empty());
    }
    if (n == 99) {
      before = pairs;
      EXPECT_TRUE(rig.cameras->figures().trigger_unanswered);
      EXPECT_FALSE(rig.cameras->figures().trigger_silent);
    }
  }
  ASSERT_EQ(notes.size(), 2U) << notes.back().text;
  EXPECT_TRUE(says(notes, "trigger_unanswered"));
  EXPECT_NE(notes[0].text.find("15000 us after the nearest"), std::string::npos) << notes[0].text;
  EXPECT_TRUE(says(notes, "trigger_answered"));
  EXPECT_FALSE(rig.cameras->figures().trigger_unanswered);
  EXPECT_GE(before, 99U - 16U);         // half a second until it was clear
  EXPECT_GE(pairs - before, 51U - 4U);  // and learning anew, once they answer
}

TEST(Trigger, PulsesThatNoCameraEverAnsweredAreTheirFaultToo) {
  CameraRig rig(config());
  test::ScriptedTrigger& trigger = rig.open_with_trigger();
  std::vector<SourceNote> notes;
  for (std::uint64_t n = 1; n <= 100; ++n) {
    rig.advance(kFramePeriod);
    trigger.give(n, kFramePeriod * static_cast<std::int64_t>(n));
    rig.step();
    for (const SourceNote& note : rig.tend()) notes.push_back(note);
    if (n == 40) {
      EXPECT_TRUE(notes.empty());  // a camera may take two seconds for its first frame
    }
  }
  EXPECT_TRUE(says(notes, "camera_silent"));
  EXPECT_GE(rig.left.opened(), 2);
}

TEST(Trigger, ItsPeriodIsThatOfThePairsWhateverTheSensorsCould) {
  StereoCameras::Config slow = config();
  slow.period = 3 * kFramePeriod;
  slow.triggered = true;
  CameraRig rig(slow);
  rig.open();
  EXPECT_EQ(rig.cameras->info().period, 3 * kFramePeriod);
  // 18 ms are within a quarter of it.
  for (std::uint64_t n = 1; n <= 5; ++n) {
    rig.advance(3 * kFramePeriod);
    const nanoseconds time = 3 * kFramePeriod * static_cast<std::int64_t>(n);
    (void)rig.left.expose({.number = n, .time = time});
    (void)rig.right.expose({.number = n, .time = time + milliseconds(18)});
    rig.step();
    const PairLease lease = rig.pool.take_oldest();
    ASSERT_TRUE(lease);
    EXPECT_EQ(lease->skew, milliseconds(18));
  }
}

TEST(Trigger, ACameraThatIsNotToBeMissesNothing) {
  StereoCameras::Config mono = config();
  mono.stereo = false;
  CameraRig rig(mono);
  test::ScriptedTrigger& trigger = rig.open_with_trigger();
  std::uint64_t pairs = 0;
  for (std::uint64_t n = 1; n <= 20; ++n) {
    rig.advance(kFramePeriod);
    const nanoseconds pulse = kFramePeriod * static_cast<std::int64_t>(n);
    trigger.give(n, pulse);
    if (n != 10) (void)rig.left.expose({.number = n, .time = pulse + kDelay});
    rig.step();
    while (rig.pool.take_oldest()) ++pairs;
  }
  EXPECT_EQ(pairs, 19U);
  EXPECT_EQ(rig.cameras->figures().cameras[0].missed, 1U);
  EXPECT_EQ(rig.cameras->figures().cameras[1].missed, 0U);
}

/// Cameras over a trigger of the program's own.
void open_with(CameraRig& rig, std::unique_ptr<trigger::Trigger> trigger) {
  rig.cameras = std::make_unique<StereoCameras>(
      [&rig](Side side) { return std::make_unique<test::ScriptedCamera>(rig.sensor(side)); }, rig.config,
      std::move(trigger));
}

TEST(Trigger, APulseTrainAsksAndItsFramesPair) {
  const gpio::LineSpec spec{.name = {"sim", "cameras-train"}};
  auto train = trigger::PulseTrain::create({.period = kFramePeriod, .width = milliseconds(1), .late = milliseconds(1)},
                                           gpio::open_lines({&spec, 1}, "test"));
  ASSERT_TRUE(train.has_value());
  CameraRig rig(config());
  open_with(rig, (*train)->trigger());
  std::uint64_t pairs = 0;
  MonotonicTime next = (*train)->step(test::simulated_now());
  for (std::uint64_t n = 1; n <= 50;) {
    // Each seventh pulse is slept over: there is no exposure, and nothing is missed.
    const bool oversleeps = !(*train)->is_active() && n % 7 == 0;
    test::simulated_ns.store((next + (oversleeps ? milliseconds(5) : milliseconds(0))).time_since_epoch().count());
    next = (*train)->step(test::simulated_now());
    if (oversleeps) ++n;
    if (!(*train)->rose()) continue;
    const nanoseconds begin = test::simulated_now().time_since_epoch() + kDelay;
    (void)rig.left.expose({.number = n, .time = begin});
    (void)rig.right.expose({.number = n, .time = begin});
    ++n;
    rig.step();
    while (const PairLease lease = rig.pool.take_oldest()) {
      EXPECT_EQ(number_of(lease->left), number_of(lease->right));
      ++pairs;
    }
  }
  const SourceFigures figures = rig.cameras->figures();
  EXPECT_EQ((*train)->counters().skipped.get(), 7U);
  EXPECT_EQ(figures.pulses, (*train)->counters().given.get());
  EXPECT_EQ(pairs + 2, figures.pulses);
  EXPECT_EQ(figures.cameras[0].missed + figures.cameras[1].missed, 0U);
}

TEST(Trigger, EdgesThatWereDroppedAreAGapWhoseFramesAreStraysAndNoPairIsWrong) {
  const gpio::InputSpec spec{.name = {"sim", "cameras-edges"}, .edges = gpio::Edges::kRising};
  CameraRig rig(config());
  open_with(rig, std::make_unique<trigger::EdgeTrigger>(spec, "test"));
  std::uint64_t pairs = 0;
  for (std::uint64_t n = 1; n <= 60; ++n) {
    const int burst = n == 30 ? static_cast<int>(gpio::simulated_chip::kKeptEdges) + 2 : 1;
    nanoseconds pulse{0};
    // A burst: all but the last are somebody's noise before it, and two of them drop out of the kernel's memory.
    for (int i = burst - 1; i >= 0; --i) {
      if (i == 0) rig.advance(kFramePeriod);
      pulse = test::simulated_now().time_since_epoch() - microseconds(200) * i;
      gpio::simulated_chip::drive("cameras-edges", true, MonotonicTime(pulse));
      gpio::simulated_chip::drive("cameras-edges", false, MonotonicTime(pulse) + microseconds(50));
    }
    (void)rig.left.expose({.number = n, .time = pulse + kDelay});
    (void)rig.right.expose({.number = n, .time = pulse + kDelay});
    rig.step();
    while (const PairLease lease = rig.pool.take_oldest()) {
      EXPECT_EQ(number_of(lease->left), number_of(lease->right));
      ++pairs;
    }
  }
  EXPECT_EQ(rig.cameras->figures().pulses_lost, 2U);
  EXPECT_EQ(rig.cameras->figures().pulses, 60U + gpio::simulated_chip::kKeptEdges + 1U);
  EXPECT_EQ(pairs, 58U);
}

}  // namespace
}  // namespace stereotrack::capture
