#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

namespace stereotrack {

/// Which pixels of a row are set, 64 a word: bit i of word w says that pixels[64 w + i] is not 0. Bits after the row's
/// end are 0. words: (width + 63) / 64, and one more that may be written. The reference is the definition, which every
/// instruction set of pipeline/core/simd.hpp equals bit for bit. About 0.02 ns a pixel. Any thread, no state.
void row_bits(const std::uint8_t* pixels, int width, std::uint64_t* words) noexcept;
void row_bits_reference(const std::uint8_t* pixels, int width, std::uint64_t* words) noexcept;

/// The other way: 255 where a row's bit is set, else 0. Plain C++: words are mostly all of one kind.
void fill_from_bits(const std::uint64_t* words, int width, std::uint8_t* pixels) noexcept;

/// 0 where a row's bit is set; the other pixels stay as they are. Plain C++, likewise.
void clear_where_bits(const std::uint64_t* words, int width, std::uint8_t* pixels) noexcept;

/// Calls fn(begin, end) for each run of set pixels of a row, from left to right. fn may change the row from `begin` to
/// `end`. A step costs by run, not by pixel.
template <class Fn>
void for_each_set_run(const std::uint8_t* pixels, int width, Fn&& fn) noexcept {
  constexpr int kWords = 32;
  constexpr int kPixels = 64 * kWords;
  std::array<std::uint64_t, kWords + 1> words;
  std::uint64_t before = 0;  // is the pixel before this word set?
  int begin = 0;
  for (int start = 0; start < width; start += kPixels) {
    const int count = std::min(width - start, kPixels);
    row_bits(pixels + start, count, words.data());
    for (int w = 0; 64 * w < count; ++w) {
      const std::uint64_t bits = words[static_cast<std::size_t>(w)];
      // A run begins and ends where a bit differs from the one before it.
      for (std::uint64_t edges = bits ^ (bits << 1 | before); edges != 0; edges &= edges - 1) {
        const int x = start + 64 * w + std::countr_zero(edges);
        before ^= 1U;
        if (before != 0) {
          begin = x;
        } else {
          fn(begin, x);
        }
      }
    }
  }
  if (before != 0) fn(begin, width);
}

}  // namespace stereotrack
