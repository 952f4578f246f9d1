#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"
#include "pipeline/geometry/calibration.hpp"
#include "pipeline/geometry/camera.hpp"
#include "pipeline/geometry/rectified_geometry.hpp"
#include "pipeline/geometry/remap_kernel.hpp"

namespace stereotrack {

/// The rotation nearest to `m` (its orthogonal polar factor, by Newton's iteration: Higham 1986), which
/// takes the last digits' rounding out of a calibration file. Faults: kNotFinite; kBadConfig, if `m` is
/// farther than 0.01 (any element) from it, or mirrors.
[[nodiscard]] Result<Eigen::Matrix3d> nearest_rotation(const Eigen::Matrix3d& m) noexcept;

/// The rotation about the same axis by half the angle: of the quaternion q, normalize(q + 1).
/// In: a rotation by less than 180 degrees.
[[nodiscard]] Eigen::Matrix3d half_rotation(const Eigen::Matrix3d& rotation) noexcept;

/// How both raw cameras are turned and onto which canvases they are drawn: what rectification decides
/// before it fills its tables.
struct RectificationPlan {
  Camera left;
  Camera right;
  Eigen::Matrix3d R_rect_left;   ///< p_rectified = R_rect_left p_left; OpenCV's R1
  Eigen::Matrix3d R_rect_right;  ///< OpenCV's R2
  RectifiedGeometry geometry;
};

/// Axes: those of OpenCV's stereoRectify with CALIB_ZERO_DISPARITY (Bouguet), to 1e-9:
///     h  = half of R_right_left; left turns by h, right by h^-1, and both look the same way
///     t' = h^-1 t_right_left, the baseline seen from there
///     w  = the smallest rotation that turns t' onto (-1, 0, 0)
///     R_rect_left = w h,  R_rect_right = w h^-1,  baseline = |t_right_left|
/// Canvas: ours, so that what each view shows is kept.
///     f         mean of the four raw focal lengths, which keeps the resolution
///     rows      those that the left picture fills, for both
///     columns   those that the left, the right picture fills; principal points are whole numbers
/// Each side at most kMaxGrowth times the raw picture's: fisheye pictures and strong toe-in, whose corners
/// would need more, are cropped symmetrically about the ray of the picture's centre (TUM-VI's fisheye
/// keeps 58 % of its picture so, 64 degrees to each side).
/// A rig that is already rectified (no distortion, one camera matrix, fx = fy, no rotation, baseline along
/// x) gets the raw picture's own canvas: the map is the identity.
///
/// Faults: kBadSize (raw picture not 2..16384 px a side, or not the calibration's size), kNotFinite,
/// kBadConfig (no rotation, baseline zero or not along -x: swapped cameras; a lens equation that cannot be
/// inverted in the middle half of the picture; a camera that looks away from the common direction).
/// About 2 ms.
[[nodiscard]] Result<RectificationPlan> plan_rectification(const StereoCalibration& calibration, int raw_width,
                                                           int raw_height) noexcept;

/// Raw pictures -> rectified pictures, and coordinates both ways.
///
///     canvas (u, v) -> ray R_rect^T ((u - cx) / f, (v - cy) / f, 1) -> Camera::project -> raw (x, y)
/// Raw positions are kept in 1/32 px and interpolated bilinearly in whole numbers,
///     out = (sum of w_i p_i + 512) / 1024,  w = (32 - a | a)(32 - b | b), a and b in 1/32 px
/// which is what cv::remap(INTER_LINEAR) does with the same map, bit for bit (but for positions halfway
/// between two 1/32 px, which OpenCV's float maps may round the other way).
///
/// Memory from the arena at create(): 13 bytes a canvas pixel, 8 bytes a raw pixel; 55 MB and 0.3 s for
/// 1280x720 with a wide lens. run: rectify() 0.3 to 2 ns a pixel, no allocation. Immutable after create():
/// any thread.
class Rectifier {
 public:
  static constexpr double kMaxGrowth = 1.5;

