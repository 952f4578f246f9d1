#include "pipeline/stereo/disparity_filter.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "pipeline/core/simd.hpp"
#include "pipeline/stereo/median_kernel.hpp"
#include "pipeline/stereo/row_bits_kernel.hpp"

namespace stereotrack {

namespace {

/// std::popcount() is a call where the compiler may not assume the instruction.
int bits_in(std::uint64_t word) noexcept {
  word -= (word >> 1) & 0x5555'5555'5555'5555;
  word = (word & 0x3333'3333'3333'3333) + ((word >> 2) & 0x3333'3333'3333'3333);
  word = (word + (word >> 4)) & 0x0F0F'0F0F'0F0F'0F0F;
  return static_cast<int>((word * 0x0101'0101'0101'0101) >> 56);
}

/// The first bit from `from` on that is set, in words with `flip` set; 64 words if there is none.
int next_bit_of(const std::uint64_t* words, int count, int from, std::uint64_t flip) noexcept {
  int w = from / 64;
  if (w >= count) return 64 * count;
  std::uint64_t word = (words[w] ^ flip) >> (from % 64) << (from % 64);
  while (word == 0) {
    if (++w == count) return 64 * count;
    word = words[w] ^ flip;
  }
  return 64 * w + std::countr_zero(word);
}

int next_bit(const std::uint64_t* words, int count, int from) noexcept { return next_bit_of(words, count, from, 0); }
int next_clear_bit(const std::uint64_t* words, int count, int from) noexcept {
  return next_bit_of(words, count, from, ~std::uint64_t{0});
}

void clear_bits(std::uint64_t* words, int first, int last) noexcept {
  for (int w = first / 64; w <= last / 64; ++w) {
    const std::uint64_t from = ~std::uint64_t{0} << (w == first / 64 ? first % 64 : 0);
    const std::uint64_t to = ~std::uint64_t{0} >> (w == last / 64 ? 63 - last % 64 : 0);
    words[w] &= ~(from & to);
  }
}

}  // namespace

Result<DisparityFilter> DisparityFilter::create(const Config& config, int width, int height, Arena& arena) noexcept {
  constexpr int kLargestSide = 8192;
  if (width < 1 || width > kLargestSide || height < 1 || height > kLargestSide || config.speckle_size < 0 ||
      config.speckle_step < 0 || config.speckle_step > 65535 || config.fill_px < 0) {
    return fail(Fault::kBadConfig);
  }
  DisparityFilter f;
  f.config_ = config;
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  f.work_ = arena.image<std::uint16_t>(width, height);
  const auto columns = static_cast<std::size_t>(width);
  f.none_row_ = arena.array<std::uint16_t>(columns);
  const auto words = static_cast<std::size_t>(words_of(width));
  f.known_ = arena.array<std::uint64_t>(words * static_cast<std::size_t>(height));
  f.alike_ = arena.array<std::uint64_t>(5 * words);
  f.runs_before_ = arena.array<std::int32_t>(2 * words);
  f.wanted_ = arena.array<std::uint64_t>(words);
  f.starts_ = arena.array<Start>(pixels);
  f.lengths_ = arena.array<std::int32_t>(pixels);
  f.parents_ = arena.array<std::int32_t>(pixels);
  f.sizes_ = arena.array<std::int32_t>(pixels);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  std::fill(f.none_row_.begin(), f.none_row_.end(), kNoDisparity);
  return f;
}

std::int32_t DisparityFilter::root(std::int32_t run) noexcept {
  while (parents_[run] != run) {
    parents_[run] = parents_[parents_[run]];
    run = parents_[run];
  }
  return run;
}

void DisparityFilter::join(std::int32_t a, std::int32_t b) noexcept {
  a = root(a);
  b = root(b);
  parents_[std::max(a, b)] = std::min(a, b);
}

std::int32_t DisparityFilter::find_runs(ImageView<const std::uint16_t> picture) noexcept {
  std::uint64_t* with_above = alike_.data();
  Row row{alike_.data() + words_, alike_.data() + 2 * std::ptrdiff_t{words_}, runs_before_.data()};
  Row above{alike_.data() + 3 * std::ptrdiff_t{words_}, alike_.data() + 4 * std::ptrdiff_t{words_},
            runs_before_.data() + words_};
  std::int32_t runs = 0;
  for (int y = 0; y < picture.height; ++y, std::swap(row, above)) {
    row_bits({picture.row(y), y > 0 ? picture.row(y - 1) : none_row_.data(), picture.width, config_.speckle_step},
             {known(y), row.with_left, with_above});
    for (int w = 0; w < words_; ++w) {
      row.starts[w] = known(y)[w] & ~row.with_left[w];
      row.runs_before[w] = runs;
      for (std::uint64_t starts = row.starts[w]; starts != 0; starts &= starts - 1) {
        starts_[runs] = {static_cast<std::int16_t>(64 * w + std::countr_zero(starts)), static_cast<std::int16_t>(y)};
        parents_[runs] = runs;
        ++runs;
      }
    }
    // Two runs meet in neighbouring columns as often as they share; the first of these is enough.
    std::uint64_t carry = 0;
    for (int w = 0; w < words_ && y > 0; ++w) {
      const std::uint64_t same = with_above[w] & row.with_left[w] & above.with_left[w];
      std::uint64_t meets = with_above[w] & ~(same & (with_above[w] << 1 | carry));
      carry = with_above[w] >> 63;
      for (; meets != 0; meets &= meets - 1) {
        // All starts up to and with this column.
        const std::uint64_t until = meets ^ (meets - 1);
        join(row.runs_before[w] + bits_in(row.starts[w] & until) - 1,
             above.runs_before[w] + bits_in(above.starts[w] & until) - 1);
      }
    }
  }
  return runs;
}

void DisparityFilter::remove_speckles(ImageView<std::uint16_t> picture, DisparityCounts& counts) noexcept {
  const std::int32_t runs = find_runs(picture);
  std::fill_n(sizes_.data(), runs, 0);
  for (std::int32_t run = 0; run < runs; ++run) {
    const Start start = starts_[run];
    const bool last_of_row = run + 1 == runs || starts_[run + 1].y != start.y;
    lengths_[run] = run_length(start, last_of_row ? picture.width : starts_[run + 1].x);
    // A parent stands before its children, so it has found its root already.
    parents_[run] = parents_[parents_[run]];
    sizes_[parents_[run]] += lengths_[run];
  }
  for (std::int32_t run = 0; run < runs; ++run) {
    if (sizes_[parents_[run]] >= config_.speckle_size) continue;
    const Start start = starts_[run];
    std::fill_n(picture.row(start.y) + start.x, lengths_[run], kNoDisparity);
    clear_bits(known(start.y), start.x, start.x + lengths_[run] - 1);
    counts.speckle += lengths_[run];
  }
}

/// Up to the first pixel without a disparity, or the next run's first.
std::int32_t DisparityFilter::run_length(Start start, int limit) const noexcept {
  return std::min(next_clear_bit(known(start.y), words_, start.x), limit) - start.x;
}

void DisparityFilter::fill_gaps(ImageView<const std::uint8_t> mask, ImageView<std::uint16_t> picture,
                                DisparityCounts& counts) const noexcept {
  std::uint64_t* gaps = alike_.data();
  for (int y = 0; y < picture.height; ++y) {
    std::fill_n(wanted_.data(), words_, ~std::uint64_t{0});
    if (!mask.empty()) wanted_bits(mask.row(y), picture.width, wanted_.data());
    for (int w = 0; w < words_; ++w) {
      counts.matched += bits_in(known(y)[w] & wanted_[w]);
      gaps[w] = ~known(y)[w] & wanted_[w];
    }
    if (config_.fill_px <= 0) continue;
    // Beyond the row there are no pixels.
    if (picture.width % 64 != 0) gaps[words_ - 1] &= (std::uint64_t{1} << (picture.width % 64)) - 1;
    std::uint16_t* row = picture.row(y);
    for (int begin = next_bit(gaps, words_, 0); begin < picture.width;) {
      const int end = std::min(next_clear_bit(gaps, words_, begin), picture.width);
      // kNoDisparity is the largest value, so an end that does not exist never wins.
      const std::uint16_t before = begin > 0 ? row[begin - 1] : kNoDisparity;
      const std::uint16_t after = end < picture.width ? row[end] : kNoDisparity;
      const std::uint16_t farther = std::min(before, after);
      if (end - begin <= config_.fill_px && farther != kNoDisparity) {
        std::fill(row + begin, row + end, farther);
        counts.filled += end - begin;
        counts.matched += end - begin;
      }
      begin = next_bit(gaps, words_, end);
    }
  }
}

void DisparityFilter::run(ImageView<const std::uint16_t> in, ImageView<const std::uint8_t> mask,
                          ImageView<std::uint16_t> out, DisparityCounts& counts) noexcept {
  const ImageView<std::uint16_t> work = work_.window(0, 0, in.width, in.height);
  words_ = words_of(in.width);
  if (config_.median) {
    if (simd_in_use() == SimdTarget::kScalar) {
      median_reference(in, work);
    } else {
      median_lanes(in, none_row_, work);
    }
  } else {
    for (int y = 0; y < in.height; ++y) std::copy_n(in.row(y), in.width, work.row(y));
  }
  if (config_.speckle_size > 1) {
    remove_speckles(work, counts);
  } else {
    for (int y = 0; y < in.height; ++y) {
      row_bits({work.row(y), none_row_.data(), in.width, 0}, {known(y), alike_.data(), alike_.data() + words_});
    }
  }
  fill_gaps(mask, work, counts);
  for (int y = 0; y < in.height; ++y) {
    const std::uint16_t* from = work.row(y);
    std::uint16_t* to = out.row(y);
    if (mask.empty()) {
      std::copy_n(from, in.width, to);
      continue;
    }
    const std::uint8_t* wanted = mask.row(y);
    for (int x = 0; x < in.width; ++x) to[x] = wanted[x] != 0 ? from[x] : to[x];
  }
}

}  // namespace stereotrack
