#include "drivers/capture/replay/view_files.hpp"
#include "tests/unit/capture/replay_support.hpp"

namespace stereotrack::capture {
namespace {

using std::chrono::nanoseconds;

std::vector<std::optional<std::uint64_t>> numbers_of(const std::vector<std::string>& names) {
  View view;
  for (const std::string& name : names) view.push_back({name, std::nullopt, std::nullopt});
  number_files(view);
  std::vector<std::optional<std::uint64_t>> numbers;
  for (const ViewFile& file : view) numbers.push_back(file.number);
  return numbers;
}

TEST(TimeInName, SecondsAndNanosecondsAreExact) {
  EXPECT_EQ(time_in_name("1585434279_805531979"), nanoseconds(1585434279805531979));
  EXPECT_EQ(time_in_name("1585434283_091121912"), nanoseconds(1585434283091121912));
}

TEST(TimeInName, NanosecondsWithoutPaddingAreStillNanoseconds) {
  EXPECT_EQ(time_in_name("1585434283_91121912"), nanoseconds(1585434283091121912));
}

TEST(TimeInName, PointMakesADecimalFraction) {
  EXPECT_EQ(time_in_name("1305031102.175304"), nanoseconds(1305031102175304000));
}

TEST(TimeInName, NineteenDigitsAreNanoseconds) {
  EXPECT_EQ(time_in_name("1403715273262142976"), nanoseconds(1403715273262142976));
}

TEST(TimeInName, PrefixAndSuffixAreAllowed) {
  EXPECT_EQ(time_in_name("left_1585434279_805531979_raw"), nanoseconds(1585434279805531979));
}

TEST(TimeInName, CountersAreNoTimes) {
  EXPECT_EQ(time_in_name("0000000012"), std::nullopt);
  EXPECT_EQ(time_in_name("0000000012_000000001"), std::nullopt);
  EXPECT_EQ(time_in_name("frame_000123"), std::nullopt);
  EXPECT_EQ(time_in_name("9999999999999999999"), std::nullopt) << "more than 63 bits";
  EXPECT_EQ(time_in_name(""), std::nullopt);
}

TEST(PictureName, KnownExtensionsInAnyCaseAndNothingElse) {
  for (const char* name : {"a.png", "a.JPG", "a.Jpeg", "a.bmp", "a.PGM", "a.ppm", "a.tif", "a.TIFF"}) {
    EXPECT_TRUE(is_picture_name(name)) << name;
  }
  for (const char* name : {"a.txt", "a.gif", "png", "._a.png", ".hidden.jpg", "a.png.part"}) {
    EXPECT_FALSE(is_picture_name(name)) << name;
  }
}

TEST(NaturalLess, DigitsCompareAsNumbers) {
  EXPECT_TRUE(natural_less("frame_2.png", "frame_10.png"));
  EXPECT_FALSE(natural_less("frame_10.png", "frame_2.png"));
  EXPECT_TRUE(natural_less("a1b9", "a1b10"));
  EXPECT_TRUE(natural_less("a", "a1"));
  EXPECT_TRUE(natural_less("99999999999999999999998", "99999999999999999999999"));
}

TEST(NaturalLess, IsAStrictOrderForEqualNumbers) {
  EXPECT_TRUE(natural_less("frame_02", "frame_2"));
  EXPECT_FALSE(natural_less("frame_2", "frame_02"));
  EXPECT_FALSE(natural_less("frame_2", "frame_2"));
}

TEST(NumberFiles, LastNumberCounts) {
  EXPECT_THAT(numbers_of({"cam0_0007.png", "cam0_0012.png"}), testing::ElementsAre(7, 12));
}

TEST(NumberFiles, NumberCommonToAllNamesSaysNothing) {
  EXPECT_THAT(numbers_of({"0007_cam1.png", "0012_cam1.png"}), testing::ElementsAre(7, 12));
}

TEST(NumberFiles, OneFileKeepsItsLastNumber) { EXPECT_THAT(numbers_of({"a3_b4.png"}), testing::ElementsAre(4)); }

TEST(NumberFiles, NamesWithoutNumberOrWithAnOverlongOneHaveNone) {
  EXPECT_THAT(numbers_of({"a.png", "b.png"}), testing::Each(std::nullopt));
  EXPECT_THAT(numbers_of({"1234567890123456789012.png", "000000000000000000000003.png"}),
              testing::ElementsAre(std::nullopt, 3));
}

TEST(KittiTimes, DecimalAndExponentAreRead) {
  const test::TempDir dir;
  const auto file = dir.write("times.txt", "0.000000e+00\n1.036224e-01\n1585434279.805531979\r\n\n");
  EXPECT_THAT(read_kitti_times(file),
              testing::ElementsAre(nanoseconds(0), nanoseconds(103622400), nanoseconds(1585434279805531979)));
}

TEST(KittiTimes, BadLineIsNamed) {
  const test::TempDir dir;
  const auto word = dir.write("a/times.txt", "0.1\nsoon\n");
  const auto back = dir.write("b/times.txt", "0.1\n0.2\n0.2\n");
  EXPECT_THAT([&] { (void)read_kitti_times(word); },
              testing::ThrowsMessage<std::runtime_error>(testing::HasSubstr("times.txt:2: expected a time")));
  EXPECT_THAT([&] { (void)read_kitti_times(back); },
              testing::ThrowsMessage<std::runtime_error>(testing::HasSubstr("times.txt:3: not later")));
}

TEST(EurocCamera, ListNamesFilesThatNeedNotExist) {
  const test::TempDir dir;
  dir.write("cam0/data.csv", "#timestamp [ns],filename\r\n100,a.png\r\n\r\n200, b.png\r\n");
  const View view = list_euroc_camera(dir / "cam0");
  ASSERT_EQ(view.size(), 2U);
  EXPECT_EQ(view[0].time, nanoseconds(100));
  EXPECT_EQ(view[1].path, dir / "cam0" / "data" / "b.png");
}

TEST(EurocCamera, WithoutListTheNamesGiveTheTimes) {
  const test::TempDir dir;
  dir.write("cam0/data/1403715273262142976.png", "");
  const View view = list_euroc_camera(dir / "cam0");
  ASSERT_EQ(view.size(), 1U);
  EXPECT_EQ(view[0].time, nanoseconds(1403715273262142976));
}

TEST(EurocCamera, FaultyListIsRefusedByLine) {
  const test::TempDir dir;
  for (const char* line : {"soon,a.png", "100", "100,"}) {
    dir.write("cam0/data.csv", std::string("#timestamp\n") + line + "\n");
    EXPECT_THAT([&] { (void)list_euroc_camera(dir / "cam0"); },
                testing::ThrowsMessage<std::runtime_error>(testing::HasSubstr("data.csv:2: expected")))
        << line;
  }
}

}  // namespace
}  // namespace stereotrack::capture
