#include "drivers/capture/synthetic/survey.hpp"

#include <algorithm>
#include <cmath>

namespace stereotrack::capture::synthetic {
namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 120;
constexpr double kPixelArea = 640.0 / kWidth * 480.0 / kHeight;
constexpr std::array<Offset, 1> kCenter{};

}  // namespace

Survey survey(const Scene& scene, std::span<const Actor> cast_list, double from_s, double to_s,
              const SurveyDetail& detail) {
  const double step_s = detail.step_s;
  const PinholeCamera camera = scene.rig.camera(0, kWidth, kHeight);
  constexpr Rect kFrame{0, 0, kWidth, kHeight};
  constexpr std::size_t kPixels = static_cast<std::size_t>(kWidth) * kHeight;
  const auto at = [](int x, int y) { return static_cast<std::size_t>(y * kWidth + x); };

  std::vector<double> still(kPixels, kMiss);
  for (const Shape& s : scene.statics) {
    cast(camera, s, intersect(screen_box(camera, s), kFrame), kCenter,
         [&](int x, int y, std::size_t, double depth) { still[at(x, y)] = std::min(still[at(x, y)], depth); });
  }

  const std::size_t count = cast_list.size();
  Survey result;
  result.actors.resize(count);
  std::vector<PosedActor> posed(count);
  std::vector<std::vector<double>> own(count, std::vector<double>(kPixels, kMiss));
  std::vector<double> hidden_until(count * count, -1e9);  // when front hid back last
  std::vector<bool> pair_seen(count * count, false);
  std::vector<Rect> boxes(count);
  std::vector<double> hidden_for(count, 0.0);

  for (double t = from_s; t < to_s; t += step_s) {
    int in_view = 0;
    for (std::size_t a = 0; a < count; ++a) {
      boxes[a] = {};
      if (!pose(cast_list[a], t, posed[a])) continue;
      for (const Shape& s : posed[a].shapes) {
        boxes[a] = unite(boxes[a], intersect(screen_box(camera, s), kFrame));
      }
      for (int y = boxes[a].top; y < boxes[a].bottom(); ++y) {
        std::fill_n(&own[a][at(boxes[a].left, y)], boxes[a].width, kMiss);
      }
      for (const Shape& s : posed[a].shapes) {
        cast(camera, s, intersect(screen_box(camera, s), kFrame), kCenter,
             [&](int x, int y, std::size_t, double depth) { own[a][at(x, y)] = std::min(own[a][at(x, y)], depth); });
      }
    }
    for (std::size_t a = 0; a < count; ++a) {
      if (boxes[a].empty()) {
        hidden_for[a] = 0;
        continue;
      }
      int inside = 0;
      int visible = 0;
      std::vector<int> hidden_by(count, 0);
      for (int y = boxes[a].top; y < boxes[a].bottom(); ++y) {
        for (int x = boxes[a].left; x < boxes[a].right(); ++x) {
          const double depth = own[a][at(x, y)];
          if (depth == kMiss) continue;
          ++inside;
          bool free = depth < still[at(x, y)];
          if (!free) continue;
          for (std::size_t b = 0; b < count; ++b) {
            const Rect& o = boxes[b];
            if (b == a || x < o.left || x >= o.right() || y < o.top || y >= o.bottom()) continue;
            if (own[b][at(x, y)] < depth) {
              ++hidden_by[b];
              free = false;
            }
          }
          if (free) ++visible;
        }
      }
      Survey::PerActor& mine = result.actors[a];
      mine.largest_px = std::max(mine.largest_px, visible * kPixelArea);
      if (visible > 0) mine.seconds_seen += step_s;
      if (inside > 0 && visible < (1.0 - detail.hidden_share) * inside) {
        mine.hidden_s += step_s;
        hidden_for[a] += step_s;
        if (hidden_for[a] > mine.longest_hidden_s) {
          mine.longest_hidden_s = hidden_for[a];
          mine.longest_hidden_at = t;
        }
      } else {
        hidden_for[a] = 0;
      }
      if (4 * visible >= inside && inside > 0) ++in_view;
      for (std::size_t b = 0; b < count; ++b) {
        if (inside < 3 || 4 * hidden_by[b] < inside) continue;
        const std::size_t key = a * count + b;
        if (t - hidden_until[key] > 1.0) ++result.occlusions;
        hidden_until[key] = t;
        const std::size_t pair = std::min(a, b) * count + std::max(a, b);
        if (!pair_seen[pair]) ++result.pairs;
        pair_seen[pair] = true;
      }
    }
    result.most_in_view = std::max(result.most_in_view, in_view);
  }
  return result;
}

bool collides(const Scene& scene, const Actor& actor, std::span<const Actor> others, double gap_m) {
  const double radius = actor.footprint() + gap_m;
  for (double t = actor.path.start_s(); t <= actor.path.end_s(); t += 0.1) {
    const Vec3 p = actor.path.at(t).position;
    for (std::size_t i = 1; i < scene.statics.size(); ++i) {
      const Shape& s = scene.statics[i];
      if (!s.casts_shadow || length({s.center.x - p.x, 0, s.center.z - p.z}) > s.bounding_radius + radius) continue;
      for (const double part : {0.15, 0.6, 1.0}) {
        if (distance(s, p + Vec3{0, 0.05 + part * actor.height(), 0}) < radius) return true;
      }
    }
    for (const Actor& other : others) {
      if (t < other.path.start_s() || t > other.path.end_s()) continue;
      const Vec3 q = other.path.at(t).position;
      if (q.y > p.y + actor.height() + 0.3 || p.y > q.y + other.height() + 0.3) continue;
      const double dx = p.x - q.x;
      const double dz = p.z - q.z;
      const double apart = radius + other.footprint();
      if (dx * dx + dz * dz < apart * apart) return true;
    }
  }
  return false;
}

}  // namespace stereotrack::capture::synthetic
