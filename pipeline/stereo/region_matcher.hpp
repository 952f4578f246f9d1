#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/stereo/disparity.hpp"
#include "pipeline/stereo/region_kernel.hpp"

namespace stereotrack {

/// Where a whole region stands in the right picture.
struct RegionMatch {
  bool found = false;           ///< false: no candidate shows half of the region's pixels; the rest is then 0
  double disparity_px = 0;      ///< sub-pixel
  double sigma_px = 0;          ///< standard deviation of disparity_px
  double cost = 0;              ///< E of the best candidate [grey levels squared]
  double look = 0;              ///< of that, what is not for pixels beside the right foreground: its A, bent
  double uniqueness = 0;        ///< E of the best candidate elsewhere / E of the best, >= 1; 1 = no evidence
  double foreground_share = 1;  ///< of the region's pixels, how many fall on right foreground
  int row_offset = 0;           ///< right row - left row
  int pixels = 0;               ///< of the region that were compared
};

/// One disparity for one small region (a ball of 8x8 px, a box far away), from the region's own pixels alone:
/// what lies behind it differs between the two views and does not count. For each candidate (d, v), v a row
/// offset of at most `row_tolerance`, over the n pixels of the region whose partner is in the right picture,
/// e = L(x, y) - R(x - d - offset, y + v):
///     A = var(e) + max(0, |mean(e)| - bias_tolerance)^2
///     E = A s / (A + s) + foreground_penalty^2 (1 - share),   s = saturation^2
/// var(e): zero-mean squared difference, so exposures may differ; but a region may not pass for anything of
/// its shape: a mean difference beyond bias_tolerance counts. A is bent so that it cannot exceed s: blurred by
/// its motion, an object takes on the greys behind it, and then where it moved says more than how it looks. share: part
/// of the n pixels on `right_foreground` (a moving object moves in the right view too); a pixel beside it counts as
/// foreground_penalty grey levels of error. Candidates with n under half of the region's pixels do not exist. Of equal
/// E the smallest |v|, then the smallest d wins.
///
/// Sub-pixel: parabola through E(d* - 1), E(d*), E(d* + 1); k = its second difference. As for least squares,
///     sigma^2 = 2 max(E*, noise^2) / (n k) + (width (1 - share) / 4)^2 + sigma_floor^2
/// (second term: pixels that miss the right foreground leave room for a shift of that part of the width)
/// and at most half the region's width; where d* is an end of what exists, 1 px.
/// uniqueness: smallest E further than max(2, half the region's width) from d*, over max(E*, noise^2).
///
/// Not all of it is summed up: e^2 over some of the pixels bounds A from below, and a place of which that is over what
/// counts is left. What counts: E up to enough_uniqueness max(E*, noise^2), and up to most_cost; so the results are
/// those of the whole sum.
///
/// In: rectified greys, 0..255; the region: pixels of the left picture, all of them take()n before a match_taken() or,
/// as pixels of `rect` that carry `label`, by it; `right_foreground` of the right picture's size (0 = background) or
/// empty. Disparities as in disparity.hpp. An empty region or one without candidates is no fault: found = false.
/// Faults: kBadConfig, kOutOfMemory at create(); kBadSize, kBadConfig (range over the stated maximum) at run.
/// Cost: O(min(region, largest_sample) x range x (2 row_tolerance + 1)) at most, and a tenth of it for what has
/// texture; a larger region is sampled on a grid, so that one huge object costs no more than a small one. Memory: 32
/// bytes x (2 row_tolerance + 1) x largest range. One instance a thread.
class RegionMatcher {
 public:
  struct Config {
    int width = 0;                   ///< left picture [px], 1..8192
    int height = 0;                  ///< both pictures [px], 1..8192
    int right_width = 0;             ///< right picture [px], 0 = as the left one
    int offset = 0;                  ///< right column = left column - disparity - offset [px], -8192..8192
    int disparities = 64;            ///< most candidates a call may ask for
    int row_tolerance = 1;           ///< 0..3 [px]
    int largest_sample = 1024;       ///< 16..4096 [px]
    double bias_tolerance = 12;      ///< 0..255 [grey levels]
    double saturation = 30;          ///< 1..1000 [grey levels]
    double foreground_penalty = 60;  ///< 0..255 [grey levels]
    double noise = 2;                ///< standard deviation of e for a perfect match, 0.1..100 [grey levels]
    double sigma_floor_px = 0.2;     ///< 0.01..10 [px]
  };

  struct Search {
    DisparityRange range;
    double most_cost = kAnyCost;          ///< found: false where even the best E is over it
    double enough_uniqueness = kAnyCost;  ///< a larger uniqueness is told as this, >= 1
  };
  static constexpr double kAnyCost = 1e12;

