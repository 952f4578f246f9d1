// What a user gets wrong, and what the machine refuses: one line, the right exit code, nothing left that looks whole.
#include "tests/replay/command_support.hpp"

namespace stereotrack::test {
namespace {

using testing::Test;

constexpr int kFailed = 1;
constexpr int kBadUsage = 2;

class BadInput : public Test {
 protected:
  BadInput() { SmallScene::write(scene_, 12); }

  [[nodiscard]] std::vector<std::string> replay(std::vector<std::string> more) const {
    more.insert(more.begin(), {"replay", scene_.string()});
    return more;
  }

  static void expect_refused(const std::vector<std::string>& arguments, int exit_code,
                             const std::vector<std::string>& said, ProgramOptions options = {}) {
    const ProgramResult result = stereotrack_command(arguments, std::move(options));
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_TRUE(is_one_line(result.err));
    for (const std::string& text : said)
      EXPECT_NE(result.err.find(text), std::string::npos) << text << "\n" << result.err;
    EXPECT_EQ(result.out, "");
  }

  /// In a file the line names FILE:LINE:COLUMN, on the command line the --set entry.
  void expect_config_refused(const std::string& toml, const std::string& line_and_column,
                             const std::vector<std::string>& set, const std::string& key) {
    const std::string file = folder_.write("bad.toml", toml).string();
    const fs::path out = folder_ / "out";
    expect_refused(replay({"--config", file, "--out", out.string()}), kBadUsage,
                   {file + ":" + line_and_column + ": " + key});
    std::vector<std::string> arguments = replay({"--out", out.string()});
    for (const std::string& entry : set) arguments.insert(arguments.end(), {"--set", entry});
    expect_refused(arguments, kBadUsage, {"--set " + key, key + ": "});
    EXPECT_FALSE(fs::exists(out));
  }

