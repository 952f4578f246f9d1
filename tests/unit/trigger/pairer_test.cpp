#include "drivers/trigger/pairer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

namespace stereotrack::trigger {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

constexpr milliseconds kPeriod{16};

Pairer make(double tolerance = 0.25, bool sequenced = false) {
  return *Pairer::create({.period = kPeriod, .tolerance = tolerance, .sequenced = sequenced});
}

CaptureTime at(double periods) {
  return CaptureTime(
      nanoseconds(static_cast<std::int64_t>(1e9 + periods * static_cast<double>(nanoseconds(kPeriod).count()))));
}

/// Frame number `number`, exposed at its time; the number is also sequence and buffer.
SideFrame frame(int number, double periods) {
  return {at(periods), static_cast<std::uint64_t>(number), static_cast<std::uint32_t>(number)};
}
SideFrame frame(int number) { return frame(number, number); }

/// What every run owes, whatever came: each frame goes out once, pairs have one number and rise in time.
class Ledger {
 public:
  void push(Pairer& pairer, Side side, const SideFrame& in) {
    ++in_[key(side, in)];
    ++pushed_;
    take(pairer.push(side, in));
  }
  void take(const Pairer::Outcome& outcome) {
    for (const Settled& settled : outcome) {
      ++verdicts[settled.verdict];
      if (settled.left) ++out_[key(Side::kLeft, *settled.left)];
      if (settled.right) ++out_[key(Side::kRight, *settled.right)];
      if (settled.ordinal != 0) {
        if (settled.ordinal != last_ordinal_ + 1) fault = "ordinals do not rise by one";
        last_ordinal_ = settled.ordinal;
      }
      const bool two = settled.verdict == Verdict::kPaired || settled.verdict == Verdict::kDisagreed;
      if (two != (settled.left && settled.right)) fault = "a verdict with the wrong number of frames";
      if (settled.verdict != Verdict::kPaired) continue;
      if (settled.left->buffer != settled.right->buffer) {
        fault = "left " + std::to_string(settled.left->buffer) + " with right " + std::to_string(settled.right->buffer);
      }
      pairs.insert(static_cast<int>(settled.left->buffer));
      if (settled.left->mid_exposure <= last_pair_ && !may_go_back) fault = "pairs out of order";
      last_pair_ = settled.left->mid_exposure;
    }
  }
  /// At the end. Empty: all is well.
  std::string end(Pairer& pairer) {
    take(pairer.restart());
    if (fault.empty() && in_ != out_) fault = "a frame lost or doubled";
    return fault;
  }

  std::string fault;
  std::set<int> pairs;
  std::map<Verdict, int> verdicts;
  bool may_go_back = false;  ///< the clock does

