#pragma once

#include <opencv2/core.hpp>

#include "pipeline/stereo/disparity.hpp"

namespace stereotrack::bench {

/// Block matching word for word as the headers of SadMatcher and CensusMatcher define it: every block of every
/// candidate is summed anew. About a second for 640x480 with 64 disparities. Out: CV_16U, winner in whole pixels,
/// kNoDisparity where no candidate exists.
[[nodiscard]] cv::Mat naive_sad(const cv::Mat& left, const cv::Mat& right, int block, DisparityRange range);
/// Before gates and filters.
[[nodiscard]] cv::Mat naive_census(const cv::Mat& left, const cv::Mat& right, int block, DisparityRange range);

}  // namespace stereotrack::bench
