#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

#include "pipeline/frame.hpp"

namespace stereotrack::capture {

/// What people, logs, configurations and recordings call each PixelFormat, in the order of the enumeration.
inline constexpr std::array<std::string_view, kPixelFormats> kPixelFormatNames{
    "grey8",   "bgr8",    "yuyv",   "uyvy",    "nv12",    "grey10",  "grey12", "grey16",
    "grey10p", "grey12p", "rgb8",   "rggb8",   "grbg8",   "gbrg8",   "bggr8",  "rggb10",
    "grbg10",  "gbrg10",  "bggr10", "rggb10p", "grbg10p", "gbrg10p", "bggr10p"};

[[nodiscard]] constexpr std::string_view name_of(PixelFormat format) noexcept {
  return kPixelFormatNames[static_cast<std::size_t>(format)];
}

/// None: no format is called so.
[[nodiscard]] constexpr std::optional<PixelFormat> pixel_format_of(std::string_view name) noexcept {
  const auto* const found = std::find(kPixelFormatNames.begin(), kPixelFormatNames.end(), name);
  if (found == kPixelFormatNames.end()) return std::nullopt;
  return static_cast<PixelFormat>(found - kPixelFormatNames.begin());
}

static_assert(name_of(PixelFormat::kGrey8) == "grey8" && name_of(PixelFormat::kRgb8) == "rgb8" &&
              name_of(PixelFormat::kBayerBggr10Packed) == "bggr10p");

}  // namespace stereotrack::capture
