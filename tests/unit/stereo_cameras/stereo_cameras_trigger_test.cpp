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

/// Two cameras and a trigger of 25 pulses a second; what each makes of a pulse is the test's.
class AstrayRig {
 public:
  explicit AstrayRig(const StereoCameras::Config& wanted = config()) : rig(wanted), trigger_(rig.open_with_trigger()) {}

  /// The next pulse, then a frame of each that answers it, or one that begins 15 ms too late for that.
  void pulse(bool left_answers, bool right_answers) {
    ask();
    expose(Side::kLeft, left_answers ? nanoseconds(0) : milliseconds(15));
    expose(Side::kRight, right_answers ? nanoseconds(0) : milliseconds(15));
    look();
  }
  void ask() {
    ++n;
    rig.advance(kFramePeriod);
    trigger_.give(n, at());
  }
  void expose(Side side, nanoseconds late) {
    auto& count = count_[static_cast<std::size_t>(side)];
    (void)rig.sensor(side).expose({.number = n, .time = at() + kDelay + late, .sequence = ++count});
  }
  void look() { look_for_anything(milliseconds(1)); }
  void look_for_anything(nanoseconds skew = kFramePeriod) {
    rig.step();
    while (const PairLease lease = rig.pool.take_oldest()) {
      if (lease->right.empty()) {
        ++mono;
      } else {
        ++pairs;
        EXPECT_EQ(number_of(lease->left), number_of(lease->right)) << "a wrong pair";
        EXPECT_LT(std::chrono::abs(*lease->skew), skew);
      }
    }
    for (const SourceNote& note : rig.tend()) notes.push_back(note);
  }
  [[nodiscard]] std::string causes() const {
    std::string text;
    for (const SourceNote& note : notes) text += std::string(note.cause) + ' ' + note.camera + ';';
    return text;
  }
  [[nodiscard]] SourceFigures figures() const { return rig.cameras->figures(); }

  CameraRig rig;
  std::uint64_t n = 0;
  std::uint64_t pairs = 0;
  std::uint64_t mono = 0;
  std::vector<SourceNote> notes;

 private:
  // A period ago: frames come when they have been exposed.
  [[nodiscard]] nanoseconds at() const {
    return std::chrono::seconds(1) + kFramePeriod * (static_cast<std::int64_t>(n) - 1);
  }

  test::ScriptedTrigger& trigger_;
  std::array<std::uint64_t, 2> count_{};
};

/// 500 ms, and the frame that is beyond them.
constexpr std::uint64_t kFound = 14;

TEST(TriggerAstray, ARightCameraThatAnswersNoPulseIsNamedAndTheLeftOneGoesOnAlone) {
  AstrayRig it;
  for (int i = 0; i < 30; ++i) it.pulse(true, true);
  EXPECT_TRUE(it.notes.empty());
  const std::uint64_t before = it.pairs;
  while (it.notes.empty() && it.n < 100) it.pulse(true, false);
  EXPECT_LE(it.n, 30 + kFound);
  EXPECT_EQ(it.pairs, before);
  ASSERT_EQ(it.causes(), "camera_astray right;");
  EXPECT_EQ(
      it.notes[0].text,
      "right camera: 13 frames, none answers a pulse, the last one began 15000 us after the nearest, and the left "
      "one's do; goes on in mono: check the trigger's wire to it, and that it is set to expose on a pulse");
  SourceFigures figures = it.figures();
  EXPECT_TRUE(figures.cameras[1].astray);
  EXPECT_FALSE(figures.cameras[0].astray);
  EXPECT_FALSE(figures.cameras[1].silent);
  EXPECT_FALSE(figures.trigger_unanswered);
  EXPECT_EQ(figures.cameras[1].strayings, 1U);

  const std::uint64_t alone = it.mono;
  for (int i = 0; i < 100; ++i) it.pulse(true, false);
  EXPECT_EQ(it.mono, alone + 2 + 100);  // two had waited for a partner
  EXPECT_EQ(it.pairs, before);

  for (int i = 0; i < 30; ++i) it.pulse(true, true);
  EXPECT_EQ(it.mono, alone + 2 + 100 + trigger::AnswerWatch::kConvincing);
  EXPECT_EQ(it.pairs, before + 30 - trigger::AnswerWatch::kConvincing);  // numbers were learnt before
  EXPECT_EQ(it.causes(), "camera_astray right;camera_follows right;");
  EXPECT_FALSE(it.figures().cameras[1].astray);
  EXPECT_EQ(it.figures().cameras[1].losses, 0U);
  EXPECT_EQ(it.rig.right.opened(), 1);
  it.look();
  EXPECT_EQ(it.rig.left.held() + it.rig.right.held(), 0U);
}

