#include "pipeline/stereo/disparity_filter.hpp"

#include <cstdlib>

namespace stereotrack {

namespace {

/// Median of nine by 19 exchanges (Smith 1996); branch-free, so that a loop over pixels vectorises.
inline std::uint16_t median9(const std::uint16_t* a, const std::uint16_t* b, const std::uint16_t* c) noexcept {
  std::uint16_t p0 = a[-1], p1 = a[0], p2 = a[1];
  std::uint16_t p3 = b[-1], p4 = b[0], p5 = b[1];
  std::uint16_t p6 = c[-1], p7 = c[0], p8 = c[1];
  const auto sort = [](std::uint16_t& low, std::uint16_t& high) {
    const std::uint16_t smaller = std::min(low, high);
    high = std::max(low, high);
    low = smaller;
  };
  sort(p1, p2), sort(p4, p5), sort(p7, p8);
  sort(p0, p1), sort(p3, p4), sort(p6, p7);
  sort(p1, p2), sort(p4, p5), sort(p7, p8);
  sort(p0, p3), sort(p5, p8), sort(p4, p7);
  sort(p3, p6), sort(p1, p4), sort(p2, p5);
  sort(p4, p7), sort(p4, p2), sort(p6, p4);
  sort(p4, p2);
  return p4;
}

/// Of those neighbours that have a disparity.
std::uint16_t median_of_valid(ImageView<const std::uint16_t> in, int x, int y) noexcept {
  std::uint16_t sorted[9];
  int count = 0;
  for (int j = std::max(y - 1, 0); j <= std::min(y + 1, in.height - 1); ++j) {
    for (int i = std::max(x - 1, 0); i <= std::min(x + 1, in.width - 1); ++i) {
      const std::uint16_t value = in.at(i, j);
      if (value == kNoDisparity) continue;
      int at = count++;
      for (; at > 0 && sorted[at - 1] > value; --at) sorted[at] = sorted[at - 1];
      sorted[at] = value;
    }
  }
  return sorted[count / 2];
}

}  // namespace

Result<DisparityFilter> DisparityFilter::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (width < 1 || height < 1 || config.speckle_size < 0 || config.speckle_step < 0 || config.speckle_step > 65535 ||
      config.fill_px < 0) {
    return fail(Fault::kBadConfig);
  }
  DisparityFilter f;
  f.config_ = config;
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  f.work_ = arena.image<std::uint16_t>(width, height);
  f.parents_ = arena.array<std::int32_t>(pixels);
  f.sizes_ = arena.array<std::int32_t>(pixels);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return f;
}

void DisparityFilter::median(ImageView<const std::uint16_t> in, ImageView<std::uint16_t> out) const noexcept {
  for (int y = 0; y < in.height; ++y) {
    const std::uint16_t* __restrict row = in.row(y);
    std::uint16_t* __restrict result = out.row(y);
    const bool inner = y > 0 && y + 1 < in.height;
    if (inner) {
      const std::uint16_t* __restrict above = in.row(y - 1);
      const std::uint16_t* __restrict below = in.row(y + 1);
      for (int x = 1; x < in.width - 1; ++x) result[x] = median9(above + x, row + x, below + x);
    }
    // The fast way counted "none" as the largest value; redo those that saw one.
    const auto column_complete = [&](int x) {
      return in.at(x, y - 1) != kNoDisparity && row[x] != kNoDisparity && in.at(x, y + 1) != kNoDisparity;
    };
    for (int x = 0; x < in.width; ++x) {
      if (row[x] == kNoDisparity) {
        result[x] = kNoDisparity;
      } else if (!inner || x == 0 || x + 1 == in.width || !column_complete(x - 1) || !column_complete(x) ||
                 !column_complete(x + 1)) {
        result[x] = median_of_valid(in, x, y);
      }
    }
  }
}

std::int32_t DisparityFilter::root(std::int32_t pixel) noexcept {
  while (parents_[pixel] != pixel) {
    parents_[pixel] = parents_[parents_[pixel]];
    pixel = parents_[pixel];
  }
  return pixel;
}

std::int64_t DisparityFilter::remove_speckles(ImageView<std::uint16_t> picture) noexcept {
  const int width = picture.width;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::uint16_t value = picture.at(x, y);
      if (value == kNoDisparity) continue;
      const std::int32_t pixel = y * width + x;
      parents_[pixel] = pixel;
      sizes_[pixel] = 1;
      const auto join = [&](int other_x, int other_y) {
        const std::uint16_t other_value = picture.at(other_x, other_y);
        if (other_value == kNoDisparity || std::abs(value - other_value) > config_.speckle_step) return;
        const std::int32_t a = root(other_y * width + other_x);
        const std::int32_t b = root(pixel);
        if (a == b) return;
        const std::int32_t parent = std::min(a, b);
        const std::int32_t child = std::max(a, b);
        parents_[child] = parent;
        sizes_[parent] += sizes_[child];
      };
      if (x > 0) join(x - 1, y);
      if (y > 0) join(x, y - 1);
    }
  }
  std::int64_t removed = 0;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (picture.at(x, y) == kNoDisparity || sizes_[root(y * width + x)] >= config_.speckle_size) continue;
      picture.at(x, y) = kNoDisparity;
      ++removed;
    }
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
    median(in, work);
  } else {
    for (int y = 0; y < in.height; ++y) std::copy_n(in.row(y), in.width, work.row(y));
  }
  if (config_.speckle_size > 1) counts.speckle += remove_speckles(work);
  if (config_.fill_px > 0) counts.filled += fill_gaps(mask, work);
  for (int y = 0; y < in.height; ++y) {
    for (int x = 0; x < in.width; ++x) {
      if (!is_wanted(mask, x, y)) continue;
      out.at(x, y) = work.at(x, y);
      counts.matched += work.at(x, y) != kNoDisparity ? 1 : 0;
    }
  }
}

}  // namespace stereotrack
