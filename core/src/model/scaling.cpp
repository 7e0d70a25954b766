#include "model/scaling.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "model/tuning.h"
#include "model/units.h"

namespace marble {
namespace {

double root_inverse(double norm) {
  return norm > 0.0 ? 1.0 / std::sqrt(std::clamp(norm, 1.0 / tuning::scale_range, tuning::scale_range)) : 1.0;
}

void absorb_norms(const RowMatrix& matrix, Vector& row_norm, Vector& column_norm) {
  for (Index row = 0; row < matrix.rows; ++row) {
    for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
      const double size = std::abs(matrix.values[k]);
      row_norm[row] = std::max(row_norm[row], size);
      column_norm[matrix.column_indices[k]] = std::max(column_norm[matrix.column_indices[k]], size);
    }
  }
}

void absorb_norms(const SymmetricMatrix& matrix, Vector& norm) {
  for (Index column = 0; column < matrix.size; ++column) {
    for (Index k = matrix.column_pointers[column]; k < matrix.column_pointers[column + 1]; ++k) {
      const double size = std::abs(matrix.values[k]);
      norm[column] = std::max(norm[column], size);
      norm[matrix.row_indices[k]] = std::max(norm[matrix.row_indices[k]], size);
    }
  }
}

// Scales the rows `first` to `first` + `count` − 1.
void apply(RowMatrix& matrix, Index first, Index count, const Vector& row_factor,
           const Vector& column_factor) {
  for (Index row = first; row < first + count; ++row) {
    for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
      matrix.values[k] *= row_factor[row] * column_factor[matrix.column_indices[k]];
    }
  }
}

void apply(SymmetricMatrix& matrix, const Vector& factor) {
  for (Index column = 0; column < matrix.size; ++column) {
    for (Index k = matrix.column_pointers[column]; k < matrix.column_pointers[column + 1]; ++k) {
      matrix.values[k] *= factor[column] * factor[matrix.row_indices[k]];
    }
  }
}

// One constraint block during equilibration.
struct Block {
  RowMatrix* matrix;
  Vector* scale;
  Vector norm;
};

// The cost's units only weigh Q against the rows during equilibration.
void apply(ScaleFactors units, ScaledProblem& p) {
  for (double& value : p.Q.values) value *= units.cost;
  apply(p.Q, units.variable);
  apply(p.A, 0, p.A.rows, units.equality, units.variable);
  apply(p.rows, 0, p.rows.rows, units.row, units.variable);
  p.variable_scale = std::move(units.variable);
  p.equality_scale = std::move(units.equality);
  p.row_scale = std::move(units.row);
}

void equilibrate(ScaledProblem& p, int passes, const Interrupt& interrupt) {
  Block blocks[] = {{&p.A, &p.equality_scale, {}}, {&p.rows, &p.row_scale, {}}};
  Vector column_norm(p.variables());
  for (int pass = 0; pass < passes && !interrupt.requested(); ++pass) {
    column_norm.setZero();
    absorb_norms(p.Q, column_norm);
    for (Block& block : blocks) {
      block.norm.setZero(block.matrix->rows);
      absorb_norms(*block.matrix, block.norm, column_norm);
    }
    column_norm = column_norm.unaryExpr(&root_inverse);
    p.variable_scale.array() *= column_norm.array();
    apply(p.Q, column_norm);
    for (Block& block : blocks) {
      block.norm = block.norm.unaryExpr(&root_inverse);
      block.scale->array() *= block.norm.array();
      apply(*block.matrix, 0, block.matrix->rows, block.norm, column_norm);
    }
  }
}

double mean_size(const SymmetricMatrix& Q) {
  Vector norm = Vector::Zero(Q.size);
  absorb_norms(Q, norm);
  return Q.size > 0 ? norm.mean() : 0.0;
}

double cost_scale(double hessian, const Vector& g) {
  const double size = std::max(hessian, max_abs(g));
  return size > 0.0 ? 1.0 / std::clamp(size, 1.0 / tuning::scale_range, tuning::scale_range) : 1.0;
}

// Chooses the factors of a problem that contains the user's numbers.
void choose_factors(ScaledProblem& p, int passes, const Interrupt& interrupt) {
  ScaleFactors units = choose_units(p, interrupt);
  const double cost = units.cost;
  apply(std::move(units), p);
  equilibrate(p, passes, interrupt);
  p.g.array() *= p.variable_scale.array();
  p.cost_scale = cost_scale(mean_size(p.Q) / cost, p.g);  // Q contains `cost` too
}

ScaledSizes measure(const ScaledProblem& p) {
  ScaledSizes sizes;
  sizes.columns.setZero(p.variables());
  absorb_norms(p.Q, sizes.columns);
  sizes.variable = sizes.columns;
  sizes.equality.setZero(p.equalities());
  sizes.row.setZero(p.layout.size());
  absorb_norms(p.A, sizes.equality, sizes.variable);
  absorb_norms(p.rows, sizes.row, sizes.variable);
  sizes.hessian = p.variables() > 0 ? sizes.columns.mean() : 0.0;
  sizes.gradient = max_abs(p.g);
  sizes.cost = std::max(sizes.hessian, sizes.gradient);
  return sizes;
}

