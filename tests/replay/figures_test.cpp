// The figures of docs/QUALITY.md, guarded: each bound is what was reached on 2026-11-22 with a small margin, so that a
// change that makes tracking worse is seen. Where the target is higher than what is reached, the comment names it.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "firmware-app/evaluation/mot_file.hpp"
#include "firmware-app/evaluation/scores.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/score/disparity_score.hpp"
#include "tests/support/score/mask_score.hpp"
#include "tests/support/score/path_fit.hpp"
#include "tests/support/score/path_score.hpp"
#include "tests/support/temp_dir.hpp"

namespace stereotrack {
namespace {

namespace fs = std::filesystem;
using evaluation::MotRow;
using test::TempDir;

const fs::path kData = STEREOTRACK_SOURCE_DIR "/../shared/data";

#define NEEDS_RECORDING(folder) \
  if (!fs::is_directory(kData / (folder))) GTEST_SKIP() << "recording not there: ../shared/data/" << (folder)

/// Runs the program; what it complained of is in the failure.
void run_stereotrack(const std::vector<std::string>& words) {
  std::vector<std::string> command = {STEREOTRACK_BIN_DIR "/stereotrack"};
  command.insert(command.end(), words.begin(), words.end());
  test::ProgramOptions options;
  options.limit = std::chrono::minutes(12);
  const test::ProgramResult result = test::run_program(command, options);
  ASSERT_EQ(result.exit_code, 0) << words.front() << " " << words.at(1) << ": " << result.err;
}

void replay(const TempDir& dir, const std::string& source, const fs::path& calibration, std::vector<MotRow>& rows,
            const std::string& frames = {}) {
  std::vector<std::string> words = {"replay", source, "--calibration", calibration.string(), "--out", dir / "out"};
  if (!frames.empty()) words.insert(words.end(), {"--frames", frames});
  ASSERT_NO_FATAL_FAILURE(run_stereotrack(words));
  rows = evaluation::read_mot(dir / "out" / "tracks.csv");
}

std::set<std::int64_t> ids_in(const std::vector<MotRow>& rows, std::int64_t first, std::int64_t last) {
  std::set<std::int64_t> ids;
  for (const MotRow& row : rows) {
    if (row.frame >= first && row.frame <= last) ids.insert(row.id);
  }
  return ids;
}

TEST(Figures, ConveyorBoxKeepsOneIdentityOnAStraightPath) {
  NEEDS_RECORDING("dtu_conveyor_stereo");
  const fs::path source = kData / "dtu_conveyor_stereo";
  const TempDir dir;
  std::vector<MotRow> rows;
  ASSERT_NO_FATAL_FAILURE(replay(dir, source.string(), source / "derived_stereo_calibration.yml", rows));

  // Somebody comes in at the right edge in frame 80.
  EXPECT_THAT(ids_in(rows, 1, 79), testing::IsEmpty()) << "on the empty belt";
  const score::PathScore box = score::follow(rows, {.first_frame = 106, .last_frame = 252, .id = {}});
  EXPECT_GE(box.coverage(), 0.98);       // reached on 2026-11-22: 1.00; target 0.95
  EXPECT_LE(box.rows_of_id.size(), 3U);  // reached: 3, the box and two hands
  const score::PathScore straight = score::follow(rows, {.first_frame = 180, .last_frame = 250, .id = box.id});
  EXPECT_GE(straight.coverage(), 0.98);  // reached: 1.00
  const score::PathFit line = score::fit_path(straight.points, score::kStraight);
  EXPECT_LE(line.rms_3d, 0.06);                     // reached: 0.0572 squares; the target itself
  EXPECT_NEAR(line.velocity.norm(), 0.173, 0.012);  // reached: 0.166 squares a frame
}

/// conveyor_box.csv: the box in the raw left picture, its edges read off enlarged crops by eye, good to about 1 px.
TEST(Figures, ConveyorBoxHasTheSizeMeasuredByHand) {
  NEEDS_RECORDING("dtu_conveyor_stereo");
  const fs::path source = kData / "dtu_conveyor_stereo";
  const TempDir dir;
  std::vector<MotRow> rows;
  ASSERT_NO_FATAL_FAILURE(replay(dir, source.string(), source / "derived_stereo_calibration.yml", rows, "1:250"));
  const std::vector<MotRow> measured = evaluation::read_mot(STEREOTRACK_SOURCE_DIR "/tests/replay/conveyor_box.csv");
  ASSERT_EQ(measured.size(), 15U);
  const score::PathScore box = score::follow(rows, {.first_frame = 106, .last_frame = 250, .id = {}});

  const auto within_a_tenth = [](double tracked, double truth) { return std::abs(tracked - truth) <= 0.1 * truth; };
  std::size_t widths = 0;
  std::size_t heights = 0;
  std::size_t overlaps = 0;
  for (const MotRow& truth : measured) {
    SCOPED_TRACE(truth.frame);
    const auto row = std::find_if(rows.begin(), rows.end(), [&](const MotRow& candidate) {
      return candidate.frame == truth.frame && candidate.id == box.id;
    });
    ASSERT_NE(row, rows.end());
    widths += within_a_tenth(row->box.width, truth.box.width) ? 1U : 0U;
    heights += within_a_tenth(row->box.height, truth.box.height) ? 1U : 0U;
    overlaps += evaluation::overlap(row->box, truth.box) >= 0.8 ? 1U : 0U;
  }
  // Reached on 2026-11-22, the target itself.
  EXPECT_EQ(widths, 15U);
  EXPECT_EQ(heights, 15U);
  EXPECT_EQ(overlaps, 15U);
}

TEST(Figures, EachPassUnderTheCeilingCameraHasATrack) {
  NEEDS_RECORDING("stereo_people_overhead");
  const fs::path source = kData / "stereo_people_overhead";
  const TempDir dir;
  std::vector<MotRow> rows;
  ASSERT_NO_FATAL_FAILURE(
      replay(dir, "sbs:" + (source / "my_video_sbs_640x240.avi").string(), source / "calibration_as_stored.yml", rows));

  struct Pass {
    std::int64_t first;
    std::int64_t last;
    std::size_t most_tracks;  ///< reached on 2026-11-22, the target itself
    std::size_t least_rows;   ///< of the longest track: reached less a fifth
  };
  constexpr std::array<Pass, 4> kPasses = {{{57, 81, 1, 10}, {102, 120, 1, 8}, {138, 174, 1, 20}, {207, 237, 1, 16}}};
  std::map<std::int64_t, std::size_t> length;
  for (const MotRow& row : rows) ++length[row.id];
  std::set<std::int64_t> outside;
  for (const auto& [id, count] : length) outside.insert(id);
  for (const Pass& pass : kPasses) {
    SCOPED_TRACE(std::to_string(pass.first));
    const score::PathScore seen = score::follow(rows, {.first_frame = pass.first, .last_frame = pass.last, .id = {}});
    std::size_t tracks = 0;
    std::size_t longest = 0;
    for (const auto& [id, count] : seen.rows_of_id) {
      if (2 * count < length[id]) continue;
      ++tracks;
      longest = std::max(longest, count);
      outside.erase(id);
    }
    EXPECT_LE(tracks, pass.most_tracks);
    EXPECT_GE(longest, pass.least_rows);
  }
  // Somebody stands in the lower left corner: feet (25-55, 267-278), two hands (91-103), a hand on the shelf (255-278).
  // Reached: a track for each; target: nothing but what is there.
  EXPECT_LE(outside.size(), 5U);
  for (const MotRow& row : rows) {
    if (outside.count(row.id) == 0) continue;
    EXPECT_LT(row.box.left, 80) << "frame " << row.frame;
    EXPECT_GT(row.box.top + row.box.height, 140) << "frame " << row.frame;
    EXPECT_TRUE(row.frame <= 56 || (row.frame >= 90 && row.frame <= 104) || row.frame >= 254) << "frame " << row.frame;
  }
}

struct Pitch {
  std::string name;
  std::int64_t first;  ///< frame in which the ball flies
  std::int64_t last;
  double coverage;  ///< reached on 2026-11-22 less 0.05; target: 0.90
  Eigen::Vector3d rms_in;
  std::string cut;  ///< frames after which the ball is confirmed: the second after its first
};

void PrintTo(const Pitch& pitch, std::ostream* out) { *out << pitch.name; }

class Pitches : public testing::TestWithParam<Pitch> {};

/// The ball comes at about 10 inches a frame: of the tracks faster than 5, the longest.
std::optional<score::PathScore> ball_of(const std::vector<MotRow>& rows, const Pitch& pitch) {
  std::optional<score::PathScore> ball;
  for (const std::int64_t id : ids_in(rows, pitch.first, pitch.last)) {
    score::PathScore path = score::follow(rows, {.first_frame = pitch.first, .last_frame = pitch.last, .id = id});
    if (path.points.size() < 5 || (ball.has_value() && path.rows <= ball->rows)) continue;
    if (score::fit_path(path.points, score::kBallistic).velocity.norm() > 5) ball = std::move(path);
  }
  return ball;
}

TEST_P(Pitches, BallIsConfirmedInThreeFramesAndFliesSmoothly) {
  NEEDS_RECORDING("baseball_stereo_slow126");
  const Pitch& pitch = GetParam();
  const fs::path source = kData / "baseball_stereo_slow126";
  const TempDir dir;
  std::vector<MotRow> rows;
  ASSERT_NO_FATAL_FAILURE(replay(dir, (source / pitch.name).string(), source / "calibration.yml", rows, pitch.cut));
  EXPECT_THAT(rows, testing::Not(testing::IsEmpty())) << "confirmed by then";

  ASSERT_NO_FATAL_FAILURE(replay(dir, (source / pitch.name).string(), source / "calibration.yml", rows));
  const std::optional<score::PathScore> ball = ball_of(rows, pitch);
  ASSERT_TRUE(ball.has_value()) << "no track flies";
  EXPECT_GE(ball->coverage(), pitch.coverage);
  const score::PathFit path = score::fit_path(ball->points, score::kBallistic);
  for (int axis = 0; axis < 3; ++axis) EXPECT_LE(path.rms(axis), pitch.rms_in(axis)) << "axis " << axis;
}

INSTANTIATE_TEST_SUITE_P(
    Figures, Pitches,
    testing::Values(Pitch{"one_pitch", 5, 42, 0.95, {0.14, 0.16, 1.3}, "1:7"},   // reached: 1.00, 0.09 0.11 0.98
                    Pitch{"two_pitch", 6, 43, 0.92, {0.19, 0.15, 1.1}, "1:8"}),  // reached: 0.97, 0.14 0.10 0.79
    [](const auto& one) { return one.param.name == "one_pitch" ? "OnePitch" : "TwoPitch"; });

class ElevenObjects : public testing::TestWithParam<std::string> {};

TEST_P(ElevenObjects, KeepTheirIdentities) {
  const TempDir dir;
  ASSERT_NO_FATAL_FAILURE(run_stereotrack({"replay", "synthetic:eleven", "--set", "synthetic.seed=" + GetParam(),
                                           "--truth", dir / "gt.csv", "--out", dir / "out"}));

  const evaluation::Scores scores =
      evaluation::evaluate(evaluation::Truth{evaluation::read_mot(dir / "gt.csv")},
                           evaluation::Tracks{evaluation::read_mot(dir / "out" / "tracks.csv")});
  EXPECT_GE(scores.idf1, 0.90);              // reached on 2026-11-22: 0.904 to 0.921; the target itself
  EXPECT_GE(scores.hota, 0.72);              // reached: 0.742 and more
  EXPECT_GE(scores.mota, 0.79);              // reached: 0.804 and more
  EXPECT_LE(scores.position.median, 0.060);  // reached: 0.050 m
}

INSTANTIATE_TEST_SUITE_P(Figures, ElevenObjects, testing::Values("1", "2", "3", "4", "5"),
                         [](const auto& seed) { return "Seed" + seed.param; });

struct Pair {
  std::string name;
  std::string range_px;
  std::string left;
  std::string right;
  std::string truth;
  double scale;
  std::string truth_right;
  std::string mask;
  double bad_2;    ///< of valid pixels: reached on 2026-11-22 plus 0.005
  double density;  ///< reached less 0.02
};

TEST(Figures, RobustDisparityOfMiddlebury) {
  NEEDS_RECORDING("middlebury_stereo");
  const TempDir dir;
  const std::vector<Pair> pairs = {
      {"Cones", "64", "im2.png", "im6.png", "disp2.png", 4, "disp6.png", "", 0.038, 0.977},
      {"Teddy", "64", "im2.png", "im6.png", "disp2.png", 4, "disp6.png", "", 0.047, 0.944},
      {"Dolls", "96", "view1.png", "view5.png", "disp1.png", 3, "disp5.png", "", 0.039, 0.974},
      {"Cloth3", "96", "view1.png", "view5.png", "disp1.png", 2, "disp5.png", "", 0.016, 0.978},
      {"Adirondack", "96", "Adirondack_left.png", "Adirondack_right.png", "Adirondack_gt.png", 1, "",
       "Adirondack_mask.png", 0.036, 0.897},
  };
  double sum = 0;
  for (const Pair& pair : pairs) {
    SCOPED_TRACE(pair.name);
    const fs::path folder = kData / "middlebury_stereo" / pair.name;
    ASSERT_NO_FATAL_FAILURE(run_stereotrack({"disparity", folder / pair.left, folder / pair.right, "--set",
                                             "disparity.max=" + pair.range_px, "--out", dir / "map.png"}));
    const cv::Mat truth = score::read_truth(folder / pair.truth, pair.scale);
    const cv::Mat mask = pair.mask.empty()
                             ? score::non_occluded(truth, score::read_truth(folder / pair.truth_right, pair.scale))
                             : score::read_scored_mask(folder / pair.mask);
    const score::DisparityScore got = score::score_disparity(truth, score::read_estimate(dir / "map.png"), mask);
    EXPECT_LE(got.bad_2(), pair.bad_2);
    EXPECT_GE(got.density(), pair.density);
    sum += got.bad_2();
  }
  EXPECT_LE(sum / static_cast<double>(pairs.size()), 0.034);  // reached: 0.030
}

TEST(Figures, RobustMasksOfHighway) {
  NEEDS_RECORDING("cdnet_highway");
  const fs::path source = kData / "cdnet_highway";
  const TempDir dir;
  ASSERT_NO_FATAL_FAILURE(run_stereotrack({"masks", "mono:" + (source / "input").string(), "--out", dir / "masks"}));
  const score::MaskScore got = score::score_mask_folders(source / "groundtruth", dir / "masks", 100, 469);
  EXPECT_GE(got.f_measure(), 0.95);    // reached: 0.952
  EXPECT_GE(got.recall(), 0.915);      // reached: 0.919
  EXPECT_LE(got.shadow_rate(), 0.25);  // reached: 0.206
}

}  // namespace
}  // namespace stereotrack
