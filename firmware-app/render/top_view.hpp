#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "firmware-app/render/trails.hpp"
#include "firmware-app/render/zones.hpp"
#include "pipeline/geometry/rectified_geometry.hpp"

namespace stereotrack::render {

/// How lengths are told to people.
struct LengthUnit {
  double per_unit = 1;     ///< of these in one unit of the calibration
  std::string name = "u";  ///< "m", or "u" for a calibration whose unit is not known
};

/// Seen from above: the left rectified camera at the middle of the lower edge, x right, z up. Grid, field of view
/// of the left camera (shaded), both cameras' places, outlines of zones in space, ignored ones filled, and each track
/// with depth: dot, 1-sigma ellipse of (x, z), where it will be in 0.5 s, trail.
///
/// Scale: one for both axes. The depth at the upper edge is one of 1 1.5 2 3 5 7 times a power of ten. It
/// starts at the first of them over Z of a disparity of a tenth of the picture's width, and grows, never
/// shrinks, when a confirmed and measured track of a second's age does not fit, up to Z of 2 px, where depth says
/// nothing any more. Tracks beyond the edge are drawn on it, hollow.
class TopView {
 public:
  TopView(const RectifiedGeometry& geometry, LengthUnit unit, std::vector<ShownZone> zones = {});

  /// Fills `picture`. Tracks of `result` must have been added to `trails`.
  void draw(cv::Mat& picture, const FrameResult& result, const Trails& trails);

 private:
  void make_room(const FrameResult& result, cv::Size size);
  void draw_scene(cv::Mat& picture) const;
  void draw_zones(cv::Mat& picture) const;
  void draw_track(cv::Mat& picture, const TrackReport& track, const Trails& trails) const;
  [[nodiscard]] double px_per_length(cv::Size size) const;
  [[nodiscard]] cv::Point2d place(cv::Size size, double x, double z) const;

  RectifiedGeometry geometry_;
  LengthUnit unit_;
  std::vector<ShownZone> zones_;  ///< in space
  double reach_ = 1;              ///< depth at the upper edge [unit_]
};

}  // namespace stereotrack::render