// A zero has no size and was scaled as if its size were 1.
bool has_drifted(double now, double then) {
  if (now == 0.0) return false;
  const double ratio = now / (then > 0.0 ? then : 1.0);
  return ratio > tuning::scale_drift || ratio * tuning::scale_drift < 1.0;
}

bool has_drifted(const Vector& now, const Vector& then) {
  for (Eigen::Index i = 0; i < now.size(); ++i)
    if (has_drifted(now[i], then[i])) return true;
  return false;
}

bool has_drifted(const ScaledSizes& now, const ScaledSizes& then) {
  return has_drifted(now.variable, then.variable) || has_drifted(now.equality, then.equality) ||
         has_drifted(now.row, then.row) || has_drifted(now.cost, then.cost);
}

bool gradient_has_drifted(double now, double then) {
  return now == 0.0 || then == 0.0 ? now != then : has_drifted(now, then);
}

void multiply_cost(ScaledProblem& p, double factor) {
  for (double& value : p.Q.values) value *= factor;
  p.g *= factor;
  p.cost_scale *= factor;
}

void multiply(ScaledProblem& p, const ScaleFactors& by) {
  multiply_cost(p, by.cost);
  apply(p.Q, by.variable);
  apply(p.A, 0, p.A.rows, by.equality, by.variable);
  apply(p.rows, 0, p.rows.rows, by.row, by.variable);
  p.g.array() *= by.variable.array();
  p.b.array() *= by.equality.array();
  p.offset.array() *= by.row.array();
  p.variable_scale.array() *= by.variable.array();
  p.equality_scale.array() *= by.equality.array();
  p.row_scale.array() *= by.row.array();
}

double power_of_two(double factor) { return std::ldexp(1.0, std::ilogb(factor * std::sqrt(2.0))); }

void scale_cost_by_power(ScaledProblem& p) {
  multiply_cost(p, power_of_two(cost_scale(mean_size(p.Q), p.g)));
}

// From the factors of `p` to those that scale() would choose for its numbers, which are known to rounding.
ScaleFactors powers_to_new_factors(const ScaledProblem& p, int passes) {
  ScaledProblem user = p;
  multiply(user, {p.variable_scale.cwiseInverse(), p.equality_scale.cwiseInverse(),
                  p.row_scale.cwiseInverse(), 1.0 / p.cost_scale});
  choose_factors(user, passes, {});
  const auto ratio = [](const Vector& factors, const Vector& before) {
    return Vector(factors.cwiseQuotient(before).unaryExpr(&power_of_two));
  };
  return {ratio(user.variable_scale, p.variable_scale), ratio(user.equality_scale, p.equality_scale),
          ratio(user.row_scale, p.row_scale), power_of_two(user.cost_scale / p.cost_scale)};
}

// Curvature that many times smaller than it could be is lost beside other numbers.
double most_hidden() { return tuning::scale_drift * tuning::scale_drift; }

bool have_hidden_curvature(const ScaledSizes& sizes) {
  return std::ranges::any_of(sizes.columns,
                             [](double size) { return size > 0.0 && size * most_hidden() < 1.0; });
}

// Whether the factors of `p` make curvature so much smaller than the new ones. Where cost and variables only
// trade their units, as where g vanishes along a sequence, both are as good.
bool hide_curvature(const ScaledProblem& p, const ScaleFactors& by) {
  for (Index column = 0; column < p.Q.size; ++column) {
    if (p.sizes.columns[column] > 0.0 && by.cost * by.variable[column] * by.variable[column] > most_hidden())
      return true;
  }
  return false;
}

Vector copy(std::span<const double> values) {
  return Eigen::Map<const Vector>(values.data(), static_cast<Eigen::Index>(values.size()));
}

// Replaces the part of a vector that begins at `first`.
void replace(std::span<const double> values, const Vector& factor, double common, Vector& out,
             Index first = 0) {
  const auto size = static_cast<Eigen::Index>(values.size());
  if (size > 0) out.segment(first, size) = common * copy(values).cwiseProduct(factor.segment(first, size));
}

// Replaces `count` rows of a matrix from `first` on, which correspond to one matrix of the user.
bool replace(std::span<const double> values, const Vector& row_factor, const Vector& column_factor,
             RowMatrix& out, Index first, Index count) {
  if (values.empty()) return false;
  const auto end = static_cast<std::size_t>(out.row_pointers[first + count]);
  for (auto k = static_cast<std::size_t>(out.row_pointers[first]); k < end; ++k)
    out.values[k] = values[static_cast<std::size_t>(out.source[k])];
  apply(out, first, count, row_factor, column_factor);
  return true;
}

