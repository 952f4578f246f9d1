#pragma once

#include <memory>
#include <string>

#include "drivers/capture/frame_source.hpp"

namespace stereotrack::capture {

/// What a user says about the input where the input does not say it itself.
struct ReplayOptions {
  double fps = 30;     ///< rate where the source has no time [Hz]
  bool flip = false;   ///< both views are upside down: their rows are reversed, before the shift
  bool swap = false;   ///< the source's right view is our left one
  int shift_rows = 0;  ///< the right view moves down by so many rows [px], negative: up; rows that come in are 0
};

/// Opens recorded pictures as a source of frame pairs. Forms of `source`:
///
///     DIR               EuRoC: `mav0` with cam0/ and cam1/, each data.csv and data/
///                       KITTI: image_0/ image_1/ (grey), else image_2/ image_3/ (colour); times.txt if there
///                       left/ right/
///                       or a folder in which exactly one of these is found, up to three levels down
///     LEFT,RIGHT        two videos, or two folders of pictures (so KITTI's colour views where both are there)
///     sbs:FILE          a video whose left half is the left view; the width must be even
///     mono:PATH         one folder of pictures, one EuRoC camera, or one video; `right` stays empty
///
/// **Pictures**: png jpg jpeg bmp pgm ppm tif tiff in any case; names that begin with a dot are not looked at.
/// Alpha is dropped, EXIF rotation is not applied; of 16 bits the high byte is kept.
///
/// **Size and format** are those of the first readable pair's left picture: kBgr8 if it has three channels and shows
/// colour (format_of in adjust.hpp), else kGrey8. A picture of the other format is converted (grey = BT.601 luma), one
/// of another size is skipped.
///
/// **Pairs of folders** are formed by time stamp, else by number, else by order: see pairing.hpp. Pairs of two
/// videos are formed by order; they must agree in size and rate.
///
/// **Capture time**
/// * folders with time stamps (EuRoC, KITTI with times.txt, names with unix time): the left picture's stamp, in
///   integer nanoseconds since the source's epoch, has_time = true, period = median of the differences;
/// * folders with numbers: (number - first number) / fps, so a gap in the numbers is time that passed;
/// * other folders: (ordinal - 1) / fps;
/// * videos: the container's stamp of the left picture, counted from its first one. Containers round their stamps,
///   so one within a tenth of a period of a multiple of 1 / (container's rate) is taken to be that multiple: a
///   constant rate gives exactly (ordinal - 1) / rate, a dropped frame leaves its gap, a variable rate stays one. A
///   missing stamp, or one not later than the one before, counts as one period later. has_time = true. A
///   container without a rate in (0, 1000] Hz: (ordinal - 1) / fps, has_time = false.
///
/// **Skew** of a pair, right stamp - left stamp: where each file has a stamp of its own (EuRoC, names with unix time).
/// times.txt of KITTI has one for both views, the stamps of two videos count from two beginnings: none.
///
/// **What cannot be read** - missing, truncated, corrupt, of another size, without a partner - is one kSkipped with a
/// line that names the file; it keeps its ordinal. A video that ends at least three frames before the end that its
/// container announces gives one kSkipped that says so.
///
/// Threads: folders decode the next pair ahead on a thread of their own, which touches nothing but that pair; the
/// result does not depend on it. Cost, 2 x 1280x720 colour JPEG: 11 ms a pair, hidden behind the caller's work
/// where a second core is free.
///
/// Throws std::runtime_error, one line with the path and the way out: a form or path that is not there, a folder
/// without pictures or with one view alone, an ambiguous folder, nothing readable, a video that cannot be opened,
/// contradicting options. `synthetic:NAME` and our own recordings are opened elsewhere.
///
/// OpenCV's and FFmpeg's own messages are silenced, for the whole process, unless OPENCV_LOG_LEVEL or
/// OPENCV_FFMPEG_LOGLEVEL is set in the environment.
[[nodiscard]] std::unique_ptr<FrameSource> open_replay(const std::string& source, const ReplayOptions& options);

}  // namespace stereotrack::capture
