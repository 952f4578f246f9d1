#pragma once

#include <opencv2/core/mat.hpp>

#include "pipeline/frame.hpp"

namespace stereotrack::capture {

/// What a picture (CV_8UC1 or CV_8UC3) shows. Grey pictures are often stored in three channels, with a constant tint
/// by rounding, so three channels are kGrey8 too
///     if  max(B - G) - min(B - G) <= 4  and  max(R - G) - min(R - G) <= 4   over all pixels,
/// unless max G - min G < 32: a picture as flat as before a fade-in shows nothing and counts by its channels.
[[nodiscard]] PixelFormat format_of(const cv::Mat& picture);

/// Luma by BT.601 where grey is asked for, which is exact for three equal channels; three equal channels where colour
/// is.
void convert(cv::Mat& picture, PixelFormat format);

/// First row becomes the last. In place, any type, also a part of a larger picture.
void flip_rows(cv::Mat& picture);

/// Row y becomes row y + rows (negative: up); rows that come in are 0, rows that go out are lost. In place.
void shift_rows_down(cv::Mat& picture, int rows);

/// A view of `picture`, which must outlive it.
[[nodiscard]] Picture view_of(const cv::Mat& picture);

}  // namespace stereotrack::capture
