#include <cmath>
#include <opencv2/videoio.hpp>

#include "drivers/capture/replay/video_source.hpp"
#include "tests/unit/capture/replay_support.hpp"

namespace stereotrack::capture {
namespace {

using std::chrono::nanoseconds;
using testing::HasSubstr;

constexpr int kWidth = 64;
constexpr int kHeight = 48;

/// Frame n: upper half of the left part 10 n, of the right part 10 n + 100; lower half 5.
std::string write_video(const std::filesystem::path& file, int frames, double fps, int first = 0, bool colour = false) {
  cv::VideoWriter writer(file.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), fps, {kWidth, kHeight});
  EXPECT_TRUE(writer.isOpened());
  for (int n = first; n < first + frames; ++n) {
    cv::Mat picture(kHeight, kWidth, CV_8UC3, cv::Scalar::all(5));
    if (colour) picture(cv::Rect(0, kHeight - 8, kWidth, 8)).setTo(cv::Scalar(200, 20, 20));
    picture(cv::Rect(0, 0, kWidth / 2, kHeight / 2)).setTo(cv::Scalar::all(10 * n));
    picture(cv::Rect(kWidth / 2, 0, kWidth / 2, kHeight / 2)).setTo(cv::Scalar::all(10 * n + 100));
    writer.write(picture);
  }
  return file.string();
}

TEST(VideoTime, StampNearTheGridIsTheGrid) {
  EXPECT_EQ(video_time(0.033, nanoseconds(0), 30), nanoseconds(33'333'333)) << "a container with a clock of 1 ms";
  EXPECT_EQ(video_time(0.067, nanoseconds(33'333'333), 30), nanoseconds(66'666'667));
}

TEST(VideoTime, DroppedFrameLeavesItsGap) {
  EXPECT_EQ(video_time(0.100, nanoseconds(33'333'333), 30), nanoseconds(100'000'000));
}

TEST(VideoTime, StampOfAVariableRateStays) {
  EXPECT_EQ(video_time(0.050, nanoseconds(33'333'333), 30), nanoseconds(50'000'000));
}

TEST(VideoTime, MissingStampIsOnePeriodLater) {
  EXPECT_EQ(video_time(0, nanoseconds(40'000'000), 25), nanoseconds(80'000'000));
  EXPECT_EQ(video_time(0.04, nanoseconds(40'000'000), 25), nanoseconds(80'000'000));
  EXPECT_EQ(video_time(std::nan(""), nanoseconds(40'000'000), 25), nanoseconds(80'000'000));
  EXPECT_EQ(video_time(-5, nanoseconds(0), 25), nanoseconds(40'000'000));
}

TEST(SideBySideVideo, HalvesAreTheViewsAndTimeIsExact) {
  const test::TempDir dir;
  const std::string file = write_video(dir / "a.avi", 10, 25, 0, true);
  const auto source = open_replay("sbs:" + file, {});
  EXPECT_EQ(source->info().width, kWidth / 2);
  EXPECT_EQ(source->info().height, kHeight);
  EXPECT_EQ(source->info().format, PixelFormat::kBgr8);
  EXPECT_TRUE(source->info().stereo);
  EXPECT_TRUE(source->info().has_time);
  EXPECT_EQ(source->info().period, std::chrono::milliseconds(40));
  EXPECT_EQ(source->info().pairs, 10U);
  const auto answers = ask_all(*source);
  ASSERT_EQ(answers.size(), 10U);
  for (int n = 0; n < 10; ++n) {
    const Answer& answer = answers[static_cast<std::size_t>(n)];
    EXPECT_EQ(answer.next, Next::kPair);
    EXPECT_EQ(answer.ordinal, static_cast<std::uint64_t>(n + 1));
    EXPECT_EQ(answer.time_ns, 40'000'000LL * n);
    EXPECT_NEAR(answer.left, 10 * n, 2);
    EXPECT_NEAR(answer.right, 10 * n + 100, 2);
  }
}

TEST(SideBySideVideo, FlipSwapAndShift) {
  const test::TempDir dir;
  const std::string file = write_video(dir / "a.avi", 1, 25);
  const auto source = open_replay("sbs:" + file, {.flip = true, .swap = true, .shift_rows = 4});
  FramePair pair;
  ASSERT_EQ(source->next(pair), Next::kPair);
  EXPECT_NEAR(pair.left.row(0)[0], 5, 2);
  EXPECT_NEAR(pair.left.row(kHeight - 1)[0], 100, 2);
  EXPECT_EQ(pair.right.row(3)[0], 0);
  EXPECT_NEAR(pair.right.row(4)[0], 5, 2);
  EXPECT_NEAR(pair.right.row(kHeight - 1)[0], 0, 2);
}

TEST(SideBySideVideo, SkipToGivesWhatReadingGives) {
  const test::TempDir dir;
  const std::string file = write_video(dir / "a.avi", 8, 30);
  const auto all = replay_all("sbs:" + file);
  ASSERT_EQ(all.size(), 8U);
  for (const std::size_t skipped : {1U, 5U, 8U, 20U}) {
    const auto source = open_replay("sbs:" + file, {});
    source->skip_to(skipped);
    const auto rest = ask_all(*source);
    ASSERT_EQ(rest.size(), skipped < 8 ? 8 - skipped : 0) << skipped;
    for (std::size_t i = 0; i < rest.size(); ++i) {
      EXPECT_EQ(rest[i].ordinal, all[i + skipped].ordinal);
      EXPECT_EQ(rest[i].time_ns, all[i + skipped].time_ns);
      EXPECT_EQ(rest[i].left, all[i + skipped].left);
    }
  }
}

TEST(SideBySideVideo, EndBeforeTheAnnouncedOneIsTold) {
  const test::TempDir dir;
  const std::string file = write_video(dir / "a.avi", 40, 25);
  const std::string bytes = file_bytes(file);
  put_bytes(file, bytes.substr(0, bytes.size() / 2));
  testing::internal::CaptureStderr();
  const auto answers = replay_all("sbs:" + file);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  ASSERT_GT(answers.size(), 5U);
  ASSERT_LT(answers.size(), 38U);
  EXPECT_EQ(answers.back().next, Next::kSkipped);
  EXPECT_THAT(answers.back().reason, HasSubstr("a.avi: ends after "));
  EXPECT_THAT(answers.back().reason, HasSubstr(" of 40 pictures"));
  EXPECT_EQ(answers[answers.size() - 2].next, Next::kPair);
}

TEST(SideBySideVideo, OddWidthIsRefused) {
  const test::TempDir dir;
  const std::string file = (dir / "odd.png").string();  // FFmpeg takes it as a video of one picture
  write_picture(file, colour_picture(1, 2, 3, 33, 16));
  EXPECT_THAT(open_error("sbs:" + file), HasSubstr("33 columns cannot be two views"));
}

TEST(SideBySideVideo, WithoutColourIsGrey) {
  const test::TempDir dir;
  const auto source = open_replay("sbs:" + write_video(dir / "a.avi", 3, 25), {});
  EXPECT_EQ(source->info().format, PixelFormat::kGrey8);
  FramePair pair;
  ASSERT_EQ(source->next(pair), Next::kPair);
  EXPECT_EQ(pair.right.format, PixelFormat::kGrey8);
  EXPECT_NEAR(pair.right.row(0)[10], 100, 2);
}

TEST(TwoVideos, ArePairedByOrderAndTheShorterOneIsNamed) {
  const test::TempDir dir;
  const std::string left = write_video(dir / "l.avi", 5, 25);
  const std::string right = write_video(dir / "r.avi", 3, 25, 7);
  const auto answers = replay_all(left + "," + right);
  ASSERT_EQ(answers.size(), 5U);
  for (std::size_t n = 0; n < 3; ++n) {
    EXPECT_NEAR(answers[n].left, 10 * static_cast<int>(n), 2);
    EXPECT_NEAR(answers[n].right, 70 + 10 * static_cast<int>(n), 2);
  }
  for (std::size_t n = 3; n < 5; ++n) {
    EXPECT_EQ(answers[n].next, Next::kSkipped);
    EXPECT_THAT(answers[n].reason, HasSubstr("r.avi: ends after 3 pictures"));
    EXPECT_EQ(answers[n].time_ns, 40'000'000LL * static_cast<int>(n));
  }
  const auto swapped = replay_all(left + "," + right, {.swap = true});
  ASSERT_EQ(swapped.size(), 5U);
  EXPECT_NEAR(swapped[0].left, 70, 2);
  EXPECT_EQ(swapped[4].time_ns, 160'000'000);
}

TEST(TwoVideos, OfDifferentRateAreRefused) {
  const test::TempDir dir;
  const std::string left = write_video(dir / "l.avi", 3, 25);
  const std::string right = write_video(dir / "r.avi", 3, 30);
  EXPECT_THAT(open_error(left + "," + right), HasSubstr("r.avi: has not the rate of"));
}

TEST(TwoVideos, PathsMayHoldCommas) {
  const test::TempDir dir;
  const std::string left = write_video(dir / "l,1.avi", 1, 25);
  const std::string right = write_video(dir / "r,1.avi", 1, 25);
  EXPECT_EQ(replay_all(left + "," + right).size(), 1U);
}

TEST(MonoVideo, HasNoRightView) {
  const test::TempDir dir;
  const auto source = open_replay("mono:" + write_video(dir / "a.avi", 2, 25), {});
  EXPECT_FALSE(source->info().stereo);
  EXPECT_EQ(source->info().width, kWidth);
  const auto answers = ask_all(*source);
  ASSERT_EQ(answers.size(), 2U);
  EXPECT_EQ(answers[0].right, -1);
}

TEST(MonoVideo, FileThatIsNoVideoIsRefused) {
  const test::TempDir dir;
  const auto file = dir.write("a.avi", std::string(5000, 'x'));
  EXPECT_THAT(open_error("mono:" + file.string()), HasSubstr("a.avi: cannot be opened as a video"));
}

}  // namespace
}  // namespace stereotrack::capture
