#include "firmware-app/signals/signal_rules.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "tests/unit/signals/targets.hpp"

namespace stereotrack::signals {
namespace {

using std::chrono::milliseconds;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr milliseconds kStale{1000};

MonotonicTime at(int ms) { return MonotonicTime(std::chrono::hours(5) + milliseconds(ms)); }
std::optional<int> ms_of(std::optional<MonotonicTime> time) {
  if (!time) return std::nullopt;
  return static_cast<int>(std::chrono::duration_cast<milliseconds>(*time - at(0)).count());
}

Signal signal(Condition when) {
  Signal made;
  made.when = when;
  if (when == Condition::kDistanceBelow) made.limit_m = 3;
  if (when == Condition::kTimeToReachBelow) made.limit_s = 2;
  if (when == Condition::kHeartbeat) made.half_period = milliseconds(100);
  return made;
}
Signal pulse(Condition when, int pulse_ms, int hold_ms = 0) {
  Signal made = signal(when);
  made.mode = Signal::Mode::kPulse;
  made.pulse = milliseconds(pulse_ms);
  made.hold = milliseconds(hold_ms);
  return made;
}
Signal held(Condition when, int hold_ms) {
  Signal made = signal(when);
  made.hold = milliseconds(hold_ms);
  return made;
}

SignalRules::Config config(std::initializer_list<Signal> signals, double unit_m = 1) {
  SignalRules::Config made;
  for (const Signal& each : signals) EXPECT_TRUE(made.signals.push(each));
  made.unit_m = unit_m;
  made.stale_after = kStale;
  return made;
}
SignalRules rules(std::initializer_list<Signal> signals, double unit_m = 1) {
  return *SignalRules::create(config(signals, unit_m));
}

/// Everything is known and well; these are the targets.
SignalRules::Inputs seen(const std::vector<TrackReport>& tracks) {
  return {.tracks = tracks, .tracks_known = true, .depth_known = true, .deadline_missed = false, .healthy = true};
}
const std::vector<TrackReport> kOne{target_at(0, 0, 2)};
const std::vector<TrackReport> kNone{};

/// Whether one target alone, all else being well, makes the signal active.
bool tells(const Signal& of, const TrackReport& target, double unit_m = 1) {
  SignalRules made = rules({of}, unit_m);
  const std::vector<TrackReport> tracks{target};
  return made.decide(seen(tracks), at(0)) == 1;
}

// ---- Conditions

TEST(SignalRules, AnyConfirmedOrCoastingTargetCountsAndATentativeOneNever) {
  TrackReport target = target_at(0, 0, 100);
  const Signal any = signal(Condition::kConfirmed);
  EXPECT_TRUE(tells(any, target));
  target.state = TrackState::kCoasting;
  EXPECT_TRUE(tells(any, target));
  target.state = TrackState::kTentative;
  EXPECT_FALSE(tells(any, target));
  SignalRules made = rules({any});
  EXPECT_EQ(made.decide(seen(kNone), at(0)), 0U);
}

TEST(SignalRules, ATentativeTargetFulfilsNoCondition) {
  TrackReport target = target_at(0, 0, 1);
  target.velocity = {0, 0, -5};
  for (const Condition when : {Condition::kConfirmed, Condition::kDistanceBelow, Condition::kTimeToReachBelow}) {
    target.state = TrackState::kConfirmed;
    EXPECT_TRUE(tells(signal(when), target));
    target.state = TrackState::kTentative;
    EXPECT_FALSE(tells(signal(when), target));
  }
}

TEST(SignalRules, DistanceIsTheLengthOfThePosition) {
  const Signal near = signal(Condition::kDistanceBelow);  // 3 m
  EXPECT_TRUE(tells(near, target_at(0, 0, 2.999)));
  EXPECT_FALSE(tells(near, target_at(0, 0, 3)));
  EXPECT_TRUE(tells(near, target_at(1, 2, 1.99)));   // 2.993
  EXPECT_FALSE(tells(near, target_at(1, 2, 2.01)));  // 3.007
  EXPECT_FALSE(tells(near, target_at(-4, 0, 1)));
}

TEST(SignalRules, DistanceIsInMetresWhateverTheUnitOfTheTracks) {
  const Signal near = signal(Condition::kDistanceBelow);
  EXPECT_TRUE(tells(near, target_at(0, 0, 118.1), 0.0254));  // 2.9997 m
  EXPECT_FALSE(tells(near, target_at(0, 0, 118.2), 0.0254));
}

TEST(SignalRules, TimeToReachWorkedByHand) {
  const Signal soon = signal(Condition::kTimeToReachBelow);  // 2 s
  // (3, 0, 4) is 5 away. Velocity (-1.5, 0, -2) comes straight with 2.5: 2 s. A little faster: less.
  TrackReport target = target_at(3, 0, 4);
  target.velocity = {-1.5, 0, -2};
  EXPECT_FALSE(tells(soon, target));
  target.velocity *= 1.001;
  EXPECT_TRUE(tells(soon, target));
  // Only the part along the line of sight counts: 7 across changes nothing.
  target.velocity += Eigen::Vector3d(0, 7, 0);
  EXPECT_TRUE(tells(soon, target));
  target.velocity = {0, 7, 0};
  EXPECT_FALSE(tells(soon, target)) << "passes by";
  target.velocity = {3, 0, 4};
  EXPECT_FALSE(tells(soon, target)) << "goes away";
  target.velocity = {0, 0, 0};
  EXPECT_FALSE(tells(soon, target)) << "stands";
}

TEST(SignalRules, TimeToReachNeedsNoUnit) {
  TrackReport target = target_at(0, 0, 500);
  target.velocity = {0, 0, -251};
  EXPECT_TRUE(tells(signal(Condition::kTimeToReachBelow), target, 0));
}

TEST(SignalRules, ATargetWithoutDepthHasNoDistanceAndDoesNotArrive) {
  TrackReport target = target_at(0, 0, 1);
  target.velocity = {0, 0, -5};
  target.has_depth = false;
  EXPECT_FALSE(tells(signal(Condition::kDistanceBelow), target));
  EXPECT_FALSE(tells(signal(Condition::kTimeToReachBelow), target));
  EXPECT_TRUE(tells(signal(Condition::kConfirmed), target));
}

TEST(SignalRules, WhatIsNotFiniteFulfilsNothing) {
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    for (int axis = 0; axis < 3; ++axis) {
      TrackReport target = target_at(0.1, 0.1, 1);
      target.velocity = {0, 0, -5};
      target.position[axis] = bad;
      EXPECT_FALSE(tells(signal(Condition::kDistanceBelow), target)) << bad << " " << axis;
      EXPECT_FALSE(tells(signal(Condition::kTimeToReachBelow), target)) << bad << " " << axis;
    }
  }
  TrackReport target = target_at(0.1, 0.1, 1);
  target.velocity = {kNan, 0, -5};
  EXPECT_FALSE(tells(signal(Condition::kTimeToReachBelow), target));
}

SignalRules::Config with_zone(Signal each, Zone::Kind kind) {
  Zone zone;
  zone.kind = kind;
  zone.x_m = {1, 2};
  zone.y_m = {-1, 1};
  zone.z_m = {0, 10};
  if (kind == Zone::Kind::kPicture) {
    for (const Zone::Corner corner : {Zone::Corner{0, 0}, {10, 0}, {10, 10}, {0, 10}}) {
      EXPECT_TRUE(zone.corners.push(corner));
    }
  }
  SignalRules::Config made = config({});
  EXPECT_TRUE(made.zones.push(Zone{}));
  EXPECT_TRUE(made.zones.push(zone));
  each.zone = 1;
  EXPECT_TRUE(made.signals.push(each));
  return made;
}

TEST(SignalRules, InZoneIsATargetInIt) {
  SignalRules made = *SignalRules::create(with_zone(signal(Condition::kInZone), Zone::Kind::kSpace));
  EXPECT_EQ(made.decide(seen({target_at(0, 0, 2)}), at(0)), 0U);
  EXPECT_EQ(made.decide(seen({target_at(0, 0, 2), target_at(1.5, 0, 2)}), at(1)), 1U);
  made = *SignalRules::create(with_zone(signal(Condition::kInZone), Zone::Kind::kPicture));
  EXPECT_EQ(made.decide(seen({target_in_picture(20, 5)}), at(0)), 0U);
  EXPECT_EQ(made.decide(seen({target_in_picture(5, 5)}), at(1)), 1U);
}

TEST(SignalRules, AZoneNarrowsOtherConditions) {
  SignalRules made = *SignalRules::create(with_zone(signal(Condition::kDistanceBelow), Zone::Kind::kSpace));
  EXPECT_EQ(made.decide(seen({target_at(0, 0, 1)}), at(0)), 0U) << "near, outside";
  EXPECT_EQ(made.decide(seen({target_at(1.5, 0, 5)}), at(1)), 0U) << "inside, far";
  EXPECT_EQ(made.decide(seen({target_at(0, 0, 1), target_at(1.5, 0, 5)}), at(2)), 0U) << "no single one is both";
  EXPECT_EQ(made.decide(seen({target_at(1.5, 0, 1)}), at(3)), 1U);
}

TEST(SignalRules, DeadlineMissedIsThatOfThisOutput) {
  SignalRules made = rules({signal(Condition::kDeadlineMissed)});
  SignalRules::Inputs inputs = seen(kNone);
  EXPECT_EQ(made.decide(inputs, at(0)), 0U);
  inputs.deadline_missed = true;
  EXPECT_EQ(made.decide(inputs, at(30)), 1U);
  inputs.tracks_known = false;
  inputs.depth_known = false;
  inputs.healthy = false;
  EXPECT_EQ(made.decide(inputs, at(60)), 1U) << "nothing else need be known for it";
  inputs.deadline_missed = false;
  EXPECT_EQ(made.decide(inputs, at(90)), 0U);
}

TEST(SignalRules, EachSignalHasItsOwnBit) {
  SignalRules made = rules({signal(Condition::kDistanceBelow), signal(Condition::kConfirmed),
                            signal(Condition::kDeadlineMissed), signal(Condition::kConfirmed)});
  EXPECT_EQ(made.size(), 4U);
  EXPECT_EQ(made.decide(seen({target_at(0, 0, 9)}), at(0)), 0b1010U);
  EXPECT_EQ(made.lines(), 0b1010U);
}

TEST(SignalRules, AsManyAsThereAreLines) {
  SignalRules::Config full = config({});
  for (std::size_t i = 0; i < kMaxSignals; ++i) {
    EXPECT_TRUE(full.signals.push(signal(i % 2 == 0 ? Condition::kConfirmed : Condition::kDeadlineMissed)));
  }
  EXPECT_FALSE(full.signals.push(signal(Condition::kConfirmed)));
  SignalRules made = *SignalRules::create(full);
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 0b0101010101010101U);
}

