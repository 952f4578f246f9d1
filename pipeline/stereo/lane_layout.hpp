#pragma once

#include <algorithm>
#include <cstdint>

#include "pipeline/stereo/disparity.hpp"

namespace stereotrack {

/// Kernels work on this many disparities at a time, the lanes of the widest vector; the last are padding.
inline constexpr int kLaneStep = 32;
/// And on this many pixels.
inline constexpr int kPixelStep = 32;

[[nodiscard]] constexpr int padded_lanes(int disparities) noexcept {
  return (disparities + kLaneStep - 1) / kLaneStep * kLaneStep;
}

/// Which candidates of a column exist and which have whole windows, as d - range.min:
/// first <= first_whole <= end_whole <= end.
struct WindowLimits {
  std::int16_t first = 0;
  std::int16_t first_whole = 0;
  std::int16_t end_whole = 0;
  std::int16_t end = 0;

  WindowLimits() noexcept = default;
  WindowLimits(const BlockGeometry& g, int x) noexcept {
    const int first_d = g.first(x);
    const int end_d = std::max(g.last(x) + 1, first_d);
    const int first_whole_d = std::clamp(g.first_whole(x), first_d, end_d);
    const int end_whole_d = std::clamp(g.last_whole(x) + 1, first_whole_d, end_d);
    const auto id = [&](int d) { return static_cast<std::int16_t>(d - g.range.min); };
    first = id(first_d), first_whole = id(first_whole_d), end_whole = id(end_whole_d), end = id(end_d);
  }
};

/// Where a kernel keeps what: the left columns that the windows of a region cover, counted from the first of them, and
/// the right columns that they meet. Lane i of a pixel is disparity range.max - i, so that the partners of
/// neighbouring lanes are neighbours in the right row: lane i of column c meets partner c + i.
struct LaneLayout {
  int count = 0;          ///< disparities
  int lanes = 0;          ///< with padding
  int first_column = 0;   ///< of the left picture
  int columns = 0;        ///< how many
  int partner = 0;        ///< right column of the first partner; may lie outside
  int partners = 0;       ///< how many
  int first_partner = 0;  ///< of them, those in [first, end) exist
  int end_partner = 0;
  int inner_begin = 0;  ///< left pixels [begin, end) have whole windows only
  int inner_end = 0;

  LaneLayout(const BlockGeometry& g, const Rect& box) noexcept
      : count(g.range.count()),
        lanes(padded_lanes(count)),
        first_column(std::max(box.left - g.radius, 0)),
        columns(std::min(box.right() + g.radius, g.left_width) - first_column),
        partner(first_column - g.offset - g.range.max),
        partners(columns + lanes - 1),
        first_partner(std::clamp(-partner, 0, partners)),
        end_partner(std::clamp(g.right_width - partner, first_partner, partners)),
        inner_begin(std::max(g.radius, g.offset + g.range.max + g.radius)),
        inner_end(std::min(g.left_width, g.right_width + g.offset + g.range.min) - g.radius) {}

  [[nodiscard]] bool is_inner(int x) const noexcept { return x >= inner_begin && x < inner_end; }

  /// How many pixels from x to `last` are alike in that, at most `most`.
  [[nodiscard]] int batch(int x, int last, int most = kPixelStep) const noexcept {
    const int limit = x < inner_begin ? inner_begin : x < inner_end ? inner_end : last + 1;
    return std::min({most, limit - x, last + 1 - x});
  }
};

}  // namespace stereotrack
