#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <tl/expected.hpp>

namespace stereotrack::capture {

/// Nothing if `bytes` is a whole file as far as its container tells, else what is wrong with it ("truncated: ...").
/// Decoders fill the rest of a truncated JPEG with grey and only print a warning, so it is looked at before:
///     JPEG  the chain of segments and scans leads to the end marker FFD9 (what follows it is not looked at)
///     PNG   every chunk's CRC-32 is right, and the last one is IEND
///     BMP, PGM, PPM  the file holds as many bytes as its header says (binary forms)
/// TIFF and text forms of PGM and PPM are left to their decoder. What begins like none of these is no picture: OpenCV
/// would hand it to GDAL, which opens all sorts of things. O(bytes).
[[nodiscard]] std::string damage(std::span<const std::uint8_t> bytes);

/// The decoded picture, CV_8UC1 or CV_8UC3 (BGR): alpha dropped, high byte of 16 bits, EXIF rotation not applied;
/// or one line that names the file and what is wrong; over 1 GiB none is read. May be called by several threads at
/// once.
[[nodiscard]] tl::expected<cv::Mat, std::string> read_picture(const std::filesystem::path& path);

}  // namespace stereotrack::capture
