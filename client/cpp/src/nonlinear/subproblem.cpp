#include "nonlinear/subproblem.h"

#include <algorithm>
#include <cmath>

#include "nonlinear/algebra.h"
#include "nonlinear/tuning.h"

namespace marble::nonlinear {
namespace {

// B of a step without an objective: prefers short steps among equals.

/// Returns a Jacobian with two more entries per column, for the trust region's rows: −low ≤ d ≤ up.
SparseMatrix with_box(const SparseMatrix& jacobian) {
  const Index n = jacobian.columns, rows = jacobian.rows;
  SparseMatrix made{
      .rows = rows + 2 * n, .columns = n, .column_pointers = {0}, .row_indices = {}, .values = {}};
  for (Index j = 0; j < n; ++j) {
    for (Index k = jacobian.column_pointers[j]; k < jacobian.column_pointers[j + 1]; ++k) {
      made.row_indices.push_back(jacobian.row_indices[k]);
      made.values.push_back(jacobian.values[k]);
    }
    made.row_indices.insert(made.row_indices.end(), {rows + j, rows + n + j});
    made.values.insert(made.values.end(), {1.0, -1.0});
    made.column_pointers.push_back(static_cast<Index>(made.row_indices.size()));
  }
  return made;
}

/// Adds one column with one entry in row `row`; none if `row` is negative.
void add_column(SparseMatrix& matrix, Index row, double value) {
  ++matrix.columns;
  if (row >= 0) {
    matrix.row_indices.push_back(row);
    matrix.values.push_back(value);
  }
  matrix.column_pointers.push_back(static_cast<Index>(matrix.row_indices.size()));
}

void copy_to_front(const std::vector<double>& from, std::vector<double>& to) {
  std::copy(from.begin(), from.end(), to.begin());
}

}  // namespace

Subproblem::Subproblem(const Linearisation& at, const SparseMatrix& B, bool elastic)
    : n_(at.gradient.size()),
      equalities_(static_cast<std::size_t>(at.equalities.rows)),
      inequalities_(static_cast<std::size_t>(at.inequalities.rows)),
      pairs_(static_cast<std::size_t>(at.G.rows)),
      elastic_(elastic) {
  OwnedProblem& p = problem_;
  p.Q = B, p.A = at.equalities, p.C = with_box(at.inequalities), p.L = at.G, p.R = at.H;
  p.hessian_form = HessianForm::upper_triangle;
  p.g.assign(n_, 0.0);
  if (elastic) {
    // Violations of the rows, in this order: equalities up and down, inequalities, and both sides of pairs up
    // and down.
    const auto add = [&p](Index a, Index c, Index l, Index r, double value) {
      add_column(p.A, a, value), add_column(p.L, l, value), add_column(p.R, r, value);
      add_column(p.C, c, value), add_column(p.Q, -1, 0.0);
      p.C.row_indices.push_back(p.C.rows++);  // the variable itself is at least 0
      p.C.values.push_back(1.0);
      ++p.C.column_pointers.back();
      p.g.push_back(0.0);
    };
    for (const double sign : {1.0, -1.0})
      for (Index i = 0; i < at.equalities.rows; ++i) add(i, -1, -1, -1, sign);
    for (Index i = 0; i < at.inequalities.rows; ++i) add(-1, i, -1, -1, 1.0);
    for (const double sign : {1.0, -1.0})
      for (Index i = 0; i < at.G.rows; ++i) add(-1, -1, i, -1, sign);
    for (const double sign : {1.0, -1.0})
      for (Index i = 0; i < at.H.rows; ++i) add(-1, -1, -1, i, sign);
    p.Q.rows = p.Q.columns;
  }
  p.b.assign(equalities_, 0.0), p.l.assign(pairs_, 0.0), p.r.assign(pairs_, 0.0);
  p.d.assign(static_cast<std::size_t>(p.C.rows), 0.0);
}

ProblemView Subproblem::view() const {
  ProblemView view = problem_.view();
  for (SparseMatrixView* part : {&view.A, &view.L, &view.R})
    if (part->rows == 0) *part = {};
  return view;
}

ProblemUpdate Subproblem::update() const {
  const OwnedProblem& p = problem_;
  return {.c0 = p.c0,
          .g = p.g,
          .b = p.b,
          .d = p.d,
          .l = p.l,
          .r = p.r,
          .Q = p.Q.values,
          .A = p.A.values,
          .C = p.C.values,
          .L = p.L.values,
          .R = p.R.values};
}

void Subproblem::sizes(Sizes& of) const {
  const OwnedProblem& p = problem_;
  auto& sizes = of.curvature;
  of.slope = largest(std::span(p.g).first(n_));
  sizes.assign(n_, 0.0);
  for (std::size_t j = 0; j < n_; ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      const double value = std::abs(p.Q.values[k]);
      sizes[j] = std::max(sizes[j], value);
      sizes[p.Q.row_indices[k]] = std::max(sizes[p.Q.row_indices[k]], value);
    }
  }
}

