#include "pipeline/shape/morphology.hpp"

#include <algorithm>
#include <utility>

#include "pipeline/shape/bits_kernel.hpp"

namespace stereotrack {
namespace {

struct And {
  static constexpr std::uint64_t kNeutral = ~std::uint64_t{0};
  static std::uint64_t of(std::uint64_t a, std::uint64_t b) noexcept { return a & b; }
};

struct Or {
  static constexpr std::uint64_t kNeutral = 0;
  static std::uint64_t of(std::uint64_t a, std::uint64_t b) noexcept { return a | b; }
};

// column: words_a_row() words, and one at each end.
template <class Both>
void pass_3x3(const BitMask& in, const BitMask& out, std::uint64_t* column) noexcept {
  const int words = in.words_a_row();
  const std::uint64_t inside = BitMask::last_word(in.width);
  column[-1] = Both::kNeutral;
  column[words] = Both::kNeutral;
  for (int y = 0; y < in.height; ++y) {
    // At the border the row itself stands in for the one outside: it changes neither AND nor OR.
    const std::uint64_t* above = in.row(std::max(y - 1, 0));
    const std::uint64_t* here = in.row(y);
    const std::uint64_t* below = in.row(std::min(y + 1, in.height - 1));
    for (int w = 0; w < words; ++w) column[w] = Both::of(Both::of(above[w], here[w]), below[w]);
    column[words - 1] = (column[words - 1] & inside) | (Both::kNeutral & ~inside);
    std::uint64_t* to = out.row(y);
    for (int w = 0; w < words; ++w) {
      const std::uint64_t left = column[w] << 1 | column[w - 1] >> 63;
      const std::uint64_t right = column[w] >> 1 | column[w + 1] << 63;
      to[w] = Both::of(Both::of(left, column[w]), right);
    }
    to[words - 1] &= inside;
  }
}

}  // namespace

Result<void> Morphology3x3::init(const Config& config, int width, int height, Arena& arena) noexcept {
  if (width <= 0 || height <= 0 || config.repeats < 0) return fail(Fault::kBadConfig);
  config_ = config;
  width_ = width;
  height_ = height;
  from_ = BitMask::create(width, height, arena);
  to_ = BitMask::create(width, height, arena);
  column_ = arena.array<std::uint64_t>(static_cast<std::size_t>(BitMask::words_of(width)) + 2);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return {};
}

void Morphology3x3::pass(Pass kind, const BitMask& in, const BitMask& out) noexcept {
  if (kind == Pass::kErode) {
    pass_3x3<And>(in, out, column_.data() + 1);
  } else {
    pass_3x3<Or>(in, out, column_.data() + 1);
  }
}

Result<void> Morphology3x3::run_passes(Pass first, Pass second, ImageView<const std::uint8_t> in,
                                       ImageView<std::uint8_t> out) noexcept {
  if (in.width != width_ || in.height != height_ || !in.same_size(out)) return fail(Fault::kBadSize);
  for (int y = 0; y < height_; ++y) row_bits(in.row(y), width_, from_.row(y));
  for (int i = 0; i < 2 * config_.repeats; ++i) {
    pass(i < config_.repeats ? first : second, from_, to_);
    std::swap(from_, to_);
  }
  for (int y = 0; y < height_; ++y) fill_from_bits(from_.row(y), width_, out.row(y));
  return {};
}

Result<Opening> Opening::create(const Config& config, int width, int height, Arena& arena) noexcept {
  Opening stage;
  const Result<void> ready = stage.init(config, width, height, arena);
  if (!ready.has_value()) return fail(ready.error());
  return stage;
}

Result<void> Opening::run(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) noexcept {
  return run_passes(Pass::kErode, Pass::kDilate, in, out);
}

Result<Closing> Closing::create(const Config& config, int width, int height, Arena& arena) noexcept {
  Closing stage;
  const Result<void> ready = stage.init(config, width, height, arena);
  if (!ready.has_value()) return fail(ready.error());
  return stage;
}

Result<void> Closing::run(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) noexcept {
  return run_passes(Pass::kDilate, Pass::kErode, in, out);
}

}  // namespace stereotrack
