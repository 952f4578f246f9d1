#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/track/appearance.hpp"

namespace stereotrack {

/// One object candidate of one frame: what the tracker is fed with.
struct Detection {
  Rect box;                                            ///< tight, raw left picture [px]
  FixedVector<Point, 48> hull;                         ///< convex hull, raw left picture, clockwise on the screen
  int area = 0;                                        ///< pixels of its mask
  bool has_depth = false;                              ///< the fields up to position_covariance are known
  double disparity = 0;                                ///< median over its mask [px]
  double disparity_sd = 0;                             ///< standard deviation of that median [px]
  double disparity_reach = 0;                          ///< nine tenths of its pixels are this near the median [px]
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< centroid of the visible surface [calibration unit]
  Eigen::Matrix3d position_covariance = Eigen::Matrix3d::Zero();
  Appearance appearance;  ///< over its mask
  bool whole = true;      ///< no target shares its segment of depth
  int region = 0;         ///< connected region of the foreground of which it is a part, 0 = its own alone
  double strength = 0;    ///< 0..1, how far above the foreground threshold it stands
  bool may_begin = true;  ///< false: it may be a known target's, but no target begins with it

  [[nodiscard]] double centre_x() const noexcept { return box.left + (box.width - 1) * 0.5; }
  [[nodiscard]] double centre_y() const noexcept { return box.top + (box.height - 1) * 0.5; }
};

/// The right camera does not see what lies further left in the left picture than its disparity: whatever was matched
/// there is wrong.
[[nodiscard]] inline bool is_blind(const Rect& box, double disparity_px) noexcept {
  constexpr double kMargin_px = 4;
  return box.right() < disparity_px + kMargin_px;
}

/// Where the tracker expects a target in the coming frame; bounds the search of the stages before it.
struct Prediction {
  std::uint32_t id = 0;
  bool confirmed = false;
  std::uint64_t apart = 0;   ///< bit id % 64 of each target that was seen beside this one, each a region of its own
  bool independent = false;  ///< has been seen as a region of its own, not only cut out of another's
  Rect box;                  ///< expected box, raw left picture, may reach outside [px]
  double area = 0;           ///< expected pixels of its mask
  double vx = 0;             ///< velocity of its centre in the picture [px/s]
  double vy = 0;
  double image_sd = 0;  ///< standard deviation of its centre, the larger axis [px]
  bool has_depth = false;
  double disparity = 0;                    ///< [px]
  double disparity_sd = 0;                 ///< from the state's covariance [px]
  double disparity_reach = 0;              ///< how far its surface usually reaches from there [px]
  const Appearance* appearance = nullptr;  ///< null: unknown; valid until the next update()

  [[nodiscard]] static std::uint64_t bit(std::uint32_t id) noexcept { return std::uint64_t{1} << (id % 64); }
  [[nodiscard]] bool seen_beside(const Prediction& other) const noexcept { return (apart & bit(other.id)) != 0; }
};

}  // namespace stereotrack
