#include "pipeline/geometry/rectify.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace stereotrack {
namespace {

constexpr int kMaxSide = 16384;                     // positions in a canvas of 1.5 times this fit 16 bits
constexpr int kSubPixels = RemapTable::kSubPixels;  // positions are kept in 1/32 px, as cv::remap does
constexpr int kSamples = 65;                        // of a raw picture, each way, to find what it covers
constexpr double kFlattest = 20;                    // a ray flatter than this (tan of its angle) counts as this flat

/// Unit quaternion w + (x, y, z) by hand: Eigen's conversions call the C library's sin and acos.
struct Quaternion {
  double w;
  Eigen::Vector3d v;
};

Quaternion normalized(const Quaternion& q) noexcept {
  const double norm = std::sqrt(q.w * q.w + q.v.squaredNorm());
  return {q.w / norm, q.v / norm};
}

Eigen::Matrix3d matrix_of(const Quaternion& q) noexcept {
  const double x = q.v.x();
  const double y = q.v.y();
  const double z = q.v.z();
  const double w = q.w;
  Eigen::Matrix3d r;
  r << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
      2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),   //
      2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y);
  return r;
}

/// w >= 0. Each branch divides by the largest component (Shepperd 1978).
Quaternion quaternion_of(const Eigen::Matrix3d& r) noexcept {
  const double trace = r(0, 0) + r(1, 1) + r(2, 2);
  Quaternion q{1 + trace, {r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1)}};
  if (trace <= 0) {
    int i = 0;
    if (r(1, 1) > r(0, 0)) i = 1;
    if (r(2, 2) > r(i, i)) i = 2;
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    q.w = r(k, j) - r(j, k);
    q.v(i) = 1 + r(i, i) - r(j, j) - r(k, k);
    q.v(j) = r(i, j) + r(j, i);
    q.v(k) = r(i, k) + r(k, i);
  }
  if (q.w < 0) q = {-q.w, -q.v};
  return normalized(q);
}

/// The smallest rotation that turns `from` onto the unit vector `to`; they must not be opposite.
Eigen::Matrix3d rotation_onto(const Eigen::Vector3d& from, const Eigen::Vector3d& to) noexcept {
  const Eigen::Vector3d unit = from / std::sqrt(from.squaredNorm());
  return matrix_of(normalized({1 + unit.dot(to), unit.cross(to)}));
}

bool is_rectified(const StereoCalibration& c) noexcept {
  const auto plain = [](const CameraModel& m) {
    return m.lens == LensModel::kRadtan && m.fx == m.fy &&
           std::all_of(m.distortion.begin(), m.distortion.end(), [](double k) { return k == 0; });
  };
  return plain(c.left) && plain(c.right) && c.left.fx == c.right.fx && c.left.cx == c.right.cx &&
         c.left.cy == c.right.cy && c.R_right_left == Eigen::Matrix3d::Identity() && c.t_right_left.x() < 0 &&
         c.t_right_left.y() == 0 && c.t_right_left.z() == 0;
}

/// What a raw picture covers in a plane at distance 1 in the rectified frame.
struct Coverage {
  Eigen::Vector2d low{1e9, 1e9};
  Eigen::Vector2d high{-1e9, -1e9};
  Eigen::Vector2d centre{0, 0};
};

std::optional<Coverage> coverage(const Camera& camera, const Eigen::Matrix3d& rotation, int width,
                                 int height) noexcept {
  Coverage result;
  for (int j = 0; j < kSamples; ++j) {
    for (int i = 0; i < kSamples; ++i) {
      const Eigen::Vector2d pixel((width - 1.0) * i / (kSamples - 1), (height - 1.0) * j / (kSamples - 1));
      const std::optional<Eigen::Vector2d> p = camera.unproject(pixel);
      const bool middle_half = std::abs(2 * i - (kSamples - 1)) <= kSamples / 2 &&  //
                               std::abs(2 * j - (kSamples - 1)) <= kSamples / 2;
      if (!p && middle_half) return std::nullopt;
      if (!p) continue;
      const Eigen::Vector3d ray = rotation * Eigen::Vector3d(p->x(), p->y(), 1.0);
      const double across = std::sqrt(ray.x() * ray.x() + ray.y() * ray.y());
      const double depth = std::max(ray.z(), across / kFlattest);
      const Eigen::Vector2d place(ray.x() / depth, ray.y() / depth);
      result.low = result.low.cwiseMin(place);
      result.high = result.high.cwiseMax(place);
      if (2 * i == kSamples - 1 && 2 * j == kSamples - 1) {
        if (!(ray.z() > 0)) return std::nullopt;
        result.centre = place;
      }
    }
  }
  return result;
}

