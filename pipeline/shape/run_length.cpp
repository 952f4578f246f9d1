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

}  // namespace

RunCount find_components(ImageView<const std::uint8_t> mask, RunKind kind, std::span<Run> runs) noexcept {
  const bool object = kind == RunKind::kObject;
  const std::int32_t reach = object ? 1 : 0;  // 8-connected runs also touch diagonally
  RunCount count;
  const auto capacity = static_cast<std::int32_t>(runs.size());
  std::array<std::uint64_t, kChunk + 1> words;
  std::int32_t previous = 0;  // first run of the row above
  for (int y = 0; y < mask.height; ++y) {
    const std::uint8_t* row = mask.row(y);
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
    for (int x = 0; x < mask.width; x += 64) {
      const int left = mask.width - x;
      const int word = x / 64 % kChunk;
      if (word == 0) row_bits(row + x, std::min(left, 64 * kChunk), words.data());
      std::uint64_t bits = words[static_cast<std::size_t>(word)] ^ (object ? 0 : ~std::uint64_t{0});
      if (left < 64) bits &= (std::uint64_t{1} << left) - 1;
      for (std::uint64_t edges = bits ^ (bits << 1 | before); edges != 0; edges &= edges - 1) {
        toggle(x + std::countr_zero(edges));
      }
    }
    if (before != 0) toggle(mask.width);
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

}  // namespace stereotrack
