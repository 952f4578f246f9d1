#include "firmware-app/evaluation/scores.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <ostream>
#include <random>

namespace stereotrack::evaluation {
namespace {

constexpr Box kHere{0, 0, 100, 40};
constexpr Box kThere{500, 0, 100, 40};
constexpr Box kNowhere{900, 0, 100, 40};

/// IoU with the box itself: (100 - shift) / (100 + shift).
Box shifted(const Box& box, double shift) { return {box.left + shift, box.top, box.width, box.height}; }

MotRow row(std::int64_t frame, std::int64_t id, const Box& box, double confidence = 1) {
  return {frame, id, box, confidence};
}

MotRow at(MotRow placed, double x, double y, double z) {
  placed.has_position = true;
  placed.position = {x, y, z};
  return placed;
}

TEST(Scores, PerfectTracksScoreOneEverywhere) {
  Truth truth;
  Tracks tracks;
  for (int frame = 1; frame <= 10; ++frame) {
    truth.rows.push_back(row(frame, 1, kHere));
    truth.rows.push_back(row(frame, 2, kThere));
    tracks.rows.push_back(row(frame, 77, kThere));
    tracks.rows.push_back(row(frame, 33, kHere));
  }
  const Scores s = evaluate(truth, tracks);
  for (const double rate : {s.hota, s.det_a, s.ass_a, s.loc_a, s.det_re, s.det_pr, s.ass_re, s.ass_pr, s.mota, s.motp,
                            s.recall, s.precision, s.idf1, s.idp, s.idr}) {
    EXPECT_DOUBLE_EQ(rate, 1.0);
  }
  EXPECT_EQ(s.true_positives, 20U);
  EXPECT_EQ(s.false_positives + s.false_negatives + s.identity_switches + s.fragmentations, 0U);
  EXPECT_EQ(s.mostly_tracked, 2U);
  EXPECT_EQ(s.frames, 10U);
}

TEST(Scores, OverlapOfSixTenthsCountsForTwelveOfNineteenThresholds) {
  Truth truth;
  Tracks tracks;
  for (int frame = 1; frame <= 5; ++frame) {
    truth.rows.push_back(row(frame, 1, kHere));
    tracks.rows.push_back(row(frame, 1, shifted(kHere, 25)));  // 75 / 125 = 0.6
  }
  const Scores s = evaluate(truth, tracks);
  EXPECT_DOUBLE_EQ(s.hota, 12.0 / 19);  // 0.05 ... 0.60; where nothing matches, HOTA is 0
  EXPECT_DOUBLE_EQ(s.det_a, 12.0 / 19);
  EXPECT_DOUBLE_EQ(s.ass_a, 12.0 / 19);
  EXPECT_DOUBLE_EQ(s.loc_a, (12 * 0.6 + 7 * 1.0) / 19);  // and LocA is 1, as TrackEval defines
  EXPECT_DOUBLE_EQ(s.motp, 0.6);
}

TEST(Scores, IdentitySwitchHalfway) {
  Truth truth;
  Tracks tracks;
  for (int frame = 1; frame <= 10; ++frame) {
    truth.rows.push_back(row(frame, 1, kHere));
    tracks.rows.push_back(row(frame, frame <= 5 ? 1 : 2, kHere));
  }
  const Scores s = evaluate(truth, tracks);
  EXPECT_DOUBLE_EQ(s.det_a, 1.0);
  EXPECT_DOUBLE_EQ(s.ass_a, 0.5);   // each pair: 5 / (10 + 5 - 5)
  EXPECT_DOUBLE_EQ(s.ass_re, 0.5);  // 5 of the object's 10 boxes
  EXPECT_DOUBLE_EQ(s.ass_pr, 1.0);
  EXPECT_DOUBLE_EQ(s.hota, std::sqrt(0.5));
  EXPECT_EQ(s.identity_switches, 1U);
  EXPECT_EQ(s.fragmentations, 0U);
  EXPECT_DOUBLE_EQ(s.mota, 0.9);
  EXPECT_EQ(s.id_true_positives, 5U);
  EXPECT_DOUBLE_EQ(s.idf1, 0.5);
}

TEST(Scores, MissesAndFalseAlarms) {
  Truth truth;
  Tracks tracks;
  for (int frame = 1; frame <= 10; ++frame) truth.rows.push_back(row(frame, 1, kHere));
  for (int frame = 1; frame <= 6; ++frame) tracks.rows.push_back(row(frame, 1, kHere));
  for (int frame = 9; frame <= 12; ++frame) tracks.rows.push_back(row(frame, 2, kNowhere));
  const Scores s = evaluate(truth, tracks);
  EXPECT_EQ(s.true_positives, 6U);
  EXPECT_EQ(s.false_negatives, 4U);
  EXPECT_EQ(s.false_positives, 4U);  // frames 11 and 12 lie after the truth's end
  EXPECT_DOUBLE_EQ(s.mota, 0.2);
  EXPECT_DOUBLE_EQ(s.recall, 0.6);
  EXPECT_DOUBLE_EQ(s.precision, 0.6);
  EXPECT_NEAR(s.det_a, 6.0 / 14, 1e-15);
  EXPECT_DOUBLE_EQ(s.ass_a, 0.6);  // 6 / (10 + 6 - 6)
  EXPECT_EQ(s.partly_tracked, 1U);
  EXPECT_EQ(s.frames, 12U);
}

TEST(Scores, OverlapOfExactlyOneHalfIsAMatch) {
  const Truth truth{{row(1, 1, {0, 0, 1, 1})}};
  EXPECT_EQ(evaluate(truth, {{row(1, 1, {0, 0, 0.5, 1})}}).true_positives, 1U);
  EXPECT_EQ(evaluate(truth, {{row(1, 1, {0, 0, 0.499, 1})}}).true_positives, 0U);
}

TEST(Scores, PairStaysTogetherThoughANewTrackFitsBetter) {
  const Truth truth{{row(1, 1, kHere), row(2, 1, kHere)}};
  const Tracks tracks{{row(1, 8, kHere), row(2, 8, shifted(kHere, 25)), row(2, 9, kHere)}};
  const Scores s = evaluate(truth, tracks);
  EXPECT_EQ(s.identity_switches, 0U);
  EXPECT_DOUBLE_EQ(s.motp, (1.0 + 0.6) / 2);
}

TEST(Scores, PairPartsWhenItsOverlapFallsUnderOneHalf) {
  const Truth truth{{row(1, 1, kHere), row(2, 1, kHere)}};
  const Tracks tracks{{row(1, 8, kHere), row(2, 8, shifted(kHere, 40)), row(2, 9, kHere)}};  // 60 / 140
  const Scores s = evaluate(truth, tracks);
  EXPECT_EQ(s.identity_switches, 1U);
  EXPECT_EQ(s.false_positives, 1U);
  EXPECT_DOUBLE_EQ(s.motp, 1.0);
}

TEST(Scores, SwitchIsCountedAcrossAGapAndTheGapIsOneFragmentation) {
  Truth truth;
  Tracks tracks;
  for (int frame = 1; frame <= 9; ++frame) {
    truth.rows.push_back(row(frame, 1, kHere));
    truth.rows.push_back(row(frame, 2, kThere));
    tracks.rows.push_back(row(frame, 2, kThere));
    if (frame <= 3) tracks.rows.push_back(row(frame, 1, kHere));
    if (frame >= 7) tracks.rows.push_back(row(frame, 5, kHere));
  }
  const Scores s = evaluate(truth, tracks);
  EXPECT_EQ(s.identity_switches, 1U);
  EXPECT_EQ(s.fragmentations, 1U);
  EXPECT_EQ(s.mostly_tracked, 1U);
  EXPECT_EQ(s.partly_tracked, 1U);  // 6 of 9
}

TEST(Scores, TrackedInExactlyFourFifthsIsPartlyTrackedAndUnderOneFifthMostlyLost) {
  Truth truth;
  Tracks tracks;
  for (int frame = 1; frame <= 10; ++frame) {
    truth.rows.push_back(row(frame, 1, kHere));
    truth.rows.push_back(row(frame, 2, kThere));
    truth.rows.push_back(row(frame, 3, kNowhere));
    if (frame <= 8) tracks.rows.push_back(row(frame, 1, kHere));
    if (frame <= 1) tracks.rows.push_back(row(frame, 2, kThere));
    if (frame <= 9) tracks.rows.push_back(row(frame, 3, kNowhere));
  }
  const Scores s = evaluate(truth, tracks);
  EXPECT_EQ(s.partly_tracked, 1U);
  EXPECT_EQ(s.mostly_lost, 1U);
  EXPECT_EQ(s.mostly_tracked, 1U);
}

TEST(Scores, IgnoredTruthNeitherHelpsNorHarms) {
  const Truth truth{{row(1, 1, kHere), row(1, 2, kThere, 0)}};
  for (const Tracks& tracks : {Tracks{{row(1, 1, kHere)}}, Tracks{{row(1, 1, kHere), row(1, 2, kThere)}}}) {
    const Scores s = evaluate(truth, tracks);
    EXPECT_EQ(s.true_positives, 1U);
    EXPECT_EQ(s.false_positives, 0U);
    EXPECT_EQ(s.false_negatives, 0U);
    EXPECT_EQ(s.truth_ids, 1U);
    EXPECT_EQ(s.ignored_boxes, 1U);
    EXPECT_EQ(s.dropped_boxes, tracks.rows.size() - 1);
    EXPECT_DOUBLE_EQ(s.hota, 1.0);
    EXPECT_DOUBLE_EQ(s.mota, 1.0);
    EXPECT_DOUBLE_EQ(s.idf1, 1.0);
  }
}

TEST(Scores, TrackFarFromIgnoredTruthStaysAFalseAlarm) {
  const Truth truth{{row(1, 1, kHere), row(1, 2, kThere, 0)}};
  const Scores s = evaluate(truth, {{row(1, 1, kHere), row(1, 2, shifted(kThere, 40))}});
  EXPECT_EQ(s.dropped_boxes, 0U);
  EXPECT_EQ(s.false_positives, 1U);
}

TEST(Scores, IgnoredTruthTakesOnlyTheTrackThatTheBestAssignmentGivesIt) {
  // Both tracks overlap both objects; the ignored one stands 20 px beside the scored one.
  const Truth truth{{row(1, 1, kHere), row(1, 2, shifted(kHere, 20), 0)}};
  const Scores s = evaluate(truth, {{row(1, 1, shifted(kHere, 2)), row(1, 2, shifted(kHere, 19))}});
  EXPECT_EQ(s.dropped_boxes, 1U);
  EXPECT_EQ(s.true_positives, 1U);
  EXPECT_DOUBLE_EQ(s.motp, 98.0 / 102);
}

TEST(Scores, NoTracksLoseEverything) {
  const Scores s = evaluate({{row(1, 1, kHere), row(2, 1, kHere), row(2, 2, kThere)}}, {});
  EXPECT_EQ(s.false_negatives, 3U);
  EXPECT_EQ(s.mostly_lost, 2U);
  EXPECT_EQ(s.hota, 0.0);
  EXPECT_EQ(s.mota, 0.0);
  EXPECT_EQ(s.idf1, 0.0);
  EXPECT_EQ(s.id_false_negatives, 3U);
}

TEST(Scores, NoTruthMakesEveryTrackBoxAFalseAlarm) {
  const Scores s = evaluate({}, {{row(1, 1, kHere), row(2, 1, kHere)}});
  EXPECT_EQ(s.false_positives, 2U);
  EXPECT_EQ(s.hota, 0.0);
  EXPECT_EQ(s.precision, 0.0);
  EXPECT_EQ(s.id_false_positives, 2U);
}

TEST(Scores, NothingAtAllScoresNothing) {
  const Scores s = evaluate({}, {});
  EXPECT_EQ(s.frames, 0U);
  EXPECT_EQ(s.idf1, 0.0);
}

// One metre a second along x, seen as 1.1: a tenth off. The other one goes too slowly to be compared.
TEST(Scores, VelocityErrorIsThatOfTheWayOfTenFrames) {
  Truth truth;
  Tracks tracks;
  for (int frame = 1; frame <= 25; ++frame) {
    const double t = frame / 30.0;
    truth.rows.push_back(at(row(frame, 1, kHere), t, 0, 5));
    tracks.rows.push_back(at(row(frame, 7, kHere), 1.1 * t + 3, 0, 5));
    truth.rows.push_back(at(row(frame, 2, kThere), 0.2 * t, 0, 5));
    tracks.rows.push_back(at(row(frame, 8, kThere), t, 0, 5));
  }
  const VelocityError v = evaluate(truth, tracks).velocity;
  EXPECT_EQ(v.pairs, 15U);
  EXPECT_NEAR(v.median, 0.1, 1e-12);
  EXPECT_NEAR(v.p95, 0.1, 1e-12);
  Options slow;
  slow.min_speed = 0.1;
  EXPECT_EQ(evaluate(truth, tracks, slow).velocity.pairs, 30U);
}

TEST(Scores, VelocityIsNotComparedAcrossAChangeOfTrack) {
  Truth truth;
  Tracks tracks;
  for (int frame = 1; frame <= 18; ++frame) {
    truth.rows.push_back(at(row(frame, 1, kHere), frame, 0, 5));
    tracks.rows.push_back(at(row(frame, frame <= 9 ? 7 : 8, kHere), frame, 0, 5));
  }
  EXPECT_EQ(evaluate(truth, tracks).velocity.pairs, 0U);
}

TEST(Scores, PositionErrorIsComparedWithWhatAQuarterOfAPixelIsWorth) {
  Options options;
  options.focal_baseline = 150;  // at 6 m: 36 / 150 / 4 = 0.06
  const Truth truth{{at(row(1, 1, kHere), 0, 0, 6), at(row(1, 2, kThere), 0, 0, 0)}};
  const Tracks tracks{{at(row(1, 1, kHere), 0, 0, 6.09), at(row(1, 2, kThere), 0, 0, 1)}};
  const PositionError p = evaluate(truth, tracks, options).position;
  EXPECT_EQ(p.geometry_pairs, 1U);
  EXPECT_NEAR(p.geometry_median, 1.5, 1e-9);
  EXPECT_EQ(evaluate(truth, tracks).position.geometry_pairs, 0U);
}

TEST(Scores, TrackThatLiesOnNothingForHalfOfItsRowsIsFalse) {
  const Box part{10, 5, 20, 10};     // within kHere
  const Box beside{60, 0, 100, 40};  // two fifths of it within kHere
  Truth truth;
  Tracks tracks;
  for (int frame = 1; frame <= 10; ++frame) {
    truth.rows.push_back(row(frame, 1, kHere, frame % 2));  // not scored now and then
    tracks.rows.push_back(row(frame, 1, part));
    tracks.rows.push_back(row(frame, 2, beside));
    tracks.rows.push_back(row(frame, 3, frame <= 5 ? part : kNowhere));
    tracks.rows.push_back(row(frame, 4, frame <= 4 ? part : kNowhere));
    tracks.rows.push_back(row(frame + 10, 5, part));  // nobody is there any more
  }
  Options options;
  const Scores s = evaluate(truth, tracks, options);
  EXPECT_EQ(s.false_tracks, 3U);  // 2, 4 and 5
  EXPECT_DOUBLE_EQ(s.false_tracks_a_minute, 3 / (20 / 30.0 / 60));
  options.frames = 1800;
  EXPECT_DOUBLE_EQ(evaluate(truth, tracks, options).false_tracks_a_minute, 3);
}

TEST(Scores, PositionErrorOfMatchedPairs) {
  Truth truth;
  Tracks tracks;
  for (int frame = 1; frame <= 5; ++frame) {  // distances 0, 5, 10, 15, 20 at z = 100
    truth.rows.push_back(at(row(frame, 1, kHere), 1, 2, 100));
    tracks.rows.push_back(at(row(frame, 1, kHere), 1 + 3 * (frame - 1), 2 + 4 * (frame - 1), 100));
  }
  truth.rows.push_back(at(row(6, 1, kHere), 0, 0, 1));
  tracks.rows.push_back(row(6, 1, kHere));  // no position: missing
  truth.rows.push_back(row(7, 1, kHere));   // no truth: nothing to measure
  tracks.rows.push_back(at(row(7, 1, kHere), 0, 0, 1));
  truth.rows.push_back(at(row(8, 1, kHere), 0, 0, 1));  // not a pair
  tracks.rows.push_back(at(row(8, 1, kThere), 9, 9, 9));
  const PositionError p = evaluate(truth, tracks).position;
  EXPECT_EQ(p.pairs, 5U);
  EXPECT_EQ(p.missing, 1U);
  EXPECT_DOUBLE_EQ(p.median, 10);
  EXPECT_DOUBLE_EQ(p.p95, 19);  // between 15 and 20
  EXPECT_EQ(p.relative_pairs, 5U);
  EXPECT_DOUBLE_EQ(p.relative_median, 0.1);
  EXPECT_DOUBLE_EQ(p.relative_p95, 0.19);
}

TEST(Scores, RelativeErrorNeedsATrueDepthOverZero) {
  const PositionError p = evaluate({{at(row(1, 1, kHere), 4, 5, 0)}}, {{at(row(1, 1, kHere), 4, 5, 2)}}).position;
  EXPECT_EQ(p.pairs, 1U);
  EXPECT_DOUBLE_EQ(p.median, 2);
  EXPECT_EQ(p.relative_pairs, 0U);
}

/// Scores that the MOTChallenge development kit published for exactly these files.
struct Published {
  const char* sequence;
  double idf1, recall, mota, motp;  // [%], one decimal
  std::size_t switches, fragmentations, mostly_tracked, partly_tracked, mostly_lost, fp, fn;
  double hota, det_a, ass_a, loc_a;  // not published: computed once from TrackEval's definition in plain Python
};

/// The name of a test instance; its bytes would hold an address, which differs in every run.
void PrintTo(const Published& published, std::ostream* out) { *out << published.sequence; }

class PublishedScores : public testing::TestWithParam<Published> {
 protected:
  void SetUp() override {
    const std::filesystem::path folder =
        std::filesystem::path(STEREOTRACK_SOURCE_DIR "/../shared/data/mot_gt_text") / GetParam().sequence;
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no test data: " << folder;
    truth_.rows = read_mot(folder / "gt.txt");
    tracks_.rows = read_mot(folder / "test.txt");
  }
  Truth truth_;
  Tracks tracks_;
};

TEST_P(PublishedScores, AreReproduced) {
  const Published& expected = GetParam();
  const Scores s = evaluate(truth_, tracks_);
  constexpr double kRounding = 0.0500001;
  EXPECT_NEAR(100 * s.idf1, expected.idf1, kRounding);
  EXPECT_NEAR(100 * s.recall, expected.recall, kRounding);
  EXPECT_NEAR(100 * s.mota, expected.mota, kRounding);
  EXPECT_NEAR(100 * s.motp, expected.motp, kRounding);
  EXPECT_EQ(s.identity_switches, expected.switches);
  EXPECT_EQ(s.fragmentations, expected.fragmentations);
  EXPECT_EQ(s.mostly_tracked, expected.mostly_tracked);
  EXPECT_EQ(s.partly_tracked, expected.partly_tracked);
  EXPECT_EQ(s.mostly_lost, expected.mostly_lost);
  EXPECT_EQ(s.false_positives, expected.fp);
  EXPECT_EQ(s.false_negatives, expected.fn);
  EXPECT_NEAR(s.hota, expected.hota, 1e-12);
  EXPECT_NEAR(s.det_a, expected.det_a, 1e-12);
  EXPECT_NEAR(s.ass_a, expected.ass_a, 1e-12);
  EXPECT_NEAR(s.loc_a, expected.loc_a, 1e-12);
}

TEST_P(PublishedScores, DoNotDependOnTheOrderOfRows) {
  const Scores before = evaluate(truth_, tracks_);
  std::mt19937 random(3);
  std::shuffle(truth_.rows.begin(), truth_.rows.end(), random);
  std::shuffle(tracks_.rows.begin(), tracks_.rows.end(), random);
  const Scores after = evaluate(truth_, tracks_);
  EXPECT_NEAR(after.hota, before.hota, 1e-12);
  EXPECT_EQ(after.identity_switches, before.identity_switches);
  EXPECT_EQ(after.id_true_positives, before.id_true_positives);
  EXPECT_EQ(after.true_positives, before.true_positives);
}

INSTANTIATE_TEST_SUITE_P(
    Mot15, PublishedScores,
    testing::Values(Published{"TUD-Campus", 55.8, 58.2, 52.6, 72.3, 7, 7, 1, 6, 1, 13, 150, 0.39139743784511366,
                              0.41804703014276295, 0.36912068120832825, 0.7700522270221717},
                    Published{"TUD-Stadtmitte", 64.5, 60.9, 56.4, 65.4, 7, 6, 5, 4, 1, 45, 452, 0.3978490169927876,
                              0.39226757236931664, 0.40884075181129964, 0.7375211771780614}),
    [](const auto& instance) { return instance.index == 0 ? "Campus" : "Stadtmitte"; });

}  // namespace
}  // namespace stereotrack::evaluation
