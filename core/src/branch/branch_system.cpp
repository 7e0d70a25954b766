#include "branch/branch_system.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kkt/blas.h"
#include "model/tuning.h"

namespace marble {
namespace {}  // namespace

template <class T>
BranchSystem<T>::BranchSystem(const ScaledProblem& problem, BranchPoint& point, BranchSystemMemory& memory)
    : problem_(problem), point_(point), memory_(memory) {
  const auto n = static_cast<std::size_t>(problem.variables());
  const auto n_e = static_cast<std::size_t>(problem.equalities());
  const auto rows = static_cast<std::size_t>(problem.layout.size());
  const std::size_t numbers = 4 * n + 3 * n_e + 2 * rows;
  if (memory.vectors.size() < numbers * kLanes) memory.vectors.resize(numbers * kLanes);
  T* next = reinterpret_cast<T*>(memory.vectors.data());
  for (T** part : {&right_z, &z, &step_z_, &pull_}) *part = next, next += n;
  for (T** part : {&right_y, &y, &step_y_}) *part = next, next += n_e;
  for (T** part : {&right_lambda, &lambda}) *part = next, next += rows;
}

template <class T>
void BranchSystem<T>::clear() {
  std::fill_n(right_z, problem_.variables(), T{});
  std::fill_n(right_y, problem_.equalities(), T{});
  std::fill_n(right_lambda, problem_.layout.size(), T{});
}

template <class T>
T BranchSystem<T>::largest() const {
  T most{};
  for (Index i = 0; i < problem_.variables(); ++i) most = larger(most, z[i]);
  for (Index i = 0; i < problem_.equalities(); ++i) most = larger(most, y[i]);
  for (Index i = 0; i < problem_.layout.size(); ++i) most = larger(most, lambda[i]);
  return most;
}

// Iterates with the regularized factor of [H Aᵀ; A −1/ρ], H = Q + δI + ρJ₀ᵀJ₀, until the residuals, which
// contain no regularization, are small. With dλ = ρ(J₀dz − r_λ) the remainder of r_λ is −dλ/ρ. It contributes
// −J₀ᵀdλ to the next right-hand side f = r_z + ρJ₀ᵀr_λ, and r_z needs the same term. Therefore each sweep
// reads each matrix only once.
template <class T>
std::array<bool, BranchSystem<T>::kLanes> BranchSystem<T>::solve(int count) {
  std::array<bool, kLanes> solved{}, over{};
  for (int i = count; i < kLanes; ++i) over[i] = true;
  std::array<double, kLanes> size{}, last{};
  last.fill(std::numeric_limits<double>::infinity());
  take_first_step();
  T error{};
  for (Index i = 0; i < problem_.variables(); ++i) error = larger(error, right_z[i]);
  for (Index i = 0; i < problem_.equalities(); ++i) error = larger(error, right_y[i]);
  for (Index i = 0; i < problem_.layout.size(); ++i) error = larger(error, right_lambda[i]);
  for (int i = 0; i < kLanes; ++i) size[i] = lane(error, i);
  for (int sweep = 0;; ++sweep) {
    int left = 0;
    std::array<bool, kLanes> ends{};
    for (int i = 0; i < kLanes; ++i) {
      if (over[i]) continue;
      const double now = lane(error, i);
      const bool is_exact = now <= tuning::rounding * size[i];
      ends[i] = is_exact || !(now <= tuning::exact_slowest * last[i]) || sweep == tuning::exact_sweeps;
      solved[i] = is_exact || (ends[i] && now <= tuning::near * size[i] && is_met_by_rows(i, size[i]));
      last[i] = now;
      if (!ends[i]) ++left;
    }
    if (left == 0) break;
    for (int i = 0; i < kLanes; ++i) {
      if (ends[i]) drop(i);
      over[i] = over[i] || ends[i];
    }
    point_.count_back_substitutions(left);
    if (!point_.kkt().solve_many(reinterpret_cast<double*>(step_z_), reinterpret_cast<double*>(step_y_),
                                 kLanes))
      return {};
    error = advance();
  }
  T sum{};  // stays non-finite if any term is
  for (Index i = 0; i < problem_.variables(); ++i) sum += z[i];
  for (Index i = 0; i < problem_.equalities(); ++i) sum += y[i];
  for (int i = 0; i < kLanes; ++i) solved[i] = solved[i] && std::isfinite(lane(sum, i));
  return solved;
}

// A row that keeps most of its own right-hand side contradicts others, even if that is small beside theirs.
template <class T>
bool BranchSystem<T>::is_met_by_rows(int i, double size) const {
  const auto is_met = [&](const RowMatrix& rows, Index row, const T& residual) {
    const double error = std::abs(lane(residual, i));
    if (error <= tuning::rounding * size) return true;
    double terms = 0.0;
    for (Index k = rows.row_pointers[row]; k < rows.row_pointers[row + 1]; ++k)
      terms += std::abs(rows.values[k] * lane(z[rows.column_indices[k]], i));
    return error <= tuning::first_digit * terms;
  };
  for (Index row = 0; row < problem_.equalities(); ++row)
    if (!is_met(problem_.A, row, right_y[row])) return false;
  for (Index row = 0; row < problem_.layout.size(); ++row)
    if (point_.set.held[row] != 0 && !is_met(problem_.rows, row, right_lambda[row])) return false;
  return true;
}

// Sets the right-hand side of the first step, and the solution to 0.
template <class T>
void BranchSystem<T>::take_first_step() {
  std::fill_n(z, problem_.variables(), T{});
  std::fill_n(y, problem_.equalities(), T{});
  std::fill_n(lambda, problem_.layout.size(), T{});
  std::copy_n(right_z, problem_.variables(), step_z_);
  std::copy_n(right_y, problem_.equalities(), step_y_);
  for (Index row = 0; row < problem_.layout.size(); ++row) {
    if (point_.set.held[row] == 0) {
      right_lambda[row] = T{};
    } else if (!is_zero(right_lambda[row])) {
      add_row(problem_.rows, row, point_.rho() * right_lambda[row], step_z_);
    }
  }
}

// Applies the step and prepares the next right-hand side. Returns the largest entry of the remaining
// residual.
template <class T>
T BranchSystem<T>::advance() {
  may_take_by_blas() ? take_by_blas() : take_by_rows();
  T error{};
  for (Index row = 0; row < problem_.layout.size(); ++row) {
    if (point_.set.held[row] != 0) error = larger(error, right_lambda[row]);
  }
  for (Index row = 0; row < problem_.equalities(); ++row) {
    error = larger(error, right_y[row]);
    step_y_[row] = right_y[row];
  }
  for (Index i = 0; i < problem_.variables(); ++i) {
    z[i] += step_z_[i];
    right_z[i] -= pull_[i];
    error = larger(error, right_z[i]);
    step_z_[i] = right_z[i] - pull_[i];
  }
  return error;
}

// Subtracts K's product with the step from the residual, and writes J₀ᵀdλ into pull_.
template <class T>
void BranchSystem<T>::take_by_rows() {
  const Index n = problem_.variables();
  const SymmetricMatrix& Q = problem_.Q;
  std::fill_n(pull_, n, T{});
  for (Index row = 0; row < problem_.layout.size(); ++row) {
    if (point_.set.held[row] == 0) continue;
    right_lambda[row] -= row_product(problem_.rows, row, step_z_);
    const T change = -point_.rho() * right_lambda[row];
    lambda[row] += change;
    add_row(problem_.rows, row, change, pull_);
  }
  for (Index row = 0; row < problem_.equalities(); ++row) {
    const T change = step_y_[row];
    y[row] += change;
    add_row(problem_.A, row, -change, right_z);
    right_y[row] -= row_product(problem_.A, row, step_z_);
  }
  for (Index column = 0; column < n; ++column) {
    T sum{};
    const T change = step_z_[column];
    for (Index k = Q.column_pointers[column]; k < Q.column_pointers[column + 1]; ++k) {
      const Index row = Q.row_indices[k];
      sum += Q.values[k] * step_z_[row];
      if (row != column) right_z[row] -= Q.values[k] * change;
    }
    right_z[column] -= sum;
  }
}

template <class T>
bool BranchSystem<T>::may_take_by_blas() {
  if (kLanes < 4) return false;
  if (memory_.hessian.size() > 0) return true;
  const Index n = problem_.variables(), equalities = problem_.equalities(), rows = problem_.layout.size();
  const auto entries =
      static_cast<double>(problem_.Q.values.size() + problem_.A.values.size() + problem_.rows.values.size());
  if (entries <= tuning::nearly_full * n * (0.5 * n + equalities + rows)) return false;
  const auto held =
      std::count_if(point_.set.held.begin(), point_.set.held.end(), [](auto h) { return h != 0; });
  memory_.hessian.setZero(n, n);
  memory_.rows.setZero(equalities + held, n);
  memory_.of_rows.resize(8, equalities + held);
  for (Index j = 0; j < n; ++j) {
    for (Index k = problem_.Q.column_pointers[j]; k < problem_.Q.column_pointers[j + 1]; ++k) {
      const Index i = problem_.Q.row_indices[k];
      memory_.hessian(i, j) = memory_.hessian(j, i) = problem_.Q.values[k];
    }
  }
  Index next = 0;
  const auto copy = [&](const RowMatrix& m, Index row) {
    for (Index k = m.row_pointers[row]; k < m.row_pointers[row + 1]; ++k)
      memory_.rows(next, m.column_indices[k]) = m.values[k];
    ++next;
  };
  for (Index row = 0; row < equalities; ++row) copy(problem_.A, row);
  for (Index row = 0; row < rows; ++row) {
    if (point_.set.held[row] != 0) copy(problem_.rows, row);
  }
  return true;
}

// Does the same on the transpose: the numbers of a variable or a row form a column.
template <class T>
void BranchSystem<T>::take_by_blas() {
  const int n = problem_.variables(), equalities = problem_.equalities(), lanes = kLanes;
  const auto all = static_cast<int>(memory_.rows.rows()), held = all - equalities;
  const double one = 1.0, minus = -1.0, nothing = 0.0;
  const double* const rows = memory_.rows.data();
  T* const of_rows = reinterpret_cast<T*>(memory_.of_rows.data());
  double* const numbers = memory_.of_rows.data();
  double* const to = reinterpret_cast<double*>(right_z);
  double* const pull = reinterpret_cast<double*>(pull_);
  const double* const step = reinterpret_cast<double*>(step_z_);
  std::fill_n(pull_, n, T{});
  dgemm_("N", "N", &lanes, &n, &n, &minus, step, &lanes, memory_.hessian.data(), &n, &one, to, &lanes);
  if (all == 0) return;
  dgemm_("N", "T", &lanes, &all, &n, &one, step, &lanes, rows, &all, &nothing, numbers, &lanes);
  for (Index row = 0; row < equalities; ++row) {
    right_y[row] -= of_rows[row];
    y[row] += of_rows[row] = step_y_[row];
  }
  T* next = of_rows + equalities;
  for (Index row = 0; row < problem_.layout.size(); ++row) {
    if (point_.set.held[row] == 0) continue;
    right_lambda[row] -= *next;
    *next = -point_.rho() * right_lambda[row];
    lambda[row] += *next++;
  }
  if (equalities > 0)
    dgemm_("N", "N", &lanes, &n, &equalities, &minus, numbers, &lanes, rows, &all, &one, to, &lanes);
  if (held > 0)
    dgemm_("N", "N", &lanes, &n, &held, &one, numbers + static_cast<std::ptrdiff_t>(equalities) * lanes,
           &lanes, rows + equalities, &all, &one, pull, &lanes);
}

// Replaces that lane by a system with right-hand side 0.
template <class T>
void BranchSystem<T>::drop(int dropped_lane) {
  const auto drop_from = [dropped_lane](T* values, Index count) {
    for (Index i = 0; i < count; ++i) set_lane(values[i], dropped_lane, 0.0);
  };
  drop_from(right_z, problem_.variables()), drop_from(step_z_, problem_.variables());
  drop_from(right_y, problem_.equalities()), drop_from(step_y_, problem_.equalities());
  drop_from(right_lambda, problem_.layout.size());
}

template class BranchSystem<double>;
template class BranchSystem<Lanes<2>>;
template class BranchSystem<Lanes<4>>;
template class BranchSystem<Lanes<8>>;

}  // namespace marble
