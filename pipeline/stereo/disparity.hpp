#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>

#include "pipeline/core/image_view.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/core/result.hpp"

namespace stereotrack {

/// A disparity picture holds 16-bit values in 1/16 px, of the size of the left picture:
///     d = value / 16 = u_left - u_right - offset   [px]
/// offset [px] moves the right canvas against the left one (0 for an ordinary rectified pair): the right
/// column of left column u at disparity d is u - d - offset.
/// A true disparity of 0 is the value 0, so "none" needs a value of its own: kNoDisparity.
inline constexpr std::uint16_t kNoDisparity = 0xFFFF;
inline constexpr int kDisparityScale = 16;       ///< values in one pixel
inline constexpr int kLargestDisparity = 4'000;  ///< [px], keeps every value under kNoDisparity

/// Disparities that are tried, both ends included [px].
struct DisparityRange {
  int min = 0;
  int max = 63;

  [[nodiscard]] constexpr int count() const noexcept { return max - min + 1; }
  [[nodiscard]] constexpr bool valid() const noexcept { return 0 <= min && min <= max && max <= kLargestDisparity; }
};

/// What became of the pixels that were asked for. `wanted` = matched + border + texture + uniqueness +
/// left_right + speckle - filled.
struct DisparityCounts {
  std::int64_t wanted = 0;      ///< pixels asked for
  std::int64_t matched = 0;     ///< pixels that have a disparity in the end, filled ones too
  std::int64_t border = 0;      ///< rejected: no candidate lies in the right picture
  std::int64_t texture = 0;     ///< rejected: the window shows nothing to match
  std::int64_t uniqueness = 0;  ///< rejected: another disparity fits nearly as well
  std::int64_t left_right = 0;  ///< rejected: its right pixel prefers another left pixel
  std::int64_t speckle = 0;     ///< rejected: a small island with a disparity of its own
  std::int64_t filled = 0;      ///< of the rejected, how many took the farther neighbour's disparity
};

/// Which candidates exist at a left column, and how much of their window does.
/// A window of (2 radius + 1) columns around left column x is clipped to the left picture, and for
/// disparity d to the columns whose partner lies in the right picture.
struct BlockGeometry {
  int left_width = 0;   ///< [px]
  int right_width = 0;  ///< [px]
  int radius = 0;       ///< [px]
  int offset = 0;       ///< [px]
  DisparityRange range;

  [[nodiscard]] int first(int x) const noexcept { return std::max(range.min, x - offset - (right_width - 1)); }
  [[nodiscard]] int last(int x) const noexcept { return std::min(range.max, x - offset); }

  /// Disparities first_whole..last_whole have every column that the left picture has.
  [[nodiscard]] int first_whole(int x) const noexcept {
    return std::max(first(x), right_end(x) - offset - (right_width - 1));
  }
  [[nodiscard]] int last_whole(int x) const noexcept { return std::min(last(x), left_end(x) - offset); }

  /// Columns of the window at x that exist for disparity d; at least 1 for first(x) <= d <= last(x).
  [[nodiscard]] int columns(int x, int d) const noexcept {
    const int begin = std::max(left_end(x), d + offset);
    const int end = std::min(right_end(x), d + offset + right_width - 1);
    return end - begin + 1;
  }
  /// The same without the right picture's limits.
  [[nodiscard]] int columns(int x) const noexcept { return right_end(x) - left_end(x) + 1; }

 private:
  [[nodiscard]] int left_end(int x) const noexcept { return std::max(x - radius, 0); }
  [[nodiscard]] int right_end(int x) const noexcept { return std::min(x + radius, left_width - 1); }
};

/// Pixels [first, last] of a row; empty (first > last) if there is none.
struct Span {
  int first = 0;
  int last = -1;
  [[nodiscard]] bool empty() const noexcept { return first > last; }
};

/// An empty mask wants everything.
[[nodiscard]] inline bool is_wanted(const ImageView<const std::uint8_t>& mask, int x, int y) noexcept {
  return mask.empty() || mask.at(x, y) != 0;
}

/// From the first to the last wanted pixel of a row of `roi`.
[[nodiscard]] inline Span wanted_span(const ImageView<const std::uint8_t>& mask, const Rect& roi, int y) noexcept {
  Span span{roi.left, roi.right() - 1};
  if (mask.empty()) return span;
  // Most of a row may be unwanted, so eight pixels are asked at a time.
  const auto eight_unwanted = [row = mask.row(y)](int x) {
    std::uint64_t eight;
    std::memcpy(&eight, row + x, sizeof eight);
    return eight == 0;
  };
  while (span.last - span.first >= 8 && eight_unwanted(span.first)) span.first += 8;
  while (!span.empty() && !is_wanted(mask, span.first, y)) ++span.first;
  while (span.last - span.first >= 8 && eight_unwanted(span.last - 7)) span.last -= 8;
  while (!span.empty() && !is_wanted(mask, span.last, y)) --span.last;
  return span;
}

/// The wanted pixels of a region, row by row.
struct WantedRows {
  Rect box;                     ///< tight around them; empty if there is none
  std::span<const Span> spans;  ///< of the rows of `box`

  [[nodiscard]] Span span(int y) const noexcept { return spans[static_cast<std::size_t>(y - box.top)]; }
};

/// `roi` lies in the picture. `memory`: at least one Span for each of its rows; the answer lives there.
[[nodiscard]] inline WantedRows find_wanted(const ImageView<const std::uint8_t>& mask, const Rect& roi,
                                            std::span<Span> memory) noexcept {
  int left = roi.right();
  int right = roi.left;
  int top = roi.bottom();
  int bottom = roi.top;
  for (int y = roi.top; y < roi.bottom(); ++y) {
    const Span span = wanted_span(mask, roi, y);
    memory[static_cast<std::size_t>(y - roi.top)] = span;
    if (span.empty()) continue;
    left = std::min(left, span.first);
    right = std::max(right, span.last + 1);
    top = std::min(top, y);
    bottom = y + 1;
  }
  if (top >= bottom) return {};
  return {{left, top, right - left, bottom - top},
          memory.subspan(static_cast<std::size_t>(top - roi.top), static_cast<std::size_t>(bottom - top))};
}

}  // namespace stereotrack
