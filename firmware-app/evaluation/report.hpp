#pragma once

#include <iosfwd>

#include "firmware-app/evaluation/scores.hpp"

namespace stereotrack::evaluation {

/// Aligned columns for people: rates in percent, 3-D errors in the files' unit and in percent of z,
/// "-" where there was nothing to measure.
void write_table(const Scores& scores, std::ostream& out);

/// One JSON object for programs, keys as the members of Scores: rates 0..1, counts as whole numbers,
/// null where there was nothing to measure. The same scores give the same bytes in any locale.
void write_json(const Scores& scores, std::ostream& out);

}  // namespace stereotrack::evaluation
