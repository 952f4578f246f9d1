#include <cstring>
#include <fstream>
#include <random>

#include "drivers/capture/replay/picture_file.hpp"
#include "tests/unit/capture/replay_support.hpp"

namespace stereotrack::capture {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

/// Noise: every row of the file then holds data, so that a cut anywhere loses pixels.
cv::Mat noise(int type, int width = 33, int height = 21) {
  cv::Mat picture(height, width, type);
  cv::RNG random(7);
  random.fill(picture, cv::RNG::UNIFORM, 0, picture.depth() == CV_16U ? 65536 : 256);
  return picture;
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.type() == b.type() && a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0;
}

class EveryKind : public testing::TestWithParam<const char*> {};

TEST_P(EveryKind, IsReadAsWrittenInGreyAndColour) {
  const test::TempDir dir;
  const std::string kind = GetParam();
  const bool lossy = kind == "jpg" || kind == "JPEG";
  for (const int type : {CV_8UC1, CV_8UC3}) {
    if ((kind == "pgm" && type == CV_8UC3) || (kind == "ppm" && type == CV_8UC1)) continue;
    const cv::Mat picture = noise(type);
    const auto file = dir / ("a." + kind);
    write_picture(file, picture);
    const auto read = read_picture(file);
    ASSERT_TRUE(read.has_value()) << read.error();
    EXPECT_EQ(read->type(), type);
    EXPECT_TRUE(lossy ? read->size() == picture.size() : same(*read, picture)) << kind << " type " << type;
  }
}

TEST_P(EveryKind, CutAnywhereIsNoticed) {
  const test::TempDir dir;
  const std::string kind = GetParam();
  const auto file = dir / ("a." + kind);
  write_picture(file, noise(kind == "pgm" ? CV_8UC1 : CV_8UC3));
  const std::string whole = file_bytes(file);
  for (const double part : {0.0, 0.01, 0.1, 0.5, 0.9, 0.99}) {
    put_bytes(file, whole.substr(0, static_cast<std::size_t>(part * static_cast<double>(whole.size()))));
    const auto read = read_picture(file);
    ASSERT_FALSE(read.has_value()) << kind << " cut to " << part;
    EXPECT_THAT(read.error(), testing::StartsWith(file.string() + ": "));
    EXPECT_THAT(read.error(), testing::Not(HasSubstr("\n")));
  }
}

INSTANTIATE_TEST_SUITE_P(ReadPicture, EveryKind,
                         testing::Values("png", "jpg", "JPEG", "bmp", "pgm", "ppm", "tif", "TIFF"));

TEST(ReadPicture, OfSixteenBitsTheHighByteIsKept) {
  const test::TempDir dir;
  cv::Mat wide(1, 4, CV_16UC1);
  wide.at<std::uint16_t>(0) = 0x00FF;
  wide.at<std::uint16_t>(1) = 0x0100;
  wide.at<std::uint16_t>(2) = 0x7F80;
  wide.at<std::uint16_t>(3) = 0xFFFF;
  for (const char* name : {"a.png", "a.pgm", "a.tif"}) {
    write_picture(dir / name, wide);
    const auto read = read_picture(dir / name);
    ASSERT_TRUE(read.has_value()) << read.error();
    EXPECT_THAT(std::vector<int>(read->begin<std::uint8_t>(), read->end<std::uint8_t>()),
                testing::ElementsAre(0x00, 0x01, 0x7F, 0xFF))
        << name;
  }
}

TEST(ReadPicture, AlphaIsDropped) {
  const test::TempDir dir;
  write_picture(dir / "a.png", cv::Mat(4, 4, CV_8UC4, cv::Scalar(10, 20, 30, 128)));
  const auto read = read_picture(dir / "a.png");
  ASSERT_TRUE(read.has_value()) << read.error();
  EXPECT_TRUE(same(*read, colour_picture(10, 20, 30, 4, 4)));
}

TEST(ReadPicture, ExifRotationIsNotApplied) {
  const test::TempDir dir;
  write_picture(dir / "a.jpg", grey_picture(0, 32, 8));
  std::string bytes = file_bytes(dir / "a.jpg");
  // APP1 with one TIFF entry: tag 0x0112 orientation = 6 (turn by 90 degrees).
  const std::string exif(
      "\xFF\xE1\x00\x22"
      "Exif\0\0"
      "II\x2A\0\x08\0\0\0"
      "\x01\0"
      "\x12\x01\x03\0\x01\0\0\0\x06\0\0\0"
      "\0\0\0\0",
      36);
  bytes.insert(2, exif);
  put_bytes(dir / "a.jpg", bytes);
  ASSERT_EQ(cv::imread((dir / "a.jpg").string()).size(), cv::Size(8, 32)) << "the file does ask for a rotation";
  const auto read = read_picture(dir / "a.jpg");
  ASSERT_TRUE(read.has_value()) << read.error();
  EXPECT_EQ(read->size(), cv::Size(32, 8));
}

TEST(ReadPicture, MissingFileAndFolderAreFaults) {
  const test::TempDir dir;
  EXPECT_THAT(read_picture(dir / "a.png").error(), HasSubstr("a.png: missing"));
  std::filesystem::create_directory(dir / "b.png");
  EXPECT_THAT(read_picture(dir / "b.png").error(), HasSubstr("b.png: not a file"));
}

// One whose size has its low 32 bits clear, too: what a machine of 32 bits would take for empty.
TEST(ReadPicture, HugeFilesAreFaultsAndNotRead) {
  const test::TempDir dir;
  for (const std::uintmax_t size : {(std::uintmax_t{1} << 30) + 1, std::uintmax_t{1} << 32}) {
    std::ofstream(dir / "a.png") << "P5 1 1 255 x";
    std::filesystem::resize_file(dir / "a.png", size);
    EXPECT_THAT(read_picture(dir / "a.png").error(), HasSubstr("a.png: larger than 1 GiB")) << size;
  }
}

TEST(ReadPicture, TextIsAFault) {
  const test::TempDir dir;
  EXPECT_THAT(read_picture(dir.write("a.png", "no picture")).error(), HasSubstr("a.png: no picture"));
}

TEST(ReadPicture, FloatsAreAFault) {
  const test::TempDir dir;
  write_picture(dir / "a.tif", cv::Mat(4, 4, CV_32FC1, cv::Scalar(0.5)));
  EXPECT_THAT(read_picture(dir / "a.tif").error(), HasSubstr("neither 8 nor 16 bits"));
}

TEST(Damage, FlippedBitInAPngIsNoticed) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", noise(CV_8UC1), bytes);
  EXPECT_THAT(damage(bytes), IsEmpty());
  bytes[bytes.size() / 2] ^= 0x10;
  EXPECT_THAT(damage(bytes), HasSubstr("wrong checksum"));
}

