#include "pipeline/track/assignment.hpp"

#include <algorithm>

namespace stereotrack {

Result<Assignment> Assignment::create(int max_rows, int max_columns, Arena& arena) noexcept {
  if (max_rows < 1 || max_columns < 1) return fail(Fault::kBadConfig);
  Assignment self;
  self.max_rows_ = max_rows;
  self.max_columns_ = max_columns;
  // Each row gets a column of its own in which it stays alone; index 0 is the search's start.
  const auto rows = static_cast<std::size_t>(max_rows) + 1;
  const auto columns = static_cast<std::size_t>(max_columns) + rows;
  self.row_potential_ = arena.array<double>(rows);
  self.column_potential_ = arena.array<double>(columns);
  self.slack_ = arena.array<double>(columns);
  self.row_of_column_ = arena.array<int>(columns);
  self.way_ = arena.array<int>(columns);
  self.used_ = arena.array<unsigned char>(columns);
  if (arena.failed()) return fail(Fault::kOutOfMemory);
  return self;
}

void Assignment::solve(std::span<const double> cost, int rows, int columns, double alone,
                       std::span<int> column_of_row) noexcept {
  const int all = columns + rows;
  // Far above any real sum, and finite: infinity minus infinity has no value.
  constexpr double kHuge = 1e12;
  const auto cost_of = [&](int row, int column) {
    if (column > columns) return column - columns == row ? alone : kHuge;
    const double value = cost[static_cast<std::size_t>((row - 1) * columns + (column - 1))];
    return value < kHuge ? value : kHuge;
  };
  const auto at = [](auto span, int i) -> auto& { return span[static_cast<std::size_t>(i)]; };
  std::fill_n(row_potential_.begin(), rows + 1, 0.0);
  std::fill_n(column_potential_.begin(), all + 1, 0.0);
  std::fill_n(row_of_column_.begin(), all + 1, 0);
  for (int row = 1; row <= rows; ++row) {
    at(row_of_column_, 0) = row;
    int column = 0;
    std::fill_n(slack_.begin(), all + 1, std::numeric_limits<double>::max());
    std::fill_n(used_.begin(), all + 1, static_cast<unsigned char>(0));
    do {
      at(used_, column) = 1;
      const int owner = at(row_of_column_, column);
      double step = std::numeric_limits<double>::max();
      int next = 0;
      for (int j = 1; j <= all; ++j) {
        if (at(used_, j) != 0) continue;
        const double reduced = cost_of(owner, j) - at(row_potential_, owner) - at(column_potential_, j);
        if (reduced < at(slack_, j)) {
          at(slack_, j) = reduced;
          at(way_, j) = column;
        }
        if (at(slack_, j) < step) {
          step = at(slack_, j);
          next = j;
        }
      }
      for (int j = 0; j <= all; ++j) {
        if (at(used_, j) != 0) {
          at(row_potential_, at(row_of_column_, j)) += step;
          at(column_potential_, j) -= step;
        } else {
          at(slack_, j) -= step;
        }
      }
      column = next;
    } while (at(row_of_column_, column) != 0);
    do {
      const int previous = at(way_, column);
      at(row_of_column_, column) = at(row_of_column_, previous);
      column = previous;
    } while (column != 0);
  }
  std::fill_n(column_of_row.begin(), rows, kNone);
  for (int column = 1; column <= columns; ++column) {
    const int row = at(row_of_column_, column);
    if (row != 0 && cost_of(row, column) < kHuge) at(column_of_row, row - 1) = column - 1;
  }
}

}  // namespace stereotrack
