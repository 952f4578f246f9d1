#include "firmware-app/render/renderer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "firmware-app/render/painter.hpp"
#include "firmware-app/render/style.hpp"
#include "pipeline/photometry/colour.hpp"
#include "scene.hpp"
#include "tests/support/pixel_layouts.hpp"
#include "tests/support/temp_dir.hpp"

namespace stereotrack::render {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

template <class Run>
std::string message_of(Run run) {
  try {
    run();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

class RendererTest : public ::testing::Test {
 protected:
  RendererTest() {
    auto made = Rectifier::create(rig(), kWidth, kHeight, arena_);
    if (made.has_value()) rectifier_ = *made;
  }

  std::unique_ptr<Renderer> make(const std::string& name, bool stereo = true) {
    return make_renderer((folder_ / name).string(), source_info(stereo), stereo ? &*rectifier_ : nullptr, 0);
  }
  static void draw(Renderer& renderer, int frames, bool stereo = true) {
    Scene scene(stereo);
    for (int i = 1; i <= frames; ++i) {
      scene.go_to(static_cast<std::uint64_t>(i));
      renderer.draw(scene.pair(), scene.result(), nullptr);
    }
  }
  std::set<std::string> names(const fs::path& below = "") const {
    std::set<std::string> out;
    for (const auto& entry : fs::directory_iterator(folder_ / below)) out.insert(entry.path().filename().string());
    return out;
  }

  Arena arena_;
  std::optional<Rectifier> rectifier_;
  test::TempDir folder_;
};

class RendererFolder : public RendererTest, public ::testing::WithParamInterface<bool> {};

TEST_P(RendererFolder, HoldsOnePngAPairAndTheSameBytesTwice) {
  for (const char* name : {"once", "again"}) {
    const auto renderer = make(name, GetParam());
    draw(*renderer, 3, GetParam());
    renderer->commit();
  }
  EXPECT_EQ(names("once"), (std::set<std::string>{"000001.png", "000002.png", "000003.png"}));
  for (const std::string& name : names("once")) {
    EXPECT_EQ(bytes_of(folder_ / "once" / name), bytes_of(folder_ / "again" / name));
  }
  EXPECT_NE(bytes_of(folder_ / "once/000001.png"), bytes_of(folder_ / "once/000003.png"));
  const cv::Mat picture = cv::imread((folder_ / "once/000002.png").string());
  ASSERT_FALSE(picture.empty());
  EXPECT_EQ(picture.cols % 2, 0);
  EXPECT_EQ(picture.rows % 2, 0);
}
INSTANTIATE_TEST_SUITE_P(StereoAndMono, RendererFolder, ::testing::Bool(),
                         [](const auto& param) { return param.param ? "Stereo" : "Mono"; });

class RendererVideo : public RendererTest, public ::testing::WithParamInterface<const char*> {};

TEST_P(RendererVideo, HoldsEveryFrameAtTheSourcesRate) {
  const std::string name = std::string("video.") + GetParam();
  const auto renderer = make(name);
  draw(*renderer, 30);
  EXPECT_FALSE(fs::exists(folder_ / name));
  renderer->commit();
  EXPECT_EQ(names(), std::set<std::string>{name});
  cv::VideoCapture video((folder_ / name).string());
  EXPECT_NEAR(video.get(cv::CAP_PROP_FPS), 25, 0.01);
  int frames = 0;
  while (video.grab()) ++frames;
  EXPECT_EQ(frames, 30);
}

TEST_P(RendererVideo, WithoutCommitNothingStays) {
  {
    const auto renderer = make(std::string("video.") + GetParam());
    draw(*renderer, 3);
    EXPECT_EQ(names().size(), 1U);
  }
  EXPECT_TRUE(names().empty());
}

TEST_P(RendererVideo, CommitWithoutFramesLeavesNothing) {
  make(std::string("video.") + GetParam())->commit();
  EXPECT_TRUE(names().empty());
}

TEST_P(RendererVideo, SameBytesTwice) {
  for (const char* name : {"once.", "again."}) {
    const auto renderer = make(std::string(name) + GetParam());
    draw(*renderer, 12);
    renderer->commit();
  }
  EXPECT_TRUE(bytes_of(folder_ / (std::string("once.") + GetParam())) ==
              bytes_of(folder_ / (std::string("again.") + GetParam())));
}

TEST_P(RendererVideo, CutOffByAFullDiskIsRefusedAndRemoved) {
  const std::string name = std::string("video.") + GetParam();
  // A limit on the size of files stands for the full disk: writing fails in the same places.
  const rlimit small{30'000, RLIM_INFINITY};
  const rlimit none{RLIM_INFINITY, RLIM_INFINITY};
  const auto before = std::signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const std::string message = message_of([&] {
    const auto renderer = make(name);
    draw(*renderer, 30);
    renderer->commit();
  });
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &none), 0);
  (void)std::signal(SIGXFSZ, before);
  EXPECT_THAT(message,
              AllOf(HasSubstr(name), HasSubstr("of 30 frames"), HasSubstr("free space"), Not(HasSubstr("\n"))));
  EXPECT_TRUE(names().empty());
}
INSTANTIATE_TEST_SUITE_P(Formats, RendererVideo, ::testing::Values("mp4", "avi", "mkv", "MP4"),
                         [](const auto& param) { return std::string(param.param); });

TEST_F(RendererTest, RateWithManyDigitsIsEncoded) {
  capture::SourceInfo info = source_info(false);
  for (const std::int64_t period : {33'180'001LL, 7'936'508LL, 1'234'567LL, 2'000'000'000LL, 0LL}) {
    info.period = std::chrono::nanoseconds(period);
    const auto renderer = make_renderer((folder_ / "rate.mp4").string(), info, nullptr, 0);
    draw(*renderer, 4, false);
    renderer->commit();
    const double wanted = period == 0 ? 25 : 1e9 / static_cast<double>(period);
    cv::VideoCapture video((folder_ / "rate.mp4").string());
    EXPECT_NEAR(video.get(cv::CAP_PROP_FPS), wanted, 0.001 * wanted);
  }
}

TEST_F(RendererTest, FolderThatDoesNotExistIsNamed) {
  EXPECT_THAT(
      message_of([&] { (void)make("missing/video.mp4"); }),
      AllOf(HasSubstr("missing/video.mp4: cannot be written: No such file or directory"), HasSubstr("--render")));
}

TEST_F(RendererTest, FolderNamedLikeAVideoIsRefused) {
  fs::create_directory(folder_ / "a.mp4");
  EXPECT_THAT(message_of([&] { (void)make("a.mp4"); }), HasSubstr("a.mp4: is a folder"));
}

TEST_F(RendererTest, FileWhereTheFolderShouldBeIsRefused) {
  std::ofstream(folder_ / "pictures") << "text";
  EXPECT_THAT(message_of([&] { (void)make("pictures"); }), HasSubstr("pictures: cannot be written"));
  EXPECT_EQ(bytes_of(folder_ / "pictures"), "text");
}

TEST_F(RendererTest, UnwritableFolderIsRefused) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write everywhere";
  fs::permissions(folder_.path(), fs::perms::owner_read | fs::perms::owner_exec);
  EXPECT_THAT(message_of([&] { (void)make("video.mp4"); }), HasSubstr("Permission denied"));
  EXPECT_THAT(message_of([&] { (void)make("pictures"); }), HasSubstr("Permission denied"));
  fs::permissions(folder_.path(), fs::perms::owner_all);
}

TEST_F(RendererTest, PictureThatCannotBeWrittenIsNamedAndLeavesNothing) {
  const auto renderer = make("pictures");
  const rlimit small{1000, RLIM_INFINITY};
  const rlimit none{RLIM_INFINITY, RLIM_INFINITY};
  const auto before = std::signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const std::string message = message_of([&] { draw(*renderer, 1); });
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &none), 0);
  (void)std::signal(SIGXFSZ, before);
  EXPECT_THAT(message, AllOf(HasSubstr("000001.png: cannot be written"), HasSubstr("free space")));
  EXPECT_TRUE(names("pictures").empty());
}

