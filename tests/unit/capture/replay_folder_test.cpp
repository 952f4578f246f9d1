#include "drivers/capture/replay/pairing.hpp"
#include "tests/unit/capture/replay_support.hpp"

namespace stereotrack::capture {
namespace {

using testing::HasSubstr;

/// left/L_<n>.png with first pixel n, right/R_<n>.png with first pixel 100 + n.
void write_recording(const test::TempDir& dir, const std::vector<int>& numbers) {
  for (const int n : numbers) {
    write_picture(dir / ("left/L_" + std::to_string(n) + ".png"), grey_picture(n));
    write_picture(dir / ("right/R_" + std::to_string(n) + ".png"), grey_picture(100 + n));
  }
}

TEST(LeftRightFolder, NumbersGiveOrderPairsAndTime) {
  const test::TempDir dir;
  write_recording(dir, {9, 10, 12});
  const auto source = open_replay(dir.path().string(), {.fps = 10});
  EXPECT_EQ(source->info().name, dir.path().string());
  EXPECT_EQ(source->info().width, 16);
  EXPECT_EQ(source->info().height, 8);
  EXPECT_EQ(source->info().format, PixelFormat::kGrey8);
  EXPECT_TRUE(source->info().stereo);
  EXPECT_FALSE(source->info().has_time);
  EXPECT_EQ(source->info().period, std::chrono::milliseconds(100));
  EXPECT_EQ(source->info().pairs, 3U);
  const auto answers = ask_all(*source);
  ASSERT_EQ(answers.size(), 3U);
  const int numbers[] = {9, 10, 12};
  const std::int64_t times[] = {0, 100'000'000, 300'000'000};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(answers[i].next, Next::kPair);
    EXPECT_EQ(answers[i].ordinal, i + 1);
    EXPECT_EQ(answers[i].left, numbers[i]);
    EXPECT_EQ(answers[i].right, 100 + numbers[i]);
    EXPECT_EQ(answers[i].time_ns, times[i]);
    EXPECT_EQ(answers[i].skew, std::nullopt);
  }
  EXPECT_EQ(ask(*source).next, Next::kEnd);
  EXPECT_EQ(ask(*source).next, Next::kEnd);
}

TEST(LeftRightFolder, UnixTimesAreExactAndTheRightNameMayDiffer) {
  const test::TempDir dir;
  const std::pair<const char*, const char*> names[] = {{"1585434279_805531979", "1585434279_805531000"},
                                                       {"1585434279_838711977", "1585434279_838712000"},
                                                       {"1585434279_871912003", "1585434279_871912003"}};
  int id = 0;
  for (const auto& [left, right] : names) {
    write_picture(dir / "left" / (std::string(left) + ".png"), grey_picture(++id));
    write_picture(dir / "right" / (std::string(right) + ".png"), grey_picture(100 + id));
  }
  const auto source = open_replay(dir.path().string(), {});
  EXPECT_TRUE(source->info().has_time);
  EXPECT_EQ(source->info().period, std::chrono::nanoseconds(33'200'026)) << "the upper of two differences";
  const auto answers = ask_all(*source);
  ASSERT_EQ(answers.size(), 3U);
  EXPECT_EQ(answers[0].time_ns, 1585434279805531979);
  EXPECT_EQ(answers[1].time_ns, 1585434279838711977);
  EXPECT_EQ(answers[0].skew, std::chrono::nanoseconds(-979)) << "right - left";
  EXPECT_EQ(answers[1].skew, std::chrono::nanoseconds(23));
  EXPECT_EQ(answers[2].skew, std::chrono::nanoseconds(0));
  EXPECT_EQ(answers[2].right, 103);
}

TEST(LeftRightFolder, FaultyFramesAreSkippedNamedAndKeepTheirOrdinal) {
  const test::TempDir dir;
  write_recording(dir, {1, 2, 3, 4, 5, 6, 7});
  std::filesystem::remove(dir / "right/R_2.png");
  const std::string bytes = file_bytes(dir / "left/L_3.png");
  put_bytes(dir / "left/L_3.png", bytes.substr(0, bytes.size() - 20));
  write_picture(dir / "right/R_4.png", grey_picture(104, 8, 8));
  put_bytes(dir / "left/L_5.png", "no picture at all");
  std::filesystem::remove(dir / "left/L_6.png");
  testing::internal::CaptureStderr();
  const auto answers = replay_all(dir.path());
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << "the decoders keep silent";
  ASSERT_EQ(answers.size(), 7U);
  const std::string reasons[] = {"",
                                 "left/L_2.png: no right picture of number 2",
                                 "left/L_3.png: truncated",
                                 "right/R_4.png: 8x8 where 16x8 is expected",
                                 "left/L_5.png: no picture",
                                 "right/R_6.png: no left picture of number 6",
                                 ""};
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(answers[i].next, reasons[i].empty() ? Next::kPair : Next::kSkipped) << i;
    EXPECT_THAT(answers[i].reason, HasSubstr(reasons[i]));
    EXPECT_EQ(answers[i].ordinal, i + 1);
    EXPECT_EQ(answers[i].time_ns, at_rate(i, 30).count()) << "known for skipped ones too";
  }
  EXPECT_EQ(answers[6].left, 7);
  EXPECT_EQ(answers[6].right, 107);
}

