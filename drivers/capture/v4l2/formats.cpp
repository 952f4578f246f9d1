#include "drivers/capture/v4l2/formats.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <vector>

#include "drivers/capture/v4l2/v4l2.hpp"

namespace stereotrack::capture::v4l2 {
namespace {

// Younger than the headers of some systems that we build on.
constexpr std::uint32_t kY12P = v4l2_fourcc('Y', '1', '2', 'P');

constexpr std::array kKnown = {
    KnownFormat{"grey8", V4L2_PIX_FMT_GREY, PixelFormat::kGrey8},
    KnownFormat{"grey10p", V4L2_PIX_FMT_Y10P, PixelFormat::kGrey10Packed},
    KnownFormat{"grey12p", kY12P, PixelFormat::kGrey12Packed},
    KnownFormat{"grey10", V4L2_PIX_FMT_Y10, PixelFormat::kGrey10},
    KnownFormat{"grey12", V4L2_PIX_FMT_Y12, PixelFormat::kGrey12},
    KnownFormat{"grey16", V4L2_PIX_FMT_Y16, PixelFormat::kGrey16},
    KnownFormat{"nv12", V4L2_PIX_FMT_NV12, PixelFormat::kNv12},
    KnownFormat{"nv12m", V4L2_PIX_FMT_NV12M, PixelFormat::kNv12, 2},
    KnownFormat{"rggb8", V4L2_PIX_FMT_SRGGB8, PixelFormat::kBayerRggb8},
    KnownFormat{"grbg8", V4L2_PIX_FMT_SGRBG8, PixelFormat::kBayerGrbg8},
    KnownFormat{"gbrg8", V4L2_PIX_FMT_SGBRG8, PixelFormat::kBayerGbrg8},
    KnownFormat{"bggr8", V4L2_PIX_FMT_SBGGR8, PixelFormat::kBayerBggr8},
    KnownFormat{"rggb10p", V4L2_PIX_FMT_SRGGB10P, PixelFormat::kBayerRggb10Packed},
    KnownFormat{"grbg10p", V4L2_PIX_FMT_SGRBG10P, PixelFormat::kBayerGrbg10Packed},
    KnownFormat{"gbrg10p", V4L2_PIX_FMT_SGBRG10P, PixelFormat::kBayerGbrg10Packed},
    KnownFormat{"bggr10p", V4L2_PIX_FMT_SBGGR10P, PixelFormat::kBayerBggr10Packed},
    KnownFormat{"yuyv", V4L2_PIX_FMT_YUYV, PixelFormat::kYuyv},
    KnownFormat{"uyvy", V4L2_PIX_FMT_UYVY, PixelFormat::kUyvy},
    KnownFormat{"rggb10", V4L2_PIX_FMT_SRGGB10, PixelFormat::kBayerRggb10},
    KnownFormat{"grbg10", V4L2_PIX_FMT_SGRBG10, PixelFormat::kBayerGrbg10},
    KnownFormat{"gbrg10", V4L2_PIX_FMT_SGBRG10, PixelFormat::kBayerGbrg10},
    KnownFormat{"bggr10", V4L2_PIX_FMT_SBGGR10, PixelFormat::kBayerBggr10},
    KnownFormat{"bgr8", V4L2_PIX_FMT_BGR24, PixelFormat::kBgr8},
    KnownFormat{"rgb8", V4L2_PIX_FMT_RGB24, PixelFormat::kRgb8},
};

}  // namespace

std::span<const KnownFormat> known_formats() noexcept { return kKnown; }

const KnownFormat* find_format(std::uint32_t fourcc) noexcept {
  const auto found = std::find_if(kKnown.begin(), kKnown.end(), [&](const auto& f) { return f.fourcc == fourcc; });
  return found == kKnown.end() ? nullptr : &*found;
}

const KnownFormat* find_format(std::string_view name) noexcept {
  const auto found = std::find_if(kKnown.begin(), kKnown.end(), [&](const auto& f) { return f.name == name; });
  return found == kKnown.end() ? nullptr : &*found;
}

std::string fourcc_text(std::uint32_t fourcc) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) {
    const char letter = static_cast<char>(fourcc >> shift & 0x7F);
    text += letter < ' ' || letter > '~' ? '?' : letter;
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

std::vector<std::string_view> format_names() {
  std::vector<std::string_view> names = {"auto"};
  for (const KnownFormat& known : kKnown) names.push_back(known.name);
  return names;
}

}  // namespace stereotrack::capture::v4l2
