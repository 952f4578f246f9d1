#include "firmware-app/render/zones.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

namespace stereotrack::render {
namespace {

constexpr double kNearest_m = 0.1;   // of a floor that reaches the camera
constexpr double kFarthest_m = 100;  // of one that has no end

}  // namespace

Pen pen_of(const ShownZone& zone) {
  switch (zone.use) {
    case ShownZone::Use::kSignals: break;
    case ShownZone::Use::kNoneBegin: return {{90, 215, 235}, 0.9, 1, true};
    case ShownZone::Use::kIgnored: return {{120, 120, 245}, 0.9, 1, true};
    case ShownZone::Use::kVolume: return {{150, 225, 150}, 0.9, 1, true};
  }
  return {{235, 200, 150}, 0.9, 1, true};
}

std::string text_of(const ShownZone& zone) {
  switch (zone.use) {
    case ShownZone::Use::kSignals: break;
    case ShownZone::Use::kNoneBegin: return zone.name + ": none begins";
    case ShownZone::Use::kIgnored: return zone.name + ": ignored";
    case ShownZone::Use::kVolume: return zone.name + ": volume";
  }
  return zone.name;
}

std::vector<Polyline> floor_of(const Zone& box, const Rectifier& rectifier, double unit_m) {
  constexpr int kSteps = 64;
  std::vector<Polyline> pieces;
  if (!(unit_m > 0) || box.y_m.to >= 10 * kFarthest_m) return pieces;
  const double near = std::max(box.z_m.from, kNearest_m);
  const double far = std::min(box.z_m.to, std::max(near, kFarthest_m));
  if (near > far) return pieces;
  const double left = std::max(box.x_m.from, -4 * far);
  const double right = std::min(box.x_m.to, 4 * far);
  const std::array<cv::Point2d, 5> corners{{{left, near}, {right, near}, {right, far}, {left, far}, {left, near}}};
  const double room = 4.0 * (rectifier.raw_width() + rectifier.raw_height());
  Polyline piece;
  const auto end_piece = [&] {
    if (piece.size() > 1) pieces.push_back(std::move(piece));
    piece.clear();
  };
  for (std::size_t i = 0; i + 1 < corners.size(); ++i) {
    for (int step = i == 0 ? 0 : 1; step <= kSteps; ++step) {
      const cv::Point2d at = corners[i] + (corners[i + 1] - corners[i]) * (step / static_cast<double>(kSteps));
      const auto pixel = rectifier.raw_from_ray(at.x / unit_m, box.y_m.to / unit_m, at.y / unit_m);
      if (pixel && pixel->allFinite() && pixel->norm() < room) {
        piece.emplace_back(pixel->x(), pixel->y());
      } else {
        end_piece();
      }
    }
  }
  end_piece();
  return pieces;
}

cv::Mat mask_of(const Zone& polygon, cv::Size drawn, double scale) {
  cv::Mat mask(drawn, CV_8UC1);
  for (int y = 0; y < drawn.height; ++y) {
    auto* row = mask.ptr<std::uint8_t>(y);
    for (int x = 0; x < drawn.width; ++x) {
      const bool inside = contains(polygon.corners.view(), (x + 0.5) / scale - 0.5, (y + 0.5) / scale - 0.5);
      row[x] = inside ? 255 : 0;
    }
  }
  return mask;
}

void hatch(cv::Mat& picture, const cv::Mat& mask, const cv::Scalar& colour) {
  constexpr int kEvery_px = 12;
  constexpr double kDim = 0.45;
  constexpr double kLine = 0.35;  // of the colour
  for (int y = 0; y < picture.rows; ++y) {
    const auto* inside = mask.ptr<std::uint8_t>(y);
    auto* pixel = picture.ptr<cv::Vec3b>(y);
    for (int x = 0; x < picture.cols; ++x) {
      if (inside[x] == 0) continue;
      const double line = (x + y) % kEvery_px == 0 ? kLine : 0;
      for (int c = 0; c < 3; ++c) {
        pixel[x][c] = cv::saturate_cast<std::uint8_t>(pixel[x][c] * kDim * (1 - line) + colour[c] * line);
      }
    }
  }
}

}  // namespace stereotrack::render
