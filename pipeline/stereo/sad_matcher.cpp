#include "pipeline/stereo/sad_matcher.hpp"

#include <cstdlib>

namespace stereotrack {

namespace {

/// first + index of the smallest of values[0..count), the first of equals.
int index_of_smallest(const std::uint32_t* values, int count) noexcept {
  std::uint32_t smallest = values[0];
  for (int i = 1; i < count; ++i) smallest = std::min(smallest, values[i]);
  int index = 0;
  while (values[index] != smallest) ++index;
  return index;
}

}  // namespace

Result<SadMatcher> SadMatcher::create(const Config& config, Arena& arena) noexcept {
  constexpr int kLargestSide = 8192;
  SadMatcher m;
  m.config_ = config;
  Config& c = m.config_;
  if (c.right_width == 0) c.right_width = c.width;
  if (c.region_disparities == 0) c.region_disparities = c.range.count();
  const bool sizes_fit = c.width >= 1 && c.width <= kLargestSide && c.height >= 1 && c.height <= kLargestSide &&
                         c.right_width >= 1 && c.right_width <= kLargestSide && std::abs(c.offset) <= kLargestSide;
  const bool block_fits = c.block >= 3 && c.block <= 21 && c.block % 2 == 1;
  const bool ranges_fit = c.range.valid() && c.region_disparities >= 1 && c.region_disparities <= kLargestDisparity + 1;
  if (!sizes_fit || !block_fits || !ranges_fit) return fail(Fault::kBadConfig);

  const auto lanes = static_cast<std::size_t>(std::max(c.range.count(), c.region_disparities));
  m.column_sums_ = arena.array<std::uint16_t>(static_cast<std::size_t>(c.width) * lanes);
  m.window_sums_ = arena.array<std::uint32_t>(lanes);
  m.reversed_right_ = arena.array<std::uint8_t>(static_cast<std::size_t>(c.right_width));
  m.used_columns_ = arena.array<std::uint8_t>(static_cast<std::size_t>(c.width));
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return m;
}

Result<DisparityCounts> SadMatcher::run(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                        ImageView<std::uint16_t> out) noexcept {
  return run_region(left, right, {0, 0, config_.width, config_.height}, {}, config_.range, out);
}

void SadMatcher::change_row(const BlockGeometry& geometry, const std::uint8_t* left, const std::uint8_t* right,
                            Span columns, bool enters) noexcept {
  std::reverse_copy(right, right + config_.right_width, reversed_right_.data());
  for (int x = columns.first; x <= columns.last; ++x) {
    if (used_columns_[x] == 0) continue;
    const int first = geometry.first(x) - geometry.range.min;
    const int last = geometry.last(x) - geometry.range.min;
    if (first > last) continue;
    std::uint16_t* __restrict sums = column_sums_.data() + static_cast<std::ptrdiff_t>(x) * lanes_ + first;
    const std::uint8_t* __restrict partners = reversed_right_.data() + (geometry.reversed(x) + first);
    const int grey = left[x];
    const int count = last - first + 1;
    if (enters) {
      for (int i = 0; i < count; ++i) {
        sums[i] = static_cast<std::uint16_t>(sums[i] + std::abs(grey - partners[i]));
      }
    } else {
      for (int i = 0; i < count; ++i) {
        sums[i] = static_cast<std::uint16_t>(sums[i] - std::abs(grey - partners[i]));
      }
    }
  }
}

int SadMatcher::best_disparity(const BlockGeometry& geometry, int x) const noexcept {
  const int d_min = geometry.range.min;
  const int first_whole = geometry.first_whole(x);
  const int last_whole = geometry.last_whole(x);
  int best = -1;
  std::uint32_t best_sum = 0;
  std::uint32_t best_columns = 1;
  // All windows of a pixel have the same rows, so the means compare as sum / columns, exactly:
  // 21 x 21 x 255 x 21 < 2^32.
  const auto offer = [&](int d) {
    const std::uint32_t sum = window_sums_[d - d_min];
    const auto columns = static_cast<std::uint32_t>(geometry.columns(x, d));
    if (best >= 0 && sum * best_columns >= best_sum * columns) return;
    best = d;
    best_sum = sum;
    best_columns = columns;
  };
  const int last = geometry.last(x);
  int d = geometry.first(x);
  for (; d <= last && d < first_whole; ++d) offer(d);
  if (d <= last_whole) {
    offer(d + index_of_smallest(window_sums_.data() + (d - d_min), last_whole - d + 1));
    d = last_whole + 1;
  }
  for (; d <= last; ++d) offer(d);
  return best;
}

Result<DisparityCounts> SadMatcher::run_region(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                               Rect roi, ImageView<const std::uint8_t> mask, DisparityRange range,
                                               ImageView<std::uint16_t> out) noexcept {
  const Config& c = config_;
  if (left.width != c.width || left.height != c.height || right.width != c.right_width || right.height != c.height ||
      !out.same_size(left) || (!mask.empty() && !mask.same_size(left))) {
    return fail(Fault::kBadSize);
  }
  if (!range.valid() || range.count() > std::max(c.range.count(), c.region_disparities)) {
    return fail(Fault::kBadConfig);
  }
  DisparityCounts counts;
  roi = intersect(roi, {0, 0, c.width, c.height});
  if (roi.empty()) return counts;

  const int radius = c.block / 2;
  const BlockGeometry geometry{c.width, c.right_width, radius, c.offset, range};
  const Span columns{std::max(roi.left - radius, 0), std::min(roi.right() + radius, c.width) - 1};
  const int first_row = std::max(roi.top - radius, 0);
  lanes_ = range.count();
  mark_window_columns(mask, roi, radius, c.width, used_columns_.data());
  const auto column = [&](int x) { return column_sums_.data() + static_cast<std::ptrdiff_t>(x) * lanes_; };
  std::fill(column(columns.first), column(columns.last + 1), std::uint16_t{0});
  for (int y = first_row; y < std::min(roi.top + radius, c.height); ++y) {
    change_row(geometry, left.row(y), right.row(y), columns, true);
  }

  for (int y = roi.top; y < roi.bottom(); ++y) {
    if (y + radius < c.height) change_row(geometry, left.row(y + radius), right.row(y + radius), columns, true);
    const int leaving = y - radius - 1;
    if (leaving >= first_row) change_row(geometry, left.row(leaving), right.row(leaving), columns, false);

    const Span span = wanted_span(mask, roi, y);
    if (span.empty()) continue;
    std::uint32_t* __restrict sums = window_sums_.data();
    std::fill_n(sums, lanes_, 0U);
    for (int x = std::max(span.first - radius, 0); x < std::min(span.first + radius, c.width); ++x) {
      const std::uint16_t* __restrict in = column(x);
      for (int i = 0; i < lanes_; ++i) sums[i] += in[i];
    }
    for (int x = span.first; x <= span.last; ++x) {
      if (x + radius < c.width) {
        const std::uint16_t* __restrict in = column(x + radius);
        for (int i = 0; i < lanes_; ++i) sums[i] += in[i];
      }
      if (x - radius - 1 >= std::max(span.first - radius, 0)) {
        const std::uint16_t* __restrict gone = column(x - radius - 1);
        for (int i = 0; i < lanes_; ++i) sums[i] -= gone[i];
      }
      if (!is_wanted(mask, x, y)) continue;
      ++counts.wanted;
      const int best = best_disparity(geometry, x);
      if (best < 0) {
        ++counts.border;
        out.at(x, y) = kNoDisparity;
      } else {
        ++counts.matched;
        out.at(x, y) = static_cast<std::uint16_t>(best * kDisparityScale);
      }
    }
  }
  return counts;
}

}  // namespace stereotrack
