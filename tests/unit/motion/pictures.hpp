#pragma once

#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "pipeline/core/image_view.hpp"

// Pictures for the tests of this room; seeded by OpenCV's own generator.
namespace stereotrack::test {

using Plane = cv::Mat_<std::uint8_t>;

template <class T>
ImageView<T> view(cv::Mat_<T>& mat) {
  return {reinterpret_cast<T*>(mat.data), mat.cols, mat.rows, static_cast<std::ptrdiff_t>(mat.step1())};
}

inline Plane random_plane(cv::Size size, int low, int high, std::uint64_t seed) {
  Plane plane(size);
  cv::RNG(seed).fill(plane, cv::RNG::UNIFORM, low, high + 1);
  return plane;
}

/// A surface with a soft texture around `mean`, the same for all shifts.
inline cv::Mat_<float> surface(cv::Size size, double mean, double phase = 0) {
  cv::Mat_<float> out(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      out(y, x) = static_cast<float>(mean + 14 * std::sin(0.31 * x + 0.17 * y + phase) +
                                     11 * std::sin(0.13 * x - 0.37 * y + 1 + 2 * phase));
    }
  }
  return out;
}

/// What the sensor makes of it: light, noise of standard deviation `noise`, rounding; then smoothed 3x3.
inline Plane exposed(const cv::Mat_<float>& scene, double light, double noise, std::uint64_t seed) {
  cv::Mat_<float> grain(scene.size());
  cv::RNG(seed).fill(grain, cv::RNG::NORMAL, 0, noise);
  Plane raw;
  cv::Mat_<float>(scene * light + grain).convertTo(raw, CV_8U);
  Plane smooth;
  cv::GaussianBlur(raw, smooth, {3, 3}, 0, 0, cv::BORDER_REPLICATE);
  return smooth;
}

/// Part of the rectangle in which `condition` (0 or 255) holds.
inline double part(const cv::Mat& condition, const cv::Rect& where) {
  return cv::countNonZero(condition(where)) / static_cast<double>(where.area());
}

/// The rectangle without a rim of `by` pixels.
inline cv::Rect inner(const cv::Rect& r, int by) { return {r.x + by, r.y + by, r.width - 2 * by, r.height - 2 * by}; }

}  // namespace stereotrack::test