TEST(SignalRules, NoneIsGood) {
  SignalRules none = rules({});
  EXPECT_EQ(none.decide(seen(kOne), at(0)), 0U);
  EXPECT_EQ(none.advance(at(1)), 0U);
  EXPECT_EQ(none.size(), 0U);
}

// ---- Not known

TEST(SignalRules, SafeStateUntilTheFirstOutput) {
  Signal safe = signal(Condition::kConfirmed);
  safe.safe = true;
  SignalRules made = rules({signal(Condition::kConfirmed), safe, signal(Condition::kHeartbeat)});
  EXPECT_EQ(made.lines(), 0b010U);
  EXPECT_EQ(made.safe_lines(), 0b010U);
  EXPECT_EQ(made.advance(at(100000)), 0b010U);
  EXPECT_EQ(made.next_change(), std::nullopt);
  EXPECT_EQ(made.decide(seen(kNone), at(100001)), 0b100U);
}

TEST(SignalRules, WithoutTracksTargetRulesAreSafeAtOnce) {
  Signal active_if_unknown = held(Condition::kDistanceBelow, 500);
  active_if_unknown.safe = true;
  SignalRules made = rules({held(Condition::kConfirmed, 500), pulse(Condition::kConfirmed, 500), active_if_unknown});
  EXPECT_EQ(made.decide(seen({target_at(0, 0, 9)}), at(0)), 0b011U);
  SignalRules::Inputs blind = seen(kOne);
  blind.tracks_known = false;
  EXPECT_EQ(made.decide(blind, at(10)), 0b100U) << "hold and pulse or not";
  EXPECT_EQ(made.decide(seen(kNone), at(20)), 0U);
}

