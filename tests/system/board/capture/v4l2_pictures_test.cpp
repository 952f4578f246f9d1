// Pixels: the same test pattern in every format that the driver offers is the same picture.
#include <gmock/gmock.h>

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <set>

#include "drivers/capture/v4l2/formats.hpp"
#include "pipeline/core/arena.hpp"
#include "pipeline/photometry/ingest.hpp"
#include "tests/system/board/capture/lent_memory.hpp"
#include "tests/system/board/capture/vivid.hpp"

namespace stereotrack::capture::v4l2::test {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;

constexpr int kColourSquares = 4;
constexpr int kGreyRamp = 20;

/// A picture's bytes, row after row without what lies between.
struct Kept {
  PixelFormat format = PixelFormat::kGrey8;
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> bytes;
};

Kept keep(const Picture& picture) {
  Kept kept{picture.format, picture.width, picture.height, {}};
  const std::size_t row = picture_bytes(picture.format, picture.width, 1);
  for (int y = 0; y < memory_rows(picture.format, picture.height); ++y) {
    kept.bytes.insert(kept.bytes.end(), picture.row(y), picture.row(y) + row);
  }
  return kept;
}

/// Brightness of each pixel, of a format that has it.
std::vector<std::uint8_t> luma(const Kept& kept) {
  std::vector<std::uint8_t> out;
  const std::size_t row = picture_bytes(kept.format, kept.width, 1);
  for (int y = 0; y < kept.height; ++y) {
    const std::uint8_t* const at = kept.bytes.data() + static_cast<std::size_t>(y) * row;
    for (int x = 0; x < kept.width; ++x) {
      if (kept.format == PixelFormat::kYuyv) {
        out.push_back(at[2 * x]);
      } else if (kept.format == PixelFormat::kUyvy) {
        out.push_back(at[2 * x + 1]);
      } else {
        out.push_back(sample_of(sample_layout(kept.format), at, x));
      }
    }
  }
  return out;
}

class Pictures : public VividTest {
 protected:
  static bool is_offered(std::string_view name, const char* device = kLeft) {
    for (const CameraFacts& camera : list_cameras()) {
      if (camera.path != device) continue;
      for (const auto& format : camera.formats) {
        if (format.name == name) return true;
      }
    }
    return false;
  }
  static Kept shot(std::string_view format, int pattern, Memory memory = Memory::kMapped,
                   const std::string& heap = "") {
    Other(kLeft).set("Test Pattern", pattern);
    Settings wanted = settings();
    wanted.format = format;
    wanted.memory = memory;
    wanted.heap = heap;
    wanted.width = 640;  // whose luma is a whole number of pages
    wanted.height = 480;
    const auto camera = started(wanted);
    const SensorFrame frame = nth_frame(*camera, 2);
    EXPECT_FALSE(frame.damaged) << format;
    return keep(camera->picture(frame.buffer));
  }
  static void expect_same_luma(std::initializer_list<const char*> formats) {
    const std::vector<std::uint8_t> grey = luma(shot("grey8", kGreyRamp));
    const auto [darkest, brightest] = std::minmax_element(grey.begin(), grey.end());
    ASSERT_GT(*brightest - *darkest, 200) << "no ramp";
    for (const char* const name : formats) {
      ASSERT_TRUE(is_offered(name)) << name;
      const Kept kept = shot(name, kGreyRamp);
      std::vector<std::uint8_t> wanted = grey;
      // The driver keeps the ends of the scale free in these, full range or not.
      if (has_colour(kept.format)) {
        for (std::uint8_t& value : wanted) value = std::clamp<std::uint8_t>(value, 1, 254);
      }
      const std::vector<std::uint8_t> made = luma(kept);
      const auto differs = std::mismatch(made.begin(), made.end(), wanted.begin(), wanted.end());
      EXPECT_TRUE(differs.first == made.end())
          << name << ": pixel " << differs.first - made.begin() << " is " << static_cast<int>(*differs.first)
          << " and not " << static_cast<int>(*differs.second);
    }
  }
  static void check_composed() {
    const Other other(kLeft);
    other.set("Test Pattern", kGreyRamp);
    other.set("OSD Text Mode", 2);
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    format.fmt.pix.width = 640;
    format.fmt.pix.height = 480;
    format.fmt.pix.pixelformat = V4L2_PIX_FMT_GREY;
    ASSERT_EQ(other.device().ask(VIDIOC_S_FMT, format), 0);
    ASSERT_EQ(format.fmt.pix.width, 640U);
    v4l2_selection part{};
    part.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    part.target = V4L2_SEL_TGT_COMPOSE;
    part.r = {64, 32, 320, 240};
    ASSERT_EQ(other.device().ask(VIDIOC_S_SELECTION, part), 0);
    Settings wanted = settings();
    wanted.width = wanted.height = 0;  // as the other program has set it
    wanted.fps = 0;
    const auto camera = started(wanted);
    ASSERT_EQ(camera->info().width, 320);
    ASSERT_EQ(camera->info().height, 240);
    const SensorFrame frame = nth_frame(*camera, 2);
    const Picture picture = camera->picture(frame.buffer);
    EXPECT_EQ(picture.stride_bytes, 640);
    // The ramp goes from side to side of the picture, and around it there is nothing.
    EXPECT_LT(picture.row(0)[0], 20);
    EXPECT_GT(picture.row(0)[319], 235);
    EXPECT_GT(picture.row(239)[319], 235);
    EXPECT_LT(picture.row(239)[320], 20);
    EXPECT_LT(*(picture.row(-1) + 319), 20);
  }
};

TEST_F(Pictures, GreyIsTheSameInEveryFormatThatHasIt) {
  expect_same_luma({"grey10", "grey12", "grey16", "nv12", "yuyv", "uyvy"});
}

TEST_F(Pictures, ColoursAreTheSameInRgbBgrAndMosaics) {
  const Kept rgb = shot("rgb8", kColourSquares);
  const Kept bgr = shot("bgr8", kColourSquares);
  ASSERT_EQ(rgb.bytes.size(), 3U * 640 * 480);
  Kept mirrored = bgr;
  for (std::size_t i = 0; i + 2 < mirrored.bytes.size(); i += 3) std::swap(mirrored.bytes[i], mirrored.bytes[i + 2]);
  EXPECT_TRUE(mirrored.bytes == rgb.bytes);

  for (const char* const name : {"rggb8", "grbg8", "gbrg8", "bggr8", "rggb10", "grbg10", "gbrg10", "bggr10"}) {
    ASSERT_TRUE(is_offered(name)) << name;
    const Kept mosaic = shot(name, kColourSquares);
    const BayerRed red = bayer_red(mosaic.format);
    const std::vector<std::uint8_t> samples = luma(mosaic);
    int wrong = 0;
    for (int y = 0; y < 480; ++y) {
      for (int x = 0; x < 640; ++x) {
        const bool is_red = x % 2 == red.x && y % 2 == red.y;
        const bool is_blue = x % 2 != red.x && y % 2 != red.y;
        const std::size_t at = static_cast<std::size_t>(y) * 640 + static_cast<std::size_t>(x);
        if (samples[at] != rgb.bytes[3 * at + (is_red ? 0U : is_blue ? 2U : 1U)]) ++wrong;
      }
    }
    EXPECT_EQ(wrong, 0) << name;
  }
}

TEST_F(Pictures, ChromaOfNv12IsThatOfYuyv) {
  const Kept nv12 = shot("nv12", kColourSquares);
  const Kept yuyv = shot("yuyv", kColourSquares);
  int wrong = 0;
  // Within the squares, which are larger than four rows: their borders are averaged differently.
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 640; ++x) {
      const auto colour = nv12.bytes[static_cast<std::size_t>(480 + y) * 640 + static_cast<std::size_t>(x)];
      if (colour != yuyv.bytes[static_cast<std::size_t>(2 * y) * 1280 + static_cast<std::size_t>(2 * x + 1)]) ++wrong;
    }
  }
  EXPECT_LT(wrong, 240 * 640 / 50);
}