void Subproblem::set(const Point& point, const Linearisation& at, const SparseMatrix& B, const Box& box) {
  OwnedProblem& p = problem_;
  p.c0 = point.objective;
  copy_to_front(B.values, p.Q.values), copy_to_front(at.gradient, p.g);
  copy_to_front(at.equalities.values, p.A.values), copy_to_front(at.G.values, p.L.values),
      copy_to_front(at.H.values, p.R.values);
  auto to = p.C.values.begin();
  for (std::size_t j = 0; j < n_; ++j, to += 2)
    to = std::copy(at.inequalities.values.begin() + at.inequalities.column_pointers[j],
                   at.inequalities.values.begin() + at.inequalities.column_pointers[j + 1], to);
  p.b = point.equalities, p.l = point.G, p.r = point.H;
  copy_to_front(point.inequalities, p.d);
  for (std::size_t j = 0; j < n_; ++j) {
    p.d[inequalities_ + j] = std::min(box.radius * box.scale[j], point.x[j] - box.lower[j]);
    p.d[inequalities_ + n_ + j] = std::min(box.radius * box.scale[j], box.upper[j] - point.x[j]);
  }
}

ProblemUpdate Subproblem::set_equalities(const Point& point) {
  problem_.b = point.equalities;
  return {.b = problem_.b};
}

void Subproblem::set_weights(const Weights& weights) {
  auto cost = problem_.g.begin() + static_cast<std::ptrdiff_t>(n_);
  for (const auto part : {weights.equalities(), weights.equalities(), weights.inequalities(), weights.pairs(),
                          weights.pairs(), weights.pairs(), weights.pairs()})
    cost = std::copy(part.begin(), part.end(), cost);
}

void Subproblem::drop_objective() {
  OwnedProblem& p = problem_;
  p.c0 = 0.0;
  std::fill_n(p.g.begin(), n_, 0.0);
  std::fill(p.Q.values.begin(), p.Q.values.end(), 0.0);
  for (std::size_t j = 0; j < n_; ++j) p.Q.values[p.Q.column_pointers[j + 1] - 1] = tuning::proximal;
}

// Uses c(x + d) − ∇c d in place of c(x).
void Subproblem::correct(const Point& trial, const Step& step) {
  OwnedProblem& p = problem_;
  const auto offset = [](std::vector<double>& at, const std::vector<double>& there,
                         const std::vector<double>& model) {
    for (std::size_t i = 0; i < there.size(); ++i) at[i] += there[i] - model[i];
  };
  offset(p.b, trial.equalities, step.equalities), offset(p.d, trial.inequalities, step.inequalities);
  offset(p.l, trial.G, step.G), offset(p.r, trial.H, step.H);
}

bool Subproblem::allows_no_step(const Options& options) const {
  const OwnedProblem& p = problem_;
  const double pairs = options.complementarity_tolerance;
  bool allows =
      std::ranges::all_of(p.b, [&](double b) { return std::abs(b) <= options.equality_tolerance; }) &&
      std::ranges::all_of(p.d, [&](double d) { return d >= -options.inequality_tolerance; });
  for (std::size_t i = 0; i < p.l.size(); ++i) allows = allows && std::abs(std::min(p.l[i], p.r[i])) <= pairs;
  return allows;
}

void Subproblem::read(const Solution& solution, const Point& point, const Linearisation& at, const Box& box,
                      Step& step) const {
  const auto n = static_cast<std::ptrdiff_t>(n_);
  step.d.assign(solution.z.begin(), solution.z.begin() + n);
  step.size = 0.0;
  Multipliers& m = step.multipliers;
  m.equalities = solution.equality_multipliers;
  const auto nu = solution.inequality_multipliers.begin();
  const auto inequalities = static_cast<std::ptrdiff_t>(inequalities_);
  m.inequalities.assign(nu, nu + inequalities);
  m.G = solution.complementarity_multipliers_L, m.H = solution.complementarity_multipliers_R;
  m.bounds.resize(n_);
  for (std::size_t j = 0; j < n_; ++j) {
    // The solver's rounding must not lead out of the bounds, nor to just inside them.
    const double low = std::min(box.radius * box.scale[j], point.x[j] - box.lower[j]);
    const double up = std::min(box.radius * box.scale[j], box.upper[j] - point.x[j]);
    step.d[j] = std::clamp(step.d[j], -low, up);
    if (step.d[j] + low <= tuning::at_bound * low) step.d[j] = -low;
    if (up - step.d[j] <= tuning::at_bound * up) step.d[j] = up;
    step.size = std::max(step.size, std::abs(step.d[j]) / box.scale[j]);
    const bool at_lower = low < box.radius * box.scale[j], at_upper = up < box.radius * box.scale[j];
    const auto row = inequalities + static_cast<std::ptrdiff_t>(j);
    m.bounds[j] = (at_lower ? nu[row] : 0.0) - (at_upper ? nu[row + n] : 0.0);
  }
  for (const auto& [rows, jacobian, linear] :
       {std::tuple{&point.equalities, &at.equalities, &step.equalities},
        std::tuple{&point.inequalities, &at.inequalities, &step.inequalities},
        std::tuple{&point.G, &at.G, &step.G}, std::tuple{&point.H, &at.H, &step.H}}) {
    *linear = *rows;
    add_product(*jacobian, step.d, *linear);
  }
  step.b_stationary = solution.b_stationary, step.stationarity = solution.stationarity;
  step.second_order = solution.second_order;
  step.elastic = elastic_;
}

}  // namespace marble::nonlinear
