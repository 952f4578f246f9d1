#include "pipeline/geometry/lazy_canvas.hpp"

#include <algorithm>

namespace stereotrack {

LazyCanvas LazyCanvas::create(const RemapTable& table, Sampling sampling, Arena& arena) noexcept {
  LazyCanvas made;
  made.table_ = table;
  made.sampling_ = sampling;
  made.canvas_ = arena.image<std::uint8_t>(table.corner.width, table.corner.height);
  made.drawn_ = arena.array<Stretch>(static_cast<std::size_t>(table.corner.height));
  return arena.failed() ? LazyCanvas() : made;
}

void LazyCanvas::show(ImageView<const std::uint8_t> raw) noexcept {
  raw_ = raw;
  std::fill(drawn_.begin(), drawn_.end(), Stretch());
}

ImageView<const std::uint8_t> LazyCanvas::with(const Rect& part) noexcept {
  constexpr int kBlock = RemapTable::kBlock;
  const Rect inside = intersect(part, {0, 0, canvas_.width, canvas_.height});
  if (inside.empty() || raw_.empty()) return canvas_;
  const int begin = inside.left / kBlock * kBlock;
  const int end = std::min((inside.right() + kBlock - 1) / kBlock * kBlock, canvas_.width);
  for (int y = inside.top; y < inside.bottom(); ++y) {
    Stretch& drawn = drawn_[static_cast<std::size_t>(y)];
    if (drawn.begin == drawn.end) drawn = {begin, begin};
    if (begin < drawn.begin) draw(y, begin, drawn.begin);
    if (end > drawn.end) draw(y, drawn.end, end);
    drawn = {std::min(drawn.begin, begin), std::max(drawn.end, end)};
  }
  return canvas_;
}

void LazyCanvas::draw(int row, int begin, int end) noexcept {
  remap_row(raw_, table_.columns(begin, end), row, sampling_, canvas_.row(row) + begin);
}

}  // namespace stereotrack
