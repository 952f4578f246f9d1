#pragma once

#include <cstdint>

namespace stereotrack {

/// A row of pixels as bits: pixel x is bit x % 64 of word x / 64.
[[nodiscard]] constexpr int words_of(int width) noexcept { return (width + 63) / 64; }

/// What DisparityFilter asks of a row of `width` disparities and the one above it. Neighbours are alike that both have
/// a disparity and differ by at most `step`.
struct RowBitsTask {
  const std::uint16_t* row;
  const std::uint16_t* above;
  int width;
  int step;  ///< [1/16 px], 0..65535
};

/// words_of(width) words each; bits from `width` on are 0.
struct RowBits {
  std::uint64_t* known;       ///< has a disparity
  std::uint64_t* with_left;   ///< and is like its left neighbour
  std::uint64_t* with_above;  ///< or like the one above
};

/// The reference is the definition, which every instruction set equals bit for bit. Any thread, no state.
void row_bits(const RowBitsTask& task, const RowBits& bits) noexcept;
void row_bits_reference(const RowBitsTask& task, const RowBits& bits) noexcept;

/// Bits of pixels that are not 0.
void wanted_bits(const std::uint8_t* mask, int width, std::uint64_t* bits) noexcept;
void wanted_bits_reference(const std::uint8_t* mask, int width, std::uint64_t* bits) noexcept;

}  // namespace stereotrack
