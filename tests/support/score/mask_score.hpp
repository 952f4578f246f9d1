#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>

namespace stereotrack::score {

/// Foreground masks against CDnet ground truth (changedetection.net). Labels of the truth: 0 static,
/// 50 hard shadow, 85 outside the region of interest, 170 unknown, 255 moving. Pixels of 85 and 170 are
/// not scored; shadow counts as static, so a mask that marks it loses precision.
struct MaskScore {
  std::uint64_t frames = 0;
  std::uint64_t true_positives = 0;
  std::uint64_t false_positives = 0;
  std::uint64_t false_negatives = 0;
  std::uint64_t true_negatives = 0;
  std::uint64_t shadow_pixels = 0;
  std::uint64_t shadow_as_object = 0;

  [[nodiscard]] double precision() const;    ///< TP / (TP + FP); 0 if nothing is marked
  [[nodiscard]] double recall() const;       ///< TP / (TP + FN); 0 if nothing moves
  [[nodiscard]] double f_measure() const;    ///< 2 TP / (2 TP + FP + FN), over the pixels of all frames together
  [[nodiscard]] double shadow_rate() const;  ///< share of shadow pixels marked as object; 0 without shadow
};

/// Adds one frame. Both pictures CV_8UC1 of one size, `mask` 0 or 255. Throws std::runtime_error for
/// another size or type, an unknown label, or another value in the mask.
void add_frame(MaskScore& score, const cv::Mat& truth, const cv::Mat& mask);

/// Scores each PNG of `truth_folder` but the first `skip` by number (the background's learning time). The
/// last number in a name is its frame; truth n belongs to mask n - offset, since masks count from 1.
/// Throws std::runtime_error if a folder has no PNG, a truth has no mask, or a file is not what it should be:
/// a missing mask must not make the score better.
[[nodiscard]] MaskScore score_mask_folders(const std::filesystem::path& truth_folder,
                                           const std::filesystem::path& mask_folder, std::size_t skip,
                                           std::int64_t offset);

}  // namespace stereotrack::score
