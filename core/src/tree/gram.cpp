#include "tree/gram.h"

namespace marble {

const double* Gram::find(Index row) {
  const std::lock_guard lock(mutex_);
  return columns_[row].get();
}

const double* Gram::fill(Index row, Kkt& kkt) {
  const RowMatrix& rows = problem_.rows;
  Vector x = Vector::Zero(problem_.variables());
  Vector y = Vector::Zero(problem_.equalities());
  for (Index k = rows.row_pointers[row]; k < rows.row_pointers[row + 1]; ++k)
    x[rows.column_indices[k]] = rows.values[k];
  if (!kkt.solve(x, y)) return nullptr;
  std::unique_ptr<double[]> column(new double[static_cast<std::size_t>(rows.rows)]);
  multiply(rows, x, Eigen::Map<Vector>(column.get(), rows.rows));
  const std::lock_guard lock(mutex_);
  if (columns_[row] == nullptr) columns_[row] = std::move(column);
  return columns_[row].get();
}

}  // namespace marble
