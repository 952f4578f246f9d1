// What is tracked where, from the configuration to the files: the square of the small scene, half a unit wide, at 2.5
// units, goes from column 20 to the right.
#include "tests/replay/command_support.hpp"

namespace stereotrack::test {
namespace {

class CommandZones : public testing::Test {
 protected:
  CommandZones() { SmallScene::write(scene_, 40); }

  ProgramResult replay(const std::string& toml, const std::string& name, std::vector<std::string> more = {},
                       bool with_unit = true) const {
    const fs::path config = folder_ / (name + ".toml");
    std::ofstream(config) << (with_unit ? "calibration.unit_m = 1\n" : "") << toml;
    std::vector<std::string> arguments{"replay",        scene_.string(), "--config",
                                       config.string(), "--out",         (folder_ / name).string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return stereotrack_command(arguments);
  }
  /// Left edges of the boxes, row by row.
  [[nodiscard]] std::vector<int> lefts(const std::string& name) const {
    std::vector<int> all;
    for (const CsvRow& row : rows_of(folder_ / name / "tracks.csv")) {
      std::istringstream fields(row.text);
      std::string field;
      for (int i = 0; i < 3; ++i) std::getline(fields, field, ',');
      all.push_back(std::stoi(field));
    }
    return all;
  }
  [[nodiscard]] std::string csv(const std::string& name) const { return read_text(folder_ / name / "tracks.csv"); }
  [[nodiscard]] int rejected(const std::string& name, const char* why) const {
    return summary_of(folder_ / name)["candidates_rejected"][why].get<int>();
  }

  TempDir folder_;
  fs::path scene_ = folder_ / "scene";
};

const std::string kRight = "[[zone]]\nname = \"right\"\npicture = [[89.5, -1], [160, -1], [160, 120], [89.5, 120]]\n";
const std::string kLeft = "[[zone]]\nname = \"left\"\npicture = [[-1, -1], [89.5, -1], [89.5, 120], [-1, 120]]\n";
const std::string kIgnore = "targets = \"ignore\"\n";
const std::string kHall = "[[zone]]\nname = \"hall\"\nz_m = [2, 3]\n";

TEST_F(CommandZones, NothingIsTrackedWhereItIsIgnoredAndElsewhereAllIsAsBefore) {
  ASSERT_EQ(replay("", "all").exit_code, 0);
  const ProgramResult result = replay(kRight + kIgnore, "some");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  ASSERT_FALSE(lefts("some").empty());
  for (const int left : lefts("some")) EXPECT_LT(left, 90);
  const std::vector<int> all = lefts("all");
  EXPECT_GT(std::count_if(all.begin(), all.end(), [](int left) { return left >= 90; }), 5) << "the test says nothing";
  // Until the square touches it.
  const auto before = [&](const char* name) {
    std::string text;
    for (const CsvRow& row : rows_of(folder_ / name / "tracks.csv")) {
      if (row.frame <= 18) text += row.text + "\n";
    }
    return text;
  };
  EXPECT_FALSE(before("all").empty());
  EXPECT_EQ(before("some"), before("all"));
  EXPECT_EQ(summary_of(folder_ / "some")["allocations_after_warmup"],
            summary_of(folder_ / "all")["allocations_after_warmup"]);
}

TEST_F(CommandZones, AZoneOfSignalsChangesNothing) {
  ASSERT_EQ(replay("", "all").exit_code, 0);
  ASSERT_EQ(replay(kRight + kHall, "zones").exit_code, 0);
  EXPECT_EQ(csv("zones"), csv("all"));
  EXPECT_EQ(read_text(folder_ / "zones" / "telemetry.bin"), read_text(folder_ / "all" / "telemetry.bin"));
}

TEST_F(CommandZones, TheWorkingVolume) {
  ASSERT_EQ(replay("", "all").exit_code, 0);
  ASSERT_EQ(replay("objects.volume = \"hall\"\n" + kHall, "inside").exit_code, 0);
  EXPECT_EQ(csv("inside"), csv("all"));
  ASSERT_EQ(replay("objects.volume = \"hall\"\n[[zone]]\nname = \"hall\"\nz_m = [3, 9]\n", "outside").exit_code, 0);
  EXPECT_TRUE(lefts("outside").empty());
  EXPECT_GT(rejected("outside", "outside_volume"), 10);
  EXPECT_EQ(summary_of(folder_ / "outside")["allocations_after_warmup"],
            summary_of(folder_ / "all")["allocations_after_warmup"]);
}

TEST_F(CommandZones, Sizes) {
  ASSERT_EQ(replay("objects.min_size_m = 0.35\nobjects.max_size_m = 0.7\n", "fits").exit_code, 0);
  EXPECT_FALSE(lefts("fits").empty());
  ASSERT_EQ(replay("objects.min_size_m = 0.7\n", "small").exit_code, 0);
  EXPECT_TRUE(lefts("small").empty());
  EXPECT_GT(rejected("small", "under_size"), 10);
  const ProgramResult large = replay("objects.max_size_m = 0.35\n", "large", {"--explain", "20:20"});
  ASSERT_EQ(large.exit_code, 0) << large.err;
  EXPECT_TRUE(lefts("large").empty());
  EXPECT_GT(rejected("large", "over_size"), 10);
  const std::string told = read_text(folder_ / "large" / "explain.txt");
  EXPECT_NE(told.find(" m long: over max_size_m of [objects] or of its zone"), std::string::npos) << told;
}

TEST_F(CommandZones, WhereNoneBegins) {
  const ProgramResult result = replay(kLeft + "targets = \"none_begin\"\n", "late", {"--explain", "15:15"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  ASSERT_FALSE(lefts("late").empty());
  for (const int left : lefts("late")) EXPECT_GT(left, 70) << "its centre has left the zone";
  EXPECT_GT(rejected("late", "none_begin"), 5);
  const std::string told = read_text(folder_ / "late" / "explain.txt");
  EXPECT_NE(told.find("no target's: none begins in its zone"), std::string::npos) << told;
  ASSERT_EQ(replay("", "all").exit_code, 0);
  ASSERT_EQ(replay(kRight + "targets = \"none_begin\"\n", "known").exit_code, 0);
  EXPECT_EQ(csv("known"), csv("all")) << "it began elsewhere";
}

TEST_F(CommandZones, MetresWithoutAUnitAreRefusedInOneLine) {
  const ProgramResult result = replay("objects.min_size_m = 0.7\n", "none", {}, false);
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(is_one_line(result.err));
  EXPECT_NE(result.err.find("none.toml:1:22: objects.min_size_m: it is in metres"), std::string::npos) << result.err;
  EXPECT_EQ(replay(kRight + kIgnore, "pixels", {}, false).exit_code, 0) << "pixels need none";
}

TEST_F(CommandZones, AreDrawn) {
  const auto pictures = [&](const std::string& toml, const std::string& name) {
    const fs::path out = folder_ / (name + "_pictures");
    const ProgramResult result = replay(toml, name, {"--render", out.string(), "--frames", "1:20"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return cv::imread((out / numbered(20)).string());
  };
  const cv::Mat plain = pictures("", "plain");
  const cv::Mat ignored = pictures(kRight + kIgnore, "ignored");
  const cv::Mat hall = pictures("objects.volume = \"hall\"\n" + kHall, "hall");
  ASSERT_FALSE(plain.empty());
  // The picture is 960 x 720 below a header of 36 px; the zone begins at 90 of 160 columns.
  const cv::Rect right(600, 500, 300, 200);
  EXPECT_LT(cv::mean(ignored(right))[1], 0.75 * cv::mean(plain(right))[1]);
  const cv::Rect left(0, 500, 500, 200);
  EXPECT_EQ(cv::norm(ignored(left), plain(left), cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(hall.colRange(968, hall.cols), plain.colRange(968, plain.cols), cv::NORM_INF), 50);
}

}  // namespace
}  // namespace stereotrack::test
