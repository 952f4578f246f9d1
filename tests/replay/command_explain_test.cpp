// replay --explain: why the tracker did what it did, and that asking changes nothing.
#include "tests/replay/command_support.hpp"

namespace stereotrack::test {
namespace {

class Explain : public testing::Test {
 protected:
  Explain() { SmallScene::write(scene_, 40); }

  ProgramResult replay(const std::string& explain, const fs::path& out, std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments{"replay", scene_.string()};
    if (!out.empty()) arguments.insert(arguments.end(), {"--out", out.string()});
    if (!explain.empty()) arguments.insert(arguments.end(), {"--explain", explain});
    arguments.insert(arguments.end(), more.begin(), more.end());
    return stereotrack_command(arguments);
  }

  TempDir folder_;
  fs::path scene_ = folder_ / "scene";
};

std::size_t count(const std::string& text, const std::string& what) {
  std::size_t found = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++found;
  return found;
}

TEST_F(Explain, ATargetFromItsBirthOn) {
  ASSERT_EQ(replay("", folder_ / "plain").exit_code, 0);
  const std::vector<CsvRow> rows = rows_of(folder_ / "plain" / "tracks.csv");
  ASSERT_FALSE(rows.empty());
  const std::string id = std::to_string(rows.front().id);
  const ProgramResult result = replay(id, folder_ / "told");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string told = read_text(folder_ / "told" / "explain.txt");
  EXPECT_EQ(count(told, "    born of detection"), 1U) << told;
  EXPECT_GE(count(told, "    waits: detections"), 1U);
  EXPECT_EQ(count(told, "    confirmed: "), 1U);
  // Each row of the table is a detection that it was born of, or took.
  EXPECT_EQ(count(told, "\n    took detection") + 1, rows.size());
  EXPECT_NE(told.find("#" + id + " confirmed, age"), std::string::npos);
}

TEST_F(Explain, AskingChangesNothing) {
  ASSERT_EQ(replay("", folder_ / "plain").exit_code, 0);
  ASSERT_EQ(replay("1:40", folder_ / "told").exit_code, 0);
  for (const char* name : {"tracks.csv", "telemetry.bin"}) {
    EXPECT_EQ(read_text(folder_ / "plain" / name), read_text(folder_ / "told" / name)) << name;
  }
  EXPECT_EQ(summary_of(folder_ / "plain")["allocations_after_warmup"],
            summary_of(folder_ / "told")["allocations_after_warmup"]);
}

TEST_F(Explain, FramesTellDetectionsAndWhatWasRejected) {
  const ProgramResult result = replay("20:21", {});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(count(result.out, "\nframe ") + (result.out.starts_with("frame ") ? 1 : 0), 2U) << result.out;
  EXPECT_NE(result.out.find("frame 20, "), std::string::npos);
  EXPECT_NE(result.out.find("  detection 1: "), std::string::npos);
  EXPECT_NE(result.out.find("taken by #"), std::string::npos);
  const ProgramResult picky = replay("20:21", {}, {"--set", "objects.min_area_px=5000"});
  EXPECT_NE(picky.out.find(": small: fewer pixels than objects.min_area_px"), std::string::npos) << picky.out;
}

TEST_F(Explain, IsDrawnToo) {
  ASSERT_EQ(replay("", {}, {"--render", (folder_ / "plain").string()}).exit_code, 0);
  ASSERT_EQ(replay("20:20", {}, {"--render", (folder_ / "told").string()}).exit_code, 0);
  const auto drawn = [&](const char* run, int ordinal) {
    return cv::imread((folder_ / run / numbered(ordinal)).string());
  };
  EXPECT_EQ(cv::norm(drawn("plain", 19), drawn("told", 19)), 0);
  EXPECT_GT(cv::norm(drawn("plain", 20), drawn("told", 20)), 0);
}

TEST_F(Explain, WhatIsNotThereIsSaid) {
  const ProgramResult nobody = replay("4711", {});
  EXPECT_EQ(nobody.exit_code, 0);
  EXPECT_NE(nobody.err.find("--explain: no target had the id 4711"), std::string::npos) << nobody.err;
  for (const char* wrong : {"seven", "0", "-1", "7x", "9:3", ":x"}) {
    const ProgramResult result = replay(wrong, folder_ / "out");
    EXPECT_EQ(result.exit_code, 2) << wrong;
    EXPECT_TRUE(is_one_line(result.err));
    EXPECT_NE(result.err.find("--explain"), std::string::npos) << result.err;
    EXPECT_FALSE(fs::exists(folder_ / "out"));
  }
}

}  // namespace
}  // namespace stereotrack::test
