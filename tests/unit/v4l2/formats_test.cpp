#include "drivers/capture/v4l2/formats.hpp"

#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <set>

#include "drivers/capture/v4l2/layout.hpp"
#include "drivers/capture/v4l2/v4l2.hpp"

namespace stereotrack::capture::v4l2 {
namespace {

TEST(Formats, EachNameAndCodeStandsOnce) {
  std::set<std::string_view> names;
  std::set<std::uint32_t> codes;
  std::set<PixelFormat> formats;
  for (const KnownFormat& known : known_formats()) {
    EXPECT_TRUE(names.insert(known.name).second) << known.name;
    EXPECT_TRUE(codes.insert(known.fourcc).second) << known.name;
    formats.insert(known.format);
    EXPECT_EQ(find_format(known.fourcc), &known);
    EXPECT_EQ(find_format(known.name), &known);
  }
  // All that the pipeline reads can come from a camera.
  EXPECT_EQ(formats.size(), static_cast<std::size_t>(kPixelFormats));
  EXPECT_EQ(format_names().size(), known_formats().size() + 1);
  EXPECT_EQ(find_format(V4L2_PIX_FMT_MJPEG), nullptr);
  EXPECT_EQ(find_format(std::string_view("auto")), nullptr);
}

TEST(Formats, GreyComesBeforeColourAndIsSortedByBytes) {
  bool colour = false;
  std::size_t bytes = 0;
  for (const KnownFormat& known : known_formats()) {
    if (has_colour(known.format)) {
      colour = true;
      continue;
    }
    EXPECT_FALSE(colour) << known.name;
    EXPECT_GE(picture_bytes(known.format, 64, 1), bytes) << known.name;
    bytes = picture_bytes(known.format, 64, 1);
  }
}

TEST(Formats, CodesAreReadable) {
  EXPECT_EQ(fourcc_text(V4L2_PIX_FMT_YUYV), "YUYV");
  EXPECT_EQ(fourcc_text(V4L2_PIX_FMT_Y16), "Y16");
  EXPECT_EQ(fourcc_text(0x01'02'03'41U), "A???");
  EXPECT_EQ(fourcc_text(V4L2_PIX_FMT_Y16_BE), "Y16");  // its highest bit says big-endian
}

TEST(Layout, APictureWithinAFrameBeginsAtItsOffset) {
  Layout layout;
  layout.format = find_format(std::string_view("grey10p"));
  layout.stride = 100;
  layout.left = 8;
  layout.top = 3;
  EXPECT_EQ(layout.offset(), 3U * 100 + 10);
}

}  // namespace
}  // namespace stereotrack::capture::v4l2
