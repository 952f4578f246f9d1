#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/shape/blob_extractor.hpp"

namespace stereotrack {

/// Level-set segmentation of one region (thesis 3.1, figure 3.19; the document gives no equation): the
/// two-phase piecewise constant model of Chan and Vese, "Active contours without edges", 2001,
///     E = sum_in (I - c_in)^2 + sum_out (I - c_out)^2 + w |C|               [grey^2]
///     c_in, c_out: mean of the feature inside and outside the contour C
///     |C|: number of pixel pairs up to sqrt(10) px apart that the contour parts, over 26: its Cauchy-Crofton
///          length, right within 4 % in any direction (Boykov and Kolmogorov, "Computing geodesics and
///          minimal surfaces via graph cuts", 2003). With 8 neighbours alone a straight contour sticks. [px]
/// evolved without a differential equation: the level-set function is its sign, the narrow band is the list
/// of pixels on both sides of the contour (the lists L_in, L_out of Shi and Karl, "A real-time algorithm for
/// the approximation of level-set-based curve evolution", 2008), and a pixel of the band changes sides if
/// that lowers E (Song and Chan, "A fast algorithm for level set based optimization", 2002). One iteration
/// visits the band once, moving the contour by a pixel at most, then renews the means.
///
/// * An absolute difference says that a pixel differs, not what it looks like: an object's bright and dark
///   parts differ by 20 or by 150, which is one class, not two. The cap makes it one. F-measure of the mask on
///   20 frames of cdnet_highway: 0.885 before, 0.869 after this stage without cap, 0.941 after it with 30.
/// * Integer: means in 1/256 grey level, energies in 1/65536 grey^2. The means are rounded to the nearest
///   step, the best one for a quadratic: E never rises.
/// * Only the contour moves: the region may split or gain holes that it reaches, nothing arises far from it.
/// * Domain: the region's box grown by margin_px, clipped to the picture. Outside it nothing changes.
/// * Pixels of other labels are no part of the domain: never taken, in neither mean, without length.
/// * Where the region fills its whole domain there is no outside to compare with: it stays as it is.
class LevelSet {
 public:
  struct Config {
    int margin_px = 8;          ///< how far the contour may leave the box, 0..1000 [px]
    int max_iterations = 20;    ///< bound on the work; 0 leaves the region as it is
    int contour_weight = 1500;  ///< w, over twice the variance of the feature's noise, 0..65025 [grey^2 / px]
    int feature_cap = 30;       ///< I = min(feature, cap), 1..255 [grey level]
  };

  struct Outcome {
    Blob blob;                     ///< the region afterwards; area 0 if it vanished
    int iterations = 0;            ///< visits of the band, <= max_iterations
    bool converged = false;        ///< a visit changed nothing
    std::int64_t energy_drop = 0;  ///< by how much E fell, >= 0 [grey^2 / 65536]
    int mean_in = 0;               ///< c_in at the end [grey level / 256]
    int mean_out = 0;              ///< c_out at the end [grey level / 256]
  };

  [[nodiscard]] static Result<LevelSet> create(const Config& config, int width, int height, Arena& arena) noexcept;

  /// In: feature, u8 (gray difference, or gray and chroma distance: what tells the object from the ground);
  /// labels, the region = pixels of `label` (> 0) inside `box`, of which the initial contour is the boundary
  /// (claim the hull with hull_claim() to start from it). Out: labels, refined in place.
  /// Faults: kBadSize, kBadConfig (label 0); labels untouched. O(domain + iterations x contour).
  /// One instance a thread.
  [[nodiscard]] Result<Outcome> run(ImageView<const std::uint8_t> feature, ImageView<std::uint16_t> labels,
                                    const Rect& box, std::uint16_t label) noexcept;

 private:
  /// One side of the contour.
  struct Phase {
    std::int64_t count = 0;
    std::int64_t sum = 0;
    std::int64_t sum_squares = 0;
    std::int64_t mean = 0;  ///< [grey level / 256]

    void add(int pixels, int values, int squares) noexcept {
      count += pixels;
      sum += values;
      sum_squares += squares;
    }
    void renew_mean() noexcept {
      if (count > 0) mean = (512 * sum + count) / (2 * count);
    }
    [[nodiscard]] std::int64_t energy() const noexcept {  ///< [grey^2 / 65536]
      return 65536 * sum_squares - 512 * mean * sum + count * mean * mean;
    }
  };

  void load(ImageView<const std::uint8_t> feature, ImageView<const std::uint16_t> labels, std::uint16_t label) noexcept;
  [[nodiscard]] int sweep() noexcept;  // how many pixels changed sides
  void sum_discs() noexcept;
  void flip(std::int32_t p) noexcept;
  void queue_contour(int y) noexcept;
  [[nodiscard]] std::int64_t pair_weight() const noexcept;  // of a parted pair [grey^2 / 65536]
  [[nodiscard]] std::int32_t at(int x, int y) const noexcept;

  Config config_;
  int width_ = 0;
  int height_ = 0;
  Rect domain_;
  std::int32_t stride_ = 0;
  Phase in_;
  Phase out_;
  std::int64_t parted_ = 0;  // pairs parted by the contour, less those at the start
  // The domain with a frame around it, as wide as pairs reach, rows stride_ apart.
  std::span<std::int8_t> side_;     // 1 inside, -1 outside, 0 not in the domain
  std::span<std::uint8_t> around_;  // sum of side_ over the disc of pairs, its middle included, from kNoSum up
  std::array<std::span<std::int8_t>, 3> row_sums_;  // of a row of side_, over 3, 5 and 7 pixels
  std::span<std::uint8_t> feature_;
  std::span<std::uint8_t> marks_;   // of one row: on the contour?
  std::span<std::uint8_t> queued_;  // the last visit for which a pixel was queued
  std::span<std::int32_t> band_;
  std::span<std::int32_t> next_band_;
  std::int32_t next_size_ = 0;
  std::uint8_t visit_ = 0;
};
static_assert(RealTimeStage<LevelSet, &LevelSet::run>);

}  // namespace stereotrack
