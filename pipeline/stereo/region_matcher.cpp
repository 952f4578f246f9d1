#include "pipeline/stereo/region_matcher.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace stereotrack {

namespace {

constexpr double kNoScore = 1e18;  // no candidate; far over the largest score
constexpr double kLeft = 1e17;     // a candidate that costs more than what counts
constexpr int kFirstLook = 16;     // samples by which most places are seen to be wrong
// Bounds are so much wider than what they bound that no rounding matters.
constexpr double kMargin = 1e-9;

// Row offsets in the order of their rows of places: 0, -1, +1, -2...
int offset_of(int row) noexcept { return row % 2 == 1 ? -(row + 1) / 2 : row / 2; }

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
  const auto steps = static_cast<std::size_t>((c.disparities + kRegionStep - 1) / kRegionStep);
  const auto rows = static_cast<std::size_t>(2 * c.row_tolerance + 1);
  const auto lanes = steps * kRegionStep * rows;
  m.found_ = arena.array<RegionSample>(static_cast<std::size_t>(c.largest_sample));
  m.samples_ = arena.array<RegionSample>(static_cast<std::size_t>(c.largest_sample));
  m.sums_ = {arena.array<std::int32_t>(lanes), arena.array<std::int32_t>(lanes), arena.array<std::int32_t>(lanes),
             arena.array<std::int32_t>(lanes)};
  m.summed_ = arena.array<std::int16_t>(steps * rows);
  m.scores_ = arena.array<double>(lanes);
  m.shares_ = arena.array<double>(lanes);
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

// The first few samples come from all over the region, and every later part of them does.
void RegionMatcher::spread() noexcept {
  const int apart = std::max((sample_size_ + kFirstLook - 1) / kFirstLook, 1);
  std::ptrdiff_t next = 0;
  for (int first = 0; first < apart; ++first) {
    for (int i = first; i < sample_size_; i += apart) samples_[next++] = found_[i];
  }
  int left = 0;
  int right = 0;
  if (sample_size_ > 0) {
    const auto [leftmost, rightmost] =
        std::minmax_element(samples_.begin(), samples_.begin() + sample_size_,
                            [](const RegionSample& a, const RegionSample& b) { return a.x < b.x; });
    left = leftmost->x;
    right = rightmost->x + 1;
    const int top = found_[0].y;
    extent_ = {left, top, right - left, found_[sample_size_ - 1].y + 1 - top};
  }
}

void RegionMatcher::read_greys(ImageView<const std::uint8_t> left) noexcept {
  for (std::ptrdiff_t i = 0; i < sample_size_; ++i) samples_[i].grey = left.at(samples_[i].x, samples_[i].y);
}

RegionMatcher::Task RegionMatcher::task_of(ImageView<const std::uint8_t> right, const Search& search,
                                           ImageView<const std::uint8_t> right_foreground) const noexcept {
  Task task{.right = right, .moving = right_foreground, .search = search};
  task.lanes = search.range.count();
  task.steps = (task.lanes + kRegionStep - 1) / kRegionStep;
  // Lane i is disparity range.max - i: right columns then rise with i, from here on.
  const int left = extent_.left - config_.offset - search.range.max;
  const auto lane = [&](int i) { return std::clamp(i, 0, task.lanes); };
  task.first_inside = lane(-left);
  task.end_inside = right.width - extent_.width - left + 1;
  task.first_touched = lane(-left - extent_.width + 1);
  task.end_touched = lane(right.width - left);
  return task;
}

std::size_t RegionMatcher::first_lane(const Task& task, int row, int step) const noexcept {
  return static_cast<std::size_t>((row * task.steps + step) * kRegionStep);
}

int RegionMatcher::summed(const Task& task, int row, int step) const noexcept {
  return summed_[std::ptrdiff_t{row} * task.steps + step];
}

void RegionMatcher::sum_up(const Task& task, int row, int step, int until) noexcept {
  std::int16_t& done = summed_[std::ptrdiff_t{row} * task.steps + step];
  const int first = step * kRegionStep;
  const int count = std::min(kRegionStep, task.lanes - first);
  if (first < task.end_touched && first + count > task.first_touched) {
    region_sums(
        {.samples = samples_.subspan(static_cast<std::size_t>(done), static_cast<std::size_t>(until - done)),
         .right = task.right,
         .moving = task.moving,
         .shift = first - config_.offset - task.search.range.max,
         .row_offset = offset_of(row),
         .lanes = count,
         .inside = first >= task.first_inside && first + kRegionStep <= task.end_inside && rows_inside(task, row)},
        sums_.lanes(first_lane(task, row, step), kRegionStep));
  }
  done = static_cast<std::int16_t>(until);
}

bool RegionMatcher::rows_inside(const Task& task, int row) const noexcept {
  return extent_.top + offset_of(row) >= 0 && extent_.bottom() + offset_of(row) <= task.right.height;
}

// Whether what is summed up so far says that each of these lanes has a candidate, one that does not count if E* is
// `best` at most: by n var(e), which only grows, or by how many pixels can still fall on right foreground, or both.
bool RegionMatcher::is_over(const Task& task, int row, int step, double best) const noexcept {
  const int first = step * kRegionStep;
  const int end = std::min(first + kRegionStep, task.lanes);
  if (first < task.first_inside || end > task.end_inside || !rows_inside(task, row)) return false;
  const double floor = config_.noise * config_.noise;
  const double saturation = config_.saturation * config_.saturation;
  const double penalty = config_.foreground_penalty * config_.foreground_penalty;
  const double limit =
      task.search.enough_uniqueness * std::max(std::min(best, task.search.most_cost), floor) * (1 + kMargin);
  const int so_far = summed(task, row, step);
  std::int64_t most_spread = INT64_MAX;  // n^2 var(e), of so many samples
  if (const double spare = saturation - limit * (1 + kMargin); spare > 0) {
    const double spread = limit * saturation / spare * sample_size_ * so_far * (1 + kMargin);
    if (spread < 9e18) most_spread = static_cast<std::int64_t>(spread) + 1;
  }
  int least_moving = 0;
  if (!task.moving.empty() && limit < penalty) {
    // Fewer than this, with all of the samples to come, is too few.
    const double needed = (1 - limit / penalty) * (1 - kMargin) * sample_size_ - (sample_size_ - so_far);
    least_moving = std::max(static_cast<int>(needed), 0);
  }
  const RegionSums sums = sums_.lanes(first_lane(task, row, step), kRegionStep);
  for (std::size_t i = 0; i < static_cast<std::size_t>(end - first); ++i) {
    if (sums.moving[i] < least_moving) continue;
    const std::int64_t sum = sums.differences[i];
    const std::int64_t spread = std::int64_t{sums.squares[i]} * so_far - sum * sum;
    if (spread > most_spread) continue;
    if (task.moving.empty()) return false;
    const double look = static_cast<double>(spread) / (static_cast<double>(so_far) * sample_size_);
    const double share = static_cast<double>(sums.moving[i] + sample_size_ - so_far) / sample_size_;
    const double least = look * saturation / (look + saturation) + penalty * (1 - share);
    if (least * (1 - kMargin) <= limit) return false;
  }
  return true;
}

// A of a lane whose samples are all summed up, bent.
double RegionMatcher::look_of(std::size_t lane) const noexcept {
  const int n = sums_.pixels[lane];
  const std::int64_t sum = sums_.differences[lane];
  const std::int64_t spread = std::int64_t{sums_.squares[lane]} * n - sum * sum;
  const double variance = static_cast<double>(spread) / (static_cast<double>(n) * n);
  const double bias = static_cast<double>(std::abs(sum)) / n;
  const double excess = std::max(0.0, bias - config_.bias_tolerance);
  const double saturation = config_.saturation * config_.saturation;
  const double appearance = variance + excess * excess;
  return appearance * saturation / (appearance + saturation);
}

// All samples of a step, and its scores; the least of them.
double RegionMatcher::finish(const Task& task, int row, int step) noexcept {
  if (summed(task, row, step) < sample_size_) sum_up(task, row, step, sample_size_);
  const int first = step * kRegionStep;
  const double penalty = config_.foreground_penalty * config_.foreground_penalty;
  double least = kNoScore;
  for (int i = first; i < std::min(first + kRegionStep, task.lanes); ++i) {
    const std::size_t lane = first_lane(task, row, step) + static_cast<std::size_t>(i - first);
    const int n = sums_.pixels[lane];
    double& score = scores_[std::ptrdiff_t{row} * task.lanes + task.lanes - 1 - i];
    double& share = shares_[std::ptrdiff_t{row} * task.lanes + task.lanes - 1 - i];
    score = kNoScore;
    share = 0;
    if (n == 0 || 2 * n < sample_size_) continue;
    share = task.moving.empty() ? 1.0 : static_cast<double>(sums_.moving[lane]) / n;
    score = look_of(lane) + penalty * (1 - share);
    least = std::min(least, score);
  }
  return least;
}

void RegionMatcher::leave(const Task& task, int row, int step) noexcept {
  const int first = step * kRegionStep;
  const int count = std::min(kRegionStep, task.lanes - first);
  std::fill_n(scores_.begin() + std::ptrdiff_t{row} * task.lanes + task.lanes - first - count, count, kLeft);
}

RegionMatch RegionMatcher::best_match(ImageView<const std::uint8_t> right, const Search& search,
                                      ImageView<const std::uint8_t> right_foreground) noexcept {
  if (sample_size_ == 0) return {};
  const Task task = task_of(right, search, right_foreground);
  const DisparityRange& range = search.range;
  const int lanes = task.lanes;
  const int rows = 2 * config_.row_tolerance + 1;
  const std::ptrdiff_t steps = std::ptrdiff_t{rows} * task.steps;
  for (const std::span<std::int32_t>& sums : {sums_.differences, sums_.squares, sums_.moving, sums_.pixels}) {
    std::fill_n(sums.begin(), steps * kRegionStep, 0);
  }
  std::fill_n(summed_.begin(), steps, std::int16_t{0});

  // Where the first few samples fit best, the best place is likely to be.
  const int look = std::min(kFirstLook, sample_size_);
  int likely_row = 0;
  int likely_step = 0;
  std::int64_t least = INT64_MAX;
  for (int row = 0; row < rows; ++row) {
    for (int step = 0; step < task.steps; ++step) {
      sum_up(task, row, step, look);
      const std::size_t first = first_lane(task, row, step);
      for (int i = 0; i < std::min(kRegionStep, lanes - step * kRegionStep); ++i) {
        const std::size_t lane = first + static_cast<std::size_t>(i);
        if (sums_.pixels[lane] < look) continue;
        const std::int64_t sum = sums_.differences[lane];
        const std::int64_t spread = std::int64_t{sums_.squares[lane]} * look - sum * sum;
        if (spread >= least) continue;
        least = spread;
        likely_row = row;
        likely_step = step;
      }
    }
  }
  double least_score = finish(task, likely_row, likely_step);
  for (int row = 0; row < rows; ++row) {
    for (int step = 0; step < task.steps; ++step) {
      if (row == likely_row && step == likely_step) continue;
      bool over = is_over(task, row, step, least_score);
      while (!over && summed(task, row, step) < sample_size_) {
        sum_up(task, row, step, std::min(2 * summed(task, row, step), sample_size_));
        over = summed(task, row, step) < sample_size_ && is_over(task, row, step, least_score);
      }
      if (over) {
        leave(task, row, step);
      } else {
        least_score = std::min(least_score, finish(task, row, step));
      }
    }
  }

  int best_row = 0;
  int best = -1;
  double best_score = kLeft;
  const auto scores_of = [&](int row) { return scores_.data() + std::ptrdiff_t{row} * lanes; };
  for (int row = 0; row < rows; ++row) {
    for (int i = 0; i < lanes; ++i) {
      if (scores_of(row)[i] >= best_score) continue;
      best_row = row;
      best = i;
      best_score = scores_of(row)[i];
    }
  }
  if (best < 0 || best_score > search.most_cost) return {};

  const double floor = config_.noise * config_.noise;
  const int width = extent_.width;
  const int apart = std::max(2, width / 2);
  double rival = kNoScore;
  for (int row = 0; row < rows; ++row) {
    for (int i = 0; i < lanes; ++i) {
      if (std::abs(i - best) > apart) rival = std::min(rival, scores_of(row)[i]);
    }
  }
  // The places beside the best give the sub-pixel.
  for (const int i : {best - 1, best + 1}) {
    if (i >= 0 && i < lanes && scores_of(best_row)[i] == kLeft) {
      (void)finish(task, best_row, (lanes - 1 - i) / kRegionStep);
    }
  }

  RegionMatch match;
  match.found = true;
  match.cost = best_score;
  match.look = look_of(first_lane(task, best_row, 0) + static_cast<std::size_t>(lanes - 1 - best));
  match.row_offset = offset_of(best_row);
  match.foreground_share = shares_[std::ptrdiff_t{best_row} * lanes + best];
  match.pixels = sample_size_;
  match.uniqueness = 1.0;
  if (rival < kNoScore) {
    match.uniqueness = std::clamp(rival / std::max(best_score, floor), 1.0, search.enough_uniqueness);
  }
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
