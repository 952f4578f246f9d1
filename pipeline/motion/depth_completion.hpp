#pragma once

#include <cstdint>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/core/result.hpp"

namespace stereotrack {

/// What belongs to an object and looks like the background behind it: found by its depth.
///
/// An object of disparity D whose colours are partly those of the background comes as pieces. A pixel of no region near
/// it is taken for the object's, where the present disparity d and the background's d_b are both known, if
///     |d - D| <= max(own_px, depth_part D)    at the object's depth
///     d - d_b > own_px                        and in front of the background
/// and at least half of the 9x9 pixels around are such: block matching widens an object by about half a block, a rim
/// which has less than half.
///
/// One instance a thread. O(window x 1), sums along rows and columns.
class DepthCompletion {
 public:
  struct Config {
    double depth_part = 0.06;  ///< 0.005..1
    double own_px = 1.0;       ///< 0.1..16 [px]
  };

  struct Input {
    ImageView<const std::uint16_t> disparity;             ///< 1/16 px, kNoDisparity where unknown
    ImageView<const std::uint16_t> disparity_background;  ///< the same of the background
  };

  /// Faults: kBadConfig, kBadSize, kOutOfMemory.
  [[nodiscard]] static Result<DepthCompletion> create(const Config& config, int width, int height,
                                                      Arena& arena) noexcept;

  /// Gives pixels of `window` whose label is 0 the label of the object with the disparity `object` [px]; returns how
  /// many.
  int run(const Input& in, const Rect& window, double object, std::uint16_t label,
          ImageView<std::uint16_t> labels) noexcept;

 private:
  Config config_;
  ImageView<std::uint8_t> likely_;
  ImageView<std::uint8_t> row_sums_;
};

}  // namespace stereotrack
