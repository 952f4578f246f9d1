#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "pipeline/core/image_view.hpp"

// Pictures for the tests of this room; seeded by OpenCV's own generator.
namespace stereotrack::test {

template <class T>
ImageView<T> view(cv::Mat_<T>& mat) {
  return {reinterpret_cast<T*>(mat.data), mat.cols, mat.rows, static_cast<std::ptrdiff_t>(mat.step1())};
}

template <class T>
ImageView<const T> const_view(cv::Mat_<T>& mat) {
  return view(mat);
}

inline cv::Mat_<std::uint8_t> random_grey(int width, int height, std::uint64_t seed) {
  cv::Mat_<std::uint8_t> grey(height, width);
  cv::RNG(seed).fill(grey, cv::RNG::UNIFORM, 0, 256);
  return grey;
}

/// Salt: each pixel set with the given probability.
inline cv::Mat_<std::uint8_t> salt(int width, int height, double density, std::uint64_t seed) {
  cv::Mat_<std::uint8_t> mask(random_grey(width, height, seed) < density * 256);
  return mask;
}

/// What thresholded edges look like: rings, open strokes, blotches that run out of the picture, some salt.
inline cv::Mat_<std::uint8_t> edge_like(int width, int height, std::uint64_t seed) {
  cv::RNG rng(seed);
  cv::Mat_<std::uint8_t> mask(height, width, std::uint8_t{0});
  for (int i = 0; i < 12; ++i) {
    const cv::Point center(rng.uniform(-5, width + 5), rng.uniform(-5, height + 5));
    const cv::Size axes(rng.uniform(2, width / 3 + 3), rng.uniform(2, height / 3 + 3));
    const int end = i % 3 == 0 ? 300 : 360;
    cv::ellipse(mask, center, axes, rng.uniform(0, 180), 0, end, 255, i % 4 == 1 ? -1 : rng.uniform(1, 3));
  }
  mask |= salt(width, height, 0.01, seed + 1);
  return mask;
}

inline int differing(const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a != b); }

}  // namespace stereotrack::test
