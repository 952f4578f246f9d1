#include "firmware-app/render/style.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace stereotrack::render {
namespace {

constexpr int kShift = 4;  ///< fractional bits of the places that OpenCV is given
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr double kDashOn_px = 7;
constexpr double kDashOff_px = 5;
const cv::Scalar kOutline{16, 14, 12};

/// Far-off places are pulled in: OpenCV counts in int.
cv::Point fixed(cv::Point2d p) {
  constexpr double kFar = 30000;
  constexpr double kOne = 1 << kShift;
  return {static_cast<int>(std::lround(std::clamp(p.x, -kFar, kFar) * kOne)),
          static_cast<int>(std::lround(std::clamp(p.y, -kFar, kFar) * kOne))};
}

std::vector<cv::Point> fixed(const Polyline& points) {
  std::vector<cv::Point> out;
  out.reserve(points.size());
  for (const cv::Point2d& p : points) out.push_back(fixed(p));
  return out;
}

/// The part of the picture that holds the points and `margin` px around them; empty if they are outside.
cv::Rect box_around(const cv::Mat& picture, const Polyline& points, double margin) {
  if (points.empty()) return {};
  cv::Point2d low = points.front();
  cv::Point2d high = low;
  for (const cv::Point2d& p : points) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  low = {std::max(low.x - margin, 0.0), std::max(low.y - margin, 0.0)};
  high = {std::min(high.x + margin, picture.cols - 1.0), std::min(high.y + margin, picture.rows - 1.0)};
  if (!(low.x <= high.x && low.y <= high.y)) return {};
  return {cv::Point(static_cast<int>(low.x), static_cast<int>(low.y)),
          cv::Point(static_cast<int>(high.x) + 1, static_cast<int>(high.y) + 1)};
}

/// Lets `draw` draw on the part around `points` and mixes that with what was there.
template <class Draw>
void blend(cv::Mat& picture, const Polyline& points, double margin, double strength, Draw draw) {
  const cv::Rect box = box_around(picture, points, margin);
  if (box.empty()) return;
  if (strength >= 1) {
    draw(picture, cv::Point2d{});
    return;
  }
  cv::Mat part = picture(box);
  cv::Mat layer = part.clone();
  draw(layer, cv::Point2d(box.tl()));
  cv::addWeighted(layer, strength, part, 1 - strength, 0, part);
}

void stroke(cv::Mat& picture, const Polyline& points, bool closed, const cv::Scalar& colour, int thickness,
            cv::Point2d origin) {
  Polyline moved = points;
  for (cv::Point2d& p : moved) p -= origin;
  cv::polylines(picture, fixed(moved), closed, colour, thickness, cv::LINE_AA, kShift);
}

std::vector<Polyline> dashes(Polyline points, bool closed) {
  std::vector<Polyline> out;
  if (closed && !points.empty()) points.push_back(points.front());
  bool on = true;
  double left = kDashOn_px;
  Polyline dash;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    cv::Point2d at = points[i];
    const cv::Point2d step = points[i + 1] - at;
    double length = std::min(std::hypot(step.x, step.y), 1e4);
    if (length <= 0) continue;
    const cv::Point2d way = step / std::hypot(step.x, step.y);
    while (length > 0) {
      const double go = std::min(left, length);
      if (on && dash.empty()) dash.push_back(at);
      at += way * go;
      if (on) dash.push_back(at);
      length -= go;
      left -= go;
      if (left > 0) continue;
      if (on) out.push_back(std::move(dash));
      dash.clear();
      on = !on;
      left = on ? kDashOn_px : kDashOff_px;
    }
  }
  if (dash.size() > 1) out.push_back(std::move(dash));
  return out;
}

}  // namespace

