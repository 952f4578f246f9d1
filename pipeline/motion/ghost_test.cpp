#include "pipeline/motion/ghost_test.hpp"

#include <cstdlib>

#include "pipeline/shape/region.hpp"

namespace stereotrack {

namespace {

int difference(ImageView<const std::uint8_t> plane, Point a, Point b) noexcept {
  return plane.empty() ? 0 : std::abs(plane.at(a.x, a.y) - plane.at(b.x, b.y));
}

}  // namespace

GhostTest::Contour GhostTest::measure(const Input& in, const Rect& box, std::uint16_t label) noexcept {
  Contour contour;
  const auto compare = [&](int x, int y, int dx, int dy) {
    // (x, y) is the last pixel inside, and the next one along (dx, dy) is outside.
    const Point inner{x - (kContourReach - 1) * dx, y - (kContourReach - 1) * dy};
    const Point outer{x + kContourReach * dx, y + kContourReach * dy};
    if (!in.labels.contains(inner.x, inner.y) || !in.labels.contains(outer.x, outer.y)) return;
    if (in.labels.at(inner.x, inner.y) != label || in.labels.at(outer.x, outer.y) != 0) return;
    ++contour.places;
    contour.now += difference(in.y, inner, outer) + difference(in.cb, inner, outer) + difference(in.cr, inner, outer);
    contour.background += difference(in.y_background, inner, outer) + difference(in.cb_background, inner, outer) +
                          difference(in.cr_background, inner, outer);
  };
  const auto is_outside = [&](int x, int y) { return in.labels.contains(x, y) && in.labels.at(x, y) != label; };
  for_each_boundary_pixel(in.labels, box, label, [&](int x, int y) {
    if (is_outside(x - 1, y)) compare(x, y, -1, 0);
    if (is_outside(x + 1, y)) compare(x, y, 1, 0);
    if (is_outside(x, y - 1)) compare(x, y, 0, -1);
    if (is_outside(x, y + 1)) compare(x, y, 0, 1);
  });
  return contour;
}

}  // namespace stereotrack
