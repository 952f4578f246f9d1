#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/track/features_kernel.hpp"
#include "pipeline/track/kalman.hpp"

namespace stereotrack {

/// Corner features of a target, followed from frame to frame as the document does: each has a Kalman filter of
/// position and velocity (3.24-3.32); its prediction and innovation covariance bound the window in which the
/// feature's patch is searched.
///
/// Corners: smaller eigenvalue of the structure tensor over a 5x5 window (Shi and Tomasi 1994)
///     l = (a + c - sqrt((a - c)^2 + 4 b^2)) / 2,   [a b; b c] = sum [gx^2 gx gy; gx gy gy^2]
/// Search: sum of absolute differences of the 9x9 patch, each less its mean (so that a change of the light does
/// not matter), over all integer positions of the window; then one step of Gauss and Newton for the sub-pixel
/// (Lucas and Kanade 1981),
///     [sum gx^2  sum gx gy; sum gx gy  sum gy^2] step = sum [gx; gy] (patch - picture),
/// g the picture's gradient, all less their means. A patch is cut anew only when it has come to differ by half of
/// most_difference: each cut adds the sub-pixel's error to the path.
class Features {
 public:
  static constexpr int kPatch = kPatchSide;  ///< side of a patch [px]
  static constexpr int kMost = 12;           ///< features a target

  struct Config {
    int corner_quality = 400;  ///< smallest eigenvalue of a corner [grey levels^2 per pixel of gradient], 1..1e6
    int most_difference = 14;  ///< mean absolute difference above which a feature is lost [grey levels], 1..255
    int search_px = 24;        ///< the window never reaches further than this from the prediction [px], 1..64
  };

  struct Feature {
    ConstantVelocityFilter<2> filter;  ///< raw left picture [px, px/s]
    Patch patch{};
    /// From the patch's centre, a whole pixel, to the feature; at most half a pixel each way.
    ConstantVelocityFilter<2>::Vector offset = ConstantVelocityFilter<2>::Vector::Zero();
    ConstantVelocityFilter<2>::Vector moved =
        ConstantVelocityFilter<2>::Vector::Zero();  ///< from the frame before to the latest [px]

    template <class Self, class Archive>
    static void visit_state(Self& self, Archive& archive) noexcept {
      archive(self.filter, self.patch, self.offset, self.moved);
    }
  };
  using Set = FixedVector<Feature, kMost>;

  /// Faults: kBadConfig, kBadSize, kOutOfMemory.
  [[nodiscard]] static Result<Features> create(const Config& config, int width, int height, Arena& arena) noexcept;

  /// Moves all features on by dt and searches each in its window of `luma`. Lost ones leave the set.
  /// acceleration_sd: process noise [px/s^2]. O(features x window x patch).
  void follow(ImageView<const std::uint8_t> luma, double dt, double acceleration_sd, Set& set) const noexcept;

  /// Fills the set with corners of `luma` where labels == label inside box, at least a patch apart from those
  /// it has. velocity, velocity_sd: start of the new filters [px/s]. O(box).
  void refill(ImageView<const std::uint8_t> luma, ImageView<const std::uint16_t> labels, std::uint16_t label,
              const Rect& box, const ConstantVelocityFilter<2>::Vector& velocity, double velocity_sd,
              Set& set) noexcept;

  /// Smaller eigenvalue at (x, y), per pixel of the window; 0 at the picture's border.
  [[nodiscard]] static double corner_strength(ImageView<const std::uint8_t> luma, int x, int y) noexcept;

 private:
  struct Corner {
    std::uint16_t x, y;
    float strength;
  };

  Config config_;
  std::span<Corner> corners_;  ///< of a box that are strong enough and still free, row by row
};
static_assert(RealTimeStage<Features, &Features::follow, &Features::refill>);

}  // namespace stereotrack
