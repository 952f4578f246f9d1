#pragma once

#include <cstdint>

#include "pipeline/core/image_view.hpp"

namespace stereotrack {

/// Whole raw pixel; (-1, -1) where the canvas shows nothing of the raw picture.
struct RawPixel {
  std::int16_t x = -1;
  std::int16_t y = -1;
  [[nodiscard]] bool valid() const noexcept { return x >= 0; }
  friend bool operator==(const RawPixel&, const RawPixel&) = default;
};

/// The map of one view, from canvas pixels to places of the raw picture in 1/kSubPixels px.
struct RemapTable {
  static constexpr int kSubPixels = 32;
  static constexpr int kFractionBits = 6;  ///< of each fraction, which reach from 0 to kSubPixels
  static constexpr int kBlock = 8;         ///< canvas pixels that are mapped together

  ImageView<RawPixel> corner;          ///< upper left of the four raw pixels that are mixed
  ImageView<std::uint16_t> fractions;  ///< a + 64 b [1/32 px], of the columns and of the rows
  ImageView<std::uint8_t> mask;        ///< 255 where the corner is valid
  // For kBlock pixels in a row whose corners lie within 15 columns and 2 rows of the raw picture, as they do unless the
  // picture is turned or shrunk a lot: a 16 x 3 window, and each corner's place in it.
  ImageView<RawPixel> window;     ///< its upper left, by block; invalid where there is none
  ImageView<std::uint8_t> place;  ///< column, and kSecondRow if it is in the second row
  static constexpr std::uint8_t kSecondRow = 16;

  /// The map of columns [begin, end) alone. begin: a multiple of kBlock.
  [[nodiscard]] RemapTable columns(int begin, int end) const noexcept;

  /// Fills `window` and `place` from the rest. Set-up only.
  void find_windows(int raw_width, int raw_height) noexcept;
};

/// One canvas row from the raw picture; 0 where the mask is 0.
///     kBilinear: out = (sum of w_i p_i + 512) / 1024,  w = (32 - a | a)(32 - b | b)
///     kNearest:  out = p of the nearest of the four, the right and the lower one if halfway
/// The reference is the definition, which every instruction set of pipeline/core/simd.hpp equals bit for bit. The
/// table's pictures must be the arena's: up to 16 bytes after a row are read. About 0.4 ns a pixel in windows, 2 ns
/// elsewhere. Any thread, no state.
enum class Sampling : std::uint8_t { kBilinear, kNearest };
void remap_row(ImageView<const std::uint8_t> raw, const RemapTable& table, int row, Sampling sampling,
               std::uint8_t* out) noexcept;
void remap_row_reference(ImageView<const std::uint8_t> raw, const RemapTable& table, int row, Sampling sampling,
                         std::uint8_t* out) noexcept;

}  // namespace stereotrack