/// One direction of a canvas: its size and where the principal point lies.
struct Extent {
  int size;
  double principal;
};

Extent extent(double low, double high, double centre, double f, int raw_size) noexcept {
  const double half = 0.5 * Rectifier::kMaxGrowth * raw_size;
  const double first = std::floor(std::max(f * low, f * centre - half) + 0.5);
  const double last = std::floor(std::min(f * high, f * centre + half) + 0.5);
  const int limit = static_cast<int>(Rectifier::kMaxGrowth * raw_size);
  return {std::min(static_cast<int>(last - first) + 1, limit), -first};
}

}  // namespace

Result<Eigen::Matrix3d> nearest_rotation(const Eigen::Matrix3d& m) noexcept {
  if (!m.allFinite()) return fail(Fault::kNotFinite);
  if (!(m.determinant() > 0.5 && m.determinant() < 2)) return fail(Fault::kBadConfig);
  Eigen::Matrix3d r = m;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Matrix3d inverse_transposed = r.inverse().transpose();
    r = 0.5 * (r + inverse_transposed);
  }
  if (!((r - m).cwiseAbs().maxCoeff() <= 0.01)) return fail(Fault::kBadConfig);
  return r;
}

Eigen::Matrix3d half_rotation(const Eigen::Matrix3d& rotation) noexcept {
  Quaternion q = quaternion_of(rotation);
  q.w += 1;
  return matrix_of(normalized(q));
}

Result<RectificationPlan> plan_rectification(const StereoCalibration& calibration, int raw_width,
                                             int raw_height) noexcept {
  if (raw_width < 2 || raw_height < 2 || raw_width > kMaxSide || raw_height > kMaxSide) return fail(Fault::kBadSize);
  for (const CameraModel* camera : {&calibration.left, &calibration.right}) {
    if (camera->width != 0 && camera->width != raw_width) return fail(Fault::kBadSize);
    if (camera->height != 0 && camera->height != raw_height) return fail(Fault::kBadSize);
  }
  const Result<Camera> left = Camera::create(calibration.left);
  if (!left.has_value()) return fail(left.error());
  const Result<Camera> right = Camera::create(calibration.right);
  if (!right.has_value()) return fail(right.error());
  if (!calibration.t_right_left.allFinite()) return fail(Fault::kNotFinite);
  const Result<Eigen::Matrix3d> rotation = nearest_rotation(calibration.R_right_left);
  if (!rotation.has_value()) return fail(rotation.error());
  const double baseline = std::sqrt(calibration.t_right_left.squaredNorm());
  if (!(baseline > 0)) return fail(Fault::kBadConfig);

  if (is_rectified(calibration)) {
    const CameraModel& m = calibration.left;
    return RectificationPlan{*left, *right, Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity(),
                             RectifiedGeometry{.width_left = raw_width,
                                               .width_right = raw_width,
                                               .height = raw_height,
                                               .f = m.fx,
                                               .cx_left = m.cx,
                                               .cx_right = m.cx,
                                               .cy = m.cy,
                                               .baseline = baseline,
                                               .offset = 0}};
  }

  const Eigen::Matrix3d half = half_rotation(*rotation);
  const Eigen::Vector3d seen = half.transpose() * calibration.t_right_left;
  if (!(-seen.x() > std::fabs(seen.y()) && -seen.x() > std::fabs(seen.z()))) return fail(Fault::kBadConfig);
  const Eigen::Matrix3d level = rotation_onto(seen, {-1, 0, 0});
  const Eigen::Matrix3d R_rect_left = level * half;
  const Eigen::Matrix3d R_rect_right = level * half.transpose();

  const std::optional<Coverage> l = coverage(*left, R_rect_left, raw_width, raw_height);
  const std::optional<Coverage> r = coverage(*right, R_rect_right, raw_width, raw_height);
  if (!l || !r) return fail(Fault::kBadConfig);
  const double f = 0.25 * (calibration.left.fx + calibration.left.fy + calibration.right.fx + calibration.right.fy);
  const Extent left_columns = extent(l->low.x(), l->high.x(), l->centre.x(), f, raw_width);
  const Extent right_columns = extent(r->low.x(), r->high.x(), r->centre.x(), f, raw_width);
  const Extent rows = extent(l->low.y(), l->high.y(), l->centre.y(), f, raw_height);
  return RectificationPlan{*left, *right, R_rect_left, R_rect_right,
                           RectifiedGeometry{.width_left = left_columns.size,
                                             .width_right = right_columns.size,
                                             .height = rows.size,
                                             .f = f,
                                             .cx_left = left_columns.principal,
                                             .cx_right = right_columns.principal,
                                             .cy = rows.principal,
                                             .baseline = baseline,
                                             .offset = static_cast<int>(left_columns.principal) -
                                                       static_cast<int>(right_columns.principal)}};
}

