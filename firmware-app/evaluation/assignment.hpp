#pragma once

#include <Eigen/Core>
#include <vector>

namespace stereotrack::evaluation {

inline constexpr int kUnassigned = -1;

/// The rectangular linear assignment problem: pairs every row with a column of its own (or every
/// column with a row, if there are fewer columns) so that the sum of the pairs' scores is largest.
/// Answers the column of each row, kUnassigned for rows left over.
///
/// Shortest augmenting paths with potentials: Kuhn's Hungarian method as Jonker and Volgenant, "A
/// shortest augmenting path algorithm for dense and sparse linear assignment problems" (1987), run it.
/// O(n^2 m) for n <= m. Scores must be finite. Ties go to the lowest column that gives the optimum
/// path, the same in every run.
[[nodiscard]] std::vector<int> assign_best(const Eigen::MatrixXd& score);

}  // namespace stereotrack::evaluation