TEST(TriggerAstray, ALeftCameraThatAnswersNoPulseLeavesNothingUntilItDoes) {
  AstrayRig it;
  for (int i = 0; i < 30; ++i) it.pulse(true, true);
  const std::uint64_t before = it.pairs;
  for (int i = 0; i < 100; ++i) {
    it.pulse(false, true);
    if (it.n == 30 + kFound) {
      EXPECT_EQ(it.causes(), "camera_astray left;");
    }
  }
  ASSERT_EQ(it.causes(), "camera_astray left;");
  EXPECT_NE(it.notes[0].text.find("left camera: 13 frames, none answers a pulse"), std::string::npos);
  EXPECT_NE(it.notes[0].text.find("outputs are predicted until it follows"), std::string::npos);
  EXPECT_TRUE(it.figures().cameras[0].astray);
  EXPECT_EQ(it.mono, 0U);
  EXPECT_EQ(it.pairs, before);
  for (int i = 0; i < 30; ++i) it.pulse(true, true);
  EXPECT_EQ(it.causes(), "camera_astray left;camera_follows left;");
  EXPECT_EQ(it.pairs, before + 31 - trigger::AnswerWatch::kConvincing);  // the left frame is there first
  EXPECT_EQ(it.mono, 0U);
  it.look();
  EXPECT_EQ(it.rig.left.held() + it.rig.right.held(), 0U);
}

TEST(TriggerAstray, OneThatNeverAnsweredIsFoundAsSoon) {
  AstrayRig it;
  while (it.notes.empty() && it.n < 100) it.pulse(true, false);
  EXPECT_LE(it.n, kFound);
  EXPECT_EQ(it.causes(), "camera_astray right;");
  EXPECT_EQ(it.pairs, 0U);
  for (int i = 0; i < 20; ++i) it.pulse(true, true);
  EXPECT_EQ(it.pairs, 20U - trigger::AnswerWatch::kConvincing - 2U);  // numbers are learnt of the first two
}

