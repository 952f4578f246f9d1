#pragma once

#include "pipeline/frame.hpp"

namespace stereotrack::capture {

/// What the two eyes of a camera saw that puts both views into one picture, the left one beside the right one.
struct SideBySide {
  Picture left;
  Picture right;
};

/// Whether a picture of that size and format can be split: both halves must be pictures of the format, too, whose
/// colours are not torn apart.
[[nodiscard]] constexpr bool splits_side_by_side(PixelFormat format, int width, int height) noexcept {
  return width > 0 && width % 2 == 0 && fits_format(format, width / 2, height);
}

/// The two views, in the memory of the whole: one buffer, one lease, one time, nothing is copied. Only of a picture for
/// which splits_side_by_side().
[[nodiscard]] constexpr SideBySide split_side_by_side(const Picture& whole) noexcept {
  SideBySide views{whole, whole};
  views.left.width = whole.width / 2;
  views.right.width = whole.width / 2;
  views.right.data = whole.data + picture_bytes(whole.format, whole.width / 2, 1);
  return views;
}

}  // namespace stereotrack::capture
