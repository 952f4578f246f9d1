#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "pipeline/core/time.hpp"

namespace stereotrack {

/// How a picture lies in memory. Chroma is ITU-R BT.601, 128 = no colour. A Bayer mosaic's name says which colours its
/// first square of 2 x 2 pixels has, row by row.
enum class PixelFormat : std::uint8_t {
  kGrey8,   ///< one byte a pixel, luma
  kBgr8,    ///< three bytes a pixel, blue green red, full range
  kYuyv,    ///< two bytes a pixel, Y Cb Y Cr of two neighbours; width even
  kUyvy,    ///< the same as Cb Y Cr Y
  kNv12,    ///< height rows of Y, one byte a pixel, then height / 2 rows of Cb Cr for squares of 2 x 2 pixels, as long
            ///< and as far apart; width and height even
  kGrey10,  ///< two bytes a pixel, little-endian, luma in bits 9..0
  kGrey12,  ///< likewise, in bits 11..0
  kGrey16,  ///< likewise, in bits 15..0
  kGrey10Packed,  ///< MIPI RAW10, four pixels in five bytes: bits 9..2 of each, then a byte of their bits 1..0, the
                  ///< first pixel's lowest; width a multiple of 4
  kGrey12Packed,  ///< MIPI RAW12, two pixels in three bytes: bits 11..4 of each, then a byte of their bits 3..0, the
                  ///< first pixel's lowest; width even
  kRgb8,          ///< three bytes a pixel, red green blue, full range
  kBayerRggb8,    ///< a mosaic, one byte a pixel; width and height even
  kBayerGrbg8,
  kBayerGbrg8,
  kBayerBggr8,
  kBayerRggb10,  ///< a mosaic, two bytes a pixel as in kGrey10
  kBayerGrbg10,
  kBayerGbrg10,
  kBayerBggr10,
  kBayerRggb10Packed,  ///< a mosaic, packed as in kGrey10Packed; width a multiple of 4, height even
  kBayerGrbg10Packed,
  kBayerGbrg10Packed,
  kBayerBggr10Packed,
};
inline constexpr int kPixelFormats = 23;
static_assert(static_cast<int>(PixelFormat::kBayerBggr10Packed) + 1 == kPixelFormats);

[[nodiscard]] constexpr bool is_bayer(PixelFormat format) noexcept { return format >= PixelFormat::kBayerRggb8; }

/// Where red lies in each square of 2 x 2 pixels of a Bayer mosaic; blue lies across from it.
struct BayerRed {
  int x = 0;  ///< 0, 1
  int y = 0;  ///< 0, 1
};
[[nodiscard]] constexpr BayerRed bayer_red(PixelFormat format) noexcept {
  const int pattern = (static_cast<int>(format) - static_cast<int>(PixelFormat::kBayerRggb8)) % 4;
  return {pattern % 2, pattern / 2};
}

[[nodiscard]] constexpr bool has_colour(PixelFormat format) noexcept {
  switch (format) {
    case PixelFormat::kGrey8:
    case PixelFormat::kGrey10:
    case PixelFormat::kGrey12:
    case PixelFormat::kGrey16:
    case PixelFormat::kGrey10Packed:
    case PixelFormat::kGrey12Packed: return false;
    default: return true;
  }
}

/// How the samples of a format that has one a pixel, luma or mosaic, lie in a row.
enum class SampleLayout : std::uint8_t { kBytes, kWords10, kWords12, kWords16, kPacked10, kPacked12 };

/// Of kGrey*, of Bayer mosaics, of the luma rows of kNv12; kBytes for what has several samples a pixel.
[[nodiscard]] constexpr SampleLayout sample_layout(PixelFormat format) noexcept {
  switch (format) {
    case PixelFormat::kGrey10:
    case PixelFormat::kBayerRggb10:
    case PixelFormat::kBayerGrbg10:
    case PixelFormat::kBayerGbrg10:
    case PixelFormat::kBayerBggr10: return SampleLayout::kWords10;
    case PixelFormat::kGrey12: return SampleLayout::kWords12;
    case PixelFormat::kGrey16: return SampleLayout::kWords16;
    case PixelFormat::kGrey10Packed:
    case PixelFormat::kBayerRggb10Packed:
    case PixelFormat::kBayerGrbg10Packed:
    case PixelFormat::kBayerGbrg10Packed:
    case PixelFormat::kBayerBggr10Packed: return SampleLayout::kPacked10;
    case PixelFormat::kGrey12Packed: return SampleLayout::kPacked12;
    default: return SampleLayout::kBytes;
  }
}

/// The 8 most significant bits of sample x of a row. The others are cut off and not rounded: what is saturated stays
/// so, nothing else becomes so, and it is what a sensor gives when it is set to 8 bits. Bits above the sample's, which
/// are 0, do not matter.
[[nodiscard]] constexpr std::uint8_t sample_of(SampleLayout layout, const std::uint8_t* row, int x) noexcept {
  const auto word = [&](int bits) {
    return static_cast<std::uint8_t>((row[2 * x] | row[2 * x + 1] << 8) >> (bits - 8) & 0xFF);
  };
  switch (layout) {
    case SampleLayout::kWords10: return word(10);
    case SampleLayout::kWords12: return word(12);
    case SampleLayout::kWords16: return word(16);
    case SampleLayout::kPacked10: return row[x + x / 4];
    case SampleLayout::kPacked12: return row[x + x / 2];
    case SampleLayout::kBytes: break;
  }
  return row[x];
}

/// Bytes of that many samples of a row; what is packed together counts as a whole.
[[nodiscard]] constexpr std::size_t row_bytes(SampleLayout layout, int samples) noexcept {
  const auto count = static_cast<std::size_t>(samples);
  switch (layout) {
    case SampleLayout::kWords10:
    case SampleLayout::kWords12:
    case SampleLayout::kWords16: return 2 * count;
    case SampleLayout::kPacked10: return (count + 3) / 4 * 5;
    case SampleLayout::kPacked12: return (count + 1) / 2 * 3;
    case SampleLayout::kBytes: break;
  }
  return count;
}

/// Bytes of a row of that many pixels; kNv12: of either kind of row.
[[nodiscard]] constexpr std::size_t row_bytes(PixelFormat format, int width) noexcept {
  switch (format) {
    case PixelFormat::kBgr8:
    case PixelFormat::kRgb8: return 3 * static_cast<std::size_t>(width);
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy: return 2 * static_cast<std::size_t>(width);
    default: return row_bytes(sample_layout(format), width);
  }
}

/// Rows in memory of a picture of that many pixel rows.
[[nodiscard]] constexpr int memory_rows(PixelFormat format, int height) noexcept {
  return format == PixelFormat::kNv12 ? height + height / 2 : height;
}

/// Bytes of a picture whose rows lie close together.
[[nodiscard]] constexpr std::size_t picture_bytes(PixelFormat format, int width, int height) noexcept {
  return row_bytes(format, width) * static_cast<std::size_t>(memory_rows(format, height));
}

/// Whether a picture of that size can have the format.
[[nodiscard]] constexpr bool fits_format(PixelFormat format, int width, int height) noexcept {
  const SampleLayout layout = sample_layout(format);
  const bool in_squares = format == PixelFormat::kNv12 || is_bayer(format);
  const bool in_pairs =
      in_squares || format == PixelFormat::kYuyv || format == PixelFormat::kUyvy || layout == SampleLayout::kPacked12;
  const int together = layout == SampleLayout::kPacked10 ? 4 : in_pairs ? 2 : 1;
  return width % together == 0 && !(in_squares && height % 2 != 0);
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

/// What was exposed at one moment by both sensors. `right` is empty for a mono source, and where its sensor is gone.
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
