#include "kkt/dense_kkt.h"

#include <algorithm>
#include <cmath>

#include "kkt/blas.h"
#include "model/tuning.h"

namespace marble {
namespace {

// C += factor · WᵀW, upper triangle, for W with k rows and n columns, split into several calls if necessary.
bool add_product(double factor, const double* w, int w_stride, int k, double* c, int c_stride, int n,
                 const Interrupt& interrupt) {
  const double one = 1.0;
  const double flops = static_cast<double>(n) * n * k;
  if (flops <= tuning::flops_of_call) {
    dsyrk_("U", "T", &n, &k, &factor, w, &w_stride, &one, c, &c_stride);
    return true;
  }
  const int width = std::min(n, tuning::block_columns);
  const int depth = std::min(k, std::max(1, static_cast<int>(0.5 * tuning::flops_of_call / n / width)));
  for (int row = 0; row < k; row += depth) {
    const int rows = std::min(depth, k - row);
    for (int column = 0; column < n; column += width) {
      if (interrupt.requested()) return false;
      const int columns = std::min(width, n - column);
      const double* const panel = w + row + static_cast<std::ptrdiff_t>(column) * w_stride;
      double* const out = c + static_cast<std::ptrdiff_t>(column) * c_stride;
      if (column > 0)
        dgemm_("T", "N", &column, &columns, &rows, &factor, w + row, &w_stride, panel, &w_stride, &one, out,
               &c_stride);
      dsyrk_("U", "T", &columns, &rows, &factor, panel, &w_stride, &one, out + column, &c_stride);
    }
  }
  return true;
}

// dpotrf, split into panels if one call would take too long.
bool factorize_cholesky(double* a, int n, const Interrupt& interrupt) {
  const double cube = static_cast<double>(n) * n * n;
  const int width = cube / 3.0 <= tuning::flops_of_call ? n : tuning::block_columns;
  const double one = 1.0;
  for (int column = 0; column < n; column += width) {
    if (column > 0 && interrupt.requested()) return false;
    const int columns = std::min(width, n - column);
    const int rest = n - column - columns;
    double* const corner = a + column + static_cast<std::ptrdiff_t>(column) * n;
    int info = 0;
    dpotrf_("U", &columns, corner, &n, &info);
    // OpenBLAS accepts a NaN as a pivot; it then spreads to the last pivot.
    if (info != 0 || !(corner[columns - 1 + static_cast<std::ptrdiff_t>(columns - 1) * n] > 0.0))
      return false;
    if (rest == 0) break;
    double* const panel = corner + static_cast<std::ptrdiff_t>(columns) * n;
    dtrsm_("L", "U", "T", "N", &columns, &rest, &one, corner, &n, panel, &n);
    if (!add_product(-1.0, panel, n, columns, panel + columns, n, rest, interrupt)) return false;
  }
  return true;
}

// x ← (UᵀU)⁻¹ x. Does not use dpotrs, whose blocks of right-hand sides double the time of a single one, and
// does not call BLAS for a factor that takes less time than the call.
void solve_triangles(const Eigen::MatrixXd& factor, VectorRef x) {
  const auto n = static_cast<int>(factor.rows());
  if (n <= tuning::tiny) {
    const auto upper = factor.triangularView<Eigen::Upper>();
    upper.transpose().solveInPlace(x);
    upper.solveInPlace(x);
    return;
  }
  const int one = 1;
  dtrsv_("U", "T", "N", &n, factor.data(), &n, x.data(), &one);
  dtrsv_("U", "N", "N", &n, factor.data(), &n, x.data(), &one);
}

// y ← y − S x, with S given by its upper triangle.
void subtract_product(const Eigen::MatrixXd& s, ConstVectorRef x, VectorRef y) {
  const auto n = static_cast<int>(s.rows());
  if (n <= tuning::tiny) {
    y.noalias() -= s.selfadjointView<Eigen::Upper>() * x;
    return;
  }
  const int one = 1;
  const double minus = -1.0;
  const double plus = 1.0;
  dsymv_("U", &n, &minus, s.data(), &n, x.data(), &one, &plus, y.data(), &one);
}

// Copies large matrices by columns, so that the copy can be interrupted: it touches their memory first.
template <class From>
bool fill(Eigen::MatrixXd& to, const From& from, const Interrupt& interrupt) {
  if (to.size() <= tuning::entries_between_looks) {
    to = from;
    return true;
  }
  Checkpoint checkpoint(interrupt);
  for (Eigen::Index column = 0; column < to.cols(); ++column) {
    to.col(column) = from.col(column);
    if (checkpoint.reached(to.rows())) return false;
  }
  return true;
}

}  // namespace

double DenseKkt::estimated_flops(const ScaledProblem& p) {
  const double n = p.variables();
  const double rows = static_cast<double>(p.equalities()) + p.inequalities() + 2.0 * p.pairs();
  return (n * n * (rows + n / 3.0) + 20.0 * n * n) / tuning::dense_advantage;
}

DenseKkt::DenseKkt(const ScaledProblem& problem)
    : variables_(problem.variables()),
      equalities_(problem.equalities()),
      inequalities_(problem.inequalities()),
      pairs_(problem.pairs()),
      flops_(estimated_flops(problem)),
      hessian_(variables_, variables_),
      rows_(equalities_ + inequalities_ + 2 * pairs_, variables_),
      weighted_(rows_.rows(), variables_),
      system_(variables_, variables_),
      factor_(variables_, variables_),
      s_single_(static_cast<std::size_t>(pairs_)),
      t_single_(static_cast<std::size_t>(pairs_)),
      residual_(variables_) {
  keep_blas_to_one_thread();
  terms_.reserve(static_cast<std::size_t>(rows_.rows()));
}

bool DenseKkt::allocate(const ScaledProblem& problem) {
  if (!fill(hessian_, Matrix::Zero(hessian_.rows(), hessian_.cols()), interrupt()) ||
      !fill(rows_, Matrix::Zero(rows_.rows(), rows_.cols()), interrupt()))
    return false;
  load(problem);
  return true;
}

void DenseKkt::load(const ScaledProblem& problem) {
  for (Index column = 0; column < variables_; ++column) {
    for (Index k = problem.Q.column_pointers[column]; k < problem.Q.column_pointers[column + 1]; ++k) {
      hessian_(problem.Q.row_indices[k], column) = problem.Q.values[k];
    }
  }
  Index offset = 0;
  for (const RowMatrix* matrix : {&problem.A, &problem.rows}) {
    for (Index row = 0; row < matrix->rows; ++row) {
      for (Index k = matrix->row_pointers[row]; k < matrix->row_pointers[row + 1]; ++k) {
        rows_(offset + row, matrix->column_indices[k]) = matrix->values[k];
      }
    }
    offset += matrix->rows;
  }
  const auto find_singles = [&matrix = problem.rows](Index first, std::vector<Single>& singles) {
    for (std::size_t i = 0; i < singles.size(); ++i) {
      const Index row = first + static_cast<Index>(i);
      const auto entry = static_cast<std::size_t>(matrix.row_pointers[row]);
      singles[i] =
          matrix.row_size(row) == 1 ? Single{matrix.column_indices[entry], matrix.values[entry]} : Single{};
    }
  };
  find_singles(problem.layout.s(0), s_single_);
  find_singles(problem.layout.t(0), t_single_);
}

// Adds the products of e = a·e_j with itself and with the row `other`: w_ee e eᵀ + w_eo (e oᵀ + o eᵀ).
void DenseKkt::add_single(const Single& single, Index other, double single_single, double single_other) {
  const Index j = single.column;
  system_(j, j) += single_single * single.value * single.value;
  if (single_other == 0.0) return;
  const double factor = single_other * single.value;
  for (Index k = 0; k < j; ++k) system_(k, j) += factor * rows_(other, k);
  system_(j, j) += 2.0 * factor * rows_(other, j);
  for (Index k = j + 1; k < variables_; ++k) system_(j, k) += factor * rows_(other, k);
}

bool DenseKkt::add_terms(double sign) {
  if (terms_.empty()) return true;
  Checkpoint checkpoint(interrupt());
  for (Index column = 0; column < variables_; ++column) {
    const double* source = rows_.col(column).data();
    double* target = weighted_.col(column).data();
    for (std::size_t k = 0; k < terms_.size(); ++k)
      target[k] = terms_[k].s_factor * source[terms_[k].s] + terms_[k].t_factor * source[terms_[k].t];
    if (checkpoint.reached(static_cast<std::int64_t>(terms_.size()))) return false;
  }
  return add_product(sign, weighted_.data(), static_cast<int>(weighted_.rows()),
                     static_cast<int>(terms_.size()), system_.data(), variables_, variables_, interrupt());
}

bool DenseKkt::factorize(const RowWeights& weights) {
  rho_ = weights.rho;
  if (!fill(system_, hessian_, interrupt())) return false;
  system_.diagonal().array() += weights.delta;
  const Index first_s = equalities_ + inequalities_;
  const Index first_t = first_s + pairs_;
  const auto single_pair = [this](Index i) {
    return s_single_[static_cast<std::size_t>(i)].column >= 0 ||
           t_single_[static_cast<std::size_t>(i)].column >= 0;
  };
  const auto weight_of = [&weights](Index i, double a, double b, double a2, double b2) {
    return weights.rows.s()[i] * a * a2 + weights.rows.t()[i] * b * b2;
  };
  for (Index i = 0; i < pairs_; ++i) {
    const double cosine = weights.cosine[i];
    const double sine = weights.sine[i];
    const double mixed = weight_of(i, cosine, sine, sine, -cosine);
    if (const Single& single = s_single_[static_cast<std::size_t>(i)]; single.column >= 0) {
      add_single(single, first_t + i, weight_of(i, cosine, sine, cosine, sine), mixed);
    } else if (const Single& other = t_single_[static_cast<std::size_t>(i)]; other.column >= 0) {
      add_single(other, first_s + i, weight_of(i, sine, cosine, sine, cosine), mixed);
    }
  }
  for (const double sign : {1.0, -1.0}) {
    terms_.clear();
    const auto add = [&](double weight, Index s, Index t, double s_factor, double t_factor) {
      if (sign * weight <= 0.0) return;
      const double root = std::sqrt(std::abs(weight));
      terms_.push_back({s, t, root * s_factor, root * t_factor});
    };
    for (Index i = 0; i < equalities_; ++i) add(rho_, i, i, 1.0, 0.0);
    for (Index i = 0; i < inequalities_; ++i)
      add(weights.rows.all[i], equalities_ + i, equalities_ + i, 1.0, 0.0);
    for (Index i = 0; i < pairs_; ++i) {
      const double cosine = weights.cosine[i];
      const double sine = weights.sine[i];
      if (!single_pair(i)) {
        add(weights.rows.s()[i], first_s + i, first_t + i, cosine, sine);
        add(weights.rows.t()[i], first_s + i, first_t + i, sine, -cosine);
      } else if (s_single_[static_cast<std::size_t>(i)].column >= 0) {
        add(weight_of(i, sine, cosine, sine, cosine), first_t + i, first_t + i, 1.0, 0.0);
      } else {
        add(weight_of(i, cosine, sine, cosine, sine), first_s + i, first_s + i, 1.0, 0.0);
      }
    }
    if (!add_terms(sign)) return false;
  }
  return fill(factor_, system_, interrupt()) && factorize_cholesky(factor_.data(), variables_, interrupt());
}

bool DenseKkt::solve(VectorRef x, VectorRef y) { return solve(x, y, true); }

// Works on the transpose: the numbers of one variable form a column. Row 2 as in solve().
bool DenseKkt::solve_many(double* x, double* y, int count) {
  Eigen::Map<Matrix> values(x, count, variables_), multipliers(y, count, equalities_);
  if (count == 1) {
    Eigen::Map<Vector> one(x, variables_), its_multipliers(y, equalities_);
    return solve(one, its_multipliers, false);
  }
  const auto A = rows_.topRows(equalities_);
  values.noalias() += rho_ * (multipliers * A);
  const auto n = static_cast<int>(variables_);
  const double one = 1.0;
  dtrsm_("R", "U", "N", "N", &count, &n, &one, factor_.data(), &n, x, &count);
  dtrsm_("R", "U", "T", "N", &count, &n, &one, factor_.data(), &n, x, &count);
  if (Checkpoint(interrupt()).reached(factor_.size() * count)) return false;
  multipliers *= -rho_;
  multipliers.noalias() += rho_ * (values * A.transpose());
  return true;
}

bool DenseKkt::solve(VectorRef x, VectorRef y, bool refined) {
  // Row 2 gives y = ρ(Ax − h). Inserted into row 1: (H + ρAᵀA) x = f + ρAᵀh.
  const auto A = rows_.topRows(equalities_);
  x.noalias() += rho_ * (A.transpose() * y);
  if (refined) residual_ = x;
  solve_triangles(factor_, x);
  if (Checkpoint(interrupt()).reached(factor_.size())) return false;
  if (refined) {
    subtract_product(system_, x, residual_);
    solve_triangles(factor_, residual_);
    x += residual_;
  }
  y *= -1.0;
  y.noalias() += A * x;
  y *= rho_;
  return true;
}

bool DenseKkt::solve_sparse(std::span<const Index> indices, std::span<const double> values, VectorRef x) {
  x.setZero();
  for (std::size_t k = 0; k < indices.size(); ++k) x[indices[k]] = values[k];
  solve_triangles(factor_, x);
  return !Checkpoint(interrupt()).reached(factor_.size());
}

double DenseKkt::bytes() const {
  return sizeof(double) *
         (3.0 * static_cast<double>(system_.size()) + 2.0 * static_cast<double>(rows_.size()));
}

double DenseKkt::estimated_bytes(const ScaledProblem& p) {
  const double n = p.variables();
  const double rows = static_cast<double>(p.equalities()) + p.inequalities() + 2.0 * p.pairs();
  return sizeof(double) * (3.0 * n * n + 2.0 * n * rows);
}

}  // namespace marble
