#pragma once

namespace stereotrack::capture::v4l2::test {

/// As Settings::heap: memory of /dev/video1. See lent_memory.cpp.
inline constexpr const char* kLender = "/dev/zero";
extern int lent_buffers;  ///< so far

}  // namespace stereotrack::capture::v4l2::test
