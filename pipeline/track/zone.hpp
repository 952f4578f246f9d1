#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/shape/bit_mask.hpp"
#include "pipeline/track/detection.hpp"
#include "pipeline/track/track_report.hpp"

namespace stereotrack {

/// A place that the configuration names. Either a box in space or a polygon in the picture.
struct Zone {
  static constexpr std::size_t kMaxCorners = 16;

  enum class Kind : std::uint8_t {
    kSpace,    ///< position in the box: left rectified camera frame, x right, y down, z forward [m]
    kPicture,  ///< point of the object in the polygon: raw left picture [px]
  };
  /// Which point of an object has to lie in the polygon.
  enum class Anchor : std::uint8_t {
    kCentre,  ///< its centre
    kBottom,  ///< (its centre's column, last row of the box): where what stands on the ground touches it
  };
  struct Range {
    double from = 0;
    double to = 0;
    friend bool operator==(const Range&, const Range&) = default;
  };
  struct Corner {
    double x = 0;
    double y = 0;
  };

  Kind kind = Kind::kSpace;
  Range x_m = {}, y_m = {}, z_m = {};             ///< kSpace: both ends belong to it
  FixedVector<Corner, kMaxCorners> corners = {};  ///< kPicture: 3 or more, in either order; edges may cross: even-odd
  Anchor anchor = Anchor::kCentre;                ///< kPicture
};

/// kBadConfig: a range from > to, fewer than three corners; kNotFinite.
[[nodiscard]] Result<void> check(const Zone& zone) noexcept;

/// The polygon holds a point if a ray from there to the right crosses an odd number of edges (even-odd rule). A point
/// of an edge belongs to one of the two sides; what is not finite is outside. O(corners).
[[nodiscard]] bool contains(std::span<const Zone::Corner> polygon, double x, double y) noexcept;

/// Sets the bits of the pixels whose centres the polygon holds, as contains() says; the others stay as they are.
/// Corners may lie outside of the picture, up to 1e9 px. O(rows x corners + words).
void add_polygon(std::span<const Zone::Corner> polygon, const BitMask& mask) noexcept;

/// What is without depth is in no box of space; a value that is not finite is nowhere. unit_m: metres in one unit of
/// the positions. O(corners).
[[nodiscard]] bool contains(const Zone& zone, const TrackReport& target, double unit_m) noexcept;
[[nodiscard]] bool contains(const Zone& zone, const Detection& detection, double unit_m) noexcept;

}  // namespace stereotrack
