// A recording with damage: what cannot be read is skipped, counted and named, the rest is processed.
#include <set>

#include "tests/replay/command_support.hpp"

namespace stereotrack::test {
namespace {

class DamagedFrames : public testing::Test {
 protected:
  static constexpr int kPairs = 30;
  static constexpr int kMissing = 5;
  static constexpr int kTruncated = 13;
  static constexpr int kOtherSize = 17;
  static constexpr int kGarbage = 21;

  DamagedFrames() {
    const fs::path scene = folder_ / "scene";
    SmallScene::write(scene, kPairs);
    fs::remove(scene / "left" / numbered(kMissing));
    const fs::path truncated = scene / "right" / numbered(kTruncated);
    fs::resize_file(truncated, fs::file_size(truncated) / 2);
    cv::imwrite((scene / "left" / numbered(kOtherSize)).string(), cv::Mat(60, 80, CV_8UC3, cv::Scalar(9, 9, 9)));
    folder_.write("scene/right/" + numbered(kGarbage), "this is no picture");
  }

  ProgramResult replay(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments{"replay", (folder_ / "scene").string(), "--out", (folder_ / "out").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return stereotrack_command(arguments);
  }

  TempDir folder_;
};

TEST_F(DamagedFrames, AreSkippedCountedAndNamed) {
  const ProgramResult result = replay({});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::ordered_json summary = summary_of(folder_ / "out");
  EXPECT_EQ(summary["frames"], kPairs - 4);
  EXPECT_EQ(summary["drops"]["unreadable"], 4);
  ASSERT_EQ(summary["skipped"].size(), 4U);
  std::size_t at = 0;
  for (const int ordinal : {kMissing, kTruncated, kOtherSize, kGarbage}) {
    const std::string reason = summary["skipped"][at++];
    EXPECT_NE(reason.find(numbered(ordinal)), std::string::npos) << reason;
    EXPECT_NE(result.err.find("skipped: " + reason + "\n"), std::string::npos) << result.err;
  }
}

TEST_F(DamagedFrames, OthersKeepTheirOrdinalsAndTheTrackItsIdentity) {
  ASSERT_EQ(replay({}).exit_code, 0);
  std::set<std::uint64_t> frames;
  std::set<std::uint32_t> ids;
  for (const CsvRow& row : rows_of(folder_ / "out/tracks.csv")) {
    frames.insert(row.frame);
    ids.insert(row.id);
  }
  for (const int ordinal : {kMissing, kTruncated, kOtherSize, kGarbage}) {
    EXPECT_FALSE(frames.contains(static_cast<std::uint64_t>(ordinal))) << ordinal;
  }
  for (const std::uint64_t ordinal : {12U, 14U, 16U, 18U, 20U, 22U, 30U})
    EXPECT_TRUE(frames.contains(ordinal)) << ordinal;
  EXPECT_EQ(ids.size(), 1U);
}

TEST_F(DamagedFrames, OutsideTheFramesAskedForAreNotCounted) {
  ASSERT_EQ(replay({"--frames", "6:12"}).exit_code, 0);
  const nlohmann::ordered_json summary = summary_of(folder_ / "out");
  EXPECT_EQ(summary["frames"], 7);
  EXPECT_EQ(summary["drops"]["unreadable"], 0);
}

TEST_F(DamagedFrames, AllOfThemIsAFailure) {
  const ProgramResult result = replay({"--frames", "5:5"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("no pair could be read"), std::string::npos) << result.err;
  EXPECT_EQ(names_in(folder_ / "out"), std::vector<std::string>{});
}

TEST_F(DamagedFrames, MasksHaveAPictureForEveryFrame) {
  const fs::path out = folder_ / "masks";
  const ProgramResult result = stereotrack_command({"masks", (folder_ / "scene").string(), "--out", out.string()});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(names_in(out).size(), std::size_t{kPairs});
  const auto pixels = [&](int ordinal) {
    return cv::countNonZero(cv::imread((out / numbered(ordinal)).string(), cv::IMREAD_GRAYSCALE));
  };
  for (const int ordinal : {kMissing, kTruncated, kOtherSize, kGarbage}) EXPECT_EQ(pixels(ordinal), 0) << ordinal;
  EXPECT_GT(pixels(kTruncated - 1), 400);
  EXPECT_GT(pixels(kTruncated + 1), 400);
}

}  // namespace
}  // namespace stereotrack::test
