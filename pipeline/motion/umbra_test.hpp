#pragma once

#include <cstdint>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"

namespace stereotrack {

/// Deep shadow at an object's foot, for one view alone: foreground that is ground after all, but so dark that neither
/// its chroma nor the background's texture is left for ShadowTest to recognise. Its form tells instead:
/// 1. it lies on the ground, so there is ground below it: it begins at a foot, a foreground pixel over one that is not
///    foreground;
/// 2. from there upwards the luma falls through the half-shadow to the darkest place, which gets least of the sky;
///    the first pixel that is brighter again is the object's. No threshold but the direction:
///        shadow = the foot and what is over it in its column, while Y(v - 1) <= Y(v)
/// 3. it is deep, somewhere in the column:  Y < darkest_percent / 100 Y_background;
/// 4. the ground lies flat and is seen at a slant, things stand upright: of the shadow so far, a row's run is shadow if
///    it is at least kFlat times as wide as its pixels are, in the mean, high over their feet (the foot has height 1),
///    and if all below it is. A leg in dark trousers stays.
/// What reaches the last row of the picture has no foot there. An object stays whole over its darkest place, whatever
/// its colour. Where there are two views, disparity knows better.
///
/// In: planes of one size, the background's under the present light. O(pixels) for the search of feet, and a few ns for
/// each pixel over one. One instance a thread.
class UmbraTest {
 public:
  static constexpr int kFlat = 2;  ///< width to height: ground seen at 30 degrees or less looks so, a square on it

  struct Config {
    int darkest_percent = 40;  ///< a light under this part of the background's is deep shadow [%], 1..99
  };

  /// Faults: kBadConfig, kBadSize, kOutOfMemory.
  [[nodiscard]] static Result<UmbraTest> create(const Config& config, int width, int height, Arena& arena) noexcept;

  /// Clears the pixels of `mask` (255 = foreground) that are deep shadow; returns how many. All of create()'s size.
  std::uint32_t run(ImageView<const std::uint8_t> y, ImageView<const std::uint8_t> y_background,
                    ImageView<std::uint8_t> mask) noexcept;

 private:
  void mark_column(ImageView<const std::uint8_t> y, ImageView<const std::uint8_t> y_background,
                   ImageView<const std::uint8_t> mask, int x, int foot) noexcept;

  Config config_;
  ImageView<std::uint8_t> heights_;  // over the foot, of what may be shadow, from 1; all zero between runs
};
static_assert(RealTimeStage<UmbraTest, &UmbraTest::run>);

}  // namespace stereotrack