TEST(SignalRules, WithoutDepthOnlyRulesThatNeedItAreSafe) {
  SignalRules::Config all = with_zone(signal(Condition::kInZone), Zone::Kind::kSpace);
  all.signals.clear();
  Zone picture;
  picture.kind = Zone::Kind::kPicture;
  for (const Zone::Corner corner : {Zone::Corner{0, 0}, {10, 0}, {10, 10}}) EXPECT_TRUE(picture.corners.push(corner));
  EXPECT_TRUE(all.zones.push(picture));
  const std::size_t in_space = 1;
  const std::size_t in_picture = 2;
  const auto add = [&all](Condition when, std::optional<std::size_t> zone) {
    Signal each = signal(when);
    each.zone = zone;
    each.safe = true;
    EXPECT_TRUE(all.signals.push(each));
  };
  add(Condition::kConfirmed, std::nullopt);
  add(Condition::kConfirmed, in_picture);
  add(Condition::kInZone, in_picture);
  add(Condition::kDistanceBelow, std::nullopt);
  add(Condition::kTimeToReachBelow, std::nullopt);
  add(Condition::kInZone, in_space);
  add(Condition::kConfirmed, in_space);
  add(Condition::kDistanceBelow, in_picture);
  SignalRules made = *SignalRules::create(all);
  EXPECT_EQ(made.decide(seen(kNone), at(0)), 0U);
  SignalRules::Inputs mono = seen(kNone);
  mono.depth_known = false;
  EXPECT_EQ(made.decide(mono, at(10)), 0b11111000U);
}

