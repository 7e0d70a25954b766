#include "global/gram.h"

#include <algorithm>

#include "model/tuning.h"

namespace marble {

ProximalSystem::ProximalSystem(const ScaledProblem& problem, Kkt& kkt)
    : problem_(problem),
      kkt_(kkt),
      weights_(problem),
      x_(problem.variables()),
      y_(problem.equalities()),
      rest_x_(problem.variables()),
      rest_y_(problem.equalities()),
      image_(problem.variables()),
      right_x_(problem.variables()),
      right_y_(problem.equalities()) {}

bool ProximalSystem::factor(double rho, double delta) {
  weights_.rho = rho;
  weights_.delta = delta;
  return kkt_.factor(weights_);
}

bool ProximalSystem::solve(VectorRef x, VectorRef y) {
  x_.setZero();
  y_.setZero();
  for (int sweep = 0; sweep < tuning::few_passes; ++sweep) {
    rest_x_ = x;
    rest_y_ = y;
    if (sweep > 0) {
      multiply(problem_.Q, x_, image_);
      rest_x_ -= image_ + weights_.delta * x_;
      add_transposed(problem_.A, -y_, rest_x_);
      multiply(problem_.A, x_, rest_y_);
      rest_y_ = y - rest_y_;
    }
    if (!kkt_.solve_once(rest_x_, rest_y_)) return false;
    x_ += rest_x_;
    y_ += rest_y_;
    // Each sweep removes about as large a part of the error as the last one: after this, the next correction
    // would be rounding.
    if (sweep > 0 && max_abs(rest_x_) <= tuning::exactness * max_abs(x_) &&
        max_abs(rest_y_) <= tuning::exactness * max_abs(y_))
      break;
  }
  x = x_;
  y = y_;
  return true;
}

bool ProximalSystem::minimize(ConstVectorRef multipliers, Vector& z, Vector& y) {
  multiply(problem_.Q, z, right_x_);
  right_x_ += problem_.g;
  add_transposed(problem_.A, y, right_x_);
  add_transposed(problem_.rows, -multipliers, right_x_);
  right_x_ = -right_x_;
  multiply(problem_.A, z, right_y_);
  right_y_ = -right_y_ - problem_.b;
  if (!solve(right_x_, right_y_)) return false;
  z += right_x_;
  y += right_y_;
  return true;
}

double Gram::bytes() {
  const std::lock_guard lock(mutex_);
  const auto filled = std::ranges::count_if(columns_, [](const auto& column) { return column != nullptr; });
  return static_cast<double>(filled) * problem_.layout.size() * sizeof(double);
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
