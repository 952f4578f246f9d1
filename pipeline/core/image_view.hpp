#pragma once

#include <cstddef>
#include <type_traits>

namespace stereotrack {

/// A rectangle of pixels that somebody else owns: pointer, size, stride. Copying it copies no pixel.
/// Rows are `stride` elements (not bytes) apart, stride >= width.
template <class T>
struct ImageView {
  T* data = nullptr;
  int width = 0;              ///< [px]
  int height = 0;             ///< [px]
  std::ptrdiff_t stride = 0;  ///< [elements]

  [[nodiscard]] T* row(int y) const noexcept { return data + y * stride; }
  [[nodiscard]] T& at(int x, int y) const noexcept { return data[y * stride + x]; }
  [[nodiscard]] bool empty() const noexcept { return data == nullptr || width <= 0 || height <= 0; }
  [[nodiscard]] bool contains(int x, int y) const noexcept { return x >= 0 && y >= 0 && x < width && y < height; }
  template <class U>
  [[nodiscard]] bool same_size(const ImageView<U>& other) const noexcept {
    return width == other.width && height == other.height;
  }

  /// The part at (x, y) of size w by h, which must lie inside.
  [[nodiscard]] ImageView window(int x, int y, int w, int h) const noexcept {
    return {data + y * stride + x, w, h, stride};
  }

  /// A view that may write converts to one that may only read.
  operator ImageView<const T>() const noexcept  // NOLINT(google-explicit-constructor): like span
      requires(!std::is_const_v<T>) {
    return {data, width, height, stride};
  }
};

}  // namespace stereotrack
