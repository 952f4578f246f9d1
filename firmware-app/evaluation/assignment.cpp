#include "firmware-app/evaluation/assignment.hpp"

#include <limits>
#include <utility>

namespace stereotrack::evaluation {

std::vector<int> assign_best(const Eigen::MatrixXd& score) {
  if (score.rows() > score.cols()) {
    const std::vector<int> row_of_column = assign_best(score.transpose());
    std::vector<int> column_of_row(static_cast<std::size_t>(score.rows()), kUnassigned);
    for (std::size_t column = 0; column < row_of_column.size(); ++column) {
      column_of_row[static_cast<std::size_t>(row_of_column[column])] = static_cast<int>(column);
    }
    return column_of_row;
  }

  // Costs are -score. Row and column `none` are virtual: each path starts at the virtual column, which
  // holds the row to be placed, and ends at a column that holds no row.
  const auto rows = static_cast<int>(score.rows());
  const auto columns = static_cast<int>(score.cols());
  const int virtual_column = columns;
  const auto slots = static_cast<std::size_t>(columns) + 1;
  std::vector<double> row_potential(static_cast<std::size_t>(rows), 0.0);
  std::vector<double> column_potential(slots, 0.0);
  std::vector<int> row_at(slots, kUnassigned);

  for (int new_row = 0; new_row < rows; ++new_row) {
    std::vector<double> distance(slots, std::numeric_limits<double>::infinity());
    std::vector<int> previous(slots, virtual_column);
    std::vector<char> reached(slots, 0);
    row_at[virtual_column] = new_row;
    int column = virtual_column;
    while (row_at[column] != kUnassigned) {
      reached[column] = 1;
      const int row = row_at[column];
      int nearest = kUnassigned;
      for (int other = 0; other < columns; ++other) {
        if (reached[other] != 0) continue;
        const double reduced = -score(row, other) - row_potential[row] - column_potential[other];
        if (reduced < distance[other]) {
          distance[other] = reduced;
          previous[other] = column;
        }
        if (nearest == kUnassigned || distance[other] < distance[nearest]) nearest = other;
      }
      const double step = distance[nearest];
      for (int other = 0; other <= columns; ++other) {
        if (reached[other] != 0) {
          row_potential[row_at[other]] += step;
          column_potential[other] -= step;
        } else {
          distance[other] -= step;
        }
      }
      column = nearest;
    }
    while (column != virtual_column) {
      row_at[column] = row_at[previous[column]];
      column = previous[column];
    }
  }

  std::vector<int> column_of_row(static_cast<std::size_t>(rows), kUnassigned);
  for (int column = 0; column < columns; ++column) {
    if (row_at[column] != kUnassigned) column_of_row[row_at[column]] = column;
  }
  return column_of_row;
}

}  // namespace stereotrack::evaluation
