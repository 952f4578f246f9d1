#include "pipeline/shape/morphology.hpp"

#include <algorithm>
#include <cstring>

namespace stereotrack {
namespace {

struct Minimum {
  static constexpr std::uint8_t kNeutral = 255;
  static std::uint8_t of(std::uint8_t a, std::uint8_t b) noexcept { return a < b ? a : b; }
};

struct Maximum {
  static constexpr std::uint8_t kNeutral = 0;
  static std::uint8_t of(std::uint8_t a, std::uint8_t b) noexcept { return a > b ? a : b; }
};

template <class Extreme>
void pass_3x3(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out, std::uint8_t* column) noexcept {
  column[-1] = Extreme::kNeutral;
  column[in.width] = Extreme::kNeutral;
  for (int y = 0; y < in.height; ++y) {
    // At the border the row itself stands in for the one outside: it changes neither minimum nor maximum.
    const std::uint8_t* above = in.row(std::max(y - 1, 0));
    const std::uint8_t* here = in.row(y);
    const std::uint8_t* below = in.row(std::min(y + 1, in.height - 1));
    for (int x = 0; x < in.width; ++x) column[x] = Extreme::of(Extreme::of(above[x], here[x]), below[x]);
    std::uint8_t* to = out.row(y);
    for (int x = 0; x < in.width; ++x) to[x] = Extreme::of(Extreme::of(column[x - 1], column[x]), column[x + 1]);
  }
}

}  // namespace

Result<void> Morphology3x3::init(const Config& config, int width, int height, Arena& arena) noexcept {
  if (width <= 0 || height <= 0 || config.repeats < 0) return fail(Fault::kBadConfig);
  config_ = config;
  width_ = width;
  height_ = height;
  between_ = arena.image<std::uint8_t>(width, height);
  column_ = arena.array<std::uint8_t>(static_cast<std::size_t>(width) + 2);
  if (between_.empty() || column_.empty()) return fail(Fault::kOutOfMemory);
  return {};
}

void Morphology3x3::pass(Pass kind, ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out) noexcept {
  if (kind == Pass::kErode) {
    pass_3x3<Minimum>(in, out, column_.data() + 1);
  } else {
    pass_3x3<Maximum>(in, out, column_.data() + 1);
  }
}

Result<void> Morphology3x3::run_passes(Pass first, Pass second, ImageView<const std::uint8_t> in,
                                       ImageView<std::uint8_t> out) noexcept {
  if (in.width != width_ || in.height != height_ || !in.same_size(out)) return fail(Fault::kBadSize);
  if (config_.repeats == 0) {
    for (int y = 0; y < height_; ++y) std::memmove(out.row(y), in.row(y), static_cast<std::size_t>(width_));
    return {};
  }
  // An even number of passes, to and fro between `between_` and `out`: the last one ends in `out`.
  const int passes = 2 * config_.repeats;
  ImageView<const std::uint8_t> from = in;
  for (int i = 0; i < passes; ++i) {
    const ImageView<std::uint8_t> to = i % 2 == 0 ? between_ : out;
    pass(i < config_.repeats ? first : second, from, to);
    from = to;
  }
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
