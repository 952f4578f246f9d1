#include "firmware-app/stereotrackd/daemon.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <set>
#include <thread>

#include "config/error.hpp"
#include "drivers/gpio/simulated_chip.hpp"
#include "firmware-app/runtime/allocation_count.hpp"
#include "firmware-app/runtime/clock.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/temp_dir.hpp"

// Real threads in real time, on a machine that may keep any of them from running: what is asserted holds however late
// they are. Exact times are the business of output_schedule_test.cpp, whose clock is simulated.
namespace stereotrack::daemon {
namespace {

using std::chrono::milliseconds;
using telemetry::Pair;
using test::film_of_scene;
using test::LiveRig;

constexpr milliseconds kPeriod{20};
const std::vector<std::string> kLatency{"latency.output_ms=30"};

signals::Signal signal(signals::Condition when) {
  signals::Signal signal;
  signal.when = when;
  signal.half_period = milliseconds(50);
  signal.limit_s = 0.001;
  return signal;
}

bool has(const Pair& pair, telemetry::Flag flag) { return (pair.header.flags & flag) != 0; }

TEST(Daemon, EachPairLeavesOnceStampedWithTheMomentOfTheContract) {
  LiveRig rig(film_of_scene(1, 80, kPeriod), kLatency);
  rig.run();
  std::set<std::uint64_t> ordinals;
  std::uint64_t sequence = 0;
  for (const Pair& pair : rig.ear.pairs()) {
    EXPECT_EQ(pair.header.session, 3U);
    EXPECT_EQ(pair.header.sequence, ++sequence);
    EXPECT_EQ(pair.header.latency_ns, 30'000'000U);
    EXPECT_EQ(pair.header.send_time_ns - pair.header.capture_time_ns, 30'000'000);
    EXPECT_TRUE(pair.live.has_value());
    if (pair.header.ordinal != 0) {
      EXPECT_TRUE(ordinals.insert(pair.header.ordinal).second) << pair.header.ordinal << " left twice";
    }
  }
  // Each of the 80 slots ended in one way.
  const std::uint64_t ends = rig.outputs("on_time") + rig.outputs("predicted_late") +
                             rig.outputs("predicted_superseded") + rig.outputs("missing") +
                             rig.outputs("overslept_pairs") + rig.outputs("overslept_missing");
  // 80 pairs were to come; a film that is kept from running passes some over, whose slots are the period's.
  EXPECT_GE(ends, rig.daemon->pool().captured);
  EXPECT_LE(rig.daemon->pool().captured, 80U);
  EXPECT_EQ(rig.ear.pairs().size(), rig.daemon->vitals().outputs.get());
  EXPECT_GT(rig.outputs("on_time"), 0U);
  EXPECT_TRUE(rig.daemon->failure().empty());
}

TEST(Daemon, EnforceBeginsNothingWhereAThreadIsNotGrantedWhatItIsToHave) {
  LiveRig rig(film_of_scene(1, 80, kPeriod), kLatency);
  config::RealTimeConfig wanted = rig.configuration.realtime;
  wanted.mode = config::RealTimeMode::kEnforce;
  for (config::ThreadConfig* thread : {&wanted.publisher, &wanted.capture, &wanted.frames}) *thread = {};
  wanted.capture.core = 1023;
  wanted.service.core = 1023;
  const std::vector<runtime::Missing> missing = rig.daemon->start(wanted, false);
  ASSERT_EQ(missing.size(), 2U);
  EXPECT_NE(missing[0].what.find("thread st-capture: core 1023: "), std::string::npos) << missing[0].what;
  EXPECT_NE(missing[1].what.find("thread service: core 1023: "), std::string::npos) << missing[1].what;
  std::this_thread::sleep_for(2 * kPeriod);
  EXPECT_EQ(rig.daemon->vitals().capture_beats.get(), 0U);
  EXPECT_EQ(rig.daemon->pool().captured, 0U);
  EXPECT_TRUE(rig.daemon->stop());
}

TEST(Daemon, TargetsLeaveAsTheyAreExpectedAtTheMomentOfLeaving) {
  LiveRig rig(film_of_scene(20, 120, kPeriod), kLatency);
  rig.run();
  // A board goes 3 px a pair to the right from pair 22 on, at 2.5 m: 3 px are 0.05 m in 20 ms. What left has it further
  // right than the pair's own box by the way of 30 ms, for which the box of the pair after next stands.
  int compared = 0;
  const std::vector<Pair>& pairs = rig.ear.pairs();
  for (std::size_t i = 2; i < pairs.size(); ++i) {
    const bool whole = pairs[i].header.ordinal == pairs[i - 1].header.ordinal + 1 &&
                       !has(pairs[i], telemetry::kPredicted) && !has(pairs[i - 1], telemetry::kPredicted);
    if (!whole || pairs[i].targets.empty() || pairs[i - 1].targets.empty()) continue;
    const telemetry::Target& now = pairs[i].targets[0];
    const telemetry::Target& before = pairs[i - 1].targets[0];
    if (now.id != before.id || !now.measured || !before.measured || pairs[i].header.ordinal > 60 ||
        pairs[i].header.ordinal < 40) {
      continue;
    }
    // Truth: at ordinal o the board's left edge is 3 (o + 19 - 41) px; 30 ms later 4.5 px more.
    const double left = 3.0 * (static_cast<double>(pairs[i].header.ordinal) + 19 - 41) + 4.5;
    EXPECT_NEAR(now.box.left, left, 2.5) << "pair " << pairs[i].header.ordinal;
    ++compared;
  }
  EXPECT_GT(compared, 0);
}

TEST(Daemon, PairsThatDoNotComeLeaveFlaggedWhereThePeriodPutsThem) {
  LiveRig rig(film_of_scene(1, 60, kPeriod, capture::Film::Repeat::kOnce, {20, 21, 40}), kLatency);
  rig.run();
  const auto missing = std::count_if(rig.ear.pairs().begin(), rig.ear.pairs().end(),
                                     [](const Pair& pair) { return has(pair, telemetry::kPairMissing); });
  EXPECT_EQ(static_cast<std::uint64_t>(missing), rig.outputs("missing"));
  EXPECT_GE(rig.outputs("missing") + rig.outputs("overslept_missing"), 3U);
  for (const Pair& pair : rig.ear.pairs()) {
    if (!has(pair, telemetry::kPairMissing)) continue;
    EXPECT_EQ(pair.header.ordinal, 0U);
    EXPECT_EQ(pair.header.send_time_ns - pair.header.capture_time_ns, 30'000'000);
    for (const telemetry::Target& target : pair.targets) EXPECT_FALSE(target.measured);
  }
}

// Makes the disparity of each n-th frame slow.
struct Slow {
  int every = 1;
  milliseconds by{0};
  int frame = 0;

