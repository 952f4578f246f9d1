#include "pipeline/stereo/census_matcher.hpp"

#include <cstdlib>

namespace stereotrack {

namespace {

constexpr std::uint16_t kNoCost = 0xFFFF;
enum State : std::uint8_t { kUnwanted, kMatched, kBorder, kTexture, kUniqueness };

/// Bits that differ. Written out so that it stays in vector registers on machines without a popcount.
inline std::uint32_t hamming(std::uint32_t a, std::uint32_t b) noexcept {
  std::uint32_t v = a ^ b;
  v = v - ((v >> 1) & 0x55555555U);
  v = (v & 0x33333333U) + ((v >> 2) & 0x33333333U);
  v = (v + (v >> 4)) & 0x0F0F0F0FU;
  v = v + (v >> 8);
  return (v + (v >> 16)) & 0x3FU;
}

/// Codes of columns [begin, end) of row y; `codes` points at column 0, `step` is +1 or -1.
void census_row(ImageView<const std::uint8_t> picture, int y, int begin, int end, std::uint32_t* codes,
                std::ptrdiff_t step) noexcept {
  const std::uint8_t* rows[7];
  for (int j = 0; j < 7; ++j) rows[j] = picture.row(std::clamp(y + j - 3, 0, picture.height - 1));
  const auto code = [&](int x, auto column) {
    const std::uint8_t centre = rows[3][x];
    std::uint32_t bits = 0;
    for (int j = 0; j < 7; ++j) {
      for (int i = (j & 1) == 0 ? 1 : 0; i < 7; i += 2) {
        if (i == 3 && j == 3) continue;
        bits = (bits << 1) | static_cast<std::uint32_t>(rows[j][column(x + i - 3)] < centre);
      }
    }
    codes[step * x] = bits;
  };
  const auto clamped = [&](int x) { return std::clamp(x, 0, picture.width - 1); };
  const int inner_begin = std::clamp(3, begin, end);
  const int inner_end = std::clamp(picture.width - 3, inner_begin, end);
  for (int x = begin; x < inner_begin; ++x) code(x, clamped);
  for (int x = inner_begin; x < inner_end; ++x) code(x, [](int column) { return column; });
  for (int x = inner_end; x < end; ++x) code(x, clamped);
}

std::uint32_t gradient(const std::uint8_t* row, int x, int width) noexcept {
  return static_cast<std::uint32_t>(std::abs(row[std::min(x + 1, width - 1)] - row[std::max(x - 1, 0)]));
}

std::uint16_t smallest(const std::uint16_t* values, int begin, int end) noexcept {
  std::uint16_t result = kNoCost;
  for (int i = begin; i < end; ++i) result = std::min(result, values[i]);
  return result;
}

}  // namespace

Result<CensusMatcher> CensusMatcher::create(const Config& config, Arena& arena) noexcept {
  constexpr int kLargestSide = 8192;
  CensusMatcher m;
  m.config_ = config;
  Config& c = m.config_;
  if (c.right_width == 0) c.right_width = c.width;
  if (c.region_disparities == 0) c.region_disparities = c.range.count();
  const bool sizes_fit = c.width >= 1 && c.width <= kLargestSide && c.height >= 1 && c.height <= kLargestSide &&
                         c.right_width >= 1 && c.right_width <= kLargestSide && std::abs(c.offset) <= kLargestSide;
  const bool block_fits = c.block >= 3 && c.block <= 21 && c.block % 2 == 1;
  const bool ranges_fit = c.range.valid() && c.region_disparities >= 1 && c.region_disparities <= kLargestDisparity + 1;
  const bool gates_fit = c.texture >= 0 && c.texture <= 4080 && c.uniqueness >= 0 && c.uniqueness <= 100 &&
                         c.left_right_px >= -1 && c.left_right_px <= 255;
  if (!sizes_fit || !block_fits || !ranges_fit || !gates_fit) return fail(Fault::kBadConfig);

  const auto width = static_cast<std::size_t>(c.width);
  const auto right_width = static_cast<std::size_t>(c.right_width);
  const auto lanes = static_cast<std::size_t>(std::max(c.range.count(), c.region_disparities));
  m.distances_ = arena.array<std::uint8_t>(static_cast<std::size_t>(c.block) * width * lanes);
  m.column_sums_ = arena.array<std::uint16_t>(width * lanes);
  m.window_sums_ = arena.array<std::uint16_t>(lanes);
  m.scaled_sums_ = arena.array<std::uint16_t>(lanes);
  m.gradient_sums_ = arena.array<std::uint32_t>(width);
  m.left_codes_ = arena.array<std::uint32_t>(width);
  m.reversed_codes_ = arena.array<std::uint32_t>(right_width);
  m.right_costs_ = arena.array<std::uint16_t>(right_width);
  m.right_lanes_ = arena.array<std::uint16_t>(right_width);
  m.matches_ = arena.array<Match>(width);
  m.used_columns_ = arena.array<std::uint8_t>(width);
  m.raw_ = arena.image<std::uint16_t>(c.width, c.height);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  Result<DisparityFilter> filter = DisparityFilter::create(c.filter, c.width, c.height, arena);
  if (!filter.has_value()) return fail(filter.error());
  m.filter_ = *filter;
  return m;
}

Result<DisparityCounts> CensusMatcher::run(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                           ImageView<std::uint16_t> out) noexcept {
  return run_region(left, right, {0, 0, config_.width, config_.height}, {}, config_.range, out);
}

void CensusMatcher::enter_row(const BlockGeometry& geometry, const Pictures& pictures, Span columns, int y,
                              int first_row) noexcept {
  census_row(pictures.left, y, columns.first, columns.last + 1, left_codes_.data(), 1);
  const int right_begin = std::max(columns.first - geometry.range.max - geometry.offset, 0);
  const int right_end = std::min(columns.last - geometry.range.min - geometry.offset + 1, geometry.right_width);
  if (right_begin < right_end) {
    census_row(pictures.right, y, right_begin, right_end, reversed_codes_.data() + (geometry.right_width - 1), -1);
  }
  // The row that leaves the window stood in the slot that this one takes.
  const bool replaces = y - config_.block >= first_row;
  std::uint8_t* slot = distances_.data() + std::ptrdiff_t{(y - first_row) % config_.block} * config_.width * lanes_;
  for (int x = columns.first; x <= columns.last; ++x) {
    if (used_columns_[x] == 0) continue;
    gradient_sums_[x] += gradient(pictures.left.row(y), x, config_.width);
    if (replaces) gradient_sums_[x] -= gradient(pictures.left.row(y - config_.block), x, config_.width);
    const int first = geometry.first(x) - geometry.range.min;
    const int count = geometry.last(x) - geometry.range.min - first + 1;
    if (count <= 0) continue;
    const std::ptrdiff_t at = std::ptrdiff_t{x} * lanes_ + first;
    std::uint16_t* __restrict sums = column_sums_.data() + at;
    std::uint8_t* __restrict distances = slot + at;
    const std::uint32_t* __restrict partners = reversed_codes_.data() + (geometry.reversed(x) + first);
    const std::uint32_t code = left_codes_[x];
    if (replaces) {
      for (int i = 0; i < count; ++i) {
        const auto distance = static_cast<std::uint8_t>(hamming(code, partners[i]));
        sums[i] = static_cast<std::uint16_t>(sums[i] + distance - distances[i]);
        distances[i] = distance;
      }
    } else {
      for (int i = 0; i < count; ++i) {
        const auto distance = static_cast<std::uint8_t>(hamming(code, partners[i]));
        sums[i] = static_cast<std::uint16_t>(sums[i] + distance);
        distances[i] = distance;
      }
    }
  }
}

void CensusMatcher::leave_row(const BlockGeometry& geometry, const Pictures& pictures, Span columns, int y,
                              int first_row) noexcept {
  const std::uint8_t* slot =
      distances_.data() + std::ptrdiff_t{(y - first_row) % config_.block} * config_.width * lanes_;
  for (int x = columns.first; x <= columns.last; ++x) {
    if (used_columns_[x] == 0) continue;
    gradient_sums_[x] -= gradient(pictures.left.row(y), x, config_.width);
    const int first = geometry.first(x) - geometry.range.min;
    const int count = geometry.last(x) - geometry.range.min - first + 1;
    const std::ptrdiff_t at = std::ptrdiff_t{x} * lanes_ + first;
    std::uint16_t* __restrict sums = column_sums_.data() + at;
    const std::uint8_t* __restrict distances = slot + at;
    for (int i = 0; i < count; ++i) sums[i] = static_cast<std::uint16_t>(sums[i] - distances[i]);
  }
}

/// Costs of lanes [first, last] of the window at x, as if each had all `block` columns.
const std::uint16_t* CensusMatcher::window_costs(const BlockGeometry& geometry, int x, int first, int last) noexcept {
  const int block = config_.block;
  const int d_min = geometry.range.min;
  const int first_whole = geometry.first_whole(x) - d_min;
  const int last_whole = geometry.last_whole(x) - d_min;
  const int columns = geometry.columns(x);
  if (columns == block && first_whole == first && last_whole == last) return window_sums_.data();
  const std::uint16_t* __restrict in = window_sums_.data();
  std::uint16_t* __restrict out = scaled_sums_.data();
  for (int i = first; i <= last; ++i) {
    const int n = i >= first_whole && i <= last_whole ? columns : geometry.columns(x, i + d_min);
    out[i] = static_cast<std::uint16_t>(in[i] * block / n);
  }
  return out;
}

CensusMatcher::Match CensusMatcher::match(const BlockGeometry& geometry, int x, int rows,
                                          std::uint32_t gradient) noexcept {
  const int first = geometry.first(x) - geometry.range.min;
  const int last = geometry.last(x) - geometry.range.min;
  if (first > last) return {0, kNoDisparity, kBorder};
  const std::uint16_t* costs = window_costs(geometry, x, first, last);

  // Every pixel bids for its right partners, wanted or not, gated or not.
  std::uint16_t* __restrict right_costs = right_costs_.data() + (geometry.reversed(x) + first);
  std::uint16_t* __restrict right_lanes = right_lanes_.data() + (geometry.reversed(x) + first);
  const std::uint16_t* bids = costs + first;
  for (int i = 0; i <= last - first; ++i) {
    const bool better = bids[i] < right_costs[i];
    right_costs[i] = better ? bids[i] : right_costs[i];
    right_lanes[i] = better ? static_cast<std::uint16_t>(first + i) : right_lanes[i];
  }

  const std::uint16_t best_cost = smallest(costs, first, last + 1);
  int best = first;
  while (costs[best] != best_cost) ++best;
  Match result{static_cast<std::uint16_t>(best), 0, kMatched};

  const auto area = static_cast<std::uint32_t>(rows * geometry.columns(x));
  if (gradient * 16 < static_cast<std::uint32_t>(config_.texture) * area) {
    result.state = kTexture;
    return result;
  }
  if (config_.uniqueness > 0) {
    const std::uint32_t rival = std::min(smallest(costs, first, best - 1), smallest(costs, best + 2, last + 1));
    if (rival != kNoCost && rival * 100U <= best_cost * static_cast<std::uint32_t>(100 + config_.uniqueness)) {
      result.state = kUniqueness;
      return result;
    }
  }
  int value = (best + geometry.range.min) * kDisparityScale;
  if (best > first && best < last) {
    const int before = costs[best - 1] - best_cost;
    const int after = costs[best + 1] - best_cost;
    const int slope = std::max(before, after);
    // Half a pixel is the most that the lines can say: |before - after| <= slope.
    if (slope > 0) {
      const int twice = (before - after) * kDisparityScale;
      value += (twice + (twice >= 0 ? slope : -slope)) / (2 * slope);
    }
  }
  result.value = static_cast<std::uint16_t>(value);
  return result;
}

void CensusMatcher::match_row(const BlockGeometry& geometry, Span span, int rows, ImageView<const std::uint8_t> mask,
                              int y) noexcept {
  const int radius = config_.block / 2;
  const int begin = std::max(span.first - radius, 0);
  const auto column = [&](int x) { return column_sums_.data() + std::ptrdiff_t{x} * lanes_; };
  std::uint16_t* __restrict sums = window_sums_.data();
  std::fill_n(sums, lanes_, std::uint16_t{0});
  std::uint32_t gradient_sum = 0;
  const auto enter = [&](int x) {
    const std::uint16_t* __restrict in = column(x);
    for (int i = 0; i < lanes_; ++i) sums[i] = static_cast<std::uint16_t>(sums[i] + in[i]);
    gradient_sum += gradient_sums_[x];
  };
  const auto leave = [&](int x) {
    const std::uint16_t* __restrict gone = column(x);
    for (int i = 0; i < lanes_; ++i) sums[i] = static_cast<std::uint16_t>(sums[i] - gone[i]);
    gradient_sum -= gradient_sums_[x];
  };
  std::fill(right_costs_.begin(), right_costs_.end(), kNoCost);
  for (int x = begin; x < std::min(span.first + radius, config_.width); ++x) enter(x);
  for (int x = span.first; x <= span.last; ++x) {
    if (x + radius < config_.width) enter(x + radius);
    if (x - radius - 1 >= begin) leave(x - radius - 1);
    matches_[x] = match(geometry, x, rows, gradient_sum);
    if (!is_wanted(mask, x, y)) matches_[x].state = kUnwanted;
  }
}

Result<DisparityCounts> CensusMatcher::run_region(ImageView<const std::uint8_t> left,
                                                  ImageView<const std::uint8_t> right, Rect roi,
                                                  ImageView<const std::uint8_t> mask, DisparityRange range,
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
  const Pictures pictures{left, right};
  const Span columns{std::max(roi.left - radius, 0), std::min(roi.right() + radius, c.width) - 1};
  const int first_row = std::max(roi.top - radius, 0);
  lanes_ = range.count();
  mark_window_columns(mask, roi, radius, c.width, used_columns_.data());
  std::uint16_t* sums = column_sums_.data();
  std::fill(sums + std::ptrdiff_t{columns.first} * lanes_, sums + std::ptrdiff_t{columns.last + 1} * lanes_,
            std::uint16_t{0});
  std::fill(gradient_sums_.begin() + columns.first, gradient_sums_.begin() + columns.last + 1, 0U);
  for (int y = first_row; y < std::min(roi.top + radius, c.height); ++y) {
    enter_row(geometry, pictures, columns, y, first_row);
  }

  const ImageView<std::uint16_t> raw = raw_.window(roi.left, roi.top, roi.width, roi.height);
  for (int y = roi.top; y < roi.bottom(); ++y) {
    if (y + radius < c.height) {
      enter_row(geometry, pictures, columns, y + radius, first_row);
    } else if (y - radius - 1 >= first_row) {
      leave_row(geometry, pictures, columns, y - radius - 1, first_row);
    }
    std::uint16_t* raw_row = raw.row(y - roi.top);
    std::fill_n(raw_row, roi.width, kNoDisparity);
    const Span span = wanted_span(mask, roi, y);
    if (span.empty()) continue;
    const int rows = std::min(y + radius, c.height - 1) - std::max(y - radius, 0) + 1;
    match_row(geometry, span, rows, mask, y);
    for (int x = span.first; x <= span.last; ++x) {
      const Match& match = matches_[x];
      if (match.state == kUnwanted) continue;
      ++counts.wanted;
      switch (match.state) {
        case kBorder: ++counts.border; continue;
        case kTexture: ++counts.texture; continue;
        case kUniqueness: ++counts.uniqueness; continue;
        default: break;
      }
      const int back = right_lanes_[geometry.reversed(x) + match.lane];
      if (c.left_right_px >= 0 && std::abs(back - match.lane) > c.left_right_px) {
        ++counts.left_right;
        continue;
      }
      raw_row[x - roi.left] = match.value;
    }
  }
  filter_.run(raw, mask.empty() ? mask : mask.window(roi.left, roi.top, roi.width, roi.height),
              out.window(roi.left, roi.top, roi.width, roi.height), counts);
  return counts;
}

}  // namespace stereotrack