TEST(TriggerAstray, OneThatRunsAtTwiceTheRateIsFoundThoughEachSecondFrameIsNearAPulse) {
  AstrayRig it;
  for (int i = 0; i < 30; ++i) it.pulse(true, true);
  while (it.notes.empty() && it.n < 200) {
    it.ask();
    it.expose(Side::kLeft, {});
    it.expose(Side::kRight, microseconds(500));
    it.expose(Side::kRight, microseconds(20'500));
    it.look();
  }
  EXPECT_LE(it.n, 30U + 49U);
  ASSERT_EQ(it.causes(), "camera_astray right;");
  EXPECT_NE(it.notes[0].text.find("47 of 93 frames answer no pulse"), std::string::npos) << it.notes[0].text;
}

TEST(TriggerAstray, OneThatDriftsPastThePulsesIsToldLessAndLessOften) {
  AstrayRig it;
  // Its frames come 0.4 ms later each time: fifty of a hundred are within a quarter of the period. All day.
  std::int64_t late_us = 0;
  for (int i = 0; i < 20'000; ++i) {
    late_us = (late_us + 400) % 40'000;
    it.ask();
    it.expose(Side::kLeft, {});
    it.expose(Side::kRight, microseconds(late_us > 20'000 ? late_us - 40'000 : late_us));
    it.look_for_anything();
  }
  EXPECT_EQ(it.figures().cameras[1].strayings, 4U);  // 8, 16, 32 in a row convince; 64 there never are
  EXPECT_EQ(it.notes.size(), 7U) << it.causes();
  EXPECT_TRUE(it.figures().cameras[1].astray);
}

TEST(TriggerAstray, BothThenOneAndItIsToldWhichOneIsLeft) {
  AstrayRig it;
  for (int i = 0; i < 30; ++i) it.pulse(true, true);
  for (int i = 0; i < 40; ++i) it.pulse(false, false);
  EXPECT_EQ(it.causes(), "trigger_unanswered ;");
  EXPECT_TRUE(it.figures().trigger_unanswered);
  EXPECT_TRUE(it.figures().cameras[0].astray);
  EXPECT_TRUE(it.figures().cameras[1].astray);
  const std::uint64_t by_time = it.pairs;
  EXPECT_GT(by_time, 28U + 20U);  // they stand together
  for (int i = 0; i < 40; ++i) it.pulse(true, false);
  EXPECT_EQ(it.causes(), "trigger_unanswered ;trigger_answered ;camera_astray right;");
  EXPECT_FALSE(it.figures().trigger_unanswered);
  EXPECT_FALSE(it.figures().cameras[0].astray);
  EXPECT_GE(it.mono, 32U);
  for (int i = 0; i < 20; ++i) it.pulse(true, true);
  EXPECT_EQ(it.causes(), "trigger_unanswered ;trigger_answered ;camera_astray right;camera_follows right;");
  EXPECT_GT(it.pairs, by_time);
}

TEST(TriggerAstray, WhenTheOtherOneGoesAstrayTooNoneIsAlone) {
  AstrayRig it;
  for (int i = 0; i < 30; ++i) it.pulse(true, true);
  for (int i = 0; i < 40; ++i) it.pulse(true, false);
  for (int i = 0; i < 40; ++i) it.pulse(false, false);
  EXPECT_EQ(it.causes(), "camera_astray right;trigger_unanswered ;");
  const std::uint64_t before = it.pairs;
  it.pulse(false, false);
  EXPECT_EQ(it.pairs, before + 1);  // by their times
  for (int i = 0; i < 40; ++i) it.pulse(true, true);
  EXPECT_EQ(it.causes(), "camera_astray right;trigger_unanswered ;trigger_answered ;");
  EXPECT_FALSE(it.figures().cameras[0].astray || it.figures().cameras[1].astray);
}

TEST(TriggerAstray, PulsesThatFailWhileOneIsAstrayAreToldAndItIsFoundAgain) {
  AstrayRig it;
  for (int i = 0; i < 30; ++i) it.pulse(true, true);
  for (int i = 0; i < 20; ++i) it.pulse(true, false);
  for (int i = 0; i < 20; ++i) {  // frames without pulses
    it.rig.advance(kFramePeriod);
    const nanoseconds time = test::simulated_now().time_since_epoch();
    (void)it.rig.left.expose({.number = it.n, .time = time, .sequence = 100U + static_cast<unsigned>(i)});
    it.look();
  }
  EXPECT_EQ(it.causes(), "camera_astray right;trigger_silent ;camera_silent right;");
  EXPECT_FALSE(it.figures().cameras[1].astray);
}

TEST(TriggerAstray, AStrayAfterAPauseOfTheTriggerSaysNothing) {
  AstrayRig it;
  for (int i = 0; i < 30; ++i) it.pulse(true, true);
  it.rig.advance(std::chrono::seconds(20));
  it.n += 500;
  it.look();
  it.ask();
  it.expose(Side::kRight, milliseconds(15));
  it.expose(Side::kRight, milliseconds(16));
  it.look();
  it.expose(Side::kLeft, {});
  it.look();
  for (int i = 0; i < 30; ++i) it.pulse(true, true);
  EXPECT_EQ(it.causes(), "cameras_silent ;cameras_heard ;");
}

TEST(Trigger, AfterAPauseNeitherThePulseNorTheOtherCamerasFrameMakesOneLate) {
  for (const bool tells : {true, false}) {
    StereoCameras::Config triggered = config();
    triggered.triggered = true;
    CameraRig rig(triggered);
    test::ScriptedTrigger* pulses = tells ? &rig.open_with_trigger() : nullptr;
    if (!tells) rig.open();
    std::vector<SourceNote> notes;
    const auto look = [&] {
      rig.step();
      for (const SourceNote& note : rig.tend()) notes.push_back(note);
    };
    std::uint64_t n = 0;
    for (int burst = 0; burst < 5; ++burst) {
      for (int i = 0; i < 3; ++i) {
        rig.advance(kFramePeriod);
        const nanoseconds pulse = test::simulated_now().time_since_epoch();
        ++n;
        if (tells) pulses->give(n, pulse);
        look();  // told, and nothing is exposed yet
        rig.advance(milliseconds(10));
        (void)rig.right.expose({.number = n, .time = pulse + kDelay, .sequence = n});
        look();
        rig.advance(milliseconds(1));
        (void)rig.left.expose({.number = n, .time = pulse + kDelay, .sequence = n});
        look();
        while (rig.pool.take_oldest()) {
        }
      }
      for (int i = 0; i < 40; ++i) {
        rig.advance(milliseconds(100));
        look();
      }
    }
    EXPECT_EQ(rig.left.opened() + rig.right.opened(), 2) << "one was given up, " << (tells ? "told" : "untold");
    for (const SourceNote& note : notes) {
      EXPECT_TRUE(std::string(note.cause).starts_with("cameras_")) << note.text;
    }
  }
}

/// Streams in which one side goes astray for a while, with missed, doubled and stray exposures of both meanwhile.
TEST(TriggerProperty, WhoeverGoesAstrayIsToldOnceInTimeAndNoPairIsWrong) {
  std::uint64_t mono = 0;
  for (std::uint32_t seed = 1; seed <= 1000 && !::testing::Test::HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto between = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
    const Side side = between(0, 1) == 0 ? Side::kLeft : Side::kRight;
    const auto s = static_cast<std::size_t>(side);
    const int from = between(1, 60);
    const int until = from + between(30, 200);
    const int off_ms = between(12, 28);
    AstrayRig it;
    int found = 0;
    int over = 0;
    for (int i = 1; i < until + 60; ++i) {
      it.ask();
      const bool stray = i >= from && i < until;
      for (const Side each : {Side::kLeft, Side::kRight}) {
        const bool is_it = each == side;
        // In the last ones, and while it has to convince, all is well.
        const bool noisy = i < until && !(is_it && stray);
        if (noisy && between(0, 99) < 6) continue;
        it.expose(each, is_it && stray ? milliseconds(off_ms) + microseconds(between(-900, 900))
                                       : nanoseconds(microseconds(between(-400, 400))));
        if (noisy && between(0, 99) < 4) it.expose(each, milliseconds(between(3, 8)));
        if (noisy && between(0, 99) < 3) it.expose(each, milliseconds(between(12, 26)));
      }
      it.look();
      const SourceFigures figures = it.figures();
      if (found == 0 && figures.cameras[s].astray) found = i;
      if (found != 0 && over == 0 && !figures.cameras[s].astray) over = i;
      ASSERT_FALSE(figures.cameras[1 - s].astray);
      ASSERT_FALSE(figures.trigger_unanswered);
    }
    // Half a second; the one before may have been missed, and the other side's last answers.
    ASSERT_GT(found, from + 3);
    ASSERT_LE(found, from + 17);
    ASSERT_EQ(over, until + static_cast<int>(trigger::AnswerWatch::kConvincing) - 1);
    const std::string name = side == Side::kLeft ? "left" : "right";
    ASSERT_EQ(it.causes(), "camera_astray " + name + ";camera_follows " + name + ';');
    ASSERT_EQ(it.figures().cameras[s].strayings, 1U);
    if (side == Side::kLeft) {
      ASSERT_EQ(it.mono, 0U);
    } else {
      ASSERT_GE(it.mono + 8, static_cast<std::uint64_t>(over - found) * 9 / 10);
    }
    ASSERT_GE(it.pairs, 50U);
    mono += it.mono;
    it.look();
    ASSERT_EQ(it.rig.left.held() + it.rig.right.held(), 0U);
  }
  EXPECT_GT(mono, 10'000U);
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
