#pragma once

#include <cstdint>

#include "pipeline/core/image_view.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/core/stage.hpp"

namespace stereotrack {

/// Ghosts by their contour: a region differs from the background because something is there now, or because
/// something was there while the background was learnt. The edge along its contour tells, without a second view: an
/// object has it in the present picture, a ghost in the background.
///     contrast C(I) = sum over the contour of  sum over Y, Cb, Cr of |I(inner) - I(outer)|
/// inner and outer are kContourReach px to either side of the contour, along the row or the column, the inner one in
/// the region, the outer one in no region, so that neither lies on the blurred edge itself.
///     ghost:  C(background) > 2 C(picture)  and  C(background) - C(picture) > kLeastContrast a place
/// An object that looks like the floor around it and hides a mark on that floor has a ghost's contour, too: whoever
/// forgets background on this verdict alone should see it stand still.
///
/// In: planes of one size, smoothed, the background's under the present light; empty chroma for grey. O(box). No state.
class GhostTest {
 public:
  static constexpr int kContourReach = 3;   ///< [px]
  static constexpr int kLeastContrast = 6;  ///< [grey levels, summed over the channels]
  static constexpr int kLeastPlaces = 12;   ///< fewer say nothing

  struct Input {
    ImageView<const std::uint8_t> y;
    ImageView<const std::uint8_t> cb;
    ImageView<const std::uint8_t> cr;
    ImageView<const std::uint8_t> y_background;
    ImageView<const std::uint8_t> cb_background;
    ImageView<const std::uint8_t> cr_background;
    ImageView<const std::uint16_t> labels;  ///< region of each pixel, 0 = none
  };

  /// Contrast along a contour.
  struct Contour {
    std::int64_t now = 0;         ///< in the picture [grey levels]
    std::int64_t background = 0;  ///< in the background [grey levels]
    int places = 0;               ///< pairs of inner and outer pixels
    [[nodiscard]] bool is_ghost() const noexcept {
      return places >= kLeastPlaces && background > 2 * now && background - now > std::int64_t{kLeastContrast} * places;
    }
  };

  [[nodiscard]] static Contour measure(const Input& in, const Rect& box, std::uint16_t label) noexcept;
};
static_assert(RealTimeStage<GhostTest, &GhostTest::measure>);

}  // namespace stereotrack
