#include "firmware-app/stereotrackd/target_notes.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace stereotrack::daemon {
namespace {

TrackReport track(std::uint32_t id, double z = 0, TrackState state = TrackState::kConfirmed, double age_s = 1) {
  TrackReport report;
  report.id = id;
  report.state = state;
  report.measured = state != TrackState::kCoasting;
  report.has_depth = z > 0;
  report.position.z() = z;
  report.age_s = age_s;
  return report;
}

std::vector<std::string> texts(TargetNotes& notes, double unit_m = 1) {
  std::vector<std::string> all;
  TargetNote note;
  while (notes.take(note)) all.push_back(text_of(note, unit_m));
  return all;
}

using Texts = std::vector<std::string>;

TEST(TargetNotes, ATargetIsToldOnceItIsConfirmedAndOnceItIsGone) {
  TargetNotes notes;
  notes.update(std::vector{track(7, 4.2, TrackState::kTentative)});
  EXPECT_EQ(texts(notes), Texts{});
  notes.update(std::vector{track(7, 4.2)});
  EXPECT_EQ(texts(notes), Texts{"target 7 is there, at 4.20 m"});
  notes.update(std::vector{track(7, 4.3, TrackState::kConfirmed, 2.5)});
  EXPECT_EQ(texts(notes), Texts{});
  notes.update({});
  EXPECT_EQ(texts(notes), Texts{"target 7 is gone after 2.5 s, last at 4.30 m"});
  notes.update({});
  EXPECT_EQ(texts(notes), Texts{});
}

TEST(TargetNotes, OneThatCoastsGoesOnAndIsToldAsItWasSeenLast) {
  TargetNotes notes;
  notes.update(std::vector{track(1, 2.0, TrackState::kConfirmed, 1.0)});
  notes.update(std::vector{track(1, 9.0, TrackState::kCoasting, 1.5)});
  notes.update({});
  EXPECT_EQ(texts(notes), (Texts{"target 1 is there, at 2.00 m", "target 1 is gone after 1.0 s, last at 2.00 m"}));
}

TEST(TargetNotes, EachOfSeveralIsToldByItself) {
  TargetNotes notes;
  notes.update(std::vector{track(1), track(3), track(5)});
  EXPECT_EQ(texts(notes), (Texts{"target 1 is there", "target 3 is there", "target 5 is there"}));
  // The first, one between and the last go; one comes.
  notes.update(std::vector{track(3), track(8)});
  EXPECT_EQ(texts(notes), (Texts{"target 1 is gone after 1.0 s", "target 5 is gone after 1.0 s", "target 8 is there"}));
  notes.update(std::vector{track(9)});
  EXPECT_EQ(texts(notes), (Texts{"target 3 is gone after 1.0 s", "target 8 is gone after 1.0 s", "target 9 is there"}));
}

TEST(TargetNotes, DistancesAreInMetresWhereTheUnitIsKnown) {
  TargetNotes notes;
  notes.update(std::vector{track(1, 12)});
  TargetNote note;
  ASSERT_TRUE(notes.take(note));
  EXPECT_EQ(text_of(note, 0.0254), "target 1 is there, at 0.30 m");
  EXPECT_EQ(text_of(note, 0), "target 1 is there, at 12.00 units");
}

TEST(TargetNotes, AsManyTargetsAsTheTrackerHasFindRoom) {
  TargetNotes notes;
  std::vector<TrackReport> all;
  for (std::uint32_t id = 1; id <= Tracker::kMaxTracks; ++id) all.push_back(track(id));
  notes.update(all);
  notes.update({});
  EXPECT_EQ(texts(notes).size(), 2U * Tracker::kMaxTracks);
  EXPECT_EQ(notes.left_out(), 0U);
}

TEST(TargetNotes, WhatNobodyFetchesIsCountedAndTheNextIsToldAgain) {
  TargetNotes notes;
  for (std::uint32_t id = 1; id <= 200; ++id) {
    notes.update(std::vector{track(id)});
    notes.update({});
  }
  EXPECT_EQ(notes.left_out(), 2 * 200U - 256U);
  EXPECT_EQ(texts(notes).size(), 256U);
  notes.update(std::vector{track(201)});
  EXPECT_EQ(texts(notes), Texts{"target 201 is there"});
}

}  // namespace
}  // namespace stereotrack::daemon
