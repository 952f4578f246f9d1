#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "firmware-app/evaluation/mot_file.hpp"
#include "tests/support/score/path_fit.hpp"

namespace stereotrack::score {

/// What is asked of a recording in which one object moves and nobody wrote ground truth.
struct PathSpec {
  std::int64_t first_frame = 1;    ///< inclusive
  std::int64_t last_frame = 1;     ///< inclusive
  std::optional<std::int64_t> id;  ///< none: the track with most rows in the range, the lowest id of equals
};

struct PathScore {
  std::int64_t frames = 0;                         ///< in the range
  std::map<std::int64_t, std::size_t> rows_of_id;  ///< every track with a row in the range
  std::int64_t id = 0;                             ///< the track looked at
  std::size_t rows = 0;                            ///< its rows in the range; 0: no such track
  std::vector<PathPoint> points;                   ///< those with x y z; time = frame number
  [[nodiscard]] double coverage() const { return static_cast<double>(rows) / static_cast<double>(frames); }
};

/// Throws std::runtime_error if the range is empty.
[[nodiscard]] PathScore follow(const std::vector<evaluation::MotRow>& rows, const PathSpec& spec);

}  // namespace stereotrack::score
