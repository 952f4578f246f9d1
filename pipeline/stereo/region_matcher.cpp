#include "pipeline/stereo/region_matcher.hpp"

#include <cmath>
#include <cstdlib>

namespace stereotrack {

namespace {

constexpr double kNoScore = 1e18;  ///< no candidate; far over the largest score

}  // namespace

Result<RegionMatcher> RegionMatcher::create(const Config& config, Arena& arena) noexcept {
  constexpr int kLargestSide = 8192;
  RegionMatcher m;
  m.config_ = config;
  Config& c = m.config_;
  if (c.right_width == 0) c.right_width = c.width;
  const auto within = [](double value, double low, double high) { return value >= low && value <= high; };
  const bool sizes_fit = c.width >= 1 && c.width <= kLargestSide && c.height >= 1 && c.height <= kLargestSide &&
                         c.right_width >= 1 && c.right_width <= kLargestSide && std::abs(c.offset) <= kLargestSide &&
                         c.disparities >= 1 && c.disparities <= kLargestDisparity + 1 && c.row_tolerance >= 0 &&
                         c.row_tolerance <= 3 && c.largest_sample >= 16 && c.largest_sample <= 4096;
  if (!sizes_fit || !within(c.bias_tolerance, 0, 255) || !within(c.foreground_penalty, 0, 255) ||
      !within(c.saturation, 1, 1000) || !within(c.noise, 0.1, 100) || !within(c.sigma_floor_px, 0.01, 10)) {
    return fail(Fault::kBadConfig);
  }
  const auto lanes = static_cast<std::size_t>(c.disparities);
  const auto rows = static_cast<std::size_t>(2 * c.row_tolerance + 1);
  m.samples_ = arena.array<RegionSample>(static_cast<std::size_t>(c.largest_sample));
  m.sums_ = {arena.array<std::int32_t>(lanes), arena.array<std::int32_t>(lanes), arena.array<std::int32_t>(lanes),
             arena.array<std::int32_t>(lanes)};
  m.scores_ = arena.array<double>(lanes * rows);
  m.shares_ = arena.array<double>(lanes * rows);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return m;
}

std::optional<Fault> RegionMatcher::check(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                          DisparityRange range,
                                          ImageView<const std::uint8_t> right_foreground) const noexcept {
  const Config& c = config_;
  if (left.width != c.width || left.height != c.height || right.width != c.right_width || right.height != c.height ||
      (!right_foreground.empty() && !right_foreground.same_size(right))) {
    return Fault::kBadSize;
  }
  if (!range.valid() || range.count() > c.disparities) return Fault::kBadConfig;
  return std::nullopt;
}

void RegionMatcher::score_row_offset(ImageView<const std::uint8_t> right,
                                     ImageView<const std::uint8_t> right_foreground, DisparityRange range,
                                     int row_offset, double* scores, double* shares) noexcept {
  const int lanes = range.count();
  // Lane i is disparity range.max - i: right columns then rise with i.
  region_sums({.samples = samples_.first(static_cast<std::size_t>(sample_size_)),
               .right = right,
               .moving = right_foreground,
               .shift = -config_.offset - range.max,
               .row_offset = row_offset,
               .lanes = lanes},
              sums_);
  for (int i = 0; i < lanes; ++i) {
    const auto lane = static_cast<std::size_t>(i);
    const int n = sums_.pixels[lane];
    double& score = scores[lanes - 1 - i];
    double& share = shares[lanes - 1 - i];
    score = kNoScore;
    share = 0;
    if (n == 0 || 2 * n < sample_size_) continue;
    const std::int64_t sum = sums_.differences[lane];
    const std::int64_t spread = std::int64_t{sums_.squares[lane]} * n - sum * sum;
    const double variance = static_cast<double>(spread) / (static_cast<double>(n) * n);
    const double bias = static_cast<double>(std::abs(sum)) / n;
    const double excess = std::max(0.0, bias - config_.bias_tolerance);
    share = right_foreground.empty() ? 1.0 : static_cast<double>(sums_.moving[lane]) / n;
    const double saturation = config_.saturation * config_.saturation;
    const double penalty = config_.foreground_penalty * config_.foreground_penalty;
    const double appearance = variance + excess * excess;
    score = appearance * saturation / (appearance + saturation) + penalty * (1 - share);
  }
}

RegionMatch RegionMatcher::best_match(ImageView<const std::uint8_t> right, DisparityRange range,
                                      ImageView<const std::uint8_t> right_foreground) noexcept {
  const int lanes = range.count();
  const int tolerance = config_.row_tolerance;
  if (sample_size_ == 0) return {};

  int best_row = 0;  // of scores_: 0, 1, 2, 3... are row offsets 0, -1, +1, -2...
  int best = -1;
  double best_score = kNoScore;
  const auto row_offset = [](int row) { return row % 2 == 1 ? -(row + 1) / 2 : row / 2; };
  const auto scores_of = [&](int row) { return scores_.data() + std::ptrdiff_t{row} * lanes; };
  const auto shares_of = [&](int row) { return shares_.data() + std::ptrdiff_t{row} * lanes; };
  for (int row = 0; row < 2 * tolerance + 1; ++row) {
    score_row_offset(right, right_foreground, range, row_offset(row), scores_of(row), shares_of(row));
    for (int i = 0; i < lanes; ++i) {
      if (scores_of(row)[i] >= best_score) continue;
      best_row = row;
      best = i;
      best_score = scores_of(row)[i];
    }
  }
  if (best < 0) return {};

  const double floor = config_.noise * config_.noise;
  const auto [leftmost, rightmost] =
      std::minmax_element(samples_.begin(), samples_.begin() + sample_size_,
                          [](const RegionSample& a, const RegionSample& b) { return a.x < b.x; });
  const int width = rightmost->x - leftmost->x + 1;
  const int apart = std::max(2, width / 2);
  double rival = kNoScore;
  for (int row = 0; row < 2 * tolerance + 1; ++row) {
    for (int i = 0; i < lanes; ++i) {
      if (std::abs(i - best) > apart) rival = std::min(rival, scores_of(row)[i]);
    }
  }

  RegionMatch match;
  match.found = true;
  match.cost = best_score;
  match.row_offset = row_offset(best_row);
  match.foreground_share = shares_of(best_row)[best];
  match.pixels = sample_size_;
  match.uniqueness = rival < kNoScore ? std::max(1.0, rival / std::max(best_score, floor)) : 1.0;
  match.disparity_px = range.min + best;
  match.sigma_px = 1.0;
  const double* scores = scores_of(best_row);
  if (best > 0 && best + 1 < lanes && scores[best - 1] < kNoScore && scores[best + 1] < kNoScore) {
    const double before = scores[best - 1];
    const double after = scores[best + 1];
    const double curvature = before - 2 * best_score + after;
    const double widest = std::max(1.0, 0.5 * width);
    double variance = widest * widest;
    if (curvature > 0) {
      match.disparity_px += std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5);
      const double missed = 0.25 * width * (1 - match.foreground_share);
      variance = 2 * std::max(best_score, floor) / (sample_size_ * curvature) + missed * missed +
                 config_.sigma_floor_px * config_.sigma_floor_px;
    }
    match.sigma_px = std::min(std::sqrt(variance), widest);
  }
  return match;
}

}  // namespace stereotrack
