#include <algorithm>

#include "tests/unit/capture/replay_support.hpp"

namespace stereotrack::capture {
namespace {

#define NEEDS(set) \
  if (!std::filesystem::exists(shared_data(set))) GTEST_SKIP() << set << " is not in ../shared/data"

std::size_t readable(const std::vector<Answer>& answers) {
  return static_cast<std::size_t>(
      std::count_if(answers.begin(), answers.end(), [](const Answer& a) { return a.next == Next::kPair; }));
}

TEST(RealRecording, ConveyorHasExactIncreasingTimes) {
  NEEDS("dtu_conveyor_stereo");
  const auto source = open_replay(shared_data("dtu_conveyor_stereo").string(), {});
  EXPECT_EQ(source->info().width, 1280);
  EXPECT_EQ(source->info().height, 720);
  EXPECT_EQ(source->info().format, PixelFormat::kBgr8);
  EXPECT_NEAR(static_cast<double>(source->info().period.count()), 33.19e6, 0.02e6);
  const auto answers = ask_all(*source);
  ASSERT_EQ(answers.size(), 285U);
  EXPECT_EQ(readable(answers), 285U);
  EXPECT_EQ(answers[0].time_ns, 1585434279805531979);
  EXPECT_EQ(answers[1].time_ns - answers[0].time_ns, 33'179'998);
  for (std::size_t i = 1; i < answers.size(); ++i) EXPECT_GT(answers[i].time_ns, answers[i - 1].time_ns);
}

TEST(RealRecording, PeopleVideoHasItsPairsAt25Hz) {
  NEEDS("stereo_people_overhead");
  std::filesystem::path video;
  for (const auto& entry : std::filesystem::directory_iterator(shared_data("stereo_people_overhead"))) {
    if (entry.path().extension() == ".avi") video = entry.path();
  }
  const auto source = open_replay("sbs:" + video.string(), {.flip = true, .shift_rows = 2});
  EXPECT_EQ(source->info().width, 320);
  EXPECT_EQ(source->info().height, 240);
  const auto answers = ask_all(*source);
  ASSERT_EQ(answers.size(), 278U);
  EXPECT_EQ(readable(answers), 278U);
  EXPECT_EQ(answers[277].time_ns, 277 * 40'000'000LL);
}

TEST(RealRecording, PitchesAreGreyAndNumbered) {
  NEEDS("baseball_stereo_slow126");
  const auto folder = shared_data("baseball_stereo_slow126");
  const auto source = open_replay((folder / "one_pitch").string(), {.fps = 60});
  EXPECT_EQ(source->info().format, PixelFormat::kGrey8);
  const auto answers = ask_all(*source);
  EXPECT_EQ(readable(answers), 45U);
  EXPECT_EQ(answers[44].time_ns, 733'333'333);
  EXPECT_EQ(readable(replay_all(folder / "two_pitch")), 43U);
  EXPECT_THAT(open_error(folder.string()), testing::HasSubstr("several recordings"));
}

TEST(RealRecording, EurocListsMoreThanItHolds) {
  NEEDS("euroc_micro");
  const auto answers = replay_all(shared_data("euroc_micro"));
  // cam0 lists 95 names, cam1 those and four more; five files of each exist.
  ASSERT_EQ(answers.size(), 99U);
  EXPECT_EQ(readable(answers), 5U);
  EXPECT_EQ(answers[1].time_ns, 1403715273312143104);
  EXPECT_THAT(answers[5].reason, testing::HasSubstr("cam0/data/1403715273512143104.png: missing"));
  EXPECT_THAT(answers[98].reason, testing::HasSubstr("no left picture within half a period"));
}

TEST(RealRecording, KittiSampleIsGreyWithoutTimes) {
  NEEDS("kitti_odom_sample");
  const auto source = open_replay(shared_data("kitti_odom_sample").string(), {.fps = 10});
  EXPECT_EQ(source->info().width, 1242);
  EXPECT_FALSE(source->info().has_time);
  EXPECT_EQ(readable(ask_all(*source)), 5U);
}

TEST(RealRecording, HighwayIsAMonoSource) {
  NEEDS("cdnet_highway");
  const auto source = open_replay("mono:" + shared_data("cdnet_highway/input").string(), {});
  EXPECT_FALSE(source->info().stereo);
  EXPECT_EQ(readable(ask_all(*source)), 530U);
}

}  // namespace
}  // namespace stereotrack::capture
