#include "pipeline/shape/run_length.hpp"

#include <algorithm>
#include <array>
#include <bit>

#include "pipeline/shape/bits_kernel.hpp"

namespace stereotrack {
namespace {

constexpr int kChunk = 64;  // words of bits taken at a time

void join(std::span<Run> runs, std::int32_t a, std::int32_t b) noexcept {
  a = root_of(runs, a);
  b = root_of(runs, b);
  runs[std::max(a, b)].parent = std::min(a, b);
}

// word_of(y, w): word w of row y, asked for in order; bits after the row's end are ignored.
template <class WordOf>
RunCount components_of(int width, int height, RunKind kind, std::span<Run> runs, WordOf&& word_of) noexcept {
  const std::uint64_t flip = kind == RunKind::kObject ? 0 : ~std::uint64_t{0};
  const std::int32_t reach = kind == RunKind::kObject ? 1 : 0;  // 8-connected runs also touch diagonally
  RunCount count;
  const auto capacity = static_cast<std::int32_t>(runs.size());
  const int words = BitMask::words_of(width);
  std::int32_t previous = 0;  // first run of the row above
  for (int y = 0; y < height; ++y) {
    const std::int32_t first = count.kept;
    // 64 pixels a step as bits: a run begins and ends where a bit differs from the one before it. Data
    // dependent branches come once a run, not once a pixel: noise costs little more than silence.
    std::uint64_t before = 0;  // is the pixel before this word of the kind sought?
    int begin = 0;
    const auto toggle = [&](int x) noexcept {
      before ^= 1U;
      if (before != 0) {
        begin = x;
      } else if (count.kept == capacity) {
        ++count.dropped;
      } else {
        runs[count.kept] = {y, begin, x, count.kept};
        ++count.kept;
      }
    };
    for (int w = 0; w < words; ++w) {
      std::uint64_t bits = word_of(y, w) ^ flip;
      if (w == words - 1) bits &= BitMask::last_word(width);
      for (std::uint64_t edges = bits ^ (bits << 1 | before); edges != 0; edges &= edges - 1) {
        toggle(64 * w + std::countr_zero(edges));
      }
    }
    if (before != 0) toggle(width);
    std::int32_t above = previous;
    for (std::int32_t here = first; here < count.kept; ++here) {
      while (above < first && runs[above].end + reach <= runs[here].begin) ++above;
      // The last run that touches may touch the next run here too, so `above` stays on it.
      for (std::int32_t i = above; i < first && runs[i].begin < runs[here].end + reach; ++i) {
        join(runs, i, here);
        above = i;
      }
    }
    previous = first;
  }
  return count;
}

}  // namespace

RunCount find_components(ImageView<const std::uint8_t> mask, RunKind kind, std::span<Run> runs) noexcept {
  std::array<std::uint64_t, kChunk + 1> words;
  return components_of(mask.width, mask.height, kind, runs, [&](int y, int w) noexcept {
    const int x = 64 * w;
    if (w % kChunk == 0) row_bits(mask.row(y) + x, std::min(mask.width - x, 64 * kChunk), words.data());
    return words[static_cast<std::size_t>(w % kChunk)];
  });
}

RunCount find_components(const BitMask& mask, RunKind kind, std::span<Run> runs) noexcept {
  return components_of(mask.width, mask.height, kind, runs, [&](int y, int w) noexcept { return mask.row(y)[w]; });
}

}  // namespace stereotrack