cv::Scalar colour_of(std::uint32_t id) {
  static const std::array<cv::Scalar, 12> kColours{{
      {79, 90, 255},    // red
      {255, 150, 60},   // blue
      {63, 215, 255},   // yellow
      {255, 115, 220},  // violet
      {100, 220, 80},   // green
      {30, 150, 255},   // orange
      {225, 215, 50},   // cyan
      {180, 120, 255},  // pink
      {30, 225, 175},   // lime
      {255, 140, 150},  // periwinkle
      {110, 165, 225},  // sand
      {185, 225, 150},  // sea green
  }};
  return kColours[(id + kColours.size() - 1) % kColours.size()];
}

Pen pen_of(const TrackReport& track) {
  switch (track.state) {
    case TrackState::kTentative: return {kTentative, 0.7, 1, false};
    case TrackState::kCoasting: return {colour_of(track.id), 0.65, 2, true};
    case TrackState::kConfirmed: break;
  }
  return {colour_of(track.id), 1, 2, false};
}

void draw_line(cv::Mat& picture, const Polyline& points, bool closed, const Pen& pen) {
  blend(picture, points, pen.thickness + 2.0, pen.strength, [&](cv::Mat& layer, cv::Point2d origin) {
    if (!pen.dashed) {
      stroke(layer, points, closed, pen.colour, pen.thickness, origin);
      return;
    }
    for (const Polyline& dash : dashes(points, closed)) stroke(layer, dash, false, pen.colour, pen.thickness, origin);
  });
}

void draw_outlined_line(cv::Mat& picture, const Polyline& points, bool closed, const Pen& pen) {
  draw_line(picture, points, closed, {kOutline, 0.55 * pen.strength, pen.thickness + 2, pen.dashed});
  draw_line(picture, points, closed, pen);
}

void draw_fading_line(cv::Mat& picture, const Polyline& points, const std::vector<double>& strengths,
                      const cv::Scalar& colour, int thickness) {
  const cv::Rect box = box_around(picture, points, thickness + 2.0);
  if (box.empty()) return;
  // Strengths are drawn first and the colour mixed in once, or the joints of the segments would show as beads.
  cv::Mat strength(box.size(), CV_8UC1, cv::Scalar::all(0));
  for (std::size_t i = 0; i + 1 < points.size() && i < strengths.size(); ++i) {
    const double grey = std::round(255 * std::clamp(strengths[i], 0.0, 1.0));
    stroke(strength, {points[i], points[i + 1]}, false, cv::Scalar::all(grey), thickness, cv::Point2d(box.tl()));
  }
  for (int y = 0; y < box.height; ++y) {
    const std::uint8_t* s = strength.ptr<std::uint8_t>(y);
    auto* pixel = picture.ptr<cv::Vec3b>(box.y + y) + box.x;
    for (int x = 0; x < box.width; ++x) {
      if (s[x] == 0) continue;
      for (int c = 0; c < 3; ++c) {
        const int mixed = pixel[x][c] * (255 - s[x]) + static_cast<int>(colour[c]) * s[x];
        pixel[x][c] = static_cast<std::uint8_t>((mixed + 127) / 255);
      }
    }
  }
}

void fill(cv::Mat& picture, const Polyline& convex, const cv::Scalar& colour, double strength) {
  blend(picture, convex, 2, strength, [&](cv::Mat& layer, cv::Point2d origin) {
    Polyline moved = convex;
    for (cv::Point2d& p : moved) p -= origin;
    cv::fillConvexPoly(layer, fixed(moved), colour, cv::LINE_AA, kShift);
  });
}

void draw_dot(cv::Mat& picture, cv::Point2d centre, double radius, const cv::Scalar& colour) {
  const auto r = [](double value) { return static_cast<int>(std::lround(value * (1 << kShift))); };
  cv::circle(picture, fixed(centre), r(radius + 1.2), kOutline, cv::FILLED, cv::LINE_AA, kShift);
  cv::circle(picture, fixed(centre), r(radius), colour, cv::FILLED, cv::LINE_AA, kShift);
}