TEST(LeftRightFolder, TruncatedJpegIsNoticed) {
  const test::TempDir dir;
  for (int n = 1; n <= 3; ++n) {
    write_picture(dir / ("left/" + std::to_string(n) + ".jpg"), grey_picture(n, 64, 64));
    write_picture(dir / ("right/" + std::to_string(n) + ".jpg"), grey_picture(n, 64, 64));
  }
  const std::string bytes = file_bytes(dir / "right/2.jpg");
  put_bytes(dir / "right/2.jpg", bytes.substr(0, bytes.size() * 3 / 4));
  ASSERT_FALSE(cv::imread((dir / "right/2.jpg").string()).empty()) << "the decoder does not notice";
  const auto answers = replay_all(dir.path());
  ASSERT_EQ(answers.size(), 3U);
  EXPECT_THAT(answers[1].reason, HasSubstr("right/2.jpg: truncated"));
}

TEST(LeftRightFolder, SizeAndFormatAreThoseOfTheFirstReadablePair) {
  const test::TempDir dir;
  write_recording(dir, {1});
  put_bytes(dir / "right/R_1.png", "");
  write_picture(dir / "left/L_2.png", colour_picture(1, 2, 3, 20, 10));
  write_picture(dir / "right/R_2.png", grey_picture(7, 20, 10));
  const auto source = open_replay(dir.path().string(), {});
  EXPECT_EQ(source->info().width, 20);
  EXPECT_EQ(source->info().format, PixelFormat::kBgr8);
  FramePair pair;
  EXPECT_EQ(source->next(pair), Next::kSkipped);
  ASSERT_EQ(source->next(pair), Next::kPair);
  EXPECT_EQ(pair.right.format, PixelFormat::kBgr8) << "converted to the source's format";
  EXPECT_EQ(pair.left.row(9)[0], 1);
  EXPECT_EQ(pair.left.row(9)[2], 3);
  EXPECT_EQ(pair.right.row(0)[2], 7);
}

TEST(LeftRightFolder, ColourInAGreySourceBecomesLuma) {
  const test::TempDir dir;
  write_recording(dir, {1});
  write_picture(dir / "left/L_2.png", colour_picture(0, 0, 200));
  write_picture(dir / "right/R_2.png", grey_picture(7));
  const auto answers = replay_all(dir.path());
  ASSERT_EQ(answers.size(), 2U);
  EXPECT_EQ(answers[1].left, 60) << "0.299 x 200";
}

TEST(LeftRightFolder, GreyStoredInThreeChannelsWithATintIsGrey) {
  const test::TempDir dir;
  cv::Mat three;
  cv::merge(std::vector<cv::Mat>{grey_picture(3), grey_picture(5), grey_picture(6)}, three);
  write_picture(dir / "left/1.png", three);
  write_picture(dir / "right/1.png", three);
  const auto source = open_replay(dir.path().string(), {});
  EXPECT_EQ(source->info().format, PixelFormat::kGrey8);
  FramePair pair;
  ASSERT_EQ(source->next(pair), Next::kPair);
  EXPECT_EQ(pair.left.row(1)[2], 5 + 5) << "0.114 x 3 + 0.587 x 5 + 0.299 x 6 = 5.07 at (0, 0)";
  EXPECT_EQ(pair.right.row(1)[2], 5 + 5);
}

TEST(LeftRightFolder, WeakColourIsColour) {
  const test::TempDir dir;
  cv::Mat picture;
  cv::merge(std::vector<cv::Mat>(3, grey_picture(5)), picture);
  picture.at<cv::Vec3b>(3, 3)[2] = static_cast<std::uint8_t>(picture.at<cv::Vec3b>(3, 3)[2] + 5);
  write_picture(dir / "left/1.png", picture);
  write_picture(dir / "right/1.png", picture);
  EXPECT_EQ(open_replay(dir.path().string(), {})->info().format, PixelFormat::kBgr8);
}