TEST(SignalRules, WhatHoldsWhenAllIsKnownAgainBeginsAnew) {
  SignalRules made = rules({pulse(Condition::kConfirmed, 20, 10000)});
  SignalRules::Inputs blind = seen(kOne);
  blind.tracks_known = false;
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(made.advance(at(20)), 0U);
  EXPECT_EQ(made.decide(seen(kOne), at(30)), 0U);
  EXPECT_EQ(made.decide(blind, at(60)), 0U);
  EXPECT_EQ(made.decide(seen(kOne), at(90)), 1U);
}

TEST(SignalRules, WhatNobodyRenewsGoesSafe) {
  Signal safe = signal(Condition::kConfirmed);
  safe.safe = true;
  SignalRules made = rules({signal(Condition::kConfirmed), safe, signal(Condition::kDeadlineMissed)});
  SignalRules::Inputs inputs = seen(kOne);
  inputs.deadline_missed = true;
  EXPECT_EQ(made.decide(inputs, at(0)), 0b111U);
  EXPECT_EQ(ms_of(made.next_change()), 1000);
  EXPECT_EQ(made.advance(at(999)), 0b111U);
  EXPECT_EQ(made.advance(at(1000)), 0b010U);
  EXPECT_EQ(made.next_change(), std::nullopt);
  EXPECT_EQ(made.decide(seen(kOne), at(1500)), 0b011U);
}