TEST_F(Pictures, ExportedBuffersShowWhatMappedOnesDo) {
  EXPECT_TRUE(shot("yuyv", kColourSquares, Memory::kExported).bytes == shot("yuyv", kColourSquares).bytes);
}

/// Heaps whose buffers the driver can write to as they are.
std::vector<std::string> heaps() {
  std::vector<std::string> there{kLender};
  for (const char* const heap : {"/dev/dma_heap/system", "/dev/udmabuf"}) {
    if (access(heap, R_OK | W_OK) == 0) there.emplace_back(heap);
  }
  return there;
}

TEST_F(Pictures, ImportedBuffersShowWhatMappedOnesDo) {
  const Kept yuyv = shot("yuyv", kColourSquares);
  const Kept grey = shot("grey8", kGreyRamp);
  const int lent = lent_buffers;
  for (const std::string& heap : heaps()) {
    EXPECT_TRUE(shot("yuyv", kColourSquares, Memory::kImported, heap).bytes == yuyv.bytes) << heap;
    EXPECT_TRUE(shot("grey8", kGreyRamp, Memory::kImported, heap).bytes == grey.bytes) << heap;
  }
  EXPECT_GE(lent_buffers - lent, 16);
}

// No memory of another camera's: a dma-buf of this process's own, as Debian 13's kernel makes it.
TEST_F(Pictures, MemoryOfTheProcesssOwnIsWrittenIntoByTheDriver) {
  const std::string heap = "/dev/udmabuf";
  ASSERT_EQ(access(heap.c_str(), R_OK | W_OK), 0) << "no " << heap;
  for (const char* const format : {"yuyv", "grey8", "nv12"}) {
    EXPECT_TRUE(shot(format, kColourSquares, Memory::kImported, heap).bytes == shot(format, kColourSquares).bytes)
        << format;
  }
}

