#include "tests/support/score/path_score.hpp"

#include <algorithm>
#include <stdexcept>

namespace stereotrack::score {

PathScore follow(const std::vector<evaluation::MotRow>& rows, const PathSpec& spec) {
  if (spec.last_frame < spec.first_frame) {
    throw std::runtime_error("frames " + std::to_string(spec.first_frame) + ":" + std::to_string(spec.last_frame) +
                             " is an empty range; the first comes first");
  }
  const auto inside = [&spec](const evaluation::MotRow& row) {
    return row.frame >= spec.first_frame && row.frame <= spec.last_frame;
  };
  PathScore score;
  score.frames = spec.last_frame - spec.first_frame + 1;
  for (const auto& row : rows) {
    if (inside(row)) ++score.rows_of_id[row.id];
  }
  if (spec.id) {
    score.id = *spec.id;
  } else if (!score.rows_of_id.empty()) {
    score.id = std::max_element(score.rows_of_id.begin(), score.rows_of_id.end(), [](const auto& a, const auto& b) {
                 return a.second < b.second;
               })->first;
  }
  for (const auto& row : rows) {
    if (!inside(row) || row.id != score.id) continue;
    ++score.rows;
    if (row.has_position) score.points.push_back({static_cast<double>(row.frame), row.position});
  }
  std::sort(score.points.begin(), score.points.end(),
            [](const PathPoint& a, const PathPoint& b) { return a.time < b.time; });
  return score;
}

}  // namespace stereotrack::score
