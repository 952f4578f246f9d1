#include "drivers/capture/stereo_cameras/rate_steering.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <utility>

#include "drivers/capture/stereo_cameras/phase.hpp"

namespace stereotrack::capture {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;
using State = RateSteering::State;

struct PlantFacts {
  nanoseconds period{33'333'333};
  nanoseconds quantum{30'000};
  double drift = 20e-6;          ///< right's crystal is slow by it
  nanoseconds phase{9'000'000};  ///< right later at the start
  double jitter_s = 20e-6;       ///< of stamps
  double lost = 0.02;            ///< of each camera's frames
  int delay = 2;                 ///< frames from set to in force
  int room = 1000;               ///< quanta, to both sides
  bool ignores = false;
  unsigned seed = 1;
};

/// Two sensors, the service thread that looks after them about ten times a second, and what it knows.
class Plant {
 public:
  explicit Plant(const PlantFacts& facts)
      : facts_(facts),
        random_(facts.seed),
        left_s_(1.0),
        right_s_(1.0 + to_seconds(facts.phase)),
        in_force_(facts.period),
        estimator_(facts.period) {
    steering_.begin(facts.period, range());
  }

  [[nodiscard]] PeriodRange range() const {
    return {facts_.period - facts_.quantum * facts_.room, facts_.period + facts_.quantum * facts_.room, facts_.quantum};
  }
  void run(seconds span) {
    for (const double until = now_s_ + to_seconds(span); now_s_ < until;) {
      // Looks are late as threads are.
      const double look = now_s_ + 0.1 + std::uniform_real_distribution<double>(0, 0.01)(random_);
      while (std::min(left_s_, right_s_) < look) left_s_ < right_s_ ? left() : right();
      now_s_ = look;
      tend();
    }
  }
  void replace_right(nanoseconds phase) {
    steering_.stop();
    estimator_.restart();
    right_s_ = left_s_ + to_seconds(phase);
    in_force_ = facts_.period;
    coming_.clear();
    steering_.begin(facts_.period, range());
  }
  void pull(double drift) { facts_.drift = drift; }
  void step_left(nanoseconds by) { left_s_ += to_seconds(by); }
  [[nodiscard]] double phase() const {
    const double period = to_seconds(facts_.period);
    const double apart = right_s_ - left_s_;
    return apart - period * std::floor(apart / period + 0.5);
  }
  [[nodiscard]] const RateSteering& steering() const { return steering_; }
  [[nodiscard]] double worst() const { return worst_s_; }
  void forget_worst() { worst_s_ = 0, reversals_ = sets_ = 0; }
  [[nodiscard]] int reversals() const { return reversals_; }  ///< of the sign of what is set
  [[nodiscard]] int sets() const { return sets_; }
  [[nodiscard]] double widest() const { return widest_; }  ///< ratio that was set

 private:
  bool is_lost() { return std::uniform_real_distribution<double>(0, 1)(random_) < facts_.lost; }
  double stamp(double time_s) { return time_s + std::normal_distribution<double>(0, facts_.jitter_s)(random_); }
  static nanoseconds span(double s) { return nanoseconds(std::llround(s * 1e9)); }

  void left() {
    if (!is_lost()) last_left_ = stamp(left_s_);
    left_s_ += to_seconds(facts_.period);
  }
  void right() {
    if (last_left_ && !is_lost()) {
      const double at = stamp(right_s_);
      estimator_.add(CaptureTime(span(at)), span(at - *last_left_));
    }
    for (auto& each : coming_) --each.first;
    while (!coming_.empty() && coming_.front().first <= 0) {
      in_force_ = coming_.front().second;
      coming_.pop_front();
    }
    right_s_ += to_seconds(in_force_) * (1 + facts_.drift);
    worst_s_ = std::max(worst_s_, std::abs(phase()));
  }
  void tend() {
    const auto latest = estimator_.latest();
    if (latest && latest->time != told_) {
      told_ = latest->time;
      steering_.measured(latest->time, latest->phase, estimator_.drift());
    }
    const MonotonicTime now(span(now_s_));
    const auto wanted = steering_.next(now);
    if (!wanted) return;
    const auto n = std::llround(static_cast<double>((*wanted - facts_.period).count()) /
                                static_cast<double>(facts_.quantum.count()));
    const nanoseconds made = facts_.period + n * facts_.quantum;
    const double ratio = to_seconds(made - facts_.period) / to_seconds(facts_.period);
    widest_ = std::max(widest_, std::abs(ratio));
    ++sets_;
    if (n != 0 && sign_ != 0 && (n > 0) != (sign_ > 0)) ++reversals_;
    if (n != 0) sign_ = n > 0 ? 1 : -1;
    if (!facts_.ignores) coming_.emplace_back(facts_.delay, made);
    steering_.made(now, made);
  }

