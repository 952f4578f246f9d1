#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>

namespace stereotrack::score {

/// A disparity map against ground truth, as the Middlebury benchmark counts. Maps are CV_32FC1 in pixels,
/// 0 = none. "Scored" are the pixels that have a true disparity and are not masked out; "matched" those of
/// them for which the map has a value.
struct DisparityScore {
  std::uint64_t scored = 0;
  std::uint64_t matched = 0;
  std::uint64_t over_1 = 0;  ///< matched, error over 1 px
  std::uint64_t over_2 = 0;

  [[nodiscard]] double density() const;       ///< matched / scored
  [[nodiscard]] double bad_1() const;         ///< of the matched
  [[nodiscard]] double bad_2() const;         ///< of the matched
  [[nodiscard]] double bad_2_of_all() const;  ///< of the scored, where none counts as bad
};

/// `mask`: CV_8UC1, 255 = scored; an empty one scores all pixels with a truth.
/// Throws std::runtime_error for another size or type.
[[nodiscard]] DisparityScore score_disparity(const cv::Mat& truth, const cv::Mat& estimate, const cv::Mat& mask);

/// The pixels of the left view that the right one sees too: 255 where the right map, at the place the left
/// disparity points to (rounded), has the same disparity within `tolerance` px; else 0.
[[nodiscard]] cv::Mat non_occluded(const cv::Mat& left, const cv::Mat& right, double tolerance = 1.0);

/// Ground truth from a grey PNG (value / scale) or PFM (value / scale); zeros, infinities and NaN: none.
[[nodiscard]] cv::Mat read_truth(const std::filesystem::path& file, double scale);

/// What `stereotrack disparity` writes: 16-bit PNG, disparity x 256, 0 = none.
[[nodiscard]] cv::Mat read_estimate(const std::filesystem::path& file);

/// A Middlebury mask: white (255) = scored; black occluded, grey at depth edges or half occluded.
[[nodiscard]] cv::Mat read_scored_mask(const std::filesystem::path& file);

}  // namespace stereotrack::score
