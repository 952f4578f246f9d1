// `replay --check-config`: what a run would refuse is refused, what it would take is told, and nothing is done.
#include <map>

#include "tests/replay/command_support.hpp"

namespace stereotrack::test {
namespace {

class CheckConfig : public testing::Test {
 protected:
  CheckConfig() { SmallScene::write(scene_, 12); }

  [[nodiscard]] ProgramResult check(const std::string& source, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"replay", source, "--check-config"});
    return stereotrack_command(more);
  }

  static void expect_refused(const ProgramResult& result, int exit_code, const std::string& said) {
    EXPECT_EQ(result.exit_code, exit_code);
    EXPECT_EQ(result.out, "");
    EXPECT_TRUE(is_one_line(result.err));
    EXPECT_NE(result.err.find(said), std::string::npos) << result.err;
  }

  /// Rows of the table, "total" included.
  static std::map<std::string, std::uint64_t> rows_in(const std::string& out) {
    std::map<std::string, std::uint64_t> rows;
    std::istringstream lines(out);
    std::string line;
    while (std::getline(lines, line) && !line.starts_with("memory ")) {
    }
    const std::size_t width = line.size();
    while (std::getline(lines, line) && !line.starts_with("the arena")) {
      EXPECT_EQ(line.size(), width) << line;
      const std::size_t gap = line.find("  ");
      rows[line.substr(0, gap)] = std::stoull(line.substr(gap));
    }
    return rows;
  }

  TempDir folder_;
  fs::path scene_ = folder_ / "scene";
};

TEST_F(CheckConfig, GoodSourceIsDescribedWithItsMemoryByPart) {
  const fs::path out = folder_ / "out";
  const ProgramResult result = check(scene_.string(), {"--out", out.string()});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.err, "");
  EXPECT_FALSE(fs::exists(out)) << "nothing is written";
  EXPECT_TRUE(result.out.starts_with(scene_.string() + ": 160x120 colour stereo, preset robust: ")) << result.out;
  std::map<std::string, std::uint64_t> rows = rows_in(result.out);
  ASSERT_EQ(rows.size(), 14U) << result.out;
  const std::uint64_t total = rows["total"];
  rows.erase("total");
  std::uint64_t sum = 0;
  for (const auto& [name, bytes] : rows) sum += bytes;
  EXPECT_EQ(sum, total);
  EXPECT_GT(rows["tracker"], 0U);
  EXPECT_EQ(rows["level set"], 0U);
  // It is what a run says.
  ASSERT_EQ(stereotrack_command({"replay", scene_.string(), "--out", out.string()}).exit_code, 0);
  EXPECT_EQ(summary_of(out)["memory_bytes"], total);
}

TEST_F(CheckConfig, TableFollowsTheConfiguration) {
  std::map<std::string, std::uint64_t> thesis = rows_in(check(scene_.string(), {"--set", "preset=thesis"}).out);
  EXPECT_GT(thesis["level set"], 0U);
  const ProgramResult mono = check("mono:" + (scene_ / "left").string());
  EXPECT_NE(mono.out.find("160x120 colour mono"), std::string::npos) << mono.out;
  EXPECT_EQ(rows_in(mono.out)["rectifier"], 0U);
}

TEST_F(CheckConfig, SyntheticSceneIsCheckedToo) {
  const ProgramResult result =
      check("synthetic:eleven", {"--set", "synthetic.width=160", "--set", "synthetic.height=120"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GT(rows_in(result.out)["total"], 0U);
}

TEST_F(CheckConfig, BadConfigurationIsRefused) {
  expect_refused(check(scene_.string(), {"--set", "disparity.max=far"}), 2, "disparity.max");
  expect_refused(check(scene_.string(), {"--set", "no.such=1"}), 2, "no.such");
  expect_refused(check(scene_.string(), {"--frames", "9:3"}), 2, "--frames");
  expect_refused(check(scene_.string(), {"--set", "telemetry.destinations=nowhere"}), 2, "nowhere");
}

TEST_F(CheckConfig, BadCalibrationIsRefused) {
  const std::string file = folder_.write("bad.yml", calibration_text(640, 480, -0.2)).string();
  const ProgramResult size = check(scene_.string(), {"--calibration", file});
  EXPECT_EQ(size.exit_code, stereotrack_command({"replay", scene_.string(), "--calibration", file}).exit_code);
  expect_refused(size, size.exit_code, "bad.yml");
  EXPECT_NE(size.exit_code, 0);
  fs::remove(scene_ / "calibration.yml");
  expect_refused(check(scene_.string()), 1, "a stereo source needs a calibration");
}

TEST_F(CheckConfig, SourceThatIsNotThereIsRefused) {
  expect_refused(check((folder_ / "nowhere").string()), 1, "nowhere");
  expect_refused(check("synthetic:nothing"), 2, "nothing");
}

}  // namespace
}  // namespace stereotrack::test
