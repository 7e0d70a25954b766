// From any multipliers of a contradiction to those of a vertex: as few rows as there are at all.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "data/linear_algebra.h"

namespace marble {

struct HeldRow;

/// All multipliers of a contradiction, Σ m row = 0 and Σ m offset = 1 with m ≤ 0 of inequalities, are a
/// polyhedron. From a point of it rows are taken away along dependencies between them, until those left are
/// linearly independent together with their offsets.
class VertexTableau {
 public:
  /// Both must outlive it.
  VertexTableau(const RowMatrix& rows, const Vector& offset) : rows_(rows), offset_(offset) {}

  /// Which of the rows are left, ascending. Empty where the tableau would have more than
  /// tuning::conflict_entries numbers.
  [[nodiscard]] std::vector<std::size_t> support(std::span<const HeldRow> held,
                                                 std::span<const double> multipliers);

 private:
  [[nodiscard]] bool fill(std::span<const HeldRow> held, std::span<const double> multipliers);
  void enter(Eigen::Index column, std::span<const HeldRow> held);
  void pivot(Eigen::Index line, Eigen::Index column);

  const RowMatrix& rows_;
  const Vector& offset_;
  std::vector<std::size_t> places_;  // of a column, among the rows held
  // A line for each variable and one for the offset; a column for each row.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> tableau_;
  Vector multiplier_;                // of a column, of rows of norm 1
  std::vector<Eigen::Index> basis_;  // of a line: its column; −1 if none
};

}  // namespace marble