  static void ended(void* self, Stage stage) noexcept {
    Slow& slow = *static_cast<Slow*>(self);
    if (stage != Stage::kDisparity || ++slow.frame % slow.every != 0) return;
    const MonotonicTime until = runtime::monotonic_now() + slow.by;
    while (runtime::monotonic_now() < until) {
    }
  }
  StageObserver observer() { return {&Slow::ended, this}; }
};

TEST(Daemon, ALateResultIsReplacedByAPredictionAtTheSameMoment) {
  Slow slow{.every = 8, .by = 2 * kPeriod};
  LiveRig rig(film_of_scene(1, 100, kPeriod), kLatency, slow.observer());
  rig.run();
  EXPECT_GT(rig.outputs("predicted_late"), 0U);
  EXPECT_GT(rig.outputs("late_results"), 0U);
  int predicted = 0;
  for (const Pair& pair : rig.ear.pairs()) {
    EXPECT_EQ(pair.header.send_time_ns - pair.header.capture_time_ns, 30'000'000);
    if (!has(pair, telemetry::kPredicted)) continue;
    ++predicted;
    EXPECT_NE(pair.header.ordinal, 0U);
    for (const telemetry::Target& target : pair.targets) {
      EXPECT_FALSE(target.measured);
      EXPECT_NE(target.state, telemetry::TargetState::kConfirmed);
    }
  }
  EXPECT_GT(predicted, 0);
}

TEST(Daemon, EffortIsShedInItsOrderWhenTheTimeRunsOutAndSaidSo) {
  Slow slow{.every = 1, .by = kPeriod + milliseconds(2)};
  LiveRig rig(film_of_scene(1, 60, kPeriod), {"latency.output_ms=60", "shed.order=corners,dense_map"}, slow.observer());
  rig.run();
  const Vitals& vitals = rig.daemon->vitals();
  EXPECT_GE(vitals.effort_overruns.get(), 2U);
  EXPECT_EQ(vitals.efforts_shed.get(), 2U);
  EXPECT_EQ(vitals.efforts_left_out.get(), bit_of(Effort::kCorners) | bit_of(Effort::kDenseMap));
  std::set<int> told;
  for (const Pair& pair : rig.ear.pairs()) {
    told.insert(pair.live->efforts_shed);
    EXPECT_TRUE(!has(pair, telemetry::kEffortShed) || pair.live->efforts_shed != 0);
  }
  EXPECT_TRUE(told.contains(bit_of(Effort::kCorners) | bit_of(Effort::kDenseMap)));
}

TEST(Daemon, ALoopThatFallsBehindTakesTheNewestPairAndCountsTheOthers) {
  Slow slow{.every = 1, .by = 5 * kPeriod};
  LiveRig rig(film_of_scene(1, 60, kPeriod), {"latency.output_ms=60"}, slow.observer());
  rig.run();
  const capture::FramePool::Counters pool = rig.daemon->pool();
  EXPECT_GT(pool.skipped + pool.evicted, 10U);
  EXPECT_GT(rig.outputs("predicted_superseded") + rig.outputs("predicted_late"), 10U);
  EXPECT_EQ(rig.daemon->vitals().frames.get() + rig.daemon->vitals().frames_left.get() + pool.skipped + pool.evicted,
            pool.captured);
}

TEST(Daemon, RealTimeThreadsMakeNoHeapCall) {
  if (!allocations_are_counted()) GTEST_SKIP() << "a sanitizer has a malloc of its own";
  Slow slow{.every = 9, .by = 2 * kPeriod};
  LiveRig rig(film_of_scene(1, 150, kPeriod, capture::Film::Repeat::kOnce, {70, 71}), kLatency, slow.observer(),
              {{.name = {"sim", "heap"}}}, {signal(signals::Condition::kConfirmed)});
  rig.run();
  EXPECT_GT(rig.daemon->vitals().frames.get(), FrameLoop::kWarmUpFrames);
  EXPECT_EQ(rig.daemon->vitals().frame_allocations.get(), 0U);
  EXPECT_EQ(rig.daemon->vitals().publisher_allocations.get(), 0U);
  EXPECT_EQ(rig.daemon->vitals().capture_allocations.get(), 0U);
}

TEST(Daemon, LinesFollowTargetsAndAreSafeAtTheEnd) {
  // A board moves in pairs 41 to 360 of the scene.
  bool was_high = false;
  LiveRig rig(film_of_scene(1, 110, kPeriod), kLatency, {}, {{.name = {"sim", "target"}}},
              {signal(signals::Condition::kConfirmed)});
  EXPECT_EQ(gpio::simulated_chip::level("target"), false);
  rig.run([&] {
    was_high = was_high || gpio::simulated_chip::level("target") == true;
    return false;
  });
  EXPECT_TRUE(was_high);
  EXPECT_EQ(gpio::simulated_chip::level("target"), false);
  EXPECT_EQ(rig.daemon->vitals().lines_failed.get(), 0U);
}

TEST(Daemon, AChipThatIsGoneIsCountedAndNothingElseStops) {
  LiveRig rig(film_of_scene(1, 60, kPeriod), kLatency, {}, {{.name = {"sim", "gone"}}},
              {signal(signals::Condition::kHeartbeat)});
  gpio::simulated_chip::set_gone("gone", true);
  rig.run();
  gpio::simulated_chip::set_gone("gone", false);
  EXPECT_GT(rig.daemon->vitals().lines_failed.get(), 0U);
  EXPECT_GT(rig.ear.pairs().size(), 0U);
}

bool is_well(const LiveRig& rig) {
  return !rig.ear.statuses().empty() && (rig.ear.statuses().back().health & telemetry::kHealthLineFailed) == 0;
}

/// Half a minute: what has not come by then never does.
bool is_long(const LiveRig& rig) { return rig.ear.statuses().size() > 30; }

TEST(Daemon, AnOutputChipThatWentIsDrivenAgainWithoutARestart) {
  LiveRig rig(film_of_scene(1, 100, kPeriod, capture::Film::Repeat::kBounce), kLatency, {},
              {{.name = {"sim", "usb_heart"}}, {.name = {"sim", "usb_still"}}},
              {signal(signals::Condition::kHeartbeat), signal(signals::Condition::kTimeToReachBelow)});
  const auto beats = [] { return gpio::simulated_chip::edges("usb_heart"); };
  int step = 0;
  std::uint64_t before = 0;
  rig.run([&] {
    if (step == 0 && beats() > 4 && is_well(rig)) {
      gpio::simulated_chip::set_gone("usb_heart", true);
      ++step;
    } else if (step == 1 && !is_well(rig)) {
      EXPECT_EQ(rig.daemon->lines().gone(), 0b11U);
      before = beats();
      gpio::simulated_chip::set_gone("usb_heart", false);
      ++step;
    } else if (step == 2 && beats() > before + 4 && is_well(rig)) {
      ++step;
    }
    return step == 3 || is_long(rig);
  });
  EXPECT_EQ(step, 3);
  EXPECT_EQ(rig.daemon->lines().gone(), 0U);
  EXPECT_EQ(rig.daemon->lines().outages(), 1U);
  EXPECT_EQ(rig.daemon->vitals().publisher_allocations.get(), 0U);
  EXPECT_EQ(gpio::simulated_chip::level("usb_heart"), false) << "safe at the end, on the new request";
}

TEST(Daemon, AChipThatIsBackOnlyAtTheEndIsMadeSafeThen) {
  LiveRig rig(film_of_scene(1, 100, kPeriod, capture::Film::Repeat::kBounce), kLatency, {},
              {{.name = {"sim", "late_heart"}}}, {signal(signals::Condition::kHeartbeat)});
  bool went = false;
  rig.run([&] {
    if (!went && gpio::simulated_chip::level("late_heart") == true) {
      gpio::simulated_chip::set_gone("late_heart", went = true);
    }
    if (!went || rig.daemon->lines().gone() == 0) return is_long(rig);
    gpio::simulated_chip::set_gone("late_heart", false);
    return true;
  });
  EXPECT_TRUE(went);
  EXPECT_EQ(rig.daemon->lines().outages(), 1U);
  EXPECT_EQ(gpio::simulated_chip::level("late_heart"), false);
}

TEST(Daemon, AnOutputChipThatWentIsNoticedThoughNothingChanges) {
  LiveRig rig(film_of_scene(1, 100, kPeriod, capture::Film::Repeat::kBounce), kLatency, {},
              {{.name = {"sim", "usb_quiet"}}}, {signal(signals::Condition::kTimeToReachBelow)});
  bool went = false;
  rig.run([&] {
    if (!went && !rig.ear.pairs().empty()) gpio::simulated_chip::set_gone("usb_quiet", went = true);
    return is_long(rig) || (went && rig.daemon->lines().gone() != 0);
  });
  gpio::simulated_chip::set_gone("usb_quiet", false);
  EXPECT_EQ(gpio::simulated_chip::edges("usb_quiet"), 0U);
  EXPECT_EQ(rig.daemon->lines().outages(), 1U);
}

Inputs::Setup button(const std::string& line, bool record = true) {
  Inputs::Input input;
  input.name = "button";
  input.spec = {.name = {"sim", line}, .edges = gpio::Edges::kBoth};
  input.apart = std::chrono::seconds(5);
  return {{input}, record};
}

TEST(Daemon, AnEdgeOfAnInputIsAReasonToRecordUnlessItComesTooSoon) {
  const test::TempDir folder;
  LiveRig rig(film_of_scene(1, 100, kPeriod, capture::Film::Repeat::kBounce),
              {"latency.output_ms=30", "record.on=true", "record.seconds=1", "record.seconds_after=0.1",
               "record.on_deadline=false", "record.directory=" + folder.path().string()});
  rig.daemon->inputs().exchange(button("button"), rig.daemon->black_box());
  const auto drive = [](bool high, int s) {
    gpio::simulated_chip::drive("button", high, MonotonicTime(std::chrono::seconds(s)));
  };
  const record::BlackBox::Counters& box = rig.daemon->black_box()->counters();
  int step = 0;
  rig.run([&] {
    if (step == 0 && box.frames.load() > 20) {
      for (const int s : {100, 101, 104}) drive(s != 101, s);  // the last two come too soon
      ++step;
    } else if (step == 1 && box.recordings.load() == 1) {
      drive(false, 106);
      ++step;
    }
    return is_long(rig) || (box.recordings.load() == 2 && rig.ear.statuses().size() > 1);
  });
  EXPECT_EQ(rig.daemon->inputs().events(0), 4U);
  EXPECT_EQ(rig.daemon->inputs().lost(0), 0U);
  EXPECT_EQ(rig.daemon->inputs().triggers(0), 2U);
  EXPECT_EQ(box.triggers.load() + box.merged.load(), 2U);
  EXPECT_NE(rig.daemon->black_box()->last_recording().find("-gpio.strec"), std::string::npos);
  const telemetry::Status& status = rig.ear.statuses().back();
  EXPECT_EQ(status.recorder_slots, rig.daemon->black_box()->slots());
  EXPECT_GT(status.recorder_slots_free_low, 0U);
  EXPECT_LT(status.recorder_slots_free_low, status.recorder_slots);
}

TEST(Daemon, AnEdgeIsCountedAndNoMoreWhereItIsNoReasonToRecord) {
  LiveRig rig(film_of_scene(1, 30, kPeriod), kLatency);
  rig.daemon->inputs().exchange(button("button_idle", false), rig.daemon->black_box());
  gpio::simulated_chip::drive("button_idle", true, MonotonicTime(std::chrono::seconds(100)));
  rig.run();
  EXPECT_EQ(rig.daemon->inputs().events(0), 1U);
  EXPECT_EQ(rig.daemon->inputs().triggers(0), 0U);
}

TEST(Daemon, AnInputChipThatWentIsToldInTheHealthAndReadAgain) {
  LiveRig rig(film_of_scene(1, 100, kPeriod, capture::Film::Repeat::kBounce), kLatency);
  rig.daemon->inputs().exchange(button("usb_button"), rig.daemon->black_box());
  int step = 0;
  rig.run([&] {
    if (step == 0 && is_well(rig)) {
      gpio::simulated_chip::set_gone("usb_button", true);
      ++step;
    } else if (step == 1 && !is_well(rig)) {
      gpio::simulated_chip::set_gone("usb_button", false);
      ++step;
    } else if (step == 2 && is_well(rig)) {
      gpio::simulated_chip::drive("usb_button", true, MonotonicTime(std::chrono::seconds(100)));
      ++step;
    }
    return is_long(rig) || (step == 3 && rig.daemon->inputs().events(0) == 1);
  });
  EXPECT_EQ(step, 3);
  EXPECT_EQ(rig.daemon->inputs().events(0), 1U);
  EXPECT_EQ(rig.daemon->inputs().outages(), 1U);
}

TEST(Inputs, ExchangedTheyKeepTheirCountsAndWhatCannotBeHadChangesNothing) {
  Inputs inputs(button("swap_a"));
  gpio::simulated_chip::drive("swap_a", true, MonotonicTime(std::chrono::seconds(1)));
  inputs.take(nullptr);
  EXPECT_EQ(inputs.events(0), 1U);
  inputs.exchange(button("swap_b"), nullptr);
  EXPECT_EQ(inputs.events(0), 1U) << "of the same name";
  gpio::simulated_chip::drive("swap_b", true, MonotonicTime(std::chrono::seconds(2)));
  inputs.take(nullptr);
  EXPECT_EQ(inputs.events(0), 2U);

  const Inputs other(button("swap_held"));
  EXPECT_THROW(inputs.exchange(button("swap_held"), nullptr), std::runtime_error);
  EXPECT_EQ(to_string(inputs.line(0)), "sim:swap_b");
  gpio::simulated_chip::drive("swap_b", false, MonotonicTime(std::chrono::seconds(3)));
  inputs.take(nullptr);
  EXPECT_EQ(inputs.events(0), 3U);
  inputs.exchange({}, nullptr);
  EXPECT_EQ(inputs.size(), 0U);
  EXPECT_EQ(inputs.descriptor(), -1);
}

TEST(LineCare, AsksAtOnceThenEverMoreRarelyAndBeginsAnewAfterARest) {
  using std::chrono::seconds;
  LineCare care("test");
  const auto at = [](int ms) { return MonotonicTime(seconds(1000) + milliseconds(ms)); };
  std::vector<int> asked;
  const auto round = [&](int from, int to, gpio::LineBits gone) {
    for (int ms = from; ms < to; ms += 100) {
      if (care.is_due(gone, at(ms))) asked.push_back(ms);
    }
  };
  round(0, 1000, 0);
  EXPECT_TRUE(asked.empty());
  round(1000, 14'000, 1);
  EXPECT_EQ(asked, (std::vector<int>{1000, 1500, 2500, 4500, 8500, 12'500}));
  asked.clear();
  round(14'000, 15'000, 0);
  round(15'000, 20'000, 1);
  EXPECT_EQ(asked, (std::vector<int>{16'500})) << "a short rest is none";
  asked.clear();
  round(20'000, 25'000, 0);
  round(25'000, 26'000, 1);
  EXPECT_EQ(asked, (std::vector<int>{25'000, 25'500}));
}

/// Pairs with a skew.
class Skewed final : public capture::FrameSource {
 public:
  explicit Skewed(std::vector<std::chrono::microseconds> skews)
      : scene_(1, static_cast<int>(skews.size()), kPeriod), skews_(std::move(skews)) {}
  [[nodiscard]] const capture::SourceInfo& info() const noexcept override { return scene_.info(); }
  [[nodiscard]] capture::Next next(FramePair& out) noexcept override {
    const capture::Next next = scene_.next(out);
    if (next == capture::Next::kPair) out.skew = skews_[static_cast<std::size_t>(out.ordinal - 1)];
    return next;
  }
  [[nodiscard]] const std::string& skip_reason() const noexcept override { return scene_.skip_reason(); }
  void skip_to(std::uint64_t ordinal) noexcept override { scene_.skip_to(ordinal); }

 private:
  test::SceneSource scene_;
  std::vector<std::chrono::microseconds> skews_;
};

TEST(Daemon, TheStatusTellsTheLargestSkewOfPairsWhateverItsSign) {
  using std::chrono::microseconds;
  Skewed source({microseconds(12), microseconds(-340), microseconds(25)});
  LiveRig rig(std::make_unique<capture::Film>(source, capture::Film::Config{.repeat = capture::Film::Repeat::kLoop}),
              kLatency);
  rig.run([&] { return rig.ear.statuses().size() >= 2; });
  ASSERT_FALSE(rig.ear.statuses().empty());
  EXPECT_EQ(rig.ear.statuses().back().skew_max_us, 340U);
  EXPECT_EQ(rig.ear.statuses().back().recorder_slots, 0U) << "it does not record";
}

TEST(Daemon, AStatusLeavesEverySecondAlsoWithoutPairs) {
  // One pair, then none for long.
  LiveRig rig(film_of_scene(1, 2, milliseconds(60'000), capture::Film::Repeat::kLoop),
              {"latency.output_ms=30", "latency.missing_limit=1"});
  rig.run([&] { return rig.ear.statuses().size() >= 3; });
  ASSERT_GE(rig.ear.statuses().size(), 3U);
  EXPECT_EQ(rig.ear.statuses().back().pairs_captured, 1U);
  EXPECT_EQ(rig.ear.statuses().back().latency_us, 30'000U);
  EXPECT_GE(rig.ear.statuses().back().uptime_ms, 1900U);
}

TEST(Daemon, GoesOnWithAnotherPlanAndFreesTheOldOne) {
  LiveRig rig(film_of_scene(1, 1000, kPeriod, capture::Film::Repeat::kLoop), kLatency);
  test::Ear elsewhere;
  bool exchanged = false;
  rig.run([&] {
    elsewhere.listen();
    if (rig.ear.pairs().size() >= 5 && !exchanged) {
      exchanged = true;
      for (int i = 0; i < 3; ++i) {
        rig.daemon->exchange(std::make_unique<Plan>(
            Plan{std::make_unique<telemetry::UdpSender>(elsewhere.here()), test::rules_of({}), 0}));
      }
    }
    return elsewhere.pairs().size() >= 5;
  });
  ASSERT_GE(elsewhere.pairs().size(), 5U);
  EXPECT_GE(rig.daemon->vitals().reloads.get(), 1U);
  // One stream: what left for the one place and for the other has each number once.
  std::set<std::uint64_t> sequences;
  for (const Pair& pair : rig.ear.pairs()) EXPECT_TRUE(sequences.insert(pair.header.sequence).second);
  for (const Pair& pair : elsewhere.pairs()) EXPECT_TRUE(sequences.insert(pair.header.sequence).second);
}

TEST(Daemon, LatencyOfMorePairsThanTheScheduleHoldsIsRefusedByItsKey) {
  try {
    const LiveRig rig(film_of_scene(1, 3, milliseconds(1)), {"latency.output_ms=50"});
    FAIL() << "it was taken";
  } catch (const config::Error& error) {
    EXPECT_NE(std::string(error.what()).find("latency.output_ms"), std::string::npos) << error.what();
  }
}

TEST(Daemon, StopsWithoutHavingStartedAndTwice) {
  LiveRig rig(film_of_scene(1, 3, kPeriod), kLatency);
  rig.daemon->stop();
  rig.daemon->stop();
  EXPECT_EQ(rig.daemon->vitals().frames.get(), 0U);
}

// A camera that vanishes.
class Vanishing final : public capture::LiveSource {
 public:
  explicit Vanishing(std::unique_ptr<capture::Film> film) : film_(std::move(film)) {}
  [[nodiscard]] const capture::SourceInfo& info() const noexcept override { return film_->info(); }
  [[nodiscard]] Step step(capture::PairOutlet& outlet, MonotonicTime until) noexcept override {
    return ++steps_ > 10 ? Step::kFailed : film_->step(outlet, until);
  }
  [[nodiscard]] ClockMap clock_map() const noexcept override { return film_->clock_map(); }
  [[nodiscard]] const std::string& failure() const noexcept override { return failure_; }

 private:
  std::unique_ptr<capture::Film> film_;
  int steps_ = 0;
  std::string failure_ = "/dev/video0: gone: check its cable";
};

TEST(Daemon, ASourceThatFailsEndsItWithTheReason) {
  LiveRig rig(std::make_unique<Vanishing>(film_of_scene(1, 60, kPeriod)), kLatency);
  rig.run();
  EXPECT_EQ(rig.daemon->failure(), "/dev/video0: gone: check its cable");
}

// A capture clock that steps: stamps jump by minutes while the monotonic clock goes on.
class Stepping final : public capture::LiveSource {
 public:
  explicit Stepping(std::unique_ptr<capture::Film> film) : film_(std::move(film)) {}
  [[nodiscard]] const capture::SourceInfo& info() const noexcept override { return film_->info(); }
  [[nodiscard]] Step step(capture::PairOutlet& outlet, MonotonicTime until) noexcept override {
    if (++steps_ == 40) offset_.store(std::chrono::nanoseconds(std::chrono::minutes(3)).count());
    (void)outlet;
    capture::FramePool pool(2);
    capture::PairOutlet::Notices notices;
    capture::Doorbell bell;
    capture::PairOutlet own(pool, notices, bell);
    const Step step = film_->step(own, until);
    if (const capture::PairLease lease = pool.take_oldest()) {
      FramePair pair = *lease;
      pair.capture_time += std::chrono::nanoseconds(offset_.load());
      (void)outlet.put(pair);
    }
    return step;
  }
  [[nodiscard]] ClockMap clock_map() const noexcept override {
    return {CaptureTime(std::chrono::nanoseconds(offset_.load())), MonotonicTime()};
  }
  [[nodiscard]] const std::string& failure() const noexcept override { return film_->failure(); }

 private:
  std::unique_ptr<capture::Film> film_;
  int steps_ = 0;
  std::atomic<std::int64_t> offset_{0};
};

TEST(Daemon, AClockThatStepsIsMeasuredAnewAndTold) {
  LiveRig rig(std::make_unique<Stepping>(film_of_scene(1, 120, kPeriod)), kLatency);
  rig.run();
  EXPECT_EQ(rig.daemon->vitals().clock_steps.get(), 1U);
  const std::vector<Pair>& pairs = rig.ear.pairs();
  const auto told =
      std::count_if(pairs.begin(), pairs.end(), [](const Pair& pair) { return has(pair, telemetry::kClockStepped); });
  EXPECT_EQ(told, 1);
  // It goes on: pairs of after the step leave with results of their own.
  ASSERT_FALSE(pairs.empty());
  EXPECT_EQ(rig.daemon->vitals().clock_steps.get(), 1U);
  EXPECT_EQ(rig.outputs("from_past") + rig.outputs("outages"), 0U);
}

}  // namespace
}  // namespace stereotrack::daemon