TEST(Painter, PictureIsScaledToBeLegible) {
  struct Case {
    int width, height, drawn_width, drawn_height;
  };
  const RectifiedGeometry geometry{320, 320, 240, 300, 160, 160, 120, 0.2, 0};
  for (const Case& c : {Case{320, 240, 960, 720}, Case{1280, 720, 1280, 720}, Case{1920, 1080, 1280, 720},
                        Case{1242, 375, 1590, 480}, Case{1, 1, 720, 720}, Case{481, 641, 540, 720}}) {
    Painter painter(c.width, c.height, &geometry, {});
    // 36 px header, 8 px gap, 540 px top view; odd sizes are made even
    EXPECT_NEAR(painter.size().height, 36 + c.drawn_height, 2) << c.width;
    EXPECT_NEAR(painter.size().width, c.drawn_width + 8 + (c.drawn_height == 720 ? 540 : 400), 42) << c.width;
    EXPECT_EQ(painter.size().width % 2, 0);
    EXPECT_EQ(painter.size().height % 2, 0);
  }
}

TEST(Painter, HullLiesOnItsPixels) {
  Painter painter(kWidth, kHeight, nullptr, {});
  Scene scene(false);
  scene.go_to(1);
  const cv::Mat with = painter.draw(scene.pair(), scene.result()).clone();
  // raw corner (left + 24, 110), three times as large, header 36 px
  const Point corner = scene.tracks()[0].hull[1];
  const auto& pixel = with.at<cv::Vec3b>(36 + 3 * corner.y + 1, 3 * corner.x + 1);
  const cv::Scalar wanted = colour_of(1);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(pixel[c], wanted[c], 40);
}

