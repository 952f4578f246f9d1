#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "pipeline/frame.hpp"

namespace stereotrack::capture::libcamera {

/// A way in which libcamera lays out pictures, and what it is to us.
///
/// Its names are those of DRM, which spells the bytes of a little-endian word from the highest down: what libcamera
/// calls RGB888 lies as blue, green, red in memory, our bgr8; its BGR888 is our rgb8. YUYV, UYVY and mosaics are spelt
/// in the order of memory.
struct KnownFormat {
  std::string_view name;   ///< as users write it
  std::uint32_t fourcc;    ///< of DRM
  std::uint64_t modifier;  ///< 0, or packed as MIPI CSI-2 sends it
  PixelFormat format;
};

inline constexpr std::uint64_t kPackedCsi2 = 0x0B00'0000'0000'0001U;

/// In the order in which `auto` takes them: grey first, by bytes a pixel; then colour, by the cost of reading it.
[[nodiscard]] std::span<const KnownFormat> known_formats() noexcept;

/// Null: none of ours.
[[nodiscard]] const KnownFormat* find_format(std::uint32_t fourcc, std::uint64_t modifier) noexcept;
[[nodiscard]] const KnownFormat* find_format(std::string_view name) noexcept;

/// "BG24", "BG10/packed", "pBAA/0x123"; characters that do not print as '?'.
[[nodiscard]] std::string format_text(std::uint32_t fourcc, std::uint64_t modifier);

}  // namespace stereotrack::capture::libcamera
