#include "firmware-app/runtime/effort.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <random>
#include <string>
#include <vector>

namespace stereotrack::runtime {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;

constexpr milliseconds kBudget{10};

EffortController::Config config() {
  EffortController::Config out;
  for (const Effort effort : {Effort::kDenseMap, Effort::kCorners, Effort::kLevelSet}) (void)out.order.push(effort);
  out.restore_after = 5;
  out.patience_most = 40;
  return out;
}
EffortController make(const EffortController::Config& of = config()) { return *EffortController::create(of); }

EffortBits after(EffortController& controller, double load, int frames = 1) {
  EffortBits bits = controller.shed();
  for (int i = 0; i < frames; ++i) {
    bits = controller.next(nanoseconds(static_cast<std::int64_t>(load * 1e7)), kBudget);
  }
  return bits;
}

constexpr EffortBits kOne = bit_of(Effort::kDenseMap);
constexpr EffortBits kTwo = kOne | bit_of(Effort::kCorners);
constexpr EffortBits kAll = kTwo | bit_of(Effort::kLevelSet);

TEST(Effort, RefusesWhatContradictsItself) {
  const auto is_bad = [](auto change) {
    EffortController::Config bad = config();
    change(bad);
    const auto made = EffortController::create(bad);
    return !made.has_value() && made.error() == Fault::kBadConfig;
  };
  EXPECT_FALSE(is_bad([](auto&) {}));
  EXPECT_TRUE(is_bad([](auto& c) { (void)c.order.push(Effort::kCorners); })) << "named twice";
  EXPECT_TRUE(is_bad([](auto& c) { (void)c.order.push(static_cast<Effort>(4)); }));
  EXPECT_TRUE(is_bad([](auto& c) { c.restore_below = c.shed_above; }));
  EXPECT_TRUE(is_bad([](auto& c) { c.restore_below = 0; }));
  EXPECT_TRUE(is_bad([](auto& c) { c.shed_above = 1.01; }));
  EXPECT_TRUE(is_bad([](auto& c) { c.shed_after = 0; }));
  EXPECT_TRUE(is_bad([](auto& c) { c.restore_after = 0; }));
  EXPECT_TRUE(is_bad([](auto& c) { c.patience_most = 4; }));
}

TEST(Effort, EachHasItsBitAndItsName) {
  EXPECT_EQ(bit_of(Effort::kLevelSet), 1);
  EXPECT_EQ(bit_of(Effort::kCorners), 2);
  EXPECT_EQ(bit_of(Effort::kBackgroundDisparity), 4);
  EXPECT_EQ(bit_of(Effort::kDenseMap), 8);
  EXPECT_EQ(std::string(to_string(Effort::kLevelSet)), "level_set");
  EXPECT_EQ(std::string(to_string(Effort::kDenseMap)), "dense_map");
}

TEST(Effort, WithinTheBudgetNothingIsShed) {
  EffortController controller = make();
  EXPECT_EQ(after(controller, 0.9, 1000), 0) << "at the limit, not above";
  EXPECT_EQ(after(controller, 1.0, 2), 0) << "exactly the budget is no overrun, twice is no row";
  EXPECT_EQ(controller.counters().overruns, 0U);
}

TEST(Effort, OneOverrunShedsTheFirstInOrder) {
  EffortController controller = make();
  EXPECT_EQ(controller.next(kBudget + nanoseconds(1), kBudget), kOne);
  EXPECT_EQ(after(controller, 1.5), kTwo);
  EXPECT_EQ(after(controller, 1.5), kAll);
  EXPECT_EQ(after(controller, 1.5), kAll);
  const auto& counters = controller.counters();
  EXPECT_EQ(counters.overruns, 4U);
  EXPECT_EQ(counters.helpless, 1U);
  EXPECT_EQ(counters.sheds, (std::array<std::uint64_t, kEfforts>{1, 1, 0, 1}));
  EXPECT_EQ(counters.frames, (std::array<std::uint64_t, kEfforts>{2, 3, 0, 4}));
}

TEST(Effort, ARowOfHeavyFramesShedsBeforeTheBudgetIsGone) {
  EffortController controller = make();
  EXPECT_EQ(after(controller, 0.95, 2), 0);
  EXPECT_EQ(after(controller, 0.75), 0) << "ends the row";
  EXPECT_EQ(after(controller, 0.95, 2), 0);
  EXPECT_EQ(after(controller, 0.95), kOne);
  EXPECT_EQ(after(controller, 0.95, 2), kOne) << "the row begins anew with the shed";
  EXPECT_EQ(after(controller, 0.95), kTwo);
  EXPECT_EQ(controller.counters().overruns, 0U);
}

TEST(Effort, ComesBackInTheOppositeOrderAfterARowOfLightFrames) {
  EffortController controller = make();
  after(controller, 1.5, 3);
  EXPECT_EQ(after(controller, 0.5, 4), kAll);
  EXPECT_EQ(after(controller, 0.5), kTwo);
  EXPECT_EQ(after(controller, 0.5, 4), kTwo);
  EXPECT_EQ(after(controller, 0.5), kOne);
  EXPECT_EQ(after(controller, 0.5, 5), 0);
  EXPECT_EQ(after(controller, 0.5, 100), 0);
  EXPECT_EQ(controller.counters().restores, (std::array<std::uint64_t, kEfforts>{1, 1, 0, 1}));
}

TEST(Effort, BetweenTheTwoFractionsNothingChanges) {
  EffortController controller = make();
  after(controller, 1.5);
  EXPECT_EQ(after(controller, 0.6, 1000), kOne) << "at the lower one, not below";
  EXPECT_EQ(after(controller, 0.59, 4), kOne);
  EXPECT_EQ(after(controller, 0.7), kOne) << "ends the row";
  EXPECT_EQ(after(controller, 0.59, 4), kOne);
  EXPECT_EQ(after(controller, 0.59), 0);
}

TEST(Effort, WithoutABudgetEveryFrameIsAnOverrun) {
  EffortController controller = make();
  EXPECT_EQ(controller.next(nanoseconds(0), nanoseconds(0)), kOne);
  EXPECT_EQ(controller.next(milliseconds(1), nanoseconds(-5)), kTwo);
  EXPECT_EQ(controller.counters().overruns, 2U);
}

TEST(Effort, NothingNamedIsNothingShed) {
  EffortController::Config none = config();
  none.order.clear();
  EffortController controller = make(none);
  EXPECT_EQ(after(controller, 2, 10), 0);
  EXPECT_EQ(controller.counters().helpless, 10U);
  EXPECT_EQ(after(controller, 0.1, 100), 0);
}

TEST(Effort, AFailedReturnDoublesThePatienceUpToItsLimit) {
  EffortController controller = make();
  after(controller, 1.5);
  for (const int patience : {5, 10, 20, 40, 40, 40}) {
    EXPECT_EQ(controller.patience(), patience);
    EXPECT_EQ(after(controller, 0.5, patience - 1), kOne);
    EXPECT_EQ(after(controller, 0.5), 0) << "a trial";
    EXPECT_EQ(after(controller, 1.2), kOne) << "that fails";
  }
  EXPECT_EQ(controller.counters().failed_trials, 6U);
}

TEST(Effort, ASurvivedReturnForgetsTheFailures) {
  EffortController controller = make();
  after(controller, 1.5);
  after(controller, 0.5, 5);
  after(controller, 1.2);
  EXPECT_EQ(controller.patience(), 10);
  EXPECT_EQ(after(controller, 0.5, 10), 0);
  EXPECT_EQ(after(controller, 0.8, 10), 0) << "back, and neither light nor heavy";
  EXPECT_EQ(controller.patience(), 10);
  after(controller, 0.8);
  EXPECT_EQ(controller.patience(), 5);
  EXPECT_EQ(after(controller, 1.2), kOne) << "much later: another matter, not a failed trial";
  EXPECT_EQ(controller.patience(), 5);
  EXPECT_EQ(controller.counters().failed_trials, 1U);
}

/// A pipeline that takes 5 ms without its efforts, and for each effort what it costs.
struct Plant {
  std::array<microseconds, kEfforts> cost{};
  microseconds base{5000};
  [[nodiscard]] nanoseconds run(EffortBits left_out) const {
    nanoseconds time = base;
    for (std::size_t i = 0; i < kEfforts; ++i) {
      if ((left_out >> i & 1U) == 0) time += cost[i];
    }
    return time;
  }
};

std::uint64_t overruns_of(const EffortController::Config& of, const Plant& plant, int frames) {
  EffortController controller = make(of);
  EffortBits left_out = 0;
  for (int i = 0; i < frames; ++i) left_out = controller.next(plant.run(left_out), kBudget);
  return controller.counters().overruns;
}

TEST(Effort, ThatNeverFitsCostsFewOverrunsWherePlainHysteresisSwings) {
  EffortController::Config with_patience = config();
  with_patience.restore_after = 60;
  with_patience.patience_most = 3600;
  EffortController::Config plain = with_patience;
  plain.patience_most = plain.restore_after;
  Plant plant;
  plant.cost[static_cast<std::size_t>(Effort::kDenseMap)] = milliseconds(6);  // 11 ms with it
  EXPECT_EQ(overruns_of(plain, plant, 36000), 591U) << "one each 61 frames, the first at once";
  // At once; after 60, 120, ... 1920 light frames, which ends at frame 3787; then every 3601 frames.
  EXPECT_EQ(overruns_of(with_patience, plant, 36000), 1U + 6U + 8U);
}

TEST(Effort, ASlowStageShedsInOrderAndAllComesBackWhenItIsOver) {
  Plant plant;
  plant.base = microseconds(1900);
  plant.cost.fill(milliseconds(1));  // 5.9 ms in all: just light
  EffortController controller = make();
  std::vector<EffortBits> path;
  EffortBits left_out = 0;
  for (int frame = 0; frame < 2000; ++frame) {
    Plant now = plant;
    if (frame >= 100 && frame < 600) now.base += microseconds(6500);  // 12.4 ms: three must go
    left_out = controller.next(now.run(left_out), kBudget);
    if (path.empty() || path.back() != left_out) path.push_back(left_out);
    if (frame == 599) {
      EXPECT_EQ(left_out, kAll);
    }
  }
  EXPECT_EQ(path, (std::vector<EffortBits>{0, kOne, kTwo, kAll, kTwo, kOne, 0}));
  EXPECT_EQ(controller.counters().overruns, 3U) << "12.4, 11.4, 10.4 ms";
}

TEST(Effort, TheSameTimesGiveTheSameDecisions) {
  std::mt19937 random(5);
  EffortController a = make();
  EffortController b = make();
  int changes = 0;
  EffortBits last = 0;
  for (int i = 0; i < 20000; ++i) {
    const nanoseconds compute = microseconds(3000 + random() % 7300);
    const EffortBits bits = a.next(compute, kBudget);
    ASSERT_EQ(bits, b.next(compute, kBudget));
    ASSERT_EQ(bits, a.shed());
    // Always a beginning of the order.
    ASSERT_TRUE(bits == 0 || bits == kOne || bits == kTwo || bits == kAll);
    if (bits != last) ++changes;
    last = bits;
  }
  EXPECT_GT(changes, 10);
}

}  // namespace
}  // namespace stereotrack::runtime
