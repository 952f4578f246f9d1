#include "drivers/capture/libcamera/formats.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <vector>

#include "drivers/capture/libcamera/libcamera.hpp"

namespace stereotrack::capture::libcamera {
namespace {

constexpr std::uint32_t code(const char (&text)[5]) noexcept {
  std::uint32_t word = 0;
  for (int i = 3; i >= 0; --i) word = word << 8 | static_cast<std::uint8_t>(text[i]);
  return word;
}

constexpr std::array kKnown = {
    KnownFormat{"grey8", code("R8  "), 0, PixelFormat::kGrey8},
    KnownFormat{"grey10p", code("R10 "), kPackedCsi2, PixelFormat::kGrey10Packed},
    KnownFormat{"grey12p", code("R12 "), kPackedCsi2, PixelFormat::kGrey12Packed},
    KnownFormat{"grey10", code("R10 "), 0, PixelFormat::kGrey10},
    KnownFormat{"grey12", code("R12 "), 0, PixelFormat::kGrey12},
    KnownFormat{"grey16", code("R16 "), 0, PixelFormat::kGrey16},
    KnownFormat{"nv12", code("NV12"), 0, PixelFormat::kNv12},
    KnownFormat{"rggb8", code("RGGB"), 0, PixelFormat::kBayerRggb8},
    KnownFormat{"grbg8", code("GRBG"), 0, PixelFormat::kBayerGrbg8},
    KnownFormat{"gbrg8", code("GBRG"), 0, PixelFormat::kBayerGbrg8},
    KnownFormat{"bggr8", code("BA81"), 0, PixelFormat::kBayerBggr8},
    KnownFormat{"rggb10p", code("RG10"), kPackedCsi2, PixelFormat::kBayerRggb10Packed},
    KnownFormat{"grbg10p", code("BA10"), kPackedCsi2, PixelFormat::kBayerGrbg10Packed},
    KnownFormat{"gbrg10p", code("GB10"), kPackedCsi2, PixelFormat::kBayerGbrg10Packed},
    KnownFormat{"bggr10p", code("BG10"), kPackedCsi2, PixelFormat::kBayerBggr10Packed},
    KnownFormat{"yuyv", code("YUYV"), 0, PixelFormat::kYuyv},
    KnownFormat{"uyvy", code("UYVY"), 0, PixelFormat::kUyvy},
    KnownFormat{"rggb10", code("RG10"), 0, PixelFormat::kBayerRggb10},
    KnownFormat{"grbg10", code("BA10"), 0, PixelFormat::kBayerGrbg10},
    KnownFormat{"gbrg10", code("GB10"), 0, PixelFormat::kBayerGbrg10},
    KnownFormat{"bggr10", code("BG10"), 0, PixelFormat::kBayerBggr10},
    KnownFormat{"bgr8", code("RG24"), 0, PixelFormat::kBgr8},
    KnownFormat{"rgb8", code("BG24"), 0, PixelFormat::kRgb8},
};

}  // namespace

std::span<const KnownFormat> known_formats() noexcept { return kKnown; }

const KnownFormat* find_format(std::uint32_t fourcc, std::uint64_t modifier) noexcept {
  const auto found = std::find_if(kKnown.begin(), kKnown.end(),
                                  [&](const auto& f) { return f.fourcc == fourcc && f.modifier == modifier; });
  return found == kKnown.end() ? nullptr : &*found;
}

const KnownFormat* find_format(std::string_view name) noexcept {
  const auto found = std::find_if(kKnown.begin(), kKnown.end(), [&](const auto& f) { return f.name == name; });
  return found == kKnown.end() ? nullptr : &*found;
}

std::string format_text(std::uint32_t fourcc, std::uint64_t modifier) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) {
    const char letter = static_cast<char>(fourcc >> shift & 0x7F);
    text += letter < ' ' || letter > '~' ? '?' : letter;
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  if (modifier == kPackedCsi2) return text + "/packed";
  if (modifier == 0) return text;
  char number[32];
  (void)std::snprintf(number, sizeof number, "/0x%llx", static_cast<unsigned long long>(modifier));
  return text + number;
}

std::vector<std::string_view> format_names() {
  std::vector<std::string_view> names = {"auto"};
  for (const KnownFormat& known : kKnown) names.push_back(known.name);
  return names;
}

}  // namespace stereotrack::capture::libcamera
