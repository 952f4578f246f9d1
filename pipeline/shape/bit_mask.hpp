#pragma once

#include <cstddef>
#include <cstdint>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"

namespace stereotrack {

/// A mask of 64 pixels a word: bit i of a row's word w is pixel 64 w + i. Bits after the row's end are 0.
/// After a row's words there is room for one that nobody reads. Copying it copies no pixel.
struct BitMask {
  ImageView<std::uint64_t> words;
  int width = 0;   ///< [px]
  int height = 0;  ///< [px]

  /// All 0; arena.failed() where there was no memory.
  [[nodiscard]] static BitMask create(int width, int height, Arena& arena) noexcept {
    return {arena.image<std::uint64_t>(words_of(width), height), width, height};
  }
  [[nodiscard]] static constexpr int words_of(int width) noexcept { return (width + 63) / 64; }
  /// The bits of a row's last word that are pixels. width > 0.
  [[nodiscard]] static constexpr std::uint64_t last_word(int width) noexcept {
    return ~std::uint64_t{0} >> (63 - (width - 1) % 64);
  }

  [[nodiscard]] int words_a_row() const noexcept { return words_of(width); }
  [[nodiscard]] std::uint64_t* row(int y) const noexcept { return words.row(y); }
  [[nodiscard]] bool at(int x, int y) const noexcept { return (words.row(y)[x / 64] >> x % 64 & 1) != 0; }
  void set(int x, int y, bool value) const noexcept {
    std::uint64_t& word = words.row(y)[x / 64];
    const std::uint64_t bit = std::uint64_t{1} << x % 64;
    word = value ? word | bit : word & ~bit;
  }
};

}  // namespace stereotrack
