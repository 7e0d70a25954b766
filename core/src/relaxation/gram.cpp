#include "relaxation/gram.h"

#include "tuning.h"

namespace marble {

ProximalSystem::ProximalSystem(const ScaledProblem& problem, std::unique_ptr<Kkt> kkt)
    : problem_(problem),
      kkt_(std::move(kkt)),
      weights_(problem),
      x_(problem.variables()),
      y_(problem.equalities()),
      rest_x_(problem.variables()),
      rest_y_(problem.equalities()),
      image_(problem.variables()) {
  weights_.rows.all.setZero();
}

bool ProximalSystem::factor(double rho, double delta) {
  weights_.rho = rho;
  weights_.delta = delta;
  return kkt_->factor(weights_);
}

bool ProximalSystem::solve(VectorRef x, VectorRef y) {
  x_.setZero();
  y_.setZero();
  for (int sweep = 0; sweep < tuning::tree_sweeps; ++sweep) {
    rest_x_ = x;
    rest_y_ = y;
    if (sweep > 0) {
      multiply(problem_.Q, x_, image_);
      rest_x_ -= image_ + weights_.delta * x_;
      add_transposed(problem_.A, -y_, rest_x_);
      multiply(problem_.A, x_, rest_y_);
      rest_y_ = y - rest_y_;
    }
    if (!kkt_->solve(rest_x_, rest_y_)) return false;
    x_ += rest_x_;
    y_ += rest_y_;
  }
  x = x_;
  y = y_;
  return true;
}

const double* Gram::find(Index row) {
  const std::lock_guard lock(mutex_);
  return columns_[row].get();
}

const double* Gram::fill(Index row, ProximalSystem& system) {
  const RowMatrix& rows = problem_.rows;
  Vector x = Vector::Zero(problem_.variables());
  Vector y = Vector::Zero(problem_.equalities());
  for (Index k = rows.row_pointers[row]; k < rows.row_pointers[row + 1]; ++k)
    x[rows.column_indices[k]] = rows.values[k];
  if (!system.solve(x, y)) return nullptr;
  std::unique_ptr<double[]> column(new double[static_cast<std::size_t>(rows.rows)]);
  multiply(rows, x, Eigen::Map<Vector>(column.get(), rows.rows));
  const std::lock_guard lock(mutex_);
  if (columns_[row] == nullptr) columns_[row] = std::move(column);
  return columns_[row].get();
}

}  // namespace marble
