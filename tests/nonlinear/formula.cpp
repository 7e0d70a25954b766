#include "formula.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace marble::testing {
namespace {

std::vector<double> values_of(const Jets& jets) {
  std::vector<double> values;
  for (const Jet& jet : jets) values.push_back(jet.value());
  return values;
}

SparseMatrix full(std::size_t rows, std::size_t columns) {
  SparseMatrix made{static_cast<Index>(rows), static_cast<Index>(columns), {0}, {}, {}};
  for (std::size_t j = 0; j < columns; ++j) {
    for (std::size_t i = 0; i < rows; ++i) made.row_indices.push_back(static_cast<Index>(i));
    made.column_pointers.push_back(static_cast<Index>(made.row_indices.size()));
  }
  return made;
}

SparseMatrix jacobian_of(const Jets& jets, std::size_t n) {
  SparseMatrix made = full(jets.size(), n);
  for (std::size_t j = 0; j < n; ++j)
    for (const Jet& jet : jets) made.values.push_back(jet.slope(j));
  return made;
}

// What the views of the last call borrow.
struct Memory {
  std::vector<double> values[5], gradient;
  SparseMatrix jacobians[5], hessian;
};

}  // namespace

Jets Formula::variables(std::span<const double> x) const {
  Jets made;
  for (std::size_t j = 0; j < x.size(); ++j) made.push_back(Jet::variable(x[j], j, x.size()));
  return made;
}

nonlinear::Problem problem_of(const Formula& formula, bool with_hessian) {
  nonlinear::Problem problem;
  const auto memory = std::make_shared<Memory>();
  const std::size_t n = formula.start.size();
  problem.start = formula.start, problem.lower = formula.lower, problem.upper = formula.upper;
  problem.values = [formula, memory](std::span<const double> x) -> nonlinear::Values {
    const Parts at = formula.parts(formula.variables(x));
    auto& v = memory->values;
    v[0] = values_of(at.equalities), v[1] = values_of(at.inequalities), v[2] = values_of(at.G),
    v[3] = values_of(at.H);
    v[4] = values_of(at.residuals);
    return {at.objective.value(), v[0], v[1], v[2], v[3], v[4]};
  };
  problem.derivatives = [formula, memory, n](std::span<const double> x) -> nonlinear::Derivatives {
    const Parts at = formula.parts(formula.variables(x));
    memory->gradient.resize(n);
    for (std::size_t j = 0; j < n; ++j) memory->gradient[j] = at.objective.slope(j);
    auto& J = memory->jacobians;
    J[0] = jacobian_of(at.equalities, n), J[1] = jacobian_of(at.inequalities, n), J[2] = jacobian_of(at.G, n);
    J[3] = jacobian_of(at.H, n), J[4] = jacobian_of(at.residuals, n);
    return {memory->gradient, J[0].view(), J[1].view(), J[2].view(), J[3].view(), J[4].view()};
  };
  if (!with_hessian) return problem;
  problem.hessian = [formula, memory, n](std::span<const double> x, const nonlinear::Multipliers& m) {
    const Parts at = formula.parts(formula.variables(x));
    Jet L = at.objective;
    for (std::size_t i = 0; i < at.equalities.size(); ++i) L += Jet(m.equalities[i]) * at.equalities[i];
    for (std::size_t i = 0; i < at.inequalities.size(); ++i)
      L += Jet(-m.inequalities[i]) * at.inequalities[i];
    for (std::size_t i = 0; i < at.G.size(); ++i) L += Jet(-m.G[i]) * at.G[i] + Jet(-m.H[i]) * at.H[i];
    for (const Jet& residual : at.residuals) L += Jet(0.5) * square(residual);
    SparseMatrix& B = memory->hessian =
        SparseMatrix{static_cast<Index>(n), static_cast<Index>(n), {0}, {}, {}};
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t i = 0; i <= j; ++i)
        B.row_indices.push_back(static_cast<Index>(i)), B.values.push_back(L.curvature(i, j));
      B.column_pointers.push_back(static_cast<Index>(B.row_indices.size()));
    }
    return B.view();
  };
  return problem;
}

std::string objection(const Formula& formula, const nonlinear::Answer& answer) {
  constexpr double kTolerance = 1e-6;
  const Parts at = formula.parts(formula.variables(answer.x));
  std::ostringstream said;
  for (std::size_t i = 0; i < at.equalities.size(); ++i)
    if (!(std::abs(at.equalities[i].value()) <= kTolerance))
      said << "equality " << i << " is " << at.equalities[i].value() << "; ";
  for (std::size_t i = 0; i < at.inequalities.size(); ++i)
    if (!(at.inequalities[i].value() >= -kTolerance))
      said << "inequality " << i << " is " << at.inequalities[i].value() << "; ";
  for (std::size_t i = 0; i < at.G.size(); ++i) {
    const double G = at.G[i].value(), H = at.H[i].value();
    if (!(std::abs(std::min(G, H)) <= kTolerance)) said << "pair " << i << " is " << G << ", " << H << "; ";
  }
  for (std::size_t j = 0; j < answer.x.size(); ++j) {
    if ((!formula.lower.empty() && answer.x[j] < formula.lower[j]) ||
        (!formula.upper.empty() && answer.x[j] > formula.upper[j]))
      said << "variable " << j << " is " << answer.x[j] << ", beyond its bounds; ";
  }
  double objective = at.objective.value();
  for (const Jet& residual : at.residuals) objective += 0.5 * residual.value() * residual.value();
  if (!(std::abs(objective - answer.objective) <= 1e-12 * std::max(1.0, std::abs(objective))))
    said << "the objective is " << objective << ", not " << answer.objective;
  return said.str();
}

}  // namespace marble::testing
