#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "pipeline/frame.hpp"

namespace stereotrack {

// Rows of ingest(). Each has its definition beside it, NAME_reference(), which every instruction set of
// pipeline/core/simd.hpp equals bit for bit. Each byte of the source is read once. Any thread, no state.

/// A row of each plane. cb and cr null: luma alone is wanted.
struct PlaneRow {
  std::uint8_t* y = nullptr;
  std::uint8_t* cb = nullptr;
  std::uint8_t* cr = nullptr;
};

/// A row of bytes as it is. Not memcpy(), which reads some bytes twice.
void copy_row(const std::uint8_t* pixels, int width, std::uint8_t* out) noexcept;
void copy_row_reference(const std::uint8_t* pixels, int width, std::uint8_t* out) noexcept;

/// sample_of() each pixel of a row, row_bytes() of them. width: what the layout allows. About 0.05 ns a pixel.
void unpack_row(const std::uint8_t* row, SampleLayout layout, int width, std::uint8_t* out) noexcept;
void unpack_row_reference(const std::uint8_t* row, SampleLayout layout, int width, std::uint8_t* out) noexcept;

/// Luma (3.1) and chroma (3.18, 3.19) of a row of kBgr8 or kRgb8, 3 width bytes. About 0.06 ns a pixel.
enum class ColourOrder : std::uint8_t { kBlueFirst, kRedFirst };
void colour_row(const std::uint8_t* pixels, ColourOrder order, int width, const PlaneRow& out) noexcept;
void colour_row_reference(const std::uint8_t* pixels, ColourOrder order, int width, const PlaneRow& out) noexcept;

/// A row of a Bayer mosaic's samples with its neighbours. Of each, columns -1 to width are read.
struct BayerRows {
  const std::uint8_t* above = nullptr;
  const std::uint8_t* row = nullptr;
  const std::uint8_t* below = nullptr;
  bool red = true;           ///< its samples that are not green are red, else blue
  bool green_first = false;  ///< the first sample is green
};

/// Luma and chroma likewise of a row whose missing colours are the mean of those beside them:
///     at red or blue     green = (N + S + W + E + 2) / 4    the other = (NW + NE + SW + SE + 2) / 4
///     at green           the row's colour = (W + E + 1) / 2    the other = (N + S + 1) / 2
/// width: even. About 0.1 ns a pixel.
void bayer_row(const BayerRows& rows, int width, const PlaneRow& out) noexcept;
void bayer_row_reference(const BayerRows& rows, int width, const PlaneRow& out) noexcept;

/// A row of kYuyv (Y Cb Y Cr) or kUyvy (Cb Y Cr Y) unpacked, 2 width bytes; a pair's chroma is that of both its pixels.
/// width: even. About 0.03 ns a pixel.
enum class PackedOrder : std::uint8_t { kLumaFirst, kChromaFirst };
void packed_row(const std::uint8_t* pixels, PackedOrder order, int width, const PlaneRow& out) noexcept;
void packed_row_reference(const std::uint8_t* pixels, PackedOrder order, int width, const PlaneRow& out) noexcept;

/// A chroma row of kNv12 (Cb Cr), width bytes, likewise. width: even.
void chroma_pairs_row(const std::uint8_t* pairs, int width, std::uint8_t* cb, std::uint8_t* cr) noexcept;
void chroma_pairs_row_reference(const std::uint8_t* pairs, int width, std::uint8_t* cb, std::uint8_t* cr) noexcept;

/// How often each grey level occurs.
using Histogram = std::array<std::uint32_t, 256>;

/// Counts the pixels of rows. Neighbours are mostly alike, and one table would wait for its own last count: so there
/// are four. About 0.3 ns a pixel; plain C++, as no instruction set counts faster.
class HistogramCounter {
 public:
  void add_row(const std::uint8_t* pixels, int width) noexcept;
  [[nodiscard]] Histogram sum() const noexcept;

 private:
  std::array<Histogram, 4> tables_{};
};

}  // namespace stereotrack