// Each frame of a second lies where its lease says, in the heap's memory, until it is given back.
TEST_F(Pictures, ImportedBuffersAreLeasedAndComeRoundManyTimes) {
  for (const std::string& heap : heaps()) {
    Settings wanted = settings();
    wanted.memory = Memory::kImported;
    wanted.heap = heap;
    const auto camera = started(wanted);
    std::set<const std::uint8_t*> places;
    std::vector<SensorFrame> held;
    for (int i = 0; i < 50; ++i) {
      const SensorFrame frame = nth_frame(*camera);
      EXPECT_FALSE(frame.damaged);
      places.insert(camera->picture(frame.buffer).data);
      held.push_back(frame);
      if (held.size() < 3) continue;
      camera->give_back(held.front().buffer);
      held.erase(held.begin());
    }
    EXPECT_EQ(places.size(), camera->info().buffers) << heap;
    EXPECT_EQ(camera->counters().lost, 0U) << heap;
  }
}

TEST_F(Pictures, AHeapThatIsNotThereIsALineWithThoseThatAre) {
  Settings wanted = settings();
  wanted.memory = Memory::kImported;
  wanted.heap = "/dev/dma_heap/none";
  EXPECT_THAT(refusal([&] { (void)open(wanted); }), AllOf(HasSubstr("no memory from /dev/dma_heap/none"),
                                                          AnyOf(HasSubstr("there are /dev/"), HasSubstr("has none"))));
}

TEST_F(Pictures, TheMultiPlanarInterfaceShowsTheSame) {
  const Kept grey = shot("grey8", kGreyRamp);
  const Kept nv12 = shot("nv12", kColourSquares);
  load_vivid("multiplanar=2,2");
  SetUp();
  EXPECT_TRUE(shot("grey8", kGreyRamp).bytes == grey.bytes);
  EXPECT_TRUE(shot("nv12", kColourSquares).bytes == nv12.bytes);
  EXPECT_TRUE(shot("nv12m", kColourSquares).bytes == nv12.bytes);
  EXPECT_TRUE(shot("nv12m", kColourSquares, Memory::kExported).bytes == nv12.bytes);
  for (const std::string& heap : heaps()) {
    EXPECT_TRUE(shot("nv12m", kColourSquares, Memory::kImported, heap).bytes == nv12.bytes) << heap;
    EXPECT_TRUE(shot("grey8", kGreyRamp, Memory::kImported, heap).bytes == grey.bytes) << heap;
  }
  expect_same_luma({"grey10", "grey12", "grey16", "nv12", "nv12m", "yuyv", "uyvy"});
  Settings wanted = settings();
  wanted.format = "nv12m";  // 320 x 180 are 14 pages and a bit
  EXPECT_THAT(refusal([&] { (void)open(wanted); }), AllOf(HasSubstr("multiple of 4096"), HasSubstr("or nv12")));
  load_vivid("");
}

TEST_F(Pictures, BuffersThatTheProcessorCachesAndOfContiguousMemoryShowTheSame) {
  const Kept grey = shot("grey8", kGreyRamp);
  for (const char* const parameters : {"cache_hints=1,1", "allocators=1,1", "allocators=1,1 cache_hints=1,1"}) {
    load_vivid(parameters);
    SetUp();
    EXPECT_TRUE(shot("grey8", kGreyRamp).bytes == grey.bytes) << parameters;
    EXPECT_TRUE(shot("grey8", kGreyRamp, Memory::kExported).bytes == grey.bytes) << parameters << ", exported";
  }
  load_vivid("");
}

// Not of a webcam: vivid's HDMI input has a scaler and a composer behind it.
TEST_F(Pictures, OfAFrameThatIsComposedOnlyTheFilledPartIsThePicture) {
  load_vivid("input_types=3,3");
  check_composed();
  load_vivid("");
}

// The address of what the pipeline reads lies in the device's own mapping: nothing was copied before.
TEST_F(Pictures, IngestReadsTheBufferOfTheDriver) {
  Other(kLeft).set("Test Pattern", kGreyRamp);
  const auto camera = started(settings());
  const SensorFrame frame = nth_frame(*camera, 2);
  const Picture picture = camera->picture(frame.buffer);
  const auto address = reinterpret_cast<std::uintptr_t>(picture.data);
  const std::uintptr_t end = address + static_cast<std::uintptr_t>(picture.stride_bytes) * 180;

  bool within = false;
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    std::uintptr_t low = 0;
    std::uintptr_t high = 0;
    if (line.find(kLeft) == std::string::npos) continue;
    if (std::sscanf(line.c_str(), "%" SCNxPTR "-%" SCNxPTR, &low, &high) == 2) {
      within = within || (low <= address && end <= high);
    }
  }
  EXPECT_TRUE(within);

  Arena arena;
  const IngestPlanes planes{arena.image<std::uint8_t>(320, 180), {}, {}};
  auto ingest = Ingest::create(320, arena);
  ASSERT_TRUE(ingest.has_value());
  ingest->run(picture, planes, nullptr);
  for (int y = 0; y < 180; ++y) {
    ASSERT_TRUE(std::equal(planes.y.row(y), planes.y.row(y) + 320, picture.row(y))) << y;
  }
}

}  // namespace
}  // namespace stereotrack::capture::v4l2::test
