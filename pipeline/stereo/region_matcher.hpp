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
/// In: rectified greys, 0..255; labels of the left picture's size, the region = pixels of `rect` that carry
/// `label`; `right_foreground` of the right picture's size (0 = background) or empty. Disparities as in
/// disparity.hpp. An empty region or one without candidates is no fault: found = false.
/// Faults: kBadConfig, kOutOfMemory at create(); kBadSize, kBadConfig (range over the stated maximum) at run.
/// Cost: O(min(region, largest_sample) x range x (2 row_tolerance + 1)): a larger region is sampled on a grid,
/// so that one huge object costs no more than a small one. Memory: 32 (1 + row_tolerance) bytes x largest range. One
/// instance a thread.
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

  [[nodiscard]] const Config& config() const noexcept { return config_; }

  [[nodiscard]] static Result<RegionMatcher> create(const Config& config, Arena& arena) noexcept;

  template <class Label>
  [[nodiscard]] Result<RegionMatch> run(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                        ImageView<const Label> labels, Label label, Rect rect, DisparityRange range,
                                        ImageView<const std::uint8_t> right_foreground) noexcept {
    if (!labels.same_size(left)) return fail(Fault::kBadSize);
    rect = intersect(rect, {0, 0, labels.width, labels.height});
    if (const auto fault = check(left, right, range, right_foreground)) return fail(*fault);
    for (int step = 1; !collect(left, labels, label, rect, step); ++step) {
    }
    return best_match(right, range, right_foreground);
  }

 private:
  RegionMatcher() noexcept = default;

  /// Every step-th pixel of every step-th row; false if they are more than the sample holds.
  template <class Label>
  [[nodiscard]] bool collect(ImageView<const std::uint8_t> left, ImageView<const Label> labels, Label label, Rect rect,
                             int step) noexcept {
    sample_size_ = 0;
    for (int y = rect.top; y < rect.bottom(); y += step) {
      for (int x = rect.left; x < rect.right(); x += step) {
        if (labels.at(x, y) != label) continue;
        if (sample_size_ == config_.largest_sample) return false;
        samples_[sample_size_] = {static_cast<std::int16_t>(x), static_cast<std::int16_t>(y), left.at(x, y)};
        ++sample_size_;
      }
    }
    return true;
  }

  [[nodiscard]] std::optional<Fault> check(ImageView<const std::uint8_t> left, ImageView<const std::uint8_t> right,
                                           DisparityRange range,
                                           ImageView<const std::uint8_t> right_foreground) const noexcept;
  [[nodiscard]] RegionMatch best_match(ImageView<const std::uint8_t> right, DisparityRange range,
                                       ImageView<const std::uint8_t> right_foreground) noexcept;
  void score_row_offset(ImageView<const std::uint8_t> right, ImageView<const std::uint8_t> right_foreground,
                        DisparityRange range, int row_offset, double* scores, double* shares) noexcept;

  Config config_;
  int sample_size_ = 0;
  std::span<RegionSample> samples_;
  RegionSums sums_;           ///< [candidate], largest disparity first
  std::span<double> scores_;  ///< E, [row offset][d - range.min]; kNoScore where no candidate exists
  std::span<double> shares_;  ///< share, likewise
};
static_assert(RealTimeStage<RegionMatcher, &RegionMatcher::run<std::uint8_t>, &RegionMatcher::run<std::uint16_t>>);

}  // namespace stereotrack