void draw_arrow(cv::Mat& picture, cv::Point2d from, cv::Point2d by, double longest, const Pen& pen) {
  constexpr double kShortest_px = 5;
  const double length = std::hypot(by.x, by.y);
  if (!(length >= kShortest_px) || !std::isfinite(length)) return;
  const cv::Point2d way = by / length;
  const cv::Point2d across(-way.y, way.x);
  const cv::Point2d tip = from + way * std::min(length, longest);
  const double head = std::min(9.0, 0.5 * std::min(length, longest) + 3);
  draw_outlined_line(picture, {from, tip - way * (head * 0.8)}, false,
                     {pen.colour, pen.strength, pen.thickness, false});
  const auto triangle = [&](double grow) {
    const cv::Point2d base = tip - way * (head + grow);
    const double half = head * 0.48 + grow;
    return Polyline{tip + way * (1.6 * grow), base + across * half, base - across * half};
  };
  fill(picture, triangle(1), kOutline, 0.6 * pen.strength);
  fill(picture, triangle(0), pen.colour, pen.strength);
}

cv::Size text_size(const std::string& text, double scale) {
  int base_line = 0;
  return cv::getTextSize(text, kFont, scale, 1, &base_line);
}

void draw_text(cv::Mat& picture, const std::string& text, cv::Point origin, double scale, const cv::Scalar& colour) {
  cv::putText(picture, text, origin, kFont, scale, kOutline, 2, cv::LINE_AA);
  cv::putText(picture, text, origin, kFont, scale, colour, 1, cv::LINE_AA);
}

void Labels::draw(const std::string& text, const cv::Rect& thing, double scale, const cv::Scalar& colour) {
  constexpr int kGap = 4;
  constexpr int kDot_px = 16;
  const cv::Size size = text_size(text, scale) + cv::Size(2 * kGap, 2 * kGap);
  const int centre_y = thing.y + (thing.height - size.height) / 2;
  std::array<cv::Point, 6> places{{{thing.x, thing.y - size.height},
                                   {thing.x, thing.y + thing.height},
                                   {thing.x + thing.width, centre_y},
                                   {thing.x - size.width, centre_y},
                                   {thing.x + thing.width, thing.y - size.height},
                                   {thing.x - size.width, thing.y + thing.height}}};
  // Above a dot is where its ellipse and often its arrow are.
  if (thing.width <= kDot_px) std::swap(places[0], places[2]);
  const cv::Rect whole(cv::Point(), picture_.size());
  cv::Rect best;
  int best_hidden = -1;
  for (const cv::Point& place : places) {
    cv::Rect spot(place, size);
    spot.x = std::clamp(spot.x, 0, std::max(0, whole.width - size.width));
    spot.y = std::clamp(spot.y, 0, std::max(0, whole.height - size.height));
    // Pushed back inside, a label may have come to lie on its own thing: as bad as on another label.
    int hidden = spot.tl() == place ? 0 : (spot & thing).area();
    for (const cv::Rect& other : taken_) hidden += (spot & other).area();
    if (best_hidden >= 0 && hidden >= best_hidden) continue;
    best = spot;
    best_hidden = hidden;
  }
  taken_.push_back(best);
  if (tags_) {
    cv::Mat part = picture_(best & whole);
    cv::addWeighted(part, 0.4, cv::Mat(part.size(), CV_8UC3, kOutline), 0.6, 0, part);
  }
  draw_text(picture_, text, {best.x + kGap, best.y + best.height - kGap}, scale, colour);
}

std::string id_text(std::uint32_t id) { return std::string("#").append(std::to_string(id)); }

std::string number_text(double value) {
  const double size = std::abs(value);
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.*f", size < 0.995 ? 2 : size < 99.95 ? 1 : 0, std::min(size, 1e9));
  return std::string(value < 0 ? "-" : "").append(text.data());
}

}  // namespace stereotrack::render