TEST(LeftRightFolder, BlackFirstPictureDoesNotMakeAColourSourceGrey) {
  const test::TempDir dir;
  write_picture(dir / "left/1.png", colour_picture(0, 0, 0));
  write_picture(dir / "right/1.png", colour_picture(0, 0, 0));
  EXPECT_EQ(open_replay(dir.path().string(), {})->info().format, PixelFormat::kBgr8);
}

TEST(LeftRightFolder, FlipSwapAndShift) {
  const test::TempDir dir;
  write_recording(dir, {1});
  const auto source = open_replay(dir.path().string(), {.flip = true, .swap = true, .shift_rows = 2});
  FramePair pair;
  ASSERT_EQ(source->next(pair), Next::kPair);
  EXPECT_EQ(pair.left.row(0)[0], 101 + 3 * 7) << "last row of the file in right/";
  EXPECT_EQ(pair.left.row(7)[5], 101 + 5);
  EXPECT_EQ(pair.right.row(0)[0], 0);
  EXPECT_EQ(pair.right.row(1)[15], 0);
  EXPECT_EQ(pair.right.row(2)[0], 1 + 3 * 7) << "last row of the file in left/, two rows down";
  EXPECT_EQ(pair.right.row(7)[15], 1 + 3 * 2 + 15);
}

TEST(LeftRightFolder, NegativeShiftMovesTheRightViewUp) {
  const test::TempDir dir;
  write_recording(dir, {1});
  const auto source = open_replay(dir.path().string(), {.shift_rows = -3});
  FramePair pair;
  ASSERT_EQ(source->next(pair), Next::kPair);
  EXPECT_EQ(pair.left.row(0)[0], 1) << "left stays";
  EXPECT_EQ(pair.right.row(0)[0], 101 + 9);
  EXPECT_EQ(pair.right.row(4)[0], 101 + 21);
  EXPECT_EQ(pair.right.row(5)[0], 0);
}

TEST(LeftRightFolder, SkipToGivesWhatReadingGives) {
  const test::TempDir dir;
  write_recording(dir, {1, 2, 3, 4, 5});
  put_bytes(dir / "left/L_4.png", "broken");
  const auto all = replay_all(dir.path());
  for (std::size_t skipped = 0; skipped <= 6; ++skipped) {
    const auto source = open_replay(dir.path().string(), {});
    source->skip_to(skipped);
    const auto rest = ask_all(*source);
    ASSERT_EQ(rest.size(), skipped < 5 ? 5 - skipped : 0);
    for (std::size_t i = 0; i < rest.size(); ++i) {
      const Answer& expected = all[i + skipped];
      EXPECT_EQ(rest[i].next, expected.next);
      EXPECT_EQ(rest[i].ordinal, expected.ordinal);
      EXPECT_EQ(rest[i].time_ns, expected.time_ns);
      EXPECT_EQ(rest[i].left, expected.left);
    }
  }
}

TEST(LeftRightFolder, OtherFilesAreNotLookedAt) {
  const test::TempDir dir;
  write_recording(dir, {1, 2});
  dir.write("left/notes.txt", "x");
  dir.write("left/._L_1.png", "x");
  EXPECT_EQ(replay_all(dir.path()).size(), 2U);
}

TEST(LeftRightFolder, SourceMayBeGivenUpStillUnread) {
  const test::TempDir dir;
  write_recording(dir, {1, 2, 3});
  const auto source = open_replay(dir.path().string(), {});
  FramePair pair;
  EXPECT_EQ(source->next(pair), Next::kPair);
}

TEST(KittiFolder, WithoutTimesTheNumbersCount) {
  const test::TempDir dir;
  for (const char* name : {"000000.png", "000001.png", "000003.png"}) {
    write_picture(dir / "image_0" / name, grey_picture(1));
    write_picture(dir / "image_1" / name, grey_picture(2));
  }
  const auto source = open_replay(dir.path().string(), {.fps = 10});
  EXPECT_FALSE(source->info().has_time);
  const auto answers = ask_all(*source);
  ASSERT_EQ(answers.size(), 3U);
  EXPECT_EQ(answers[2].time_ns, 300'000'000);
}