  TempDir folder_;
  fs::path scene_ = folder_ / "scene";
};

TEST_F(BadInput, SceneIsFineOtherwise) {
  const ProgramResult result = stereotrack_command(replay({"--out", (folder_ / "out").string()}));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.err, "");
  EXPECT_EQ(names_in(folder_ / "out"), (std::vector<std::string>{"summary.json", "telemetry.bin", "tracks.csv"}));
}

TEST_F(BadInput, UnknownKeyIsNamedWithItsPlace) {
  expect_config_refused("[disparity]\nmaxx = 64\n", "2:1", {"disparity.maxx=64"}, "disparity.maxx");
}

TEST_F(BadInput, WrongTypeIsNamedWithItsPlace) {
  expect_config_refused("\n[disparity]\nmax = \"far\"\n", "3:7", {"disparity.max=far"}, "disparity.max");
}

TEST_F(BadInput, ValueOutOfRangeIsNamedWithItsPlace) {
  expect_config_refused("[track]\n  gate = 11.0\n", "2:10", {"track.gate=11.0"}, "track.gate");
}

TEST_F(BadInput, ContradictingValuesAreNamedWithTheirPlace) {
  expect_config_refused("[foreground]\nlow_sd = 20\nhigh_sd = 10\n", "2:10",
                        {"foreground.low_sd=20", "foreground.high_sd=10"}, "foreground.low_sd");
}

TEST_F(BadInput, FileThatIsNotTomlIsNamedWithThePlace) {
  const std::string file = folder_.write("bad.toml", "[track\ngate = 3\n").string();
  expect_refused(replay({"--config", file}), kBadUsage, {file + ":1:"});
}

TEST_F(BadInput, RecordingsOwnConfigurationIsCheckedToo) {
  const std::string file = folder_.write("scene/stereotrack.toml", "[track]\ngait = 3\n").string();
  expect_refused(replay({}), kBadUsage, {file + ":2:1: track.gait"});
}

TEST_F(BadInput, SetWithoutValueIsRefused) {
  expect_refused(replay({"--set", "track.gate"}), kBadUsage, {"--set track.gate"});
}

TEST_F(BadInput, MissingConfigurationFileIsNamed) {
  const std::string file = (folder_ / "none.toml").string();
  expect_refused(replay({"--config", file}), kBadUsage, {file});
}

TEST_F(BadInput, MissingSourceIsNamed) {
  const std::string source = (folder_ / "nowhere").string();
  for (const char* prefix : {"", "mono:", "sbs:"}) expect_refused({"replay", prefix + source}, kFailed, {source});
}

TEST_F(BadInput, FolderWithoutPicturesIsNamed) {
  const fs::path empty = folder_ / "empty";
  fs::create_directories(empty);
  expect_refused({"replay", empty.string()}, kFailed, {empty.string()});
  fs::create_directories(empty / "left");
  fs::create_directories(empty / "right");
  fs::copy_file(scene_ / "calibration.yml", empty / "calibration.yml");
  expect_refused({"replay", empty.string()}, kFailed, {(empty / "left").string()});
}

TEST_F(BadInput, CalibrationOfAnotherSizeNamesBothSizes) {
  const std::string file = folder_.write("other.yml", calibration_text(640, 480, -0.2)).string();
  expect_refused(replay({"--calibration", file}), kFailed, {file, "640x480", "160x120"});
}

TEST_F(BadInput, CalibrationWithLeftAndRightExchangedIsRefused) {
  const std::string file = folder_.write("swapped.yml", calibration_text(160, 120, 0.2)).string();
  expect_refused(replay({"--calibration", file}), kFailed, {file, "left and right are exchanged"});
}

TEST_F(BadInput, MissingCalibrationFileIsNamed) {
  const std::string file = (folder_ / "none.yml").string();
  expect_refused(replay({"--calibration", file}), kFailed, {file});
}

TEST_F(BadInput, StereoSourceWithoutCalibrationIsTold) {
  fs::remove(scene_ / "calibration.yml");
  expect_refused(replay({}), kFailed, {scene_.string(), "--calibration FILE", "mono:PATH"});
}

TEST_F(BadInput, CalibrationOfMonoSourceIsRefused) {
  const std::string file = (scene_ / "calibration.yml").string();
  expect_refused({"replay", "mono:" + (scene_ / "left").string(), "--calibration", file}, kBadUsage, {file, "mono"});
}

TEST_F(BadInput, TruthOfARecordingIsRefused) {
  const fs::path file = folder_ / "gt.csv";
  expect_refused(replay({"--truth", file.string()}), kBadUsage, {"--truth", scene_.string(), "synthetic:NAME"});
  EXPECT_FALSE(fs::exists(file));
}

TEST_F(BadInput, OutputFolderThatCannotBeIsNamed) {
  const fs::path file = folder_.write("file", "kept");
  for (const std::string& out : {file.string(), (file / "below").string(), std::string("/proc/stereotrack"),
                                 std::string("/proc/stereotrack/below")}) {
    expect_refused(replay({"--out", out}), kFailed, {out});
    expect_refused({"masks", scene_.string(), "--out", out}, kFailed, {out});
    expect_refused(replay({"--render", out + "/video.mp4"}), kFailed, {out});
  }
  EXPECT_EQ(read_text(file), "kept");
}

TEST_F(BadInput, FramesOutsideTheSourceAreTold) {
  const fs::path out = folder_ / "out";
  expect_refused(replay({"--frames", "50:60", "--out", out.string()}), kFailed, {"no pair could be read"});
  EXPECT_EQ(names_in(out), std::vector<std::string>{});
}

TEST_F(BadInput, WrongUsageExitsWithTwo) {
  expect_refused({}, kBadUsage, {"--help"});
  expect_refused({"walk"}, kBadUsage, {"--help"});
  expect_refused(replay({"--walk"}), kBadUsage, {"--walk"});
  expect_refused({"replay"}, kBadUsage, {"source"});
  expect_refused(replay({"--pace", "fast"}), kBadUsage, {"--pace", "fast"});
  expect_refused(replay({"--simd", "mmx"}), kBadUsage, {"--simd mmx", "scalar"});
  expect_refused({"eval", "--truth", "a", "--tracks", "b", "--fps", "nan"}, kBadUsage, {"--fps", "nan"});
  for (const char* frames : {"5:2", "0:3", "a:b", "1:2:3", "-1"}) {
    expect_refused(replay({"--frames=" + std::string(frames)}), kBadUsage, {"--frames"});
  }
}

TEST_F(BadInput, UnknownSceneExitsWithTwo) {
  expect_refused({"replay", "synthetic:twelve"}, kBadUsage, {"synthetic:twelve", "eleven"});
  expect_refused({"masks", "synthetic:twelve", "--out", (folder_ / "out").string()}, kBadUsage, {"synthetic:twelve"});
  expect_refused({"synth", "twelve", "--out", (folder_ / "out").string()}, kBadUsage, {"synthetic:twelve"});
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

TEST(Usage, HelpAndVersionExitWithZero) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{"--help"},
                                                    {"--version"},
                                                    {"replay", "--help"},
                                                    {"masks", "--help"},
                                                    {"synth", "--help"},
                                                    {"eval", "--help"},
                                                    {"disparity", "--help"},
                                                    {"monitor", "--help"}}) {
    const ProgramResult result = stereotrack_command(arguments);
    EXPECT_EQ(result.exit_code, 0) << arguments.front() << result.err;
    EXPECT_EQ(result.err, "");
    EXPECT_NE(result.out.find("stereotrack"), std::string::npos) << result.out;
  }
}