TEST(SignalRules, APulseThatWentSafeIsOver) {
  SignalRules made = rules({pulse(Condition::kConfirmed, 5000)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(made.advance(at(1000)), 0U);
  EXPECT_EQ(made.decide(seen(kNone), at(1010)), 0U);
}

TEST(SignalRules, AnOutputThatComesTooLateBeginsAnew) {
  SignalRules made = rules({pulse(Condition::kConfirmed, 20, 100000)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(made.decide(seen(kOne), at(999)), 0U);
  EXPECT_EQ(made.decide(seen(kOne), at(1998)), 0U);
  EXPECT_EQ(made.decide(seen(kOne), at(2998)), 1U);
}

// ---- Level and hold

TEST(SignalRules, LevelFollowsTheCondition) {
  SignalRules made = rules({signal(Condition::kConfirmed)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(made.advance(at(20)), 1U);
  EXPECT_EQ(made.decide(seen(kNone), at(30)), 0U);
  EXPECT_EQ(made.decide(seen(kOne), at(60)), 1U);
}

TEST(SignalRules, AShortConditionIsHeldToTheEndOfItsHoldAndNoLonger) {
  SignalRules made = rules({held(Condition::kConfirmed, 200)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(ms_of(made.next_change()), 1000) << "it holds: only age can end it";
  EXPECT_EQ(made.decide(seen(kNone), at(30)), 1U);
  EXPECT_EQ(ms_of(made.next_change()), 200);
  EXPECT_EQ(made.advance(at(199)), 1U);
  EXPECT_EQ(made.advance(at(200)), 0U);
  EXPECT_EQ(ms_of(made.next_change()), 1030);
}

TEST(SignalRules, HoldCountsFromTheBeginningSoALongConditionEndsAtOnce) {
  SignalRules made = rules({held(Condition::kConfirmed, 200)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(made.decide(seen(kOne), at(250)), 1U);
  EXPECT_EQ(made.decide(seen(kNone), at(280)), 0U);
}

TEST(SignalRules, HoldNeverDelaysTheNextActivation) {
  SignalRules made = rules({held(Condition::kConfirmed, 200)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(made.decide(seen(kNone), at(200)), 0U);
  EXPECT_EQ(made.decide(seen(kOne), at(201)), 1U);
  EXPECT_EQ(made.decide(seen(kNone), at(230)), 1U);
  EXPECT_EQ(made.advance(at(400)), 1U);
  EXPECT_EQ(made.advance(at(401)), 0U);
}

TEST(SignalRules, FlickerWithinTheHoldIsOneActivation) {
  SignalRules made = rules({held(Condition::kConfirmed, 200)});
  int edges = 0;
  gpio::LineBits before = 0;
  for (int ms = 0; ms <= 400; ms += 10) {
    const gpio::LineBits now = made.decide(seen(ms < 190 && ms % 20 == 0 ? kOne : kNone), at(ms));
    if (now != before) ++edges;
    before = now;
  }
  EXPECT_EQ(edges, 2);
}

TEST(SignalRules, HoldEndsWithoutAnyCallInBetween) {
  SignalRules made = rules({held(Condition::kConfirmed, 200)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(made.decide(seen(kNone), at(500)), 0U);
}

// ---- Pulse

TEST(SignalRules, APulseLastsItsWidthHoweverLongTheConditionHolds) {
  SignalRules made = rules({pulse(Condition::kConfirmed, 50)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(ms_of(made.next_change()), 50);
  EXPECT_EQ(made.decide(seen(kOne), at(30)), 1U);
  EXPECT_EQ(made.advance(at(49)), 1U);
  EXPECT_EQ(made.advance(at(50)), 0U);
  EXPECT_EQ(ms_of(made.next_change()), 1030);
  for (int ms = 60; ms < 900; ms += 30) EXPECT_EQ(made.decide(seen(kOne), at(ms)), 0U);
}

TEST(SignalRules, APulseLastsItsWidthHoweverShortTheConditionHolds) {
  SignalRules made = rules({pulse(Condition::kConfirmed, 50)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(made.decide(seen(kNone), at(10)), 1U);
  EXPECT_EQ(ms_of(made.next_change()), 50);
  EXPECT_EQ(made.advance(at(50)), 0U);
}

TEST(SignalRules, EachBeginningMakesAPulse) {
  SignalRules made = rules({pulse(Condition::kConfirmed, 10)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(made.decide(seen(kNone), at(30)), 0U);
  EXPECT_EQ(made.decide(seen(kOne), at(60)), 1U);
  EXPECT_EQ(made.advance(at(70)), 0U);
}

TEST(SignalRules, ABeginningWhileThePulseRunsAddsNothing) {
  SignalRules made = rules({pulse(Condition::kConfirmed, 100)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(made.decide(seen(kNone), at(30)), 1U);
  EXPECT_EQ(made.decide(seen(kOne), at(60)), 1U);
  EXPECT_EQ(ms_of(made.next_change()), 100);
  EXPECT_EQ(made.advance(at(100)), 0U);
  EXPECT_EQ(made.decide(seen(kOne), at(120)), 0U);
}

TEST(SignalRules, ASecondTargetBeginsNothing) {
  SignalRules made = rules({pulse(Condition::kConfirmed, 10)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(made.decide(seen({target_at(0, 0, 2), target_at(1, 0, 2)}), at(30)), 0U);
}

TEST(SignalRules, FlickerWithinTheHoldMakesOnePulse) {
  SignalRules made = rules({pulse(Condition::kConfirmed, 10, 200)});
  EXPECT_EQ(made.decide(seen(kOne), at(0)), 1U);
  EXPECT_EQ(made.decide(seen(kNone), at(30)), 0U);
  EXPECT_EQ(made.decide(seen(kOne), at(60)), 0U);
  EXPECT_EQ(made.decide(seen(kNone), at(199)), 0U);
  EXPECT_EQ(made.decide(seen(kOne), at(200)), 1U);
}

TEST(SignalRules, APulseThatEndedUnseenIsFollowedByTheNext) {
  SignalRules made = rules({pulse(Condition::kDeadlineMissed, 10)});
  SignalRules::Inputs missed = seen(kNone);
  missed.deadline_missed = true;
  EXPECT_EQ(made.decide(missed, at(0)), 1U);
  EXPECT_EQ(made.decide(seen(kNone), at(5)), 1U);
  EXPECT_EQ(made.decide(missed, at(40)), 1U);
  EXPECT_EQ(ms_of(made.next_change()), 50);
}

// ---- Heartbeat

TEST(SignalRules, TheHeartBeatsWhileHealthy) {
  SignalRules made = rules({signal(Condition::kHeartbeat)});  // an edge every 100 ms
  EXPECT_EQ(made.decide(seen(kNone), at(0)), 1U);
  EXPECT_EQ(ms_of(made.next_change()), 100);
  EXPECT_EQ(made.decide(seen(kNone), at(40)), 1U);
  EXPECT_EQ(made.advance(at(99)), 1U);
  EXPECT_EQ(made.advance(at(100)), 0U);
  EXPECT_EQ(made.advance(at(103)), 0U);
  EXPECT_EQ(made.decide(seen(kNone), at(190)), 0U);
  EXPECT_EQ(made.advance(at(203)), 1U);
  EXPECT_EQ(ms_of(made.next_change()), 300) << "lateness does not add up";
}

TEST(SignalRules, TheHeartStopsWithHealthAndBeatsAgainWithIt) {
  Signal safe_high = signal(Condition::kHeartbeat);
  safe_high.safe = true;
  SignalRules made = rules({signal(Condition::kHeartbeat), safe_high});
  SignalRules::Inputs ill = seen(kNone);
  ill.healthy = false;
  EXPECT_EQ(made.decide(ill, at(0)), 0b10U);
  EXPECT_EQ(made.advance(at(150)), 0b10U);
  EXPECT_EQ(made.decide(seen(kNone), at(160)), 0b11U);
  EXPECT_EQ(made.advance(at(260)), 0b00U);
  EXPECT_EQ(made.decide(ill, at(270)), 0b10U);
  EXPECT_EQ(ms_of(made.next_change()), 1270) << "only age";
  EXPECT_EQ(made.advance(at(460)), 0b10U);
}

TEST(SignalRules, TheHeartStopsWhenNoOutputsCome) {
  SignalRules made = rules({signal(Condition::kHeartbeat)});
  EXPECT_EQ(made.decide(seen(kNone), at(0)), 1U);
  int edges = 0;
  gpio::LineBits before = 1;
  for (int ms = 1; ms < 5000; ++ms) {
    const gpio::LineBits now = made.advance(at(ms));
    if (now != before) ++edges;
    before = now;
  }
  EXPECT_EQ(edges, 9) << "the last at 900 ms, to inactive";
  EXPECT_EQ(before, 0U);
}

TEST(SignalRules, AfterASleepTheHeartBeatsOnFromNow) {
  SignalRules made = rules({signal(Condition::kHeartbeat)});
  EXPECT_EQ(made.decide(seen(kNone), at(0)), 1U);
  EXPECT_EQ(made.advance(at(730)), 0U) << "one edge, not seven";
  EXPECT_EQ(ms_of(made.next_change()), 830);
}

// ---- Time

TEST(SignalRules, TimeThatFallsStands) {
  SignalRules made = rules({pulse(Condition::kConfirmed, 50)});
  EXPECT_EQ(made.decide(seen(kOne), at(100)), 1U);
  EXPECT_EQ(made.advance(at(150)), 0U);
  EXPECT_EQ(made.advance(at(120)), 0U);
  EXPECT_EQ(made.decide(seen(kNone), at(120)), 0U);
  EXPECT_EQ(ms_of(made.next_change()), 1150);
}

/// Against the definition: the line of one signal of any kind, worked out from all that was ever told.
struct Told {
  int ms;
  bool condition;
};
bool expected(const Signal& of, const std::vector<Told>& told, int now) {
  const auto hold = static_cast<int>(of.hold / milliseconds(1));
  const auto width = static_cast<int>(of.pulse / milliseconds(1));
  bool before = false;
  int held_until = -1;
  int pulse_from = -100000;
  for (const Told& each : told) {
    const bool was_held = before || each.ms < held_until;
    if (each.condition && !was_held) {
      held_until = each.ms + hold;
      if (each.ms >= pulse_from + width) pulse_from = each.ms;
    }
    before = each.condition;
  }
  return of.mode == Signal::Mode::kPulse ? now < pulse_from + width : before || now < held_until;
}

TEST(SignalRules, AnyHistoryAgreesWithTheDefinitionAndNextChangeMissesNothing) {
  std::mt19937 random(7);
  const auto below = [&random](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  for (int run = 0; run < 300; ++run) {
    const Signal of = below(2) == 0 ? held(Condition::kConfirmed, below(120))
                                    : pulse(Condition::kConfirmed, 1 + below(80), below(120));
    SignalRules made = rules({of});
    std::vector<Told> told;
    int next_output = 0;
    gpio::LineBits line = 0;
    for (int ms = 0; ms < 1500; ++ms) {
      const std::optional<int> change = ms_of(made.next_change());
      if (ms == next_output) {
        told.push_back({ms, below(3) == 0});
        line = made.decide(seen(told.back().condition ? kOne : kNone), at(ms));
        next_output += 1 + below(60);
      } else if (change && *change <= ms) {
        line = made.advance(at(ms));
      }
      ASSERT_EQ(line == 1, expected(of, told, ms)) << "run " << run << " at " << ms;
    }
  }
}

// ---- Faults

Fault fault(const SignalRules::Config& bad) {
  const auto made = SignalRules::create(bad);
  EXPECT_FALSE(made.has_value());
  return made.has_value() ? Fault::kOutOfMemory : made.error();
}

TEST(SignalRulesCreate, RefusesLimitsThatAreNone) {
  for (const double limit : {0.0, -1.0}) {
    Signal bad = signal(Condition::kDistanceBelow);
    bad.limit_m = limit;
    EXPECT_EQ(fault(config({bad})), Fault::kBadConfig);
    bad = signal(Condition::kTimeToReachBelow);
    bad.limit_s = limit;
    EXPECT_EQ(fault(config({bad})), Fault::kBadConfig);
  }
  for (const double limit : {kNan, kInfinity}) {
    Signal bad = signal(Condition::kDistanceBelow);
    bad.limit_m = limit;
    EXPECT_EQ(fault(config({bad})), Fault::kNotFinite);
    bad = signal(Condition::kConfirmed);
    bad.limit_s = limit;
    EXPECT_EQ(fault(config({bad})), Fault::kNotFinite);
  }
}

TEST(SignalRulesCreate, RefusesMetresWithoutAUnit) {
  EXPECT_EQ(fault(config({signal(Condition::kDistanceBelow)}, 0)), Fault::kBadConfig);
  EXPECT_EQ(fault(config({}, -1)), Fault::kBadConfig);
  EXPECT_EQ(fault(config({}, kNan)), Fault::kNotFinite);
  SignalRules::Config zone = with_zone(signal(Condition::kInZone), Zone::Kind::kSpace);
  zone.unit_m = 0;
  EXPECT_EQ(fault(zone), Fault::kBadConfig);
  zone = with_zone(signal(Condition::kInZone), Zone::Kind::kPicture);
  zone.unit_m = 0;
  EXPECT_TRUE(SignalRules::create(zone).has_value()) << "a zone that nobody asks for needs no unit";
}

TEST(SignalRulesCreate, RefusesZonesThatAreNotThereOrMakeNoSense) {
  EXPECT_EQ(fault(config({signal(Condition::kInZone)})), Fault::kBadConfig);
  Signal nowhere = signal(Condition::kInZone);
  nowhere.zone = 0;
  EXPECT_EQ(fault(config({nowhere})), Fault::kBadConfig);
  EXPECT_EQ(fault(with_zone(signal(Condition::kHeartbeat), Zone::Kind::kSpace)), Fault::kBadConfig);
  EXPECT_EQ(fault(with_zone(signal(Condition::kDeadlineMissed), Zone::Kind::kSpace)), Fault::kBadConfig);
  SignalRules::Config zone = with_zone(signal(Condition::kInZone), Zone::Kind::kSpace);
  zone.zones[0].x_m = {1, 0};
  EXPECT_EQ(fault(zone), Fault::kBadConfig);
}

TEST(SignalRulesCreate, RefusesTimesThatAreNone) {
  EXPECT_EQ(fault(config({pulse(Condition::kConfirmed, 0)})), Fault::kBadConfig);
  EXPECT_EQ(fault(config({pulse(Condition::kHeartbeat, 10)})), Fault::kBadConfig);
  EXPECT_EQ(fault(config({held(Condition::kConfirmed, -1)})), Fault::kBadConfig);
  Signal stopped = signal(Condition::kHeartbeat);
  stopped.half_period = milliseconds(0);
  EXPECT_EQ(fault(config({stopped})), Fault::kBadConfig);
  SignalRules::Config ageless = config({});
  ageless.stale_after = milliseconds(0);
  EXPECT_EQ(fault(ageless), Fault::kBadConfig);
}

}  // namespace
}  // namespace stereotrack::signals
