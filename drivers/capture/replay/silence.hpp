#pragma once

namespace stereotrack::capture {

/// OpenCV and FFmpeg print nothing of their own from now on, in the whole process: errors are told by us, once, and not
/// by libraries in the middle of a line. What OPENCV_LOG_LEVEL and OPENCV_FFMPEG_LOGLEVEL say in the environment stays.
/// Before the first video is opened, while no other thread reads the environment.
void silence_codecs();

}  // namespace stereotrack::capture
