#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "pipeline/core/image_view.hpp"

namespace stereotrack::test {

/// A picture of its own for tests that must run without OpenCV, too. Rows have an odd number of elements and begin at
/// odd elements: no vector of a row is aligned. What lies beside the rows belongs to nobody; margins_untouched() tells.
template <class T>
class Grid {
 public:
  Grid(int width, int height, T value = {})
      : width_(width), height_(height), stride_(width + 5 - width % 2), all_(size(), kMargin) {
    for (int y = 0; y < height; ++y) std::fill_n(row(y), width, value);
  }

  [[nodiscard]] int width() const noexcept { return width_; }
  [[nodiscard]] int height() const noexcept { return height_; }
  [[nodiscard]] T* row(int y) noexcept { return all_.data() + 1 + y * stride_; }
  [[nodiscard]] const T* row(int y) const noexcept { return all_.data() + 1 + y * stride_; }
  [[nodiscard]] T& at(int x, int y) noexcept { return row(y)[x]; }
  [[nodiscard]] T at(int x, int y) const noexcept { return row(y)[x]; }
  [[nodiscard]] ImageView<T> view() noexcept { return {row(0), width_, height_, stride_}; }
  [[nodiscard]] ImageView<const T> view() const noexcept { return {row(0), width_, height_, stride_}; }

  [[nodiscard]] bool margins_untouched() const {
    std::vector<T> copy = all_;
    for (int y = 0; y < height_; ++y) std::fill_n(copy.begin() + 1 + y * stride_, width_, T{kMargin});
    return std::all_of(copy.begin(), copy.end(), [](T value) { return value == kMargin; });
  }
  /// Size, elements and margins.
  friend bool operator==(const Grid& a, const Grid& b) = default;

 private:
  static constexpr T kMargin = 77;
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(stride_ * std::max(height_, 1) + 1); }

  int width_;
  int height_;
  std::ptrdiff_t stride_;
  std::vector<T> all_;
};

/// Each element from low to high, both included.
inline Grid<std::uint8_t> random_grid(int width, int height, int low, int high, unsigned seed) {
  std::mt19937 random(seed);
  Grid<std::uint8_t> grid(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      grid.at(x, y) = static_cast<std::uint8_t>(low + static_cast<int>(random() % (high - low + 1U)));
    }
  }
  return grid;
}

}  // namespace stereotrack::test
