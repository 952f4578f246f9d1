#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/bounded_vector.hpp"
#include "pipeline/core/image_view.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"

namespace stereotrack {

/// Convex polygon, clockwise on the screen, from its topmost (of these leftmost) vertex; strictly convex:
/// no three vertices on a line. One point or two for a region that is no wider.
using Hull = FixedVector<Point, 48>;

/// Boundary of an object: the convex hull of its blob.
///     H(X) = { sum a_i x_i | x_i in X, a_i >= 0, sum a_i = 1 }              (3.16)
/// Only the first and last pixel of each row can be vertices; they come sorted, so Andrew's monotone chain
/// ("Another efficient algorithm for convex hulls in two dimensions", 1979) is linear. Integers throughout.
///
/// More vertices than max_vertices (a disc has about 3.4 r^(2/3): from r = 53 on): the vertex whose triangle
/// with its neighbours is least goes, the first of equals, again and again. The result then no longer
/// contains all pixels: at the rim of a disc of radius r up to 0.4 % of r are lost with 48 vertices. reduced() counts
/// the hulls that this happened to.
///
/// In: labels, width x height; the pixels in `box` (clipped) that have `label`. Out: hull, empty if there
/// is none. Fault: kBadSize. O(box + vertices x vertices dropped). One instance a thread.
class ConvexHull {
 public:
  struct Config {
    int max_vertices = static_cast<int>(Hull::capacity());  ///< 3..48
  };

  [[nodiscard]] static Result<ConvexHull> create(const Config& config, int width, int height, Arena& arena) noexcept;
  [[nodiscard]] Result<Hull> run(ImageView<const std::uint16_t> labels, const Rect& box, std::uint16_t label) noexcept;

  /// Hulls that lost vertices for want of room, since create().
  [[nodiscard]] std::uint64_t reduced() const noexcept { return reduced_; }

  /// What crosses frames: pipeline/core/state.hpp.
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.reduced_);
  }

 private:
  [[nodiscard]] Hull chain(std::span<const Point> sorted) noexcept;

  Config config_;
  int width_ = 0;
  int height_ = 0;
  std::span<Point> points_;  // row extremes
  std::uint64_t reduced_ = 0;
  std::span<Point> vertices_;  // right side downwards, left side upwards
};
static_assert(RealTimeStage<ConvexHull, &ConvexHull::run>);

/// Calls fn(y, begin, end) for each row of the picture that the hull covers, columns [begin, end): the
/// pixels whose centres lie in the hull or on its edge, exactly. O(rows x vertices).
template <class Fn>
void for_each_hull_row(const Hull& hull, int width, int height, Fn&& fn) noexcept {
  if (hull.empty()) return;
  int bottom = hull[0].y;
  for (const Point& p : hull) bottom = std::max(bottom, p.y);
  const auto floor_of = [](std::int64_t a, std::int64_t b) noexcept { return a >= 0 ? a / b : -((b - 1 - a) / b); };
  for (int y = std::max(hull[0].y, 0); y <= std::min(bottom, height - 1); ++y) {
    std::int64_t first = width;
    std::int64_t last = -1;
    for (std::size_t i = 0; i < hull.size(); ++i) {
      const Point& p = hull[i];
      const Point& q = hull[i + 1 == hull.size() ? 0 : i + 1];
      const Point& upper = p.y <= q.y ? p : q;
      const Point& lower = p.y <= q.y ? q : p;
      if (y < upper.y || y > lower.y) continue;
      if (upper.y == lower.y) {
        first = std::min<std::int64_t>(first, std::min(p.x, q.x));
        last = std::max<std::int64_t>(last, std::max(p.x, q.x));
        continue;
      }
      // The edge crosses row y at x = across / rows.
      const std::int64_t rows = lower.y - upper.y;
      const std::int64_t across = upper.x * rows + static_cast<std::int64_t>(lower.x - upper.x) * (y - upper.y);
      first = std::min(first, -floor_of(-across, rows));
      last = std::max(last, floor_of(across, rows));
    }
    const int begin = static_cast<int>(std::max<std::int64_t>(first, 0));
    const int end = static_cast<int>(std::min<std::int64_t>(last + 1, width));
    if (begin < end) fn(y, begin, end);
  }
}

/// Fills the hull with `value`, clipped to the picture. O(area).
inline void hull_fill(const Hull& hull, ImageView<std::uint8_t> mask, std::uint8_t value) noexcept {
  for_each_hull_row(hull, mask.width, mask.height, [&](int y, int begin, int end) noexcept {
    std::fill(mask.row(y) + begin, mask.row(y) + end, value);
  });
}

/// Gives the hull's pixels the label, except those that another region owns. O(area).
inline void hull_claim(const Hull& hull, ImageView<std::uint16_t> labels, std::uint16_t label) noexcept {
  for_each_hull_row(hull, labels.width, labels.height, [&](int y, int begin, int end) noexcept {
    std::uint16_t* row = labels.row(y);
    for (int x = begin; x < end; ++x) row[x] = row[x] == 0 ? label : row[x];
  });
}

}  // namespace stereotrack
