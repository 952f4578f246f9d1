#include <cmath>

#include "tests/unit/capture/replay_support.hpp"

namespace stereotrack::capture {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

void write_pair(const std::filesystem::path& folder) {
  write_picture(folder / "left/1.png", grey_picture(1));
  write_picture(folder / "right/1.png", grey_picture(1));
}

TEST(OpenReplay, MissingPathNamesItAndTheForms) {
  EXPECT_THAT(open_error("/nonexistent/recording"),
              AllOf(HasSubstr("/nonexistent/recording: no such"), HasSubstr("mono:PATH"), Not(HasSubstr("\n"))));
  EXPECT_THAT(open_error("sbs:/nonexistent/a.avi"), HasSubstr("/nonexistent/a.avi: no such video"));
  EXPECT_THAT(open_error("mono:/nonexistent/a"), HasSubstr("/nonexistent/a: no such folder or video"));
  EXPECT_THAT(open_error("/nonexistent/l.avi,/nonexistent/r.avi"), HasSubstr("/nonexistent/l.avi: no such file"));
  EXPECT_THAT(open_error(""), HasSubstr("empty"));
}

TEST(OpenReplay, UnknownFormIsNamed) {
  EXPECT_THAT(open_error("rtsp://camera/1"), HasSubstr("unknown form 'rtsp:'"));
  EXPECT_THAT(open_error("stereo:folder"), HasSubstr("unknown form 'stereo:'"));
}

TEST(OpenReplay, FolderWithoutPicturesSaysWhatItCouldBe) {
  const test::TempDir dir;
  EXPECT_THAT(open_error(dir.path().string()), AllOf(HasSubstr("no recording found"), HasSubstr("left/ and right/")));
}

TEST(OpenReplay, OneViewAloneSaysWhatIsMissing) {
  const test::TempDir dir;
  write_picture(dir / "left/1.png", grey_picture(1));
  EXPECT_THAT(open_error(dir.path().string()),
              AllOf(HasSubstr("left: has no "), HasSubstr("right beside it"), HasSubstr("mono:")));
}

TEST(OpenReplay, EmptyViewIsNamed) {
  const test::TempDir dir;
  write_picture(dir / "left/1.png", grey_picture(1));
  std::filesystem::create_directory(dir / "right");
  EXPECT_THAT(open_error(dir.path().string()), HasSubstr("right: holds no pictures"));
}

TEST(OpenReplay, FolderOfOneViewPointsToMono) {
  const test::TempDir dir;
  write_picture(dir / "1.png", grey_picture(1));
  EXPECT_THAT(open_error(dir.path().string()), HasSubstr("give the folder above it, or mono:"));
}

TEST(OpenReplay, VideoWithoutFormPointsToSbsAndMono) {
  const test::TempDir dir;
  const std::string file = dir.write("a.avi", "x").string();
  EXPECT_THAT(open_error(file), AllOf(HasSubstr("sbs:" + file), HasSubstr("mono:" + file)));
}

TEST(OpenReplay, RecordingIsFoundFurtherDownIfItIsTheOnlyOne) {
  const test::TempDir dir;
  write_pair(dir / "a/b/one");
  EXPECT_EQ(replay_all(dir.path()).size(), 1U);
  write_pair(dir / "a/two");
  EXPECT_THAT(open_error(dir.path().string()),
              AllOf(HasSubstr("holds several recordings"), HasSubstr("a/b/one"), HasSubstr("a/two")));
}

TEST(OpenReplay, VideoBesideAFolderIsAmbiguous) {
  const test::TempDir dir;
  write_pair(dir / "calibration");
  dir.write("run.avi", "x");
  EXPECT_THAT(open_error(dir.path().string()), AllOf(HasSubstr("several recordings"), HasSubstr("run.avi")));
}

TEST(OpenReplay, NothingReadableNamesTheFirstFault) {
  const test::TempDir dir;
  dir.write("left/1.png", "x");
  dir.write("right/1.png", "x");
  EXPECT_THAT(open_error(dir.path().string()),
              AllOf(HasSubstr("none of 1 frames can be read"), HasSubstr("left/1.png: no picture")));
}

TEST(OpenReplay, EmptyEurocListIsNamed) {
  const test::TempDir dir;
  dir.write("mav0/cam0/data.csv", "#timestamp [ns],filename\n");
  dir.write("mav0/cam1/data.csv", "#timestamp [ns],filename\n");
  EXPECT_THAT(open_error(dir.path().string()), HasSubstr("cam0/data.csv: lists no pictures"));
}

TEST(OpenReplay, ContradictingOptionsAreRefused) {
  const test::TempDir dir;
  write_pair(dir.path());
  const std::string source = dir.path().string();
  EXPECT_THAT(open_error(source, {.fps = 0}), HasSubstr("outside 0.1..10000"));
  EXPECT_THAT(open_error(source, {.fps = std::nan("")}), HasSubstr("outside 0.1..10000"));
  EXPECT_THAT(open_error(source, {.shift_rows = 8}), HasSubstr("a shift of 8 rows leaves nothing"));
  EXPECT_THAT(open_error(source, {.shift_rows = -8}), HasSubstr("a shift of -8 rows leaves nothing"));
  EXPECT_THAT(open_error("mono:" + source + "/left", {.swap = true}), HasSubstr("need two views"));
  EXPECT_THAT(open_error("mono:" + source + "/left", {.shift_rows = 1}), HasSubstr("need two views"));
}

}  // namespace
}  // namespace stereotrack::capture