TEST(Painter, FlagsTargetsAndTimeChangeTheHeader) {
  const auto header = [](std::uint32_t flags, std::uint64_t ordinal, std::size_t tracks) {
    Painter painter(kWidth, kHeight, nullptr, {});
    Scene scene(false);
    scene.go_to(1);
    (void)painter.draw(scene.pair(), scene.result());
    scene.go_to(ordinal);
    scene.result().flags = flags;
    scene.result().tracks = scene.result().tracks.first(tracks);
    return painter.draw(scene.pair(), scene.result()).rowRange(0, 36).clone();
  };
  const cv::Mat plain = header(0, 2, 2);
  EXPECT_EQ(cv::norm(plain, header(0, 2, 3), cv::NORM_INF), 0);  // a tentative track is no target
  EXPECT_GT(cv::norm(plain, header(0, 2, 1), cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(plain, header(0, 3, 2), cv::NORM_INF), 0);
  for (const std::uint32_t flag : {kFlagMono, kFlagNoColour, kFlagLearning, kFlagLightChange, kFlagWrongPair}) {
    EXPECT_GT(cv::norm(plain, header(flag, 2, 2), cv::NORM_INF), 0) << flag;
  }
}

TEST(Painter, TrailEndsTwoSecondsBack) {
  Trails trails;
  Scene scene(true);
  for (std::uint64_t i = 1; i <= 100; ++i) {
    scene.go_to(i);
    trails.add(scene.result());
  }
  EXPECT_EQ(trails.of(1).size(), 51U);  // 2 s at 25 Hz, both ends
  EXPECT_NEAR(trails.strength(trails.of(1).front()), 0, 1e-9);
  EXPECT_EQ(trails.strength(trails.of(1).back()), 1);
}

TEST(Painter, ColourPictureKeepsItsColoursAndAnEmptyOneIsDrawn) {
  Painter painter(16, 16, nullptr, {});
  const cv::Mat red(16, 16, CV_8UC3, cv::Scalar(10, 20, 200));
  FramePair pair;
  pair.left = {red.data, 16, 16, static_cast<std::ptrdiff_t>(red.step), PixelFormat::kBgr8};
  EXPECT_EQ(painter.draw(pair, {}).at<cv::Vec3b>(300, 300), cv::Vec3b(10, 20, 200));
  pair.left = {};
  EXPECT_NE(painter.draw(pair, {}).at<cv::Vec3b>(300, 300), cv::Vec3b(10, 20, 200));
}

// One colour all over in each format: where a format has colour, that colour is drawn, else its luma. Not the YUV ones:
// OpenCV takes them to be of limited range.
TEST(Painter, EachFormatIsDrawnInItsOwnColour) {
  const cv::Vec3b colour(30, 90, 200);
  const cv::Mat bgr(16, 16, CV_8UC3, cv::Scalar(colour));
  const Picture whole{bgr.data, 16, 16, static_cast<std::ptrdiff_t>(bgr.step), PixelFormat::kBgr8};
  Painter painter(16, 16, nullptr, {});
  for (int i = static_cast<int>(PixelFormat::kGrey10); i < kPixelFormats; ++i) {
    const auto format = static_cast<PixelFormat>(i);
    const auto stride = static_cast<std::ptrdiff_t>(row_bytes(format, 16)) + 3;
    std::vector<std::uint8_t> pixels;
    test::lay_out(whole, format, stride, pixels);
    FramePair pair;
    pair.left = {pixels.data(), 16, 16, stride, format};
    const std::uint8_t grey = luma(colour[0], colour[1], colour[2]);
    EXPECT_EQ(painter.draw(pair, {}).at<cv::Vec3b>(300, 300), has_colour(format) ? colour : cv::Vec3b(grey, grey, grey))
        << i;
  }
}

TEST(MakeRenderer, SourceWithoutASizeIsRefused) {
  EXPECT_THAT(message_of([] { (void)make_renderer("x", {}, nullptr, 0); }), HasSubstr("size"));
}

}  // namespace
}  // namespace stereotrack::render
