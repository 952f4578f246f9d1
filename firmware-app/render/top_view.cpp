#include "firmware-app/render/top_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>
#include <vector>

#include "firmware-app/render/style.hpp"

namespace stereotrack::render {
namespace {

constexpr double kLabel = 0.45;
constexpr double kSmall = 0.38;
constexpr int kFloor_px = 26;  ///< beneath the camera, for the numbers of the x axis
constexpr double kLookAhead_s = 0.5;
const cv::Scalar kField{46, 41, 37};
const cv::Scalar kGrid{66, 60, 55};
const cv::Scalar kAxis{120, 112, 104};

/// The first of `steps` times a power of ten that is at least `value`.
template <std::size_t N>
double round_up(double value, const std::array<double, N>& steps) {
  double power = std::pow(10.0, std::floor(std::log10(std::clamp(value, 1e-6, 1e9))));
  for (;; power *= 10) {
    for (const double step : steps) {
      if (step * power >= value * (1 - 1e-9)) return step * power;
    }
  }
}

double round_reach(double value) { return round_up(value, std::array{1.0, 1.5, 2.0, 3.0, 5.0, 7.0}); }

bool usable(const TrackReport& track) {
  return track.has_depth && track.position.allFinite() && track.velocity.allFinite();
}

/// 1-sigma ellipse of (x, z): sqrt of the eigenvalues along the eigenvectors of the 2x2 block.
Polyline ellipse(const TrackReport& track) {
  const double xx = track.covariance(0, 0);
  const double xz = track.covariance(0, 2);
  const double zz = track.covariance(2, 2);
  const double mean = (xx + zz) / 2;
  const double half = std::hypot((xx - zz) / 2, xz);
  Polyline out;
  if (!std::isfinite(mean) || !std::isfinite(half) || mean <= 0) return out;
  const double major = std::sqrt(mean + half);
  const double minor = std::sqrt(std::max(mean - half, 0.0));
  const double angle = 0.5 * std::atan2(2 * xz, xx - zz);
  constexpr int kPoints = 48;
  for (int i = 0; i < kPoints; ++i) {
    const double t = 2 * std::numbers::pi * i / kPoints;
    const double a = major * std::cos(t);
    const double b = minor * std::sin(t);
    out.emplace_back(a * std::cos(angle) - b * std::sin(angle), a * std::sin(angle) + b * std::cos(angle));
  }
  return out;
}

}  // namespace

TopView::TopView(const RectifiedGeometry& geometry, LengthUnit unit, std::vector<ShownZone> zones)
    : geometry_(geometry), unit_(std::move(unit)) {
  std::copy_if(zones.begin(), zones.end(), std::back_inserter(zones_),
               [](const ShownZone& zone) { return zone.zone.kind == Zone::Kind::kSpace; });
  const double near_px = geometry_.width_left / 10.0;
  reach_ = round_reach(geometry_.f * geometry_.baseline / near_px * unit_.per_unit);
}

double TopView::px_per_length(cv::Size size) const { return (size.height - kFloor_px) / reach_; }

cv::Point2d TopView::place(cv::Size size, double x, double z) const {
  const double scale = px_per_length(size) * unit_.per_unit;
  return {size.width / 2.0 + x * scale, size.height - kFloor_px - z * scale};
}

void TopView::make_room(const FrameResult& result, cv::Size size) {
  constexpr double kFilled = 0.95;
  constexpr double kSure_s = 1;  // what has just come into view may be matched anywhere
  const double limit = round_reach(geometry_.f * geometry_.baseline / 2.0 * unit_.per_unit);
  const double aspect = (size.height - kFloor_px) / (size.width / 2.0);
  for (const TrackReport& track : result.tracks) {
    if (track.state != TrackState::kConfirmed || !track.measured || !usable(track)) continue;
    if (track.age_s < kSure_s) continue;
    const double depth = std::max(track.position.z(), std::abs(track.position.x()) * aspect);
    const double needed = round_reach(depth * unit_.per_unit / kFilled);
    reach_ = std::max(reach_, std::min(needed, limit));
  }
}

void TopView::draw_scene(cv::Mat& picture) const {
  const cv::Size size = picture.size();
  const double scale = px_per_length(size);
  const double floor_y = size.height - kFloor_px;
  const double far = 4 * reach_ / unit_.per_unit;
  const auto edge = [&](double column) { return place(size, (column - geometry_.cx_left) / geometry_.f * far, far); };
  const cv::Point2d camera = place(size, 0, 0);
  const cv::Point2d left = edge(0);
  const cv::Point2d right = edge(geometry_.width_left - 1);
  fill(picture, {camera, left, right}, kField, 1);

  const double step = round_up(64 / scale, std::array{1.0, 2.0, 5.0});
  const int columns = static_cast<int>(size.width / 2.0 / (step * scale));
  const int rows = static_cast<int>(reach_ / step + 1e-6);
  const Pen grid{kGrid, 1, 1, false};
  for (int i = -columns; i <= columns; ++i) {
    const double x = size.width / 2.0 + i * step * scale;
    draw_line(picture, {{x, 0}, {x, floor_y}}, false, grid);
  }
  for (int i = 1; i <= rows; ++i) {
    const double y = floor_y - i * step * scale;
    draw_line(picture, {{0, y}, {static_cast<double>(size.width), y}}, false, grid);
  }
  const Pen axis{kAxis, 1, 1, false};
  draw_line(picture, {{0, floor_y}, {static_cast<double>(size.width), floor_y}}, false, axis);
  draw_line(picture, {camera, left}, false, axis);
  draw_line(picture, {camera, right}, false, axis);

  const auto tick = [&](double value) {
    const std::string text = step >= 0.999 ? std::to_string(std::lround(value)) : number_text(value);
    return value == 0 ? std::string("0") : text;
  };
  for (int i = -columns; i <= columns; ++i) {
    const std::string text = tick(i * step);
    const int half = text_size(text, kSmall).width / 2;
    const int x = static_cast<int>(std::lround(size.width / 2.0 + i * step * scale)) - half;
    if (x < 2 || x + 2 * half > size.width - 44) continue;
    draw_text(picture, text, {x, size.height - 8}, kSmall, kFaint);
  }
  draw_text(picture, "x [" + unit_.name + "]", {size.width - 40, size.height - 8}, kSmall, kFaint);
  for (int i = 1; i <= rows; ++i) {
    const int y = static_cast<int>(std::lround(floor_y - i * step * scale)) + 4;
    if (y > 34) draw_text(picture, tick(i * step), {6, y}, kSmall, kFaint);
  }
  draw_text(picture, "z [" + unit_.name + "]", {6, 18}, kSmall, kFaint);
  const std::string title = "top view";
  draw_text(picture, title, {size.width - text_size(title, kSmall).width - 8, 18}, kSmall, kFaint);

  draw_dot(picture, place(size, geometry_.baseline, 0), 3, kAxis);
  draw_dot(picture, camera, 4, kBright);
}

// Clipped to a little more than the view: a side that is anywhere lies far away.
void TopView::draw_zones(cv::Mat& picture) const {
  const cv::Size size = picture.size();
  const auto corner = [&](double x_m, double z_m) {
    const cv::Point2d at = place(size, x_m / unit_.per_unit, z_m / unit_.per_unit);
    return cv::Point2d(std::clamp(at.x, -20.0, size.width + 20.0), std::clamp(at.y, -20.0, size.height + 20.0));
  };
  for (const ShownZone& shown : zones_) {
    const Zone& box = shown.zone;
    const cv::Point2d low = corner(box.x_m.from, box.z_m.to);
    const cv::Point2d high = corner(box.x_m.to, box.z_m.from);
    const Polyline outline{low, {high.x, low.y}, high, {low.x, high.y}};
    const Pen pen = pen_of(shown);
    if (shown.use == ShownZone::Use::kIgnored) fill(picture, outline, pen.colour, 0.18);
    draw_line(picture, outline, true, pen);
    const cv::Point at(static_cast<int>(std::max(low.x, 40.0)) + 4, static_cast<int>(std::max(low.y, 24.0)) + 14);
    if (at.x < high.x && at.y < high.y && at.x < size.width && at.y < size.height) {
      draw_text(picture, text_of(shown), at, kSmall, pen.colour);
    }
  }
}

void TopView::draw_track(cv::Mat& picture, const TrackReport& track, const Trails& trails) const {
  const cv::Size size = picture.size();
  const Pen pen = pen_of(track);
  const cv::Point2d at = place(size, track.position.x(), track.position.z());
  const cv::Point2d inside(std::clamp(at.x, 6.0, size.width - 6.0), std::clamp(at.y, 6.0, size.height - 6.0));
  if (inside != at) {
    draw_dot(picture, inside, 5, pen.colour);
    draw_dot(picture, inside, 1, kBackground);
    return;
  }
  Polyline trail;
  std::vector<double> strengths;
  for (const Trails::Place& then : trails.of(track.id)) {
    if (!then.has_depth) continue;
    trail.push_back(place(size, then.x, then.z));
    strengths.push_back(pen.strength * trails.strength(then));
  }
  draw_fading_line(picture, trail, strengths, pen.colour, pen.thickness);
  Polyline outline = ellipse(track);
  for (cv::Point2d& p : outline) p = place(size, track.position.x() + p.x, track.position.z() + p.y);
  if (!outline.empty()) {
    fill(picture, outline, pen.colour, 0.16 * pen.strength);
    draw_line(picture, outline, true, {pen.colour, 0.8 * pen.strength, 1, pen.dashed});
  }
  const Eigen::Vector3d ahead = track.position + kLookAhead_s * track.velocity;
  draw_arrow(picture, at, place(size, ahead.x(), ahead.z()) - at, 90, {pen.colour, pen.strength, 1, false});
  draw_dot(picture, at, track.state == TrackState::kTentative ? 2.5 : 4, pen.colour);
}

void TopView::draw(cv::Mat& picture, const FrameResult& result, const Trails& trails) {
  make_room(result, picture.size());
  picture.setTo(kBackground);
  draw_scene(picture);
  draw_zones(picture);
  for (const TrackReport& track : result.tracks) {
    if (usable(track)) draw_track(picture, track, trails);
  }
  const auto dot_at = [&](const Eigen::Vector3d& position) {
    const cv::Point2d at = place(picture.size(), position.x(), position.z());
    const cv::Point dot(static_cast<int>(std::clamp(at.x, 0.0, picture.cols - 1.0)),
                        static_cast<int>(std::clamp(at.y, 0.0, picture.rows - 1.0)));
    return cv::Rect(dot.x - 6, dot.y - 6, 13, 13);
  };
  Labels labels(picture, false);
  for (const TrackReport& track : result.tracks) {
    if (!usable(track)) continue;
    labels.keep_clear(dot_at(track.position));
    labels.keep_clear(dot_at(track.position + kLookAhead_s * track.velocity));
  }
  for (const TrackReport& track : result.tracks) {
    if (!usable(track) || track.state == TrackState::kTentative) continue;
    labels.draw(id_text(track.id), dot_at(track.position), kLabel, colour_of(track.id));
  }
}

}  // namespace stereotrack::render