bool replace(std::span<const double> values, const Vector& factor, double common, SymmetricMatrix& out) {
  if (values.empty()) return false;
  for (std::size_t k = 0; k < out.values.size(); ++k)
    out.values[k] = common * values[static_cast<std::size_t>(out.source[k])];
  apply(out, factor);
  return true;
}

bool is_constant(const RowMatrix& matrix, Index row) {
  const auto begin = matrix.values.begin() + matrix.row_pointers[row];
  const auto end = matrix.values.begin() + matrix.row_pointers[row + 1];
  return std::all_of(begin, end, [](double value) { return value == 0.0; });
}

// A row without variables has a fixed violation. If it is no larger than an exact solution may have, it is
// taken as 0; otherwise it would be a proof of infeasibility.
void accept_constant_rows(ScaledProblem& p) {
  for (Index row = 0; row < p.A.rows; ++row) {
    const double largest = tuning::exactness * p.equality_scale[row];
    if (p.b[row] != 0.0 && std::abs(p.b[row]) <= largest && is_constant(p.A, row)) p.b[row] = 0.0;
  }
  for (Index row = 0; row < p.rows.rows; ++row) {
    const double largest = tuning::exactness * p.row_scale[row];
    if (p.offset[row] < 0.0 && -p.offset[row] <= largest && is_constant(p.rows, row)) p.offset[row] = 0.0;
  }
}

}  // namespace

bool rescale(const ProblemUpdate& update, ScaledProblem& p) {
  const RowLayout& rows = p.layout;
  if (update.c0) p.c0 = *update.c0;
  replace(update.g, p.variable_scale, p.cost_scale, p.g);
  replace(update.b, p.equality_scale, 1.0, p.b);
  replace(update.d, p.row_scale, 1.0, p.offset);
  replace(update.l, p.row_scale, 1.0, p.offset, rows.s(0));
  replace(update.r, p.row_scale, 1.0, p.offset, rows.t(0));
  bool changed = replace(update.Q, p.variable_scale, p.cost_scale, p.Q);
  changed |= replace(update.A, p.equality_scale, p.variable_scale, p.A, 0, p.A.rows);
  changed |= replace(update.C, p.row_scale, p.variable_scale, p.rows, 0, rows.inequalities);
  changed |= replace(update.L, p.row_scale, p.variable_scale, p.rows, rows.s(0), rows.pairs);
  changed |= replace(update.R, p.row_scale, p.variable_scale, p.rows, rows.t(0), rows.pairs);
  accept_constant_rows(p);
  return changed;
}

bool refit_scaling(ScaledProblem& p, int passes, bool matrices_changed) {
  if (passes == 0) return false;
  const double gradient = max_abs(p.g);
  bool drifted = has_drifted(std::max(p.sizes.hessian, gradient), p.sizes.cost);
  bool drifted_alone = gradient_has_drifted(gradient, p.sizes.gradient);
  if (matrices_changed) {
    ScaledSizes now = measure(p);
    drifted = has_drifted(now, p.sizes);
    drifted_alone |= has_drifted(now.columns, p.sizes.columns);
    if (drifted_alone) p.sizes.columns = std::move(now.columns);
  }
  if (!drifted && !drifted_alone) return false;
  p.sizes.gradient = gradient;
  if (!drifted && !have_hidden_curvature(p.sizes)) return false;
  const ScaleFactors by = powers_to_new_factors(p, passes);
  if (!drifted && !hide_curvature(p, by)) return false;
  multiply(p, by);
  scale_cost_by_power(p);  // beyond tuning::scale_range
  p.sizes = measure(p);
  return true;
}

ScaledProblem scale(const Problem& problem, int passes, const Interrupt& interrupt) {
  const ProblemView& view = problem.view();
  const Index n = problem.variables();
  ScaledProblem p;
  p.layout = {problem.inequalities(), problem.pairs()};
  p.Q = upper_triangle(view.Q, n);
  p.A.columns = p.rows.columns = n;
  append_rows(view.A, problem.equalities(), p.A);
  append_rows(view.C, problem.inequalities(), p.rows);
  append_rows(view.L, problem.pairs(), p.rows);
  append_rows(view.R, problem.pairs(), p.rows);
  p.g = copy(view.g);
  p.b = copy(view.b);
  p.offset.resize(p.layout.size());
  p.offset << copy(view.d), copy(view.l), copy(view.r);
  p.c0 = view.c0;

  if (passes > 0) {
    choose_factors(p, passes, interrupt);
  } else {
    p.variable_scale.setOnes(n);
    p.equality_scale.setOnes(p.A.rows);
    p.row_scale.setOnes(p.rows.rows);
  }
  // Computed from the original: gives the same bits as an update with the same numbers.
  rescale({.g = view.g,
           .b = view.b,
           .d = view.d,
           .l = view.l,
           .r = view.r,
           .Q = view.Q.values,
           .A = view.A.values,
           .C = view.C.values,
           .L = view.L.values,
           .R = view.R.values},
          p);
  p.sizes = measure(p);
  return p;
}

}  // namespace marble