  [[nodiscard]] const Config& config() const noexcept { return config_; }

  [[nodiscard]] static Result<RegionMatcher> create(const Config& config, Arena& arena) noexcept;

  /// The region: those pixels of `rect`, which must lie in the left picture, for which inside(x, y).
  template <class Inside>
  void take(const Rect& rect, Inside&& inside) noexcept {
    for (int step = 1; !collect(rect, step, inside); ++step) {
    }
    spread();
  }

  /// Matches the region that was taken last, of which `left` gives the greys.
  [[nodiscard]] Result<RegionMatch> match_taken(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                                const Search& search,
                                                ImageView<const std::uint8_t> right_foreground) noexcept {
    if (const auto fault = check(left, right, search.range, right_foreground)) return fail(*fault);
    read_greys(left);
    return best_match(right, search, right_foreground);
  }

  template <class Label>
  [[nodiscard]] Result<RegionMatch> run(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                        ImageView<const Label> labels, Label label, const Rect& rect,
                                        DisparityRange range, ImageView<const std::uint8_t> right_foreground) noexcept {
    if (!labels.same_size(left)) return fail(Fault::kBadSize);
    if (const auto fault = check(left, right, range, right_foreground)) return fail(*fault);
    take(intersect(rect, {0, 0, labels.width, labels.height}),
         [&](int x, int y) noexcept { return labels.at(x, y) == label; });
    return match_taken(left, right, {.range = range}, right_foreground);
  }

 private:
  RegionMatcher() noexcept = default;

  /// One task's constants.
  struct Task {
    ImageView<const std::uint8_t> right;
    ImageView<const std::uint8_t> moving;
    Search search;
    int lanes = 0;
    int steps = 0;          ///< of kRegionStep lanes, a row of places
    int first_inside = 0;   ///< lanes [first_inside, end_inside): all pixels meet one, as far as columns matter
    int end_inside = 0;     ///< may lie beyond the last lane
    int first_touched = 0;  ///< lanes [first_touched, end_touched): some may
    int end_touched = 0;
  };

  /// Every step-th pixel of every step-th row; false if they are more than the sample holds.
  template <class Inside>
  [[nodiscard]] bool collect(const Rect& rect, int step, Inside& inside) noexcept {
    sample_size_ = 0;
    for (int y = rect.top; y < rect.bottom(); y += step) {
      for (int x = rect.left; x < rect.right(); x += step) {
        if (!inside(x, y)) continue;
        if (sample_size_ == config_.largest_sample) return false;
        found_[sample_size_] = {static_cast<std::int16_t>(x), static_cast<std::int16_t>(y), 0};
        ++sample_size_;
      }
    }
    return true;
  }

  [[nodiscard]] std::optional<Fault> check(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                           DisparityRange range,
                                           ImageView<const std::uint8_t> right_foreground) const noexcept;
  void spread() noexcept;
  void read_greys(ImageView<const std::uint8_t> left) noexcept;
  [[nodiscard]] RegionMatch best_match(ImageView<const std::uint8_t> right, const Search& search,
                                       ImageView<const std::uint8_t> right_foreground) noexcept;
  [[nodiscard]] Task task_of(ImageView<const std::uint8_t> right, const Search& search,
                             ImageView<const std::uint8_t> right_foreground) const noexcept;
  [[nodiscard]] std::size_t first_lane(const Task& task, int row, int step) const noexcept;
  [[nodiscard]] int summed(const Task& task, int row, int step) const noexcept;
  void sum_up(const Task& task, int row, int step, int until) noexcept;
  [[nodiscard]] bool rows_inside(const Task& task, int row) const noexcept;
  [[nodiscard]] bool is_over(const Task& task, int row, int step, double best) const noexcept;
  [[nodiscard]] double look_of(std::size_t lane) const noexcept;
  [[nodiscard]] double finish(const Task& task, int row, int step) noexcept;
  void leave(const Task& task, int row, int step) noexcept;

  Config config_;
  int sample_size_ = 0;
  Rect extent_;                      ///< of the samples
  std::span<RegionSample> found_;    ///< in raster order
  std::span<RegionSample> samples_;  ///< the same, the first few from all over the region
  RegionSums sums_;                  ///< [row offset][lane], the largest disparity first, steps of lanes padded
  std::span<std::int16_t> summed_;   ///< [row offset][step of lanes]: samples so far
  std::span<double> scores_;  ///< E, [row offset][d - range.min]; kNoScore where no candidate exists, kLeft where left
  std::span<double> shares_;  ///< share, likewise
};
static_assert(RealTimeStage<RegionMatcher, &RegionMatcher::match_taken, &RegionMatcher::run<std::uint8_t>,
                            &RegionMatcher::run<std::uint16_t>>);

}  // namespace stereotrack
