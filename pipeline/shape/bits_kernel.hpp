#pragma once

#include <cstdint>

namespace stereotrack {

/// Which pixels of a row are set, 64 a word: bit i of word w says that pixels[64 w + i] is not 0. Bits after the row's
/// end are 0. words: (width + 63) / 64, and one more that may be written. The reference is the definition, which every
/// instruction set of pipeline/core/simd.hpp equals bit for bit. About 0.02 ns a pixel. Any thread, no state.
void row_bits(const std::uint8_t* pixels, int width, std::uint64_t* words) noexcept;
void row_bits_reference(const std::uint8_t* pixels, int width, std::uint64_t* words) noexcept;

}  // namespace stereotrack