Result<Rectifier> Rectifier::create(const StereoCalibration& calibration, int raw_width, int raw_height,
                                    Arena& arena) noexcept {
  const Result<RectificationPlan> plan = plan_rectification(calibration, raw_width, raw_height);
  if (!plan.has_value()) return fail(plan.error());
  Rectifier rectifier(*plan);
  rectifier.raw_width_ = raw_width;
  rectifier.raw_height_ = raw_height;
  if (!rectifier.fill(View::kLeft, arena)) return fail(Fault::kOutOfMemory);
  if (!rectifier.fill(View::kRight, arena)) return fail(Fault::kOutOfMemory);
  if (!rectifier.fill_rectified_from_raw(arena)) return fail(Fault::kOutOfMemory);
  return rectifier;
}

bool Rectifier::fill(View view, Arena& arena) noexcept {
  const bool is_left = view == View::kLeft;
  const RectifiedGeometry& g = plan_.geometry;
  const Camera& camera = is_left ? plan_.left : plan_.right;
  const Eigen::Matrix3d back = (is_left ? plan_.R_rect_left : plan_.R_rect_right).transpose();
  const int width = is_left ? g.width_left : g.width_right;
  const double cx = is_left ? g.cx_left : g.cx_right;

  Map map;
  RemapTable& table = map.table;
  table.corner = arena.image<Point16>(width, g.height);
  table.fractions = arena.image<std::uint16_t>(width, g.height);
  table.mask = arena.image<std::uint8_t>(width, g.height);
  table.window = arena.image<Point16>((width + RemapTable::kBlock - 1) / RemapTable::kBlock, g.height);
  table.place = arena.image<std::uint8_t>(width, g.height);
  map.nearest = arena.image<Point16>(width, g.height);
  if (arena.failed()) return false;

  for (int v = 0; v < g.height; ++v) {
    for (int u = 0; u < width; ++u) {
      table.corner.at(u, v) = {};
      map.nearest.at(u, v) = {};
      const Eigen::Vector3d ray = back * Eigen::Vector3d((u - cx) / g.f, (v - g.cy) / g.f, 1.0);
      if (!(ray.z() > 0)) continue;
      const std::optional<Eigen::Vector2d> p = camera.project({ray.x() / ray.z(), ray.y() / ray.z()});
      // The comparison comes first: a value far outside does not fit an int.
      if (!p || !(p->x() > -1 && p->y() > -1 && p->x() < raw_width_ && p->y() < raw_height_)) continue;
      const int x = static_cast<int>(std::floor(p->x() * kSubPixels + 0.5));
      const int y = static_cast<int>(std::floor(p->y() * kSubPixels + 0.5));
      if (x < 0 || y < 0 || x > (raw_width_ - 1) * kSubPixels || y > (raw_height_ - 1) * kSubPixels) continue;
      // On the last column and row the corner steps back, so that all four pixels exist.
      const int corner_x = std::min(x / kSubPixels, raw_width_ - 2);
      const int corner_y = std::min(y / kSubPixels, raw_height_ - 2);
      table.corner.at(u, v) = {static_cast<std::int16_t>(corner_x), static_cast<std::int16_t>(corner_y)};
      table.fractions.at(u, v) = static_cast<std::uint16_t>((x - corner_x * kSubPixels) +
                                                            ((y - corner_y * kSubPixels) << RemapTable::kFractionBits));
      map.nearest.at(u, v) = {static_cast<std::int16_t>((x + kSubPixels / 2) / kSubPixels),
                              static_cast<std::int16_t>((y + kSubPixels / 2) / kSubPixels)};
      table.mask.at(u, v) = 255;
    }
  }
  table.find_windows(raw_width_, raw_height_);
  (is_left ? left_ : right_) = map;
  return true;
}

