#include "drivers/capture/libcamera/formats.hpp"

#include <gtest/gtest.h>

#include <set>

#include "drivers/capture/libcamera/libcamera.hpp"
#include "drivers/capture/pixel_format_names.hpp"

namespace stereotrack::capture::libcamera {
namespace {

TEST(LibcameraFormats, EachOfOursIsThereOnceUnderItsOwnName) {
  std::set<PixelFormat> formats;
  for (const KnownFormat& known : known_formats()) {
    EXPECT_TRUE(formats.insert(known.format).second) << known.name;
    EXPECT_EQ(known.name, name_of(known.format));
    EXPECT_EQ(find_format(known.fourcc, known.modifier), &known);
    EXPECT_EQ(find_format(known.name), &known);
  }
  EXPECT_EQ(formats.size(), static_cast<std::size_t>(kPixelFormats));
  EXPECT_EQ(format_names().size(), formats.size() + 1);
}

// drm_fourcc.h: DRM_FORMAT_RGB888 "[23:0] R:G:B little endian" is 0x34324752 and lies as B, G, R.
TEST(LibcameraFormats, NamesOfDrmSpellFromTheHighestByteDown) {
  ASSERT_NE(find_format(0x34324752, 0), nullptr);
  EXPECT_EQ(find_format(0x34324752, 0)->format, PixelFormat::kBgr8);
  ASSERT_NE(find_format(0x34324742, 0), nullptr);  // DRM_FORMAT_BGR888
  EXPECT_EQ(find_format(0x34324742, 0)->format, PixelFormat::kRgb8);
}

// drm_fourcc.h: fourcc_mod_code(MIPI, 1), MIPI = 0x0b.
TEST(LibcameraFormats, PackedOnesAreToldByTheirModifier) {
  constexpr std::uint32_t kBggr10 = 0x30314742;  // "BG10"
  EXPECT_EQ(find_format(kBggr10, 0)->format, PixelFormat::kBayerBggr10);
  EXPECT_EQ(find_format(kBggr10, (std::uint64_t{0x0b} << 56) | 1)->format, PixelFormat::kBayerBggr10Packed);
  EXPECT_EQ(find_format(kBggr10, 2), nullptr);
  EXPECT_EQ(format_text(kBggr10, kPackedCsi2), "BG10/packed");
  EXPECT_EQ(format_text(kBggr10, 2), "BG10/0x2");
  EXPECT_EQ(format_text(0x20203852, 0), "R8");
  EXPECT_EQ(format_text(0x01020304, 0), "????");
}

}  // namespace
}  // namespace stereotrack::capture::libcamera