TEST(Damage, PaddingAfterTheJpegEndMarkerIsNone) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", noise(CV_8UC3), bytes);
  bytes.resize(bytes.size() + 100);
  EXPECT_THAT(damage(bytes), IsEmpty());
}

TEST(Damage, ProgressiveJpegWithRestartsIsFollowedToItsEnd) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", noise(CV_8UC3, 200, 150), bytes,
               {cv::IMWRITE_JPEG_PROGRESSIVE, 1, cv::IMWRITE_JPEG_RST_INTERVAL, 3, cv::IMWRITE_JPEG_OPTIMIZE, 1});
  EXPECT_THAT(damage(bytes), IsEmpty());
  bytes.resize(bytes.size() - 2);
  EXPECT_THAT(damage(bytes), HasSubstr("end marker is missing"));
}

TEST(Damage, EndMarkerInsideAnExifSegmentIsNotTheEnd) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", noise(CV_8UC1), bytes);
  const std::vector<std::uint8_t> thumbnail{0xFF, 0xE1, 0x00, 0x06, 0xFF, 0xD8, 0xFF, 0xD9};
  bytes.insert(bytes.begin() + 2, thumbnail.begin(), thumbnail.end());
  EXPECT_THAT(damage(bytes), IsEmpty());
  bytes.resize(bytes.size() - 2);
  EXPECT_THAT(damage(bytes), HasSubstr("end marker is missing"));
}

TEST(Damage, HeaderThatPromisesTooMuchIsTruncated) {
  const auto of = [](const std::string& text) {
    return damage({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  };
  EXPECT_THAT(of("P5\n# 9 9\n2 2\n255\nabcd"), IsEmpty());
  EXPECT_THAT(of("P5\n# 9 9\n2 2\n255\nabc"), HasSubstr("truncated"));
  EXPECT_THAT(of("P6 1 1 255 ab"), HasSubstr("truncated"));
  EXPECT_THAT(of("P5 999999999999999999999 2 255 a"), HasSubstr("truncated"));
  EXPECT_THAT(of("P5"), HasSubstr("truncated"));
  EXPECT_THAT(of(""), HasSubstr("empty"));
}

TEST(Damage, RandomBytesAfterAKnownStartNeverReadOutside) {
  std::mt19937 random(1);
  for (const char* magic : {"\xFF\xD8", "\x89PNG\r\n\x1A\n", "BM", "P5", "P6"}) {
    for (int size = 0; size < 200; ++size) {
      std::vector<std::uint8_t> bytes(magic, magic + std::strlen(magic));
      for (int i = 0; i < size; ++i) bytes.push_back(static_cast<std::uint8_t>(random()));
      bytes.shrink_to_fit();
      (void)damage(bytes);
    }
  }
}

}  // namespace
}  // namespace stereotrack::capture