// A file that may not grow fails as on a full disk; at each size another file is the first to fail.
TEST_F(BadInput, FullDiskLeavesNoResult) {
  SmallScene::write(scene_, 24);
  const fs::path out = folder_ / "out";
  ASSERT_EQ(stereotrack_command(replay({"--out", out.string()})).exit_code, 0);
  std::vector<std::uintmax_t> sizes;
  for (const char* name : {"tracks.csv", "summary.json", "telemetry.bin"}) sizes.push_back(fs::file_size(out / name));
  std::sort(sizes.begin(), sizes.end());
  ASSERT_GT(sizes.front(), 100U);
  fs::remove_all(out);
  for (const std::uintmax_t size : sizes) {
    ProgramOptions options;
    options.most_file_bytes = size - 50;
    expect_refused(replay({"--out", out.string()}), kFailed, {out.string()}, options);
    EXPECT_EQ(names_in(out), std::vector<std::string>{}) << options.most_file_bytes;
  }
  EXPECT_EQ(stereotrack_command(replay({"--out", out.string()})).exit_code, 0);
}

TEST_F(BadInput, NoSpaceLeftForOneFileLeavesNoneOfThem) {
  for (const char* name : {"tracks.csv", "summary.json", "telemetry.bin"}) {
    const fs::path out = folder_ / ("out-" + std::string(name));
    fs::create_directories(out);
    fs::create_symlink("/dev/full", out / (std::string(name) + ".part"));
    expect_refused(replay({"--out", out.string()}), kFailed, {(out / name).string(), "No space left"});
    EXPECT_EQ(names_in(out), std::vector<std::string>{}) << name;
  }
}

TEST_F(BadInput, FullDiskLeavesNoVideoNorHalfPicture) {
  ProgramOptions options;
  options.most_file_bytes = 3000;
  const fs::path video = folder_ / "video.mp4";
  expect_refused(replay({"--render", video.string()}), kFailed, {video.string()}, options);
  EXPECT_FALSE(fs::exists(video));
  const fs::path pictures = folder_ / "pictures";
  expect_refused(replay({"--render", pictures.string()}), kFailed, {pictures.string()}, options);
  EXPECT_EQ(names_in(pictures), std::vector<std::string>{});
  const fs::path masks = folder_ / "masks";
  fs::create_directories(masks);
  fs::create_symlink("/dev/full", masks / (numbered(3) + ".part"));
  expect_refused({"masks", scene_.string(), "--out", masks.string()}, kFailed, {(masks / numbered(3)).string()});
  EXPECT_EQ(names_in(masks), (std::vector<std::string>{numbered(1), numbered(2)}));
}

TEST(Interrupt, LeavesNoFileAndTheNextRunWorks) {
  const TempDir folder;
  const fs::path out = folder / "out";
  std::vector<std::string> arguments{"replay",     "synthetic:eleven", "--out",
                                     out.string(), "--render",         (folder / "video.mkv").string()};
  ProgramOptions options;
  options.signal = SIGINT;
  options.signal_when = [&] { return fs::exists(out / "telemetry.bin.part"); };
  options.signal_after = std::chrono::milliseconds(300);
  const ProgramResult stopped = stereotrack_command(arguments, options);
  EXPECT_EQ(stopped.exit_code, 1) << stopped.signal;
  EXPECT_TRUE(is_one_line(stopped.err));
  EXPECT_NE(stopped.err.find("interrupted"), std::string::npos) << stopped.err;
  EXPECT_EQ(names_in(out), std::vector<std::string>{});
  EXPECT_EQ(names_in(folder.path()), std::vector<std::string>{"out"});

  arguments.insert(arguments.end(), {"--frames", "1:5"});
  const ProgramResult again = stereotrack_command(arguments);
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(summary_of(out)["frames"], 5);
}

TEST(Interrupt, AtOnceAfterOpeningTheFilesLeavesNoneEither) {
  const TempDir folder;
  SmallScene::write(folder / "scene", 12);
  const fs::path out = folder / "out";
  ProgramOptions options;
  options.signal = SIGTERM;
  options.signal_when = [&] { return fs::exists(out / "telemetry.bin.part"); };
  // At two pairs a second the small scene takes 6 s, so the signal comes in the middle.
  const ProgramResult stopped = stereotrack_command(
      {"replay", (folder / "scene").string(), "--out", out.string(), "--pace", "real", "--set", "source.fps=2"},
      options);
  EXPECT_EQ(stopped.exit_code, 1) << stopped.signal;
  EXPECT_TRUE(is_one_line(stopped.err));
  EXPECT_EQ(names_in(out), std::vector<std::string>{});
}

}  // namespace
}  // namespace stereotrack::test
