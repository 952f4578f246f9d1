#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/track/track_report.hpp"

namespace stereotrack::signals {

/// Where a target may be. Either a box in space or a polygon in the picture.
struct Zone {
  static constexpr std::size_t kMaxCorners = 16;

  enum class Kind : std::uint8_t {
    kSpace,    ///< position in the box: left rectified camera frame, x right, y down, z forward [m]
    kPicture,  ///< point of the target in the polygon: raw left picture [px]
  };
  /// Which point of a target has to lie in the polygon.
  enum class Anchor : std::uint8_t {
    kCentre,  ///< (image_x, image_y)
    kBottom,  ///< (image_x, last row of the box): where what stands on the ground touches it
  };
  struct Range {
    double from = 0;
    double to = 0;
  };
  struct Corner {
    double x = 0;
    double y = 0;
  };

  Kind kind = Kind::kSpace;
  Range x_m, y_m, z_m;                       ///< kSpace: both ends belong to it
  FixedVector<Corner, kMaxCorners> corners;  ///< kPicture: 3 or more, in either order; edges may cross (even-odd rule)
  Anchor anchor = Anchor::kCentre;           ///< kPicture
};

/// kBadConfig: a range from > to, fewer than three corners; kNotFinite.
[[nodiscard]] Result<void> check(const Zone& zone) noexcept;

/// A target without depth is in no box of space; a value that is not finite is nowhere. O(corners).
[[nodiscard]] bool contains(const Zone& zone, const TrackReport& target, double unit_m) noexcept;

}  // namespace stereotrack::signals
