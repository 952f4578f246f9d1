#include "pipeline/stereo/disparity_filter.hpp"

#include <cstdlib>

#include "pipeline/core/simd.hpp"
#include "pipeline/stereo/median_kernel.hpp"

namespace stereotrack {

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
  f.run_of_ = arena.array<std::int32_t>(2 * columns);
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
  const auto alike = [step = config_.speckle_step](int a, int b) {
    return a != kNoDisparity && b != kNoDisparity && std::abs(a - b) <= step;
  };
  std::int32_t runs = 0;
  for (int y = 0; y < picture.height; ++y) {
    const std::uint16_t* row = picture.row(y);
    const std::uint16_t* above = y > 0 ? picture.row(y - 1) : none_row_.data();
    std::int32_t* run_of = run_of_.data() + std::ptrdiff_t{y & 1} * picture.width;
    const std::int32_t* run_above = run_of_.data() + std::ptrdiff_t{1 - (y & 1)} * picture.width;
    int before = kNoDisparity;
    // The two runs joined last: neighbours mostly want the same again.
    std::int32_t joined = -1;
    std::int32_t joined_above = -1;
    for (int x = 0; x < picture.width; ++x) {
      const int value = row[x];
      if (alike(before, value)) {
        ++lengths_[runs - 1];
      } else if (value != kNoDisparity) {
        starts_[runs] = {static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)};
        lengths_[runs] = 1;
        parents_[runs] = runs;
        ++runs;
      }
      run_of[x] = runs - 1;
      before = value;
      if (!alike(above[x], value) || (joined == runs - 1 && joined_above == run_above[x])) continue;
      joined = runs - 1;
      joined_above = run_above[x];
      join(joined, joined_above);
    }
  }
  return runs;
}

std::int64_t DisparityFilter::remove_speckles(ImageView<std::uint16_t> picture) noexcept {
  const std::int32_t runs = find_runs(picture);
  std::fill_n(sizes_.data(), runs, 0);
  for (std::int32_t run = 0; run < runs; ++run) sizes_[root(run)] += lengths_[run];
  std::int64_t removed = 0;
  for (std::int32_t run = 0; run < runs; ++run) {
    if (sizes_[root(run)] >= config_.speckle_size) continue;
    std::fill_n(picture.row(starts_[run].y) + starts_[run].x, lengths_[run], kNoDisparity);
    removed += lengths_[run];
  }
  return removed;
}

std::int64_t DisparityFilter::fill_gaps(ImageView<const std::uint8_t> mask,
                                        ImageView<std::uint16_t> picture) const noexcept {
  std::int64_t filled = 0;
  for (int y = 0; y < picture.height; ++y) {
    std::uint16_t* row = picture.row(y);
    int begin = 0;
    while (begin < picture.width) {
      if (row[begin] != kNoDisparity || !is_wanted(mask, begin, y)) {
        ++begin;
        continue;
      }
      int end = begin;
      while (end < picture.width && row[end] == kNoDisparity && is_wanted(mask, end, y)) ++end;
      // kNoDisparity is the largest value, so an end that does not exist never wins.
      const std::uint16_t before = begin > 0 ? row[begin - 1] : kNoDisparity;
      const std::uint16_t after = end < picture.width ? row[end] : kNoDisparity;
      const std::uint16_t farther = std::min(before, after);
      if (end - begin <= config_.fill_px && farther != kNoDisparity) {
        std::fill(row + begin, row + end, farther);
        filled += end - begin;
      }
      begin = end;
    }
  }
  return filled;
}

void DisparityFilter::run(ImageView<const std::uint16_t> in, ImageView<const std::uint8_t> mask,
                          ImageView<std::uint16_t> out, DisparityCounts& counts) noexcept {
  const ImageView<std::uint16_t> work = work_.window(0, 0, in.width, in.height);
  if (config_.median) {
    if (simd_in_use() == SimdTarget::kScalar) {
      median_reference(in, work);
    } else {
      median_lanes(in, none_row_, work);
    }
  } else {
    for (int y = 0; y < in.height; ++y) std::copy_n(in.row(y), in.width, work.row(y));
  }
  if (config_.speckle_size > 1) counts.speckle += remove_speckles(work);
  if (config_.fill_px > 0) counts.filled += fill_gaps(mask, work);
  for (int y = 0; y < in.height; ++y) {
    const std::uint16_t* from = work.row(y);
    std::uint16_t* to = out.row(y);
    std::int32_t matched = 0;
    if (mask.empty()) {
      for (int x = 0; x < in.width; ++x) matched += from[x] != kNoDisparity ? 1 : 0;
      std::copy_n(from, in.width, to);
    } else {
      for (int x = 0; x < in.width; ++x) {
        if (mask.at(x, y) == 0) continue;
        to[x] = from[x];
        matched += from[x] != kNoDisparity ? 1 : 0;
      }
    }
    counts.matched += matched;
  }
}

}  // namespace stereotrack
