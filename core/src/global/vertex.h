// Reduces the multipliers of a contradiction to those of a vertex, which has as few rows as possible.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "model/linear_algebra.h"

namespace marble {

struct HeldRow;

/// All multipliers of a contradiction, Σ m row = 0 and Σ m offset = 1 with m ≤ 0 for inequalities, form a
/// polyhedron. Starting from a point of it, rows are removed along their linear dependencies, until the rest
/// is linearly independent together with its offsets.
class VertexTableau {
 public:
  /// Both arguments must outlive this object.
  VertexTableau(const RowMatrix& rows, const Vector& offset) : rows_(rows), offset_(offset) {}

  /// Returns the remaining rows, ascending. Empty if the tableau would have more than
  /// tuning::conflict_entries numbers.
  [[nodiscard]] std::vector<std::size_t> support(std::span<const HeldRow> held,
                                                 std::span<const double> multipliers);

 private:
  [[nodiscard]] bool fill(std::span<const HeldRow> held, std::span<const double> multipliers);
  void enter(Eigen::Index column, std::span<const HeldRow> held);
  void pivot(Eigen::Index line, Eigen::Index column);

  const RowMatrix& rows_;
  const Vector& offset_;
  std::vector<std::size_t> places_;  // index of a column's row among the rows held
  // A line for each variable and one for the offset; a column for each row.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> tableau_;
  Vector multiplier_;                // by column, for rows of norm 1
  std::vector<Eigen::Index> basis_;  // by line: its column; −1 if none
};

}  // namespace marble
