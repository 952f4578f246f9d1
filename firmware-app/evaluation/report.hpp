#pragma once

#include <iosfwd>

#include "firmware-app/evaluation/scores.hpp"

namespace stereotrack::evaluation {

/// Aligned columns for people: rates in percent, 3-D errors in the files' unit, in percent of z and
/// as a multiple of what a quarter of a pixel of disparity is worth, velocities in percent of the true speed,
/// "-" where there was nothing to measure.
void write_table(const Scores& scores, std::ostream& out);

/// One JSON object for programs, keys as the members of Scores: rates 0..1, counts as whole numbers,
/// null where there was nothing to measure. The same scores give the same bytes in any locale.
void write_json(const Scores& scores, std::ostream& out);

}  // namespace stereotrack::evaluation