  using Point16 = RawPixel;
  /// Place on a canvas [px], may lie outside of it; (kNowhere, kNowhere) where the lens equation has no ray.
  struct PointF {
    static constexpr float kNowhere = -32768.0F;
    float x = kNowhere;
    float y = kNowhere;
    [[nodiscard]] bool valid() const noexcept { return x != kNowhere; }
  };

  /// Faults: those of plan_rectification, and kOutOfMemory.
  [[nodiscard]] static Result<Rectifier> create(const StereoCalibration& calibration, int raw_width, int raw_height,
                                                Arena& arena) noexcept;

  [[nodiscard]] const RectifiedGeometry& geometry() const noexcept { return plan_.geometry; }
  [[nodiscard]] const RectificationPlan& plan() const noexcept { return plan_; }
  [[nodiscard]] int raw_width() const noexcept { return raw_width_; }
  [[nodiscard]] int raw_height() const noexcept { return raw_height_; }

  /// In: one channel of the raw picture of `view`, raw size. Out: its canvas (width_left or width_right by
  /// height); 0 where it shows nothing of the raw picture. With other sizes `out` is left untouched. kNearest is for
  /// masks: each pixel's raw_from_rectified().
  void rectify(ImageView<const std::uint8_t> raw, View view, ImageView<std::uint8_t> out,
               Sampling sampling = Sampling::kBilinear) const noexcept;

  /// The map behind rectify(), for who draws parts of a canvas. Lives as long as the arena.
  [[nodiscard]] const RemapTable& table(View view) const noexcept { return of(view).table; }

  /// 255 where the canvas shows a place of the raw picture, else 0.
  [[nodiscard]] ImageView<const std::uint8_t> mask(View view) const noexcept { return of(view).table.mask; }

  /// Canvas pixel -> nearest raw pixel.
  [[nodiscard]] ImageView<const Point16> raw_from_rectified(View view) const noexcept { return of(view).nearest; }

  /// Left raw pixel -> place on the left canvas, within 1e-4 px: a table of raw size.
  [[nodiscard]] ImageView<const PointF> rectified_from_raw() const noexcept { return rectified_from_raw_; }

  /// The part of the left canvas in which a box of the left raw picture lies, by its rim, a pixel around it; clipped.
  /// Empty where the canvas shows nothing of the rim. O(rim).
  [[nodiscard]] Rect on_left_canvas(const Rect& raw) const noexcept;

  /// rectified_from_raw() for any place of the left raw picture, to 1e-8 px, computed: about 0.15 us. Nothing where the
  /// lens equation has no ray.
  [[nodiscard]] std::optional<Eigen::Vector2d> rectified_from_raw(double x, double y) const noexcept;

  /// A point in the left rectified camera frame -> left raw pixel [px], which may lie outside the picture.
  /// Nothing behind the camera or outside the lens equation's domain. About 50 ns.
  [[nodiscard]] std::optional<Eigen::Vector2d> raw_from_ray(double x, double y, double z) const noexcept;

 private:
  struct Map {
    RemapTable table;
    ImageView<Point16> nearest;
  };

  explicit Rectifier(const RectificationPlan& plan) noexcept : plan_(plan) {}
  [[nodiscard]] const Map& of(View view) const noexcept { return view == View::kLeft ? left_ : right_; }
  [[nodiscard]] bool fill(View view, Arena& arena) noexcept;
  [[nodiscard]] bool fill_rectified_from_raw(Arena& arena) noexcept;

  RectificationPlan plan_;
  int raw_width_ = 0;
  int raw_height_ = 0;
  Map left_;
  Map right_;
  ImageView<PointF> rectified_from_raw_;
};
static_assert(RealTimeStage<Rectifier, &Rectifier::rectify, &Rectifier::on_left_canvas, &Rectifier::raw_from_ray>);

}  // namespace stereotrack