TEST(KittiFolder, TimesBelongToNumbersNotToOrder) {
  const test::TempDir dir;
  for (const char* name : {"000001.png", "000003.png"}) {
    write_picture(dir / "image_2" / name, colour_picture(1, 2, 3));
    write_picture(dir / "image_3" / name, colour_picture(4, 5, 6));
  }
  dir.write("times.txt", "0.0\n1.036224e-01\n0.21\n0.3\n0.4\n");
  const auto source = open_replay(dir.path().string(), {});
  EXPECT_TRUE(source->info().has_time);
  EXPECT_EQ(source->info().format, PixelFormat::kBgr8);
  const auto answers = ask_all(*source);
  ASSERT_EQ(answers.size(), 2U);
  EXPECT_EQ(answers[0].time_ns, 103'622'400);
  EXPECT_EQ(answers[1].time_ns, 300'000'000);
  EXPECT_EQ(answers[0].skew, std::nullopt) << "one stamp for both views";
}

TEST(KittiFolder, TooFewTimesAreRefused) {
  const test::TempDir dir;
  write_picture(dir / "image_0/000005.png", grey_picture(1));
  write_picture(dir / "image_1/000005.png", grey_picture(1));
  dir.write("times.txt", "0.0\n0.1\n");
  EXPECT_THAT(open_error(dir.path().string()), HasSubstr("times.txt: has 2 times, none for"));
}

TEST(KittiFolder, GreyStandsBeforeColourAndColourCanBeNamed) {
  const test::TempDir dir;
  for (const char* view : {"image_0", "image_1"}) write_picture(dir / view / "0.png", grey_picture(1));
  for (const char* view : {"image_2", "image_3"}) write_picture(dir / view / "0.png", colour_picture(1, 2, 3));
  EXPECT_EQ(open_replay(dir.path().string(), {})->info().format, PixelFormat::kGrey8);
  const std::string colour = (dir / "image_2").string() + "," + (dir / "image_3").string();
  EXPECT_EQ(open_replay(colour, {})->info().format, PixelFormat::kBgr8);
}

TEST(EurocFolder, ListedTimesAndMissingFiles) {
  const test::TempDir dir;
  dir.write("mav0/cam0/data.csv", "#timestamp [ns],filename\n1000000000,a.png\n1050000000,b.png\n1100000000,c.png\n");
  dir.write("mav0/cam1/data.csv", "#timestamp [ns],filename\n1000000300,a.png\n1050000300,b.png\n1100000300,c.png\n");
  for (const char* camera : {"cam0", "cam1"}) {
    write_picture(dir / "mav0" / camera / "data/a.png", grey_picture(1));
    write_picture(dir / "mav0" / camera / "data/c.png", grey_picture(3));
  }
  for (const auto& path : {dir.path(), dir / "mav0"}) {
    const auto source = open_replay(path.string(), {});
    EXPECT_TRUE(source->info().has_time);
    EXPECT_EQ(source->info().period, std::chrono::milliseconds(50));
    const auto answers = ask_all(*source);
    ASSERT_EQ(answers.size(), 3U);
    EXPECT_EQ(answers[0].next, Next::kPair);
    EXPECT_EQ(answers[1].next, Next::kSkipped);
    EXPECT_THAT(answers[1].reason, HasSubstr("cam0/data/b.png: missing"));
    EXPECT_EQ(answers[1].time_ns, 1050000000);
    EXPECT_EQ(answers[2].left, 3);
  }
}

TEST(EurocFolder, OneCameraIsAMonoSource) {
  const test::TempDir dir;
  dir.write("cam0/data.csv", "#t,f\n1000,a.png\n2000,b.png\n");
  write_picture(dir / "cam0/data/a.png", grey_picture(1));
  const auto answers = replay_all("mono:" + (dir / "cam0").string());
  ASSERT_EQ(answers.size(), 2U);
  EXPECT_EQ(answers[0].time_ns, 1000);
  EXPECT_EQ(answers[0].right, -1);
  EXPECT_EQ(answers[1].next, Next::kSkipped);
}

TEST(MonoFolder, HasNoRightView) {
  const test::TempDir dir;
  write_picture(dir / "in000470.jpg", colour_picture(10, 20, 30));
  write_picture(dir / "in000472.jpg", colour_picture(10, 20, 30));
  const auto source = open_replay("mono:" + dir.path().string(), {.fps = 10, .flip = true});
  EXPECT_FALSE(source->info().stereo);
  EXPECT_EQ(source->info().format, PixelFormat::kBgr8);
  FramePair pair;
  ASSERT_EQ(source->next(pair), Next::kPair);
  EXPECT_TRUE(pair.right.empty());
  ASSERT_EQ(source->next(pair), Next::kPair);
  EXPECT_EQ(pair.capture_time.time_since_epoch(), std::chrono::milliseconds(200));
}

}  // namespace
}  // namespace stereotrack::capture
