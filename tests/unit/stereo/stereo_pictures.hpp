#pragma once

#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <random>

#include "pipeline/core/image_view.hpp"

namespace stereotrack::test {

template <class T>
ImageView<const T> view(const cv::Mat& m) {
  return {m.ptr<T>(), m.cols, m.rows, static_cast<std::ptrdiff_t>(m.step / sizeof(T))};
}
template <class T>
ImageView<T> writable(cv::Mat& m) {
  return {m.ptr<T>(), m.cols, m.rows, static_cast<std::ptrdiff_t>(m.step / sizeof(T))};
}

inline cv::Mat noise(int width, int height, unsigned seed, int low = 0, int high = 255) {
  std::mt19937 random(seed);
  cv::Mat m(height, width, CV_8U);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      m.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(low + static_cast<int>(random() % (high - low + 1U)));
    }
  }
  return m;
}

/// What the right camera sees if all of `left` has disparity d: right(x) = left(x + d + offset), noise beyond.
inline cv::Mat shifted(const cv::Mat& left, int d, unsigned seed) {
  cv::Mat right = noise(left.cols, left.rows, seed);
  for (int y = 0; y < left.rows; ++y) {
    for (int x = 0; x < left.cols; ++x) {
      if (x + d >= 0 && x + d < left.cols) right.at<std::uint8_t>(y, x) = left.at<std::uint8_t>(y, x + d);
    }
  }
  return right;
}

/// A texture that is known between the pixels too: four waves of different direction. Periods over 6 px.
inline double waves(double x, double y) {
  return 128 + 30 * std::sin(0.61 * x + 0.37 * y) + 28 * std::sin(0.43 * x - 0.71 * y + 1) +
         25 * std::sin(0.97 * x + 0.11 * y + 2) + 22 * std::sin(0.23 * x + 0.53 * y + 3);
}

inline cv::Mat waves_picture(int width, int height, double shift) {
  cv::Mat m(height, width, CV_8U);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) m.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(waves(x + shift, y));
  }
  return m;
}

}  // namespace stereotrack::test
