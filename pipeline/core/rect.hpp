#pragma once

#include <algorithm>
#include <cstdint>

namespace stereotrack {

/// Integer pixel position, x right, y down, (0, 0) the centre of the first pixel.
struct Point {
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend bool operator==(const Point&, const Point&) = default;
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.x, self.y);
  }
};

/// Pixels x in [left, left + width), y in [top, top + height).
struct Rect {
  int left = 0;
  int top = 0;
  int width = 0;
  int height = 0;

  [[nodiscard]] int right() const noexcept { return left + width; }   ///< first column outside
  [[nodiscard]] int bottom() const noexcept { return top + height; }  ///< first row outside
  [[nodiscard]] bool empty() const noexcept { return width <= 0 || height <= 0; }
  [[nodiscard]] std::int64_t area() const noexcept { return empty() ? 0 : static_cast<std::int64_t>(width) * height; }
  friend bool operator==(const Rect&, const Rect&) = default;
  template <class Self, class Archive>
  static void visit_state(Self& self, Archive& archive) noexcept {
    archive(self.left, self.top, self.width, self.height);
  }
};

/// Common part; empty (0 x 0) if there is none.
[[nodiscard]] inline Rect intersect(const Rect& a, const Rect& b) noexcept {
  const int left = std::max(a.left, b.left);
  const int top = std::max(a.top, b.top);
  const int right = std::min(a.right(), b.right());
  const int bottom = std::min(a.bottom(), b.bottom());
  if (right <= left || bottom <= top) return {};
  return {left, top, right - left, bottom - top};
}

/// Smallest rectangle around both; an empty one does not count.
[[nodiscard]] inline Rect unite(const Rect& a, const Rect& b) noexcept {
  if (a.empty()) return b;
  if (b.empty()) return a;
  const int left = std::min(a.left, b.left);
  const int top = std::min(a.top, b.top);
  return {left, top, std::max(a.right(), b.right()) - left, std::max(a.bottom(), b.bottom()) - top};
}

/// With `margin` more to each side.
[[nodiscard]] inline Rect grown(const Rect& a, int margin) noexcept {
  return {a.left - margin, a.top - margin, a.width + 2 * margin, a.height + 2 * margin};
}

/// Columns or rows between two boxes, the larger of both; 0 if they touch [px].
[[nodiscard]] inline int gap(const Rect& a, const Rect& b) noexcept {
  const int across = std::max({a.left - b.right(), b.left - a.right(), 0});
  const int down = std::max({a.top - b.bottom(), b.top - a.bottom(), 0});
  return std::max(across, down);
}

/// Intersection over union of two boxes, 0..1.
[[nodiscard]] inline double overlap(const Rect& a, const Rect& b) noexcept {
  const auto common = static_cast<double>(intersect(a, b).area());
  const double all = static_cast<double>(a.area()) + static_cast<double>(b.area()) - common;
  return all > 0 ? common / all : 0.0;
}

}  // namespace stereotrack