 private:
  static std::uint64_t key(Side side, const SideFrame& in) {
    return (std::uint64_t{in.buffer} << 1) | static_cast<std::uint64_t>(side);
  }
  std::map<std::uint64_t, int> in_, out_;
  int pushed_ = 0;
  std::uint64_t last_ordinal_ = 0;
  CaptureTime last_pair_{};
};

/// All orders in which `left` lefts and `right` rights can arrive, each side in its own order: bit i of a pattern says
/// that arrival i is a right.
std::vector<unsigned> interleavings(int left, int right) {
  std::vector<unsigned> out;
  for (unsigned pattern = 0; pattern < (1U << (left + right)); ++pattern) {
    if (__builtin_popcount(pattern) == right) out.push_back(pattern);
  }
  return out;
}

TEST(Pairer, RefusesWhatCannotWork) {
  EXPECT_EQ(Pairer::create({.period = nanoseconds(0)}).error(), Fault::kBadConfig);
  EXPECT_EQ(Pairer::create({.period = nanoseconds(-1)}).error(), Fault::kBadConfig);
  EXPECT_EQ(Pairer::create({.period = kPeriod, .tolerance = 0}).error(), Fault::kBadConfig);
  EXPECT_EQ(Pairer::create({.period = kPeriod, .tolerance = 0.51}).error(), Fault::kBadConfig);
  EXPECT_TRUE(Pairer::create({.period = kPeriod, .tolerance = 0.5}).has_value());
  Pairer pairer = make();
  EXPECT_EQ(pairer.set_period(nanoseconds(0)).error(), Fault::kBadConfig);
}

TEST(Pairer, PairsWithinTheToleranceAndGivesTheSkew) {
  Pairer pairer = make(0.25);  // 4 ms
  EXPECT_TRUE(pairer.push(Side::kLeft, {at(0), 0, 7}).empty());
  EXPECT_EQ(pairer.waiting(), 1U);
  const auto& outcome = pairer.push(Side::kRight, {at(0) + milliseconds(4), 0, 9});
  ASSERT_EQ(outcome.size(), 1U);
  EXPECT_EQ(outcome[0].verdict, Verdict::kPaired);
  EXPECT_EQ(outcome[0].ordinal, 1U);
  EXPECT_EQ(outcome[0].left->buffer, 7U);
  EXPECT_EQ(outcome[0].right->buffer, 9U);
  EXPECT_EQ(outcome[0].skew(), milliseconds(4));
  EXPECT_EQ(pairer.waiting(), 0U);
  (void)pairer.push(Side::kRight, {at(1) - milliseconds(4), 1, 1});
  EXPECT_EQ(pairer.push(Side::kLeft, {at(1), 1, 1})[0].skew(), -milliseconds(4));
  EXPECT_EQ(pairer.counters().paired, 2U);
}

TEST(Pairer, ANanosecondBeyondTheToleranceIsNoPair) {
  Pairer pairer = make(0.25);
  (void)pairer.push(Side::kLeft, {at(0), 0, 7});
  const auto& outcome = pairer.push(Side::kRight, {at(0) + milliseconds(4) + nanoseconds(1), 0, 9});
  ASSERT_EQ(outcome.size(), 1U);
  EXPECT_EQ(outcome[0].verdict, Verdict::kNoPartner);
  EXPECT_EQ(outcome[0].left->buffer, 7U);
  EXPECT_FALSE(outcome[0].right);
  EXPECT_EQ(pairer.waiting(), 1U) << "the right may still find a left";
  EXPECT_EQ(pairer.counters().missing_right, 1U);
}

TEST(Pairer, OfTwoWithinReachTakesTheCloser) {
  Pairer pairer = make(0.5);  // 8 ms
  (void)pairer.push(Side::kLeft, {at(0), 0, 1});
  (void)pairer.push(Side::kLeft, {at(0) + milliseconds(9), 0, 2});
  const auto& outcome = pairer.push(Side::kRight, {at(0) + milliseconds(7), 0, 2});
  ASSERT_EQ(outcome.size(), 2U);
  EXPECT_EQ(outcome[0].verdict, Verdict::kNoPartner);
  EXPECT_EQ(outcome[0].left->buffer, 1U);
  EXPECT_EQ(outcome[1].verdict, Verdict::kPaired);
  EXPECT_EQ(outcome[1].left->buffer, 2U);
}

TEST(Pairer, NamesEachCause) {
  Pairer pairer = make();
  (void)pairer.push(Side::kLeft, frame(5));
  EXPECT_EQ(pairer.push(Side::kLeft, frame(5))[0].verdict, Verdict::kDuplicate);
  EXPECT_EQ(pairer.push(Side::kLeft, frame(4))[0].verdict, Verdict::kOutOfOrder);
  (void)pairer.push(Side::kLeft, frame(6));
  EXPECT_EQ(pairer.give_up_before(at(5.5))[0].left->buffer, 5U);
  const auto& late = pairer.push(Side::kRight, frame(5));
  ASSERT_EQ(late.size(), 1U);
  EXPECT_EQ(late[0].verdict, Verdict::kLate);
  EXPECT_EQ(late[0].ordinal, 0U);
  EXPECT_EQ(pairer.push(Side::kRight, frame(6))[0].verdict, Verdict::kPaired);
  EXPECT_EQ(pairer.push(Side::kRight, frame(3))[0].verdict, Verdict::kOutOfOrder);
  const Pairer::Counters& counters = pairer.counters();
  EXPECT_EQ(counters.duplicate, 1U);
  EXPECT_EQ(counters.out_of_order, 2U);
  EXPECT_EQ(counters.late, 1U);
  EXPECT_EQ(counters.missing_right, 1U);
  EXPECT_EQ(counters.missing_left, 0U);
  EXPECT_EQ(counters.paired, 1U);
  EXPECT_EQ(counters.waiting_high, 2U);
}

TEST(Pairer, ASilentSideFillsNoMoreThanTheWaitingRoom) {
  Pairer pairer = make();
  Ledger ledger;
  for (int i = 0; i < 100; ++i) {
    ledger.push(pairer, Side::kRight, frame(i));
    EXPECT_LE(pairer.waiting(), Pairer::kMaxWaiting);
  }
  EXPECT_EQ(pairer.counters().missing_left, 100 - Pairer::kMaxWaiting);
  // The left comes back, behind: what was given up is late, what waits is paired.
  for (int i = 90; i < 100; ++i) ledger.push(pairer, Side::kLeft, frame(i));
  EXPECT_EQ(pairer.counters().late, 2U);
  EXPECT_EQ(ledger.pairs.size(), Pairer::kMaxWaiting);
  EXPECT_EQ(ledger.end(pairer), "");
}

TEST(Pairer, OrdinalsCountWhatIsMissing) {
  Pairer pairer = make();
  (void)pairer.push(Side::kLeft, frame(1));
  EXPECT_EQ(pairer.push(Side::kRight, frame(1))[0].ordinal, 1U);
  (void)pairer.push(Side::kLeft, frame(2));
  (void)pairer.push(Side::kLeft, frame(3));
  const auto& outcome = pairer.push(Side::kRight, frame(3));
  ASSERT_EQ(outcome.size(), 2U);
  EXPECT_EQ(outcome[0].ordinal, 2U);
  EXPECT_EQ(outcome[1].ordinal, 3U);
}

TEST(Pairer, EveryLossPatternInEveryInterleavingPairsWhatIsThereAndNothingElse) {
  constexpr int kFrames = 4;
  int runs = 0;
  for (const double skew : {-0.45, -0.2, 0.0, 0.2, 0.45}) {
    for (unsigned lost = 0; lost < (1U << (2 * kFrames)); ++lost) {
      std::vector<int> lefts;
      std::vector<int> rights;
      std::set<int> both;
      for (int i = 0; i < kFrames; ++i) {
        const bool left = (lost >> i & 1U) == 0;
        const bool right = (lost >> (i + kFrames) & 1U) == 0;
        if (left) lefts.push_back(i);
        if (right) rights.push_back(i);
        if (left && right) both.insert(i);
      }
      const int count = static_cast<int>(lefts.size() + rights.size());
      for (const unsigned pattern : interleavings(static_cast<int>(lefts.size()), static_cast<int>(rights.size()))) {
        Pairer pairer = make(0.5);
        Ledger ledger;
        std::size_t l = 0;
        std::size_t r = 0;
        for (int i = 0; i < count; ++i) {
          if ((pattern >> i & 1U) == 0) {
            ledger.push(pairer, Side::kLeft, frame(lefts[l], lefts[l]));
            ++l;
          } else {
            ledger.push(pairer, Side::kRight, frame(rights[r], rights[r] + skew));
            ++r;
          }
        }
        ASSERT_EQ(ledger.end(pairer), "") << "lost " << lost << " order " << pattern << " skew " << skew;
        ASSERT_EQ(ledger.pairs, both) << "lost " << lost << " order " << pattern << " skew " << skew;
        const Pairer::Counters& counters = pairer.counters();
        ASSERT_EQ(counters.missing_right, lefts.size() - both.size());
        ASSERT_EQ(counters.missing_left, rights.size() - both.size());
        ASSERT_EQ(counters.late + counters.out_of_order + counters.duplicate + counters.clock_steps, 0U);
        ++runs;
      }
    }
  }
  EXPECT_EQ(runs, 5 * 1921);  // sum over l, r = 0..4 of C(4, l) C(4, r) C(l + r, l)
}

TEST(Pairer, EveryOrderOfSixFramesLosesNothingAndPairsNothingWrong) {
  // Each side out of order as well.
  std::vector<int> order{0, 1, 2, 3, 4, 5};
  int all = 0;
  do {
    Pairer pairer = make(0.5);
    Ledger ledger;
    for (const int which : order) {
      ledger.push(pairer, which < 3 ? Side::kLeft : Side::kRight, frame(which % 3));
    }
    ASSERT_EQ(ledger.end(pairer), "");
    if (ledger.pairs.size() == 3) ++all;
  } while (std::next_permutation(order.begin(), order.end()));
  EXPECT_EQ(all, 20) << "the interleavings C(6, 3) in which each side keeps its order";
}

/// Frames 0..n-1 of both sides; from exposure number `at_frame` on (the right one a moment later than the left) all
/// stamps are `step` periods off.
struct Step {
  int at_frame;
  bool between;  ///< after the left of at_frame - 1 ... before its right: the right is stepped one frame earlier
  double step;
};

std::string run_with_step(const Step& step, unsigned lost, unsigned pattern, bool sequenced) {
  constexpr int kFrames = 5;
  std::vector<int> lefts;
  std::vector<int> rights;
  for (int i = 0; i < kFrames; ++i) {
    if ((lost >> i & 1U) == 0) lefts.push_back(i);
    if ((lost >> (i + kFrames) & 1U) == 0) rights.push_back(i);
  }
  Pairer pairer = make(0.25, sequenced);
  Ledger ledger;
  ledger.may_go_back = true;
  for (int number = -Pairer::kLearn; sequenced && number < 0; ++number) {
    ledger.push(pairer, Side::kLeft, frame(number, number + 10));
    ledger.push(pairer, Side::kRight, frame(number, number + 10));
  }
  std::size_t l = 0;
  std::size_t r = 0;
  for (std::size_t i = 0; i < lefts.size() + rights.size(); ++i) {
    const bool right = (pattern >> i & 1U) != 0;
    const int number = right ? rights[r++] : lefts[l++];
    const bool stepped = number >= (right && step.between ? step.at_frame - 1 : step.at_frame);
    ledger.push(pairer, right ? Side::kRight : Side::kLeft, frame(number, number + 10 + (stepped ? step.step : 0)));
  }
  return ledger.end(pairer);
}

// Steps of these sizes, in periods, at each of five frames, whatever is lost, in every order of arrival.
void expect_steps_never_pair_wrong(std::initializer_list<double> sizes, bool sequenced) {
  for (const double size : sizes) {
    for (int at_frame = 1; at_frame < 5; ++at_frame) {
      for (unsigned lost = 0; lost < 1024; ++lost) {
        const int rights = 5 - __builtin_popcount(lost >> 5);
        const int lefts = 5 - __builtin_popcount(lost & 31U);
        for (const unsigned pattern : interleavings(lefts, rights)) {
          for (const bool between : {false, true}) {
            ASSERT_EQ(run_with_step({at_frame, between, size}, lost, pattern, sequenced), "")
                << "step " << size << " at " << at_frame << " lost " << lost << " order " << pattern;
          }
        }
      }
    }
  }
}

TEST(Pairer, ClockStepsForwardNeverPairWrong) {
  expect_steps_never_pair_wrong({0.3, 0.5, 1.0, 1.5, 2.0, 3.0, 100.0}, false);
}

TEST(Pairer, ClockStepsBackNeverPairWrongWhereThereAreSequences) {
  expect_steps_never_pair_wrong({-0.3, -0.5, -1.0, -1.5, -2.0, -3.0, -4.0, -5.0, -100.0}, true);
}

TEST(Pairer, WithoutSequencesAStepBackByAPeriodAtALossPairsWrong) {
  // What the header says of times alone, and why drivers pass on sequences. Right 1 waits, left 1 is lost, the clock
  // goes back by a period, left 2 comes with the stamp of 1.
  Pairer blind = make();
  (void)blind.push(Side::kRight, frame(1));
  const auto& wrong = blind.push(Side::kLeft, frame(2, 1));
  ASSERT_EQ(wrong.size(), 1U);
  EXPECT_EQ(wrong[0].verdict, Verdict::kPaired);

  Pairer seeing = make(0.25, true);
  for (int i = 0; i < 5; ++i) {
    (void)seeing.push(Side::kLeft, frame(i));
    (void)seeing.push(Side::kRight, frame(i));
  }
  EXPECT_EQ(seeing.counters().paired, 3U);
  (void)seeing.push(Side::kRight, frame(5));
  EXPECT_EQ(seeing.push(Side::kLeft, frame(6, 5))[0].verdict, Verdict::kDisagreed);
  (void)seeing.push(Side::kRight, frame(6, 5));  // a duplicate, by its time
  (void)seeing.push(Side::kRight, frame(7, 6));
  EXPECT_EQ(seeing.push(Side::kLeft, frame(7, 6))[0].verdict, Verdict::kPaired) << "the difference still holds";
}

TEST(Pairer, ALongStepBackStartsAnew) {
  Pairer pairer = make();
  Ledger ledger;
  ledger.may_go_back = true;
  for (int i = 0; i < 10; ++i) {
    ledger.push(pairer, Side::kLeft, frame(i, 1000 + i));
    ledger.push(pairer, Side::kRight, frame(i, 1000 + i));
  }
  ledger.push(pairer, Side::kLeft, frame(10, 1010));  // waits when the clock goes back
  for (int i = 11; i < 20; ++i) {
    ledger.push(pairer, Side::kLeft, frame(i, i));
    ledger.push(pairer, Side::kRight, frame(i, i));
  }
  EXPECT_EQ(pairer.counters().clock_steps, 1U);
  EXPECT_EQ(ledger.verdicts[Verdict::kClockStep], 1);
  EXPECT_EQ(ledger.pairs.size(), 10U + 9U);
  EXPECT_EQ(ledger.end(pairer), "");
}

TEST(Pairer, AFrameFromBeforeTheStepThatComesAfterItIsPairedWithNothing) {
  Pairer pairer = make();
  Ledger ledger;
  ledger.may_go_back = true;
  for (int i = 0; i < 10; ++i) {
    ledger.push(pairer, Side::kLeft, frame(i, 1000 + i));
    if (i < 9) ledger.push(pairer, Side::kRight, frame(i, 1000 + i));
  }
  ledger.push(pairer, Side::kLeft, frame(10, 10));
  ledger.push(pairer, Side::kRight, frame(9, 1009));
  for (int i = 11; i < 20; ++i) {
    ledger.push(pairer, Side::kRight, frame(i - 1, i - 1));
    ledger.push(pairer, Side::kLeft, frame(i, i));
  }
  EXPECT_EQ(pairer.counters().clock_steps, 2U) << "the right shows it, too";
  EXPECT_EQ(ledger.pairs.size(), 9U + 8U);
  EXPECT_EQ(ledger.end(pairer), "");
}

TEST(Pairer, AShortStepBackCostsNoMoreThanTheStep) {
  Pairer pairer = make();
  Ledger ledger;
  for (int i = 0; i < 10; ++i) {
    ledger.push(pairer, Side::kLeft, frame(i));
    ledger.push(pairer, Side::kRight, frame(i));
  }
  for (int i = 10; i < 20; ++i) {
    ledger.push(pairer, Side::kLeft, frame(i, i - 2.5));
    ledger.push(pairer, Side::kRight, frame(i, i - 2.5));
  }
  EXPECT_EQ(pairer.counters().out_of_order, 4U);  // 10 and 11, whose stamps are 7.5 and 8.5
  EXPECT_EQ(ledger.pairs.size(), 18U);
  EXPECT_EQ(ledger.end(pairer), "");
}

TEST(Pairer, LearnsSequencesOfASensorThatStartedAnew) {
  Pairer pairer = make(0.25, true);
  const auto both = [&](int number, std::uint64_t left, std::uint64_t right) {
    (void)pairer.push(Side::kLeft, {at(number), left, 0});
    return pairer.push(Side::kRight, {at(number), right, 0})[0].verdict;
  };
  EXPECT_EQ(both(1, 100, 7), Verdict::kDisagreed) << "nothing is known yet";
  EXPECT_EQ(both(2, 101, 8), Verdict::kDisagreed);
  EXPECT_EQ(both(3, 102, 9), Verdict::kPaired);
  EXPECT_EQ(both(4, 103, 10), Verdict::kPaired);
  EXPECT_EQ(both(5, 104, 0), Verdict::kDisagreed) << "the right counts anew";
  EXPECT_EQ(both(6, 105, 1), Verdict::kDisagreed);
  EXPECT_EQ(both(7, 106, 5), Verdict::kDisagreed) << "does not agree with the two before: the row begins anew";
  for (std::uint64_t i = 8; i < 12; ++i) {
    EXPECT_EQ(both(static_cast<int>(i), 99 + i, i - 2), Verdict::kDisagreed);
  }
  EXPECT_EQ(both(12, 111, 10), Verdict::kPaired) << "the sixth fit in a row";
  EXPECT_EQ(both(13, 112, 11), Verdict::kPaired);
  EXPECT_EQ(pairer.counters().disagreed, 2U + 2U + 5U) << "at the start, before the row, in the row";
  // The same sequence twice is the same frame, whatever its stamp.
  EXPECT_EQ(pairer.push(Side::kLeft, {at(14), 112, 0})[0].verdict, Verdict::kDuplicate);
}

TEST(Pairer, FollowsAChangeOfRate) {
  Pairer pairer = make(0.5);
  Ledger ledger;
  for (int i = 0; i < 4; ++i) {
    ledger.push(pairer, Side::kLeft, frame(i));
    ledger.push(pairer, Side::kRight, frame(i, i + 0.2));
  }
  ASSERT_TRUE(pairer.set_period(kPeriod / 4).has_value());
  for (int i = 16; i < 32; ++i) {
    // Rights of odd frames only; the tolerance is an eighth of the old period now.
    ledger.push(pairer, Side::kLeft, frame(i, i / 4.0));
    if (i % 2 == 1) ledger.push(pairer, Side::kRight, frame(i, i / 4.0 + 0.1));
  }
  EXPECT_EQ(ledger.pairs.size(), 4U + 8U);
  EXPECT_EQ(ledger.end(pairer), "");
}

TEST(Pairer, RestartHandsBackWhatWaits) {
  Pairer pairer = make();
  (void)pairer.push(Side::kLeft, frame(100));
  (void)pairer.push(Side::kLeft, frame(101));
  EXPECT_EQ(pairer.restart().size(), 2U);
  EXPECT_EQ(pairer.waiting(), 0U);
  (void)pairer.push(Side::kLeft, frame(1));
  EXPECT_EQ(pairer.push(Side::kRight, frame(1))[0].ordinal, 3U) << "ordinals go on";
  EXPECT_EQ(pairer.counters().clock_steps, 0U);
}

TEST(Pairer, AnHourOfSkewJitterLossAndDelay) {
  // 60 pairs/s: right 1.5 ms behind, jitter of 1 ms, one frame in 30 lost, each delivered 0 to 60 ms late but in order,
  // some twice.
  std::mt19937 random(7);
  const auto chance = [&](int one_in) { return random() % static_cast<unsigned>(one_in) == 0; };
  struct Arrival {
    std::int64_t when;
    Side side;
    SideFrame frame;
  };
  constexpr int kFrames = 200'000;
  std::vector<Arrival> arrivals;
  std::vector<int> present(kFrames, 0);
  std::uint64_t doubled = 0;
  for (const Side side : {Side::kLeft, Side::kRight}) {
    std::int64_t in_order = 0;
    for (int i = 0; i < kFrames; ++i) {
      if (chance(30)) continue;
      ++present[static_cast<std::size_t>(i)];
      const std::int64_t jitter = static_cast<std::int64_t>(random() % 2'000'001) - 1'000'000;
      SideFrame one = frame(i);
      one.mid_exposure += nanoseconds(jitter + (side == Side::kRight ? 1'500'000 : 0));
      const std::int64_t when = one.mid_exposure.time_since_epoch().count() + random() % 60'000'000;
      in_order = std::max(in_order + 1, when);
      arrivals.push_back({in_order, side, one});
      if (chance(200)) {
        arrivals.push_back({++in_order, side, one});
        ++doubled;
      }
    }
  }
  std::stable_sort(arrivals.begin(), arrivals.end(),
                   [](const Arrival& a, const Arrival& b) { return a.when < b.when; });
  Pairer pairer = make(0.3);  // 4.8 ms: skew and both jitters are 3.5 at most
  Ledger ledger;
  for (const Arrival& arrival : arrivals) ledger.push(pairer, arrival.side, arrival.frame);
  EXPECT_EQ(ledger.end(pairer), "");
  const auto both = std::count(present.begin(), present.end(), 2);
  EXPECT_EQ(static_cast<std::ptrdiff_t>(ledger.pairs.size()), both);
  const Pairer::Counters& counters = pairer.counters();
  EXPECT_EQ(counters.missing_left + counters.missing_right,
            static_cast<std::uint64_t>(std::count(present.begin(), present.end(), 1)));
  EXPECT_EQ(counters.duplicate, doubled);
  EXPECT_GT(doubled, 500U);
  EXPECT_LE(counters.waiting_high, Pairer::kMaxWaiting);
}

}  // namespace
}  // namespace stereotrack::trigger
