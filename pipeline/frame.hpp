#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "pipeline/core/time.hpp"

namespace stereotrack {

/// How a picture lies in memory. Chroma is ITU-R BT.601, 128 = no colour.
enum class PixelFormat : std::uint8_t {
  kGrey8,  ///< one byte a pixel, luma
  kBgr8,   ///< three bytes a pixel, blue green red, full range
  kYuyv,   ///< two bytes a pixel, Y Cb Y Cr of two neighbours; width even
  kUyvy,   ///< the same as Cb Y Cr Y
  kNv12,   ///< height rows of Y, one byte a pixel, then height / 2 rows of Cb Cr for squares of 2 x 2 pixels, as long
           ///< and as far apart; width and height even
};

[[nodiscard]] constexpr bool has_colour(PixelFormat format) noexcept { return format != PixelFormat::kGrey8; }

/// In a row; kNv12: of either kind of row.
[[nodiscard]] constexpr int bytes_per_pixel(PixelFormat format) noexcept {
  switch (format) {
    case PixelFormat::kBgr8: return 3;
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy: return 2;
    case PixelFormat::kGrey8:
    case PixelFormat::kNv12: break;
  }
  return 1;
}

/// Rows in memory of a picture of that many pixel rows.
[[nodiscard]] constexpr int memory_rows(PixelFormat format, int height) noexcept {
  return format == PixelFormat::kNv12 ? height + height / 2 : height;
}

/// Bytes of a picture whose rows lie close together.
[[nodiscard]] constexpr std::size_t picture_bytes(PixelFormat format, int width, int height) noexcept {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(bytes_per_pixel(format)) *
         static_cast<std::size_t>(memory_rows(format, height));
}

/// Whether a picture of that size can have the format.
[[nodiscard]] constexpr bool fits_format(PixelFormat format, int width, int height) noexcept {
  const bool in_pairs = format == PixelFormat::kYuyv || format == PixelFormat::kUyvy || format == PixelFormat::kNv12;
  return !(in_pairs && width % 2 != 0) && !(format == PixelFormat::kNv12 && height % 2 != 0);
}

/// One sensor's picture as the source delivers it: raw, unrectified, owned by the source.
struct Picture {
  const std::uint8_t* data = nullptr;
  int width = 0;                    ///< [px]
  int height = 0;                   ///< [px]
  std::ptrdiff_t stride_bytes = 0;  ///< from one row to the next
  PixelFormat format = PixelFormat::kGrey8;

  [[nodiscard]] const std::uint8_t* row(int y) const noexcept { return data + y * stride_bytes; }
  [[nodiscard]] bool empty() const noexcept { return data == nullptr || width <= 0 || height <= 0; }
};

/// What was exposed at one moment by both sensors. `right` is empty for a mono source.
/// The pixels stay valid until the source is asked for the next pair.
struct FramePair {
  std::uint64_t ordinal = 0;                     ///< from 1, counts the source's pairs, unreadable ones too
  CaptureTime capture_time{};                    ///< middle of the exposure, of the left sensor where each has its own
  std::optional<std::chrono::nanoseconds> skew;  ///< right capture time - left; none: one stamp for both, or mono
  Picture left;
  Picture right;
  std::uint8_t* left_copy = nullptr;   ///< where ingest puts the picture's bytes, too (picture_bytes()); null: nowhere
  std::uint8_t* right_copy = nullptr;  ///< likewise
};

}  // namespace stereotrack
