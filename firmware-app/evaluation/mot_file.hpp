#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

namespace stereotrack::evaluation {

/// A box with its sides where they are, not on whole pixels: MOT files have fractions.
struct Box {
  double left = 0;  ///< [px]
  double top = 0;
  double width = 0;  ///< >= 0
  double height = 0;
};

/// Intersection over union, 0..1; 0 where a box has no area.
[[nodiscard]] double overlap(const Box& a, const Box& b) noexcept;

/// One line of a MOT file: where one object (or one track) was in one frame.
struct MotRow {
  std::int64_t frame = 0;  ///< from 1
  std::int64_t id = 0;     ///< >= 0, at most once a frame
  Box box;
  double confidence = 0;                               ///< ground truth: 0 = not scored
  bool has_position = false;                           ///< false: the columns are missing or -1 -1 -1
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< [unit of the file's author]
};

/// Ground truth and tracker output have the same rows but different roles: two types, so that they
/// cannot be exchanged in a call.
struct Truth {
  std::vector<MotRow> rows;
};
struct Tracks {
  std::vector<MotRow> rows;
};

/// Reads MOTChallenge columns `frame,id,left,top,width,height,confidence,x,y,z`. The last three may be
/// absent (7 to 10 columns; x y z count only when all three are there). Blank lines, spaces around
/// numbers, CR LF and a first line with the column names are accepted; no row at all is a valid file.
/// Throws std::runtime_error, one line `FILE:LINE: what is wrong`: another number of columns, a field
/// that is no finite number, a frame under 1, a fractional or negative id, a negative size, an id that
/// a frame holds twice; `FILE: ...` if it cannot be read.
[[nodiscard]] std::vector<MotRow> read_mot(const std::filesystem::path& file);

/// The same from a stream; `name` stands in the messages.
[[nodiscard]] std::vector<MotRow> read_mot(std::istream& in, const std::string& name);

}  // namespace stereotrack::evaluation
