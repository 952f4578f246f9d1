#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>

#include "pipeline/core/image_view.hpp"
#include "pipeline/core/rect.hpp"
#include "pipeline/shape/blob_extractor.hpp"

// Small tools on a region: the pixels of `labels` inside `box` whose value is `label`. The box is clipped
// to the picture. No state.
namespace stereotrack {

/// BorderSide bits of the picture's sides that `box` touches.
[[nodiscard]] inline std::uint8_t sides_touched(const Rect& box, int width, int height) noexcept {
  if (box.empty()) return 0;
  return static_cast<std::uint8_t>((box.left <= 0 ? kLeftSide : 0) | (box.top <= 0 ? kTopSide : 0) |
                                   (box.right() >= width ? kRightSide : 0) |
                                   (box.bottom() >= height ? kBottomSide : 0));
}

/// The first of the labels [x, end) that is `label`, or that is not; four at a time.
template <bool kSame>
[[nodiscard]] inline int find_label(const std::uint16_t* row, int x, int end, std::uint16_t label) noexcept {
  static_assert(std::endian::native == std::endian::little, "the first label must be a word's lowest");
  constexpr std::uint64_t kOnes = 0x0001'0001'0001'0001U;
  for (; x + 4 <= end; x += 4) {
    std::uint64_t labels;
    std::memcpy(&labels, row + x, sizeof labels);
    std::uint64_t found = labels ^ (kOnes * label);  // 0 where it is the label
    // The lowest of the top bits is right; those above may be a borrow's.
    if (kSame) found = (found - kOnes) & ~found & (kOnes << 15);
    if (found != 0) return x + std::countr_zero(found) / 16;
  }
  while (x < end && (row[x] == label) != kSame) ++x;
  return x;
}

/// Calls fn(y, begin, end) for each run of the region's pixels in a row, in raster order. O(box).
template <class Fn>
void for_each_run(ImageView<const std::uint16_t> labels, const Rect& box, std::uint16_t label, Fn&& fn) noexcept {
  const Rect part = intersect(box, {0, 0, labels.width, labels.height});
  for (int y = part.top; y < part.bottom(); ++y) {
    const std::uint16_t* row = labels.row(y);
    for (int end = part.left;;) {
      const int begin = find_label<true>(row, end, part.right(), label);
      if (begin >= part.right()) break;
      end = find_label<false>(row, begin, part.right(), label);
      fn(y, begin, end);
    }
  }
}

/// Calls fn(x, y) for each pixel of the region, in raster order. fn may change the label of its pixel. O(box).
template <class Fn>
void for_each_pixel(ImageView<const std::uint16_t> labels, const Rect& box, std::uint16_t label, Fn&& fn) noexcept {
  for_each_run(labels, box, label, [&](int y, int begin, int end) noexcept {
    for (int x = begin; x < end; ++x) fn(x, y);
  });
}

/// 255 where a pixel has a label, else 0. Sizes must agree. O(pixels).
inline void mask_of_labels(ImageView<const std::uint16_t> labels, ImageView<std::uint8_t> mask) noexcept {
  const int width = labels.width;  // a local, which bytes written do not alias: else nothing is vectorised
  for (int y = 0; y < labels.height; ++y) {
    const std::uint16_t* label = labels.row(y);
    std::uint8_t* out = mask.row(y);
    for (int x = 0; x < width; ++x) out[x] = label[x] != 0 ? 255 : 0;
  }
}

/// Calls fn(x, y) for each pixel of the region with a 4-neighbour that has another label, in raster order:
/// the inner boundary. The end of the picture is not a boundary: there the object goes on unseen. O(box).
template <class Fn>
void for_each_boundary_pixel(ImageView<const std::uint16_t> labels, const Rect& box, std::uint16_t label,
                             Fn&& fn) noexcept {
  const int last_x = labels.width - 1;
  const int last_y = labels.height - 1;
  for_each_pixel(labels, box, label, [&](int x, int y) noexcept {
    const bool boundary = (x > 0 && labels.at(x - 1, y) != label) || (x < last_x && labels.at(x + 1, y) != label) ||
                          (y > 0 && labels.at(x, y - 1) != label) || (y < last_y && labels.at(x, y + 1) != label);
    if (boundary) fn(x, y);
  });
}

/// The region's Blob, measured anew (after labels were merged, split or refined). Area 0 and an empty box
/// where there is no such pixel. O(box).
[[nodiscard]] inline Blob measure_region(ImageView<const std::uint16_t> labels, const Rect& box,
                                         std::uint16_t label) noexcept {
  Blob blob;
  blob.label = label;
  std::int64_t sum_x = 0;
  std::int64_t sum_y = 0;
  int left = labels.width;
  int right = 0;
  int bottom = 0;
  for_each_run(labels, box, label, [&](int y, int begin, int end) noexcept {
    const int length = end - begin;
    if (blob.area == 0) blob.first = {begin, y};
    blob.area += length;
    sum_x += static_cast<std::int64_t>(length) * (begin + end - 1) / 2;
    sum_y += static_cast<std::int64_t>(length) * y;
    left = std::min(left, begin);
    right = std::max(right, end);
    bottom = y + 1;
  });
  if (blob.area == 0) return blob;
  blob.box = {left, blob.first.y, right - left, bottom - blob.first.y};
  blob.center_x = static_cast<double>(sum_x) / blob.area;
  blob.center_y = static_cast<double>(sum_y) / blob.area;
  blob.sides = sides_touched(blob.box, labels.width, labels.height);
  return blob;
}

/// Gives the region's pixels the label `to`: to merge blobs, or with to = 0 to remove one. O(box).
inline void relabel_region(ImageView<std::uint16_t> labels, const Rect& box, std::uint16_t from,
                           std::uint16_t to) noexcept {
  for_each_run(labels, box, from,
               [&](int y, int begin, int end) noexcept { std::fill(labels.row(y) + begin, labels.row(y) + end, to); });
}

}  // namespace stereotrack
