#include "pipeline/shape/convex_hull.hpp"

namespace stereotrack {
namespace {

/// Twice the area of the triangle o a b; positive where the way turns clockwise on the screen (y is down).
std::int64_t turn(const Point& o, const Point& a, const Point& b) noexcept {
  return static_cast<std::int64_t>(a.x - o.x) * (b.y - o.y) - static_cast<std::int64_t>(a.y - o.y) * (b.x - o.x);
}

/// Removes the vertex whose triangle with its neighbours is least. n > 3.
void drop_least(std::span<Point> vertices, std::size_t n) noexcept {
  std::size_t least = 0;
  std::int64_t least_area = INT64_MAX;
  for (std::size_t i = 0; i < n; ++i) {
    const std::int64_t area = turn(vertices[i == 0 ? n - 1 : i - 1], vertices[i], vertices[i + 1 == n ? 0 : i + 1]);
    if (area < least_area) {
      least_area = area;
      least = i;
    }
  }
  for (std::size_t i = least; i + 1 < n; ++i) vertices[i] = vertices[i + 1];
}

}  // namespace

Result<ConvexHull> ConvexHull::create(const Config& config, int width, int height, Arena& arena) noexcept {
  if (width <= 0 || height <= 0 || config.max_vertices < 3 ||
      config.max_vertices > static_cast<int>(Hull::capacity())) {
    return fail(Fault::kBadConfig);
  }
  ConvexHull stage;
  stage.config_ = config;
  stage.width_ = width;
  stage.height_ = height;
  const std::size_t points = 2 * static_cast<std::size_t>(height);
  stage.points_ = arena.array<Point>(points);
  stage.vertices_ = arena.array<Point>(2 * points);
  if (stage.points_.empty() || stage.vertices_.empty()) return fail(Fault::kOutOfMemory);
  return stage;
}

Result<Hull> ConvexHull::run(ImageView<const std::uint16_t> labels, const Rect& box, std::uint16_t label) noexcept {
  if (labels.width != width_ || labels.height != height_) return fail(Fault::kBadSize);
  const Rect part = intersect(box, {0, 0, width_, height_});
  std::size_t count = 0;
  for (int y = part.top; y < part.bottom(); ++y) {
    const std::uint16_t* row = labels.row(y);
    int first = part.left;
    int last = part.right() - 1;
    while (first <= last && row[first] != label) ++first;
    while (last > first && row[last] != label) --last;
    if (first > last) continue;
    points_[count++] = {first, y};
    if (last > first) points_[count++] = {last, y};
  }
  return chain(points_.first(count));
}

Hull ConvexHull::chain(std::span<const Point> sorted) noexcept {
  std::size_t n = 0;
  // Down the right side, then up the left one; a vertex that does not turn clockwise is inside.
  for (const Point& p : sorted) {
    while (n >= 2 && turn(vertices_[n - 2], vertices_[n - 1], p) <= 0) --n;
    vertices_[n++] = p;
  }
  const std::size_t right_side = n + 1;
  for (std::size_t i = sorted.size(); i >= 2; --i) {
    const Point& p = sorted[i - 2];
    while (n >= right_side && turn(vertices_[n - 2], vertices_[n - 1], p) <= 0) --n;
    vertices_[n++] = p;
  }
  if (n > 1) --n;  // the way up ends where the way down began
  const auto room = static_cast<std::size_t>(config_.max_vertices);
  if (n > room) ++reduced_;
  for (; n > room; --n) drop_least(vertices_, n);
  Hull hull;
  for (std::size_t i = 0; i < n; ++i) {
    [[maybe_unused]] const bool fits = hull.push(vertices_[i]);  // n <= max_vertices <= capacity
  }
  return hull;
}

}  // namespace stereotrack
