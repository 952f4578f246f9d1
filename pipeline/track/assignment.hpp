#pragma once

#include <limits>
#include <span>

#include "pipeline/core/arena.hpp"
#include "pipeline/core/result.hpp"
#include "pipeline/core/stage.hpp"

namespace stereotrack {

/// Which detection belongs to which track, all at once: rows and columns are paired so that the sum of the
/// costs of the pairs is least, where leaving a row alone costs `alone`. Hungarian method with potentials
/// (Kuhn 1955; shortest augmenting paths as in Jonker and Volgenant 1987). Deterministic; O(rows^2 (rows + columns)).
/// Fixed memory; one thread.
class Assignment {
 public:
  static constexpr int kNone = -1;
  /// A pair that must not be.
  static constexpr double kForbidden = std::numeric_limits<double>::infinity();

  /// Faults: kBadConfig, kOutOfMemory.
  [[nodiscard]] static Result<Assignment> create(int max_rows, int max_columns, Arena& arena) noexcept;

  /// cost: rows x columns, row-major, >= 0, kForbidden where a pair must not be; rows, columns within create()'s
  /// limits. column_of_row (rows long) receives the column of each row, or kNone.
  void solve(std::span<const double> cost, int rows, int columns, double alone, std::span<int> column_of_row) noexcept;

 private:
  std::span<double> row_potential_;
  std::span<double> column_potential_;
  std::span<double> slack_;
  std::span<int> row_of_column_;
  std::span<int> way_;
  std::span<unsigned char> used_;
  int max_rows_ = 0;
  int max_columns_ = 0;
};
static_assert(RealTimeStage<Assignment, &Assignment::solve>);

}  // namespace stereotrack
