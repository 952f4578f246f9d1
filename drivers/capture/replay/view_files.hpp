#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

namespace stereotrack::capture {

/// One picture file of one view, and what its name or a list beside it says about when it was taken.
struct ViewFile {
  std::filesystem::path path;
  std::optional<std::chrono::nanoseconds> time;  ///< since the source's epoch
  std::optional<std::uint64_t> number;           ///< last number in the name that is not the same in all names
};
using View = std::vector<ViewFile>;

/// png jpg jpeg bmp pgm ppm tif tiff, any case; not hidden.
[[nodiscard]] bool is_picture_name(const std::filesystem::path& path);

/// Unix time in a file name without its extension, integers only, because a double holds such a time to 240 ns:
///     1585434279_805531979     seconds _ nanoseconds
///     1305031102.175304        seconds . fraction
///     1403715273262142976      nanoseconds
/// Text before and after is allowed. Nothing if the name holds none.
[[nodiscard]] std::optional<std::chrono::nanoseconds> time_in_name(std::string_view stem);

/// "frame_2" before "frame_10", "frame_02" beside "frame_2": runs of digits compare as numbers.
[[nodiscard]] bool natural_less(std::string_view a, std::string_view b);

/// Sets `number` of every file. A number that is the same in all names (`0001_cam1`, `0002_cam1`) says nothing, so
/// the one before it counts; one of more than 18 digits is none.
void number_files(View& view);

/// The pictures of a folder in natural order, with time and number. Throws if the folder cannot be listed.
[[nodiscard]] View list_pictures(const std::filesystem::path& folder);

/// The pictures that a EuRoC camera folder lists in data.csv (`time [ns],name`), whether they exist or not; without
/// data.csv those in data/. Throws, naming the line, on a list that is empty or not of that form.
[[nodiscard]] View list_euroc_camera(const std::filesystem::path& camera);

/// KITTI's times.txt, line k (from 0) the time in seconds of picture number k; decimal or with exponent. Throws,
/// naming the line, on one that is no number or not later than the line before.
[[nodiscard]] std::vector<std::chrono::nanoseconds> read_kitti_times(const std::filesystem::path& file);

}  // namespace stereotrack::capture
