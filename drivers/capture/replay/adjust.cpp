#include "drivers/capture/replay/adjust.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <opencv2/imgproc.hpp>

namespace stereotrack::capture {

namespace {

struct Span {
  int low = 255;
  int high = -255;
  void add(int value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  [[nodiscard]] int width() const { return high - low; }
};

constexpr int kTint = 4;       ///< JPEG and video round chroma to about this
constexpr int kContrast = 32;  ///< below it colour could hide in the rounding

}  // namespace

PixelFormat format_of(const cv::Mat& picture) {
  if (picture.channels() == 1) return PixelFormat::kGrey8;
  Span green;
  Span blue_green;
  Span red_green;
  for (int y = 0; y < picture.rows; ++y) {
    const std::uint8_t* pixel = picture.ptr(y);
    for (int x = 0; x < picture.cols; ++x, pixel += 3) {
      green.add(pixel[1]);
      blue_green.add(pixel[0] - pixel[1]);
      red_green.add(pixel[2] - pixel[1]);
    }
  }
  const bool tint = blue_green.width() <= kTint && red_green.width() <= kTint;
  return tint && green.width() >= kContrast ? PixelFormat::kGrey8 : PixelFormat::kBgr8;
}

void convert(cv::Mat& picture, PixelFormat format) {
  if ((format == PixelFormat::kBgr8 ? 3 : 1) == picture.channels()) return;
  cv::Mat converted;
  cv::cvtColor(picture, converted, format == PixelFormat::kBgr8 ? cv::COLOR_GRAY2BGR : cv::COLOR_BGR2GRAY);
  picture = converted;
}

void flip_rows(cv::Mat& picture) {
  const std::size_t bytes = static_cast<std::size_t>(picture.cols) * picture.elemSize();
  for (int top = 0, bottom = picture.rows - 1; top < bottom; ++top, --bottom) {
    std::swap_ranges(picture.ptr(top), picture.ptr(top) + bytes, picture.ptr(bottom));
  }
}

void shift_rows_down(cv::Mat& picture, int rows) {
  if (rows == 0) return;
  const std::size_t bytes = static_cast<std::size_t>(picture.cols) * picture.elemSize();
  const int count = picture.rows;
  for (int i = 0; i < count; ++i) {
    const int y = rows > 0 ? count - 1 - i : i;
    if (y - rows >= 0 && y - rows < count) {
      std::memcpy(picture.ptr(y), picture.ptr(y - rows), bytes);
    } else {
      std::memset(picture.ptr(y), 0, bytes);
    }
  }
}

Picture view_of(const cv::Mat& picture) {
  return {picture.data, picture.cols, picture.rows, static_cast<std::ptrdiff_t>(picture.step[0]),
          picture.channels() == 3 ? PixelFormat::kBgr8 : PixelFormat::kGrey8};
}

}  // namespace stereotrack::capture