  PlantFacts facts_;
  std::mt19937 random_;
  double now_s_ = 1.0;
  double left_s_;
  double right_s_;
  nanoseconds in_force_;
  std::deque<std::pair<int, nanoseconds>> coming_;
  std::optional<double> last_left_;
  PhaseEstimator estimator_;
  RateSteering steering_;
  CaptureTime told_{};
  double worst_s_ = 0;
  double widest_ = 0;
  int reversals_ = 0;
  int sets_ = 0;
  int sign_ = 0;
};

TEST(RateSteering, LocksWithinThirtySecondsAndStaysForTenMinutes) {
  unsigned seed = 1;
  for (const double drift : {-200e-6, -50e-6, -5e-6, 0.0, 20e-6, 90e-6, 200e-6}) {
    for (const nanoseconds quantum : {nanoseconds(100), nanoseconds(9'100), nanoseconds(18'904), nanoseconds(30'000)}) {
      for (const nanoseconds phase : {nanoseconds(-16'600'000), nanoseconds(-900'000), nanoseconds(9'000'000)}) {
        SCOPED_TRACE(testing::Message() << drift * 1e6 << " ppm, quantum " << quantum.count() << " ns, phase "
                                        << phase.count());
        Plant plant({.quantum = quantum, .drift = drift, .phase = phase, .seed = ++seed});
        plant.run(seconds(30));
        EXPECT_EQ(plant.steering().state(), State::kLocked);
        EXPECT_LE(plant.widest(), RateSteering::kMostRatio);
        plant.forget_worst();
        plant.run(seconds(600));
        EXPECT_EQ(plant.steering().state(), State::kLocked);
        // A row of 30 us moves the phase by 90 us between two looks, give or take a frame's 30 us.
        EXPECT_LT(plant.worst(), quantum > microseconds(20) ? 160e-6 : 100e-6);
        EXPECT_NEAR(plant.steering().natural(), drift, 10e-6);
      }
    }
  }
}

TEST(RateSteering, WhatDoesNotDriftIsLeftAlone) {
  Plant plant({.drift = 0, .phase = nanoseconds(10'000)});
  plant.run(seconds(600));
  EXPECT_EQ(plant.steering().state(), State::kLocked);
  EXPECT_LE(plant.sets(), 4);
  EXPECT_LT(plant.worst(), 60e-6);
}

TEST(RateSteering, ApproachesFromOneSideAndTheNearer) {
  for (const nanoseconds phase : {nanoseconds(-16'000'000), nanoseconds(16'000'000), nanoseconds(3'000'000)}) {
    SCOPED_TRACE(phase.count());
    Plant plant({.drift = 50e-6, .phase = phase});
    double before = plant.phase();
    double furthest_beyond = 0;
    for (int second = 0; second < 30; ++second) {
      plant.run(seconds(1));
      const double now = plant.phase();
      EXPECT_LT(std::abs(now - before), 6e-3) << "went round";
      if (phase.count() > 0) furthest_beyond = std::min(furthest_beyond, now);
      if (phase.count() < 0) furthest_beyond = std::max(furthest_beyond, now);
      before = now;
    }
    EXPECT_LT(std::abs(furthest_beyond), 160e-6);
    EXPECT_EQ(plant.steering().state(), State::kLocked);
  }
}

TEST(RateSteering, FollowsACrystalThatWarmsUp) {
  Plant plant({.quantum = nanoseconds(18'904), .drift = 10e-6});
  plant.run(seconds(30));
  plant.forget_worst();
  for (int step = 0; step < 60; ++step) {
    plant.pull(10e-6 + 1e-6 * step);
    plant.run(seconds(5));
  }
  EXPECT_EQ(plant.steering().state(), State::kLocked);
  EXPECT_LT(plant.worst(), 110e-6);
}

TEST(RateSteering, BadFramesDoNotLeadItAstray) {
  Plant plant({.quantum = nanoseconds(18'904), .drift = 40e-6, .jitter_s = 100e-6, .lost = 0.2});
  plant.run(seconds(30));
  EXPECT_EQ(plant.steering().state(), State::kLocked);
  plant.forget_worst();
  plant.run(seconds(600));
  EXPECT_EQ(plant.steering().state(), State::kLocked);
  EXPECT_LT(plant.worst(), 200e-6);
}

TEST(RateSteering, AJumpOfAClockIsMadeGood) {
  Plant plant({.drift = 40e-6});
  plant.run(seconds(30));
  plant.step_left(milliseconds(5));
  plant.run(seconds(6));
  EXPECT_EQ(plant.steering().state(), State::kApproaching);
  plant.run(seconds(34));
  EXPECT_EQ(plant.steering().state(), State::kLocked);
  EXPECT_LT(std::abs(plant.phase()), 160e-6);
}

TEST(RateSteering, ASensorThatIgnoresItIsGivenUpAndAskedForItsOwnPeriod) {
  for (const double drift : {-200e-6, 0.0, 20e-6, 200e-6}) {
    for (const nanoseconds phase : {nanoseconds(300'000), nanoseconds(-9'000'000)}) {
      SCOPED_TRACE(testing::Message() << drift << ' ' << phase.count());
      Plant plant({.drift = drift, .phase = phase, .ignores = true});
      plant.run(seconds(30));
      EXPECT_EQ(plant.steering().state(), State::kGivenUp);
      EXPECT_EQ(plant.steering().period(), plant.steering().nominal());
      plant.forget_worst();
      plant.run(seconds(60));
      EXPECT_EQ(plant.sets(), 0);
    }
  }
}

TEST(RateSteering, ARateThatCannotBeReachedIsGivenUp) {
  Plant plant({.drift = 0.02});
  plant.run(seconds(300));
  EXPECT_EQ(plant.steering().state(), State::kGivenUp);
  EXPECT_LE(plant.widest(), RateSteering::kMostRatio);
}

TEST(RateSteering, WhatFollowsAndDoesNotComeNearIsGivenUp) {
  Plant plant({.drift = 0.003, .room = 2});
  plant.run(seconds(60));
  EXPECT_EQ(plant.steering().state(), State::kApproaching);
  plant.run(seconds(30));
  EXPECT_EQ(plant.steering().state(), State::kGivenUp);
  EXPECT_LT(plant.widest(), 0.0019);
}

TEST(RateSteering, ACameraThatCameAnewIsMeasuredAnew) {
  Plant plant({.drift = 100e-6});
  plant.run(seconds(30));
  plant.pull(-100e-6);
  plant.replace_right(milliseconds(-7));
  EXPECT_EQ(plant.steering().state(), State::kMeasuring);
  EXPECT_FALSE(RateSteering(plant.steering()).next(MonotonicTime(seconds(32))).has_value());
  plant.run(seconds(30));
  EXPECT_EQ(plant.steering().state(), State::kLocked);
  EXPECT_NEAR(plant.steering().natural(), -100e-6, 10e-6);
}

TEST(RateSteering, SaysWhatStandsInItsWay) {
  using Obstacle = RateSteering::Obstacle;
  const nanoseconds period = milliseconds(40);
  const auto obstacle = [&](const std::optional<PeriodRange>& range) {
    RateSteering steering;
    steering.begin(period, range);
    EXPECT_EQ(steering.state(), steering.obstacle() == Obstacle::kNone ? State::kMeasuring : State::kCannot);
    EXPECT_FALSE(steering.next(MonotonicTime(seconds(1))).has_value());
    return steering.obstacle();
  };
  const nanoseconds row = microseconds(20);
  EXPECT_EQ(obstacle(std::nullopt), Obstacle::kNoControl);
  EXPECT_EQ(obstacle(PeriodRange{milliseconds(20), milliseconds(80), nanoseconds(0)}), Obstacle::kNoControl);
  EXPECT_EQ(obstacle(PeriodRange{period, milliseconds(80), row}), Obstacle::kNoRoom);
  EXPECT_EQ(obstacle(PeriodRange{milliseconds(20), period, row}), Obstacle::kNoRoom);
  EXPECT_EQ(obstacle(PeriodRange{milliseconds(20), milliseconds(80), microseconds(201)}), Obstacle::kCoarse);
  EXPECT_EQ(obstacle(PeriodRange{milliseconds(20), milliseconds(80), row}), Obstacle::kNone);
}

TEST(RateSteering, RefusalsInARowEndIt) {
  RateSteering steering;
  steering.begin(milliseconds(40), PeriodRange{milliseconds(20), milliseconds(80), microseconds(20)});
  steering.measured(CaptureTime(seconds(10)), milliseconds(3), 20e-6);
  for (int i = 0; i < RateSteering::kMostRefusals; ++i) {
    EXPECT_EQ(steering.state(), State::kApproaching);
    ASSERT_TRUE(steering.next(MonotonicTime(seconds(10) + milliseconds(100) * i)).has_value());
    steering.refused();
  }
  EXPECT_EQ(steering.state(), State::kGivenUp);
  EXPECT_FALSE(steering.next(MonotonicTime(seconds(12))).has_value());  // it is at its own period
}

}  // namespace
}  // namespace stereotrack::capture