bool Rectifier::fill_rectified_from_raw(Arena& arena) noexcept {
  const RectifiedGeometry& g = plan_.geometry;
  rectified_from_raw_ = arena.image<PointF>(raw_width_, raw_height_);
  if (rectified_from_raw_.empty()) return false;
  for (int y = 0; y < raw_height_; ++y) {
    std::optional<Eigen::Vector2d> neighbour;
    for (int x = 0; x < raw_width_; ++x) {
      const Eigen::Vector2d pixel(x, y);
      neighbour = neighbour ? plan_.left.unproject(pixel, *neighbour) : plan_.left.unproject(pixel);
      PointF& out = rectified_from_raw_.at(x, y);
      out = {};
      if (!neighbour) continue;
      const Eigen::Vector3d ray = plan_.R_rect_left * Eigen::Vector3d(neighbour->x(), neighbour->y(), 1.0);
      if (!(ray.z() > 0)) continue;
      const double u = g.cx_left + g.f * ray.x() / ray.z();
      const double v = g.cy + g.f * ray.y() / ray.z();
      if (std::fabs(u) < -PointF::kNowhere && std::fabs(v) < -PointF::kNowhere) {
        out = {static_cast<float>(u), static_cast<float>(v)};
      }
    }
  }
  return true;
}

void Rectifier::rectify(ImageView<const std::uint8_t> raw, View view, ImageView<std::uint8_t> out,
                        Sampling sampling) const noexcept {
  const RemapTable& table = of(view).table;
  if (raw.width != raw_width_ || raw.height != raw_height_ || !out.same_size(table.corner)) return;
  for (int v = 0; v < out.height; ++v) remap_row(raw, table, v, sampling, out.row(v));
}

Rect Rectifier::on_left_canvas(const Rect& raw) const noexcept {
  double left = 1e9;
  double top = 1e9;
  double right = -1e9;
  double bottom = -1e9;
  const auto reach = [&](int x, int y) {
    const PointF p = rectified_from_raw_.at(x, y);
    if (!p.valid()) return;
    left = std::min<double>(left, p.x);
    right = std::max<double>(right, p.x);
    top = std::min<double>(top, p.y);
    bottom = std::max<double>(bottom, p.y);
  };
  for (int x = raw.left; x < raw.right(); ++x) {
    reach(x, raw.top);
    reach(x, raw.bottom() - 1);
  }
  for (int y = raw.top; y < raw.bottom(); ++y) {
    reach(raw.left, y);
    reach(raw.right() - 1, y);
  }
  if (right < left) return {};
  const int u = static_cast<int>(std::floor(left)) - 1;
  const int v = static_cast<int>(std::floor(top)) - 1;
  return intersect({u, v, static_cast<int>(std::ceil(right)) + 2 - u, static_cast<int>(std::ceil(bottom)) + 2 - v},
                   {0, 0, plan_.geometry.width_left, plan_.geometry.height});
}

std::optional<Eigen::Vector2d> Rectifier::rectified_from_raw(double x, double y) const noexcept {
  const std::optional<Eigen::Vector2d> p = plan_.left.unproject({x, y});
  if (!p) return std::nullopt;
  const Eigen::Vector3d ray = plan_.R_rect_left * Eigen::Vector3d(p->x(), p->y(), 1.0);
  if (!(ray.z() > 0)) return std::nullopt;
  const RectifiedGeometry& g = plan_.geometry;
  return Eigen::Vector2d(g.cx_left + g.f * ray.x() / ray.z(), g.cy + g.f * ray.y() / ray.z());
}

std::optional<Eigen::Vector2d> Rectifier::raw_from_ray(double x, double y, double z) const noexcept {
  const Eigen::Vector3d ray = plan_.R_rect_left.transpose() * Eigen::Vector3d(x, y, z);
  if (!(ray.z() > 0)) return std::nullopt;
  return plan_.left.project({ray.x() / ray.z(), ray.y() / ray.z()});
}

}  // namespace stereotrack
