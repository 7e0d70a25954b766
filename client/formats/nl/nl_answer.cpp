#include "nl/nl_answer.h"

#include <algorithm>
#include <cmath>

namespace marble::formats {
namespace {

constexpr double kAtBound = 1e-6;  // of a bound's slack

std::size_t at(Index index) { return static_cast<std::size_t>(index); }

std::span<const double> part(const MultiplierView& multipliers, Block block) {
  switch (block) {
    case Block::equality:
      return multipliers.equality;
    case Block::inequality:
      return multipliers.inequality;
    case Block::left:
      return multipliers.left;
    case Block::right:
      break;
  }
  return multipliers.right;
}

// result += M z.
void add_product(const SparseMatrix& M, std::span<const double> z, std::vector<double>& result) {
  for (Index column = 0; column < M.columns; ++column) {
    for (Index k = M.column_pointers[at(column)]; k < M.column_pointers[at(column) + 1]; ++k)
      result[at(M.row_indices[at(k)])] += M.values[at(k)] * z[at(column)];
  }
}

// result += factor · Mᵀ v.
void add_transposed(const SparseMatrix& M, std::span<const double> v, double factor,
                    std::vector<double>& result) {
  for (Index column = 0; column < M.columns; ++column) {
    for (Index k = M.column_pointers[at(column)]; k < M.column_pointers[at(column) + 1]; ++k)
      result[at(column)] += factor * M.values[at(k)] * v[at(M.row_indices[at(k)])];
  }
}

}  // namespace

MultiplierView MultiplierView::of(const Solution& s) {
  return {s.equality_multipliers, s.inequality_multipliers, s.complementarity_multipliers_L,
          s.complementarity_multipliers_R};
}

MultiplierView MultiplierView::stacked(const OwnedProblem& p, std::span<const double> values) {
  const std::size_t pairs = p.l.size(), rows = p.b.size() + p.d.size();
  if (values.size() != rows + 2 * pairs) return {};
  return {values.first(p.b.size()), values.subspan(p.b.size(), p.d.size()), values.subspan(rows, pairs),
          values.last(pairs)};
}

std::vector<double> sums(const std::vector<DualTerm>& terms, std::size_t count,
                         const MultiplierView& multipliers, double sign) {
  std::vector<double> result(count, 0.0);
  for (const DualTerm& term : terms) {
    const std::span<const double> values = part(multipliers, term.block);
    if (at(term.index) < values.size()) result[at(term.of)] += sign * term.sign * values[at(term.index)];
  }
  return result;
}

Solution initial_answer(const NlProblem& nl) {
  const OwnedProblem& p = nl.file.problem;
  Solution start;
  start.z = p.initial_z;
  start.equality_multipliers.assign(p.b.size(), 0.0);
  start.inequality_multipliers.assign(p.d.size(), 0.0);
  start.complementarity_multipliers_L.assign(p.l.size(), 0.0);
  start.complementarity_multipliers_R.assign(p.r.size(), 0.0);
  const auto set = [&start](const DualTerm& term, double value) {
    switch (term.block) {
      case Block::equality:
        start.equality_multipliers[at(term.index)] = value;
        break;
      case Block::inequality:
        start.inequality_multipliers[at(term.index)] = std::max(value, 0.0);
        break;
      case Block::left:
        start.complementarity_multipliers_L[at(term.index)] = value;
        break;
      case Block::right:
        start.complementarity_multipliers_R[at(term.index)] = value;
        break;
    }
  };
  for (const DualTerm& term : nl.row_duals) set(term, nl.sign() * term.sign * nl.initial_duals[at(term.of)]);

  std::vector<double> gradient(p.g.size(), 0.0);  // Qz, then all of the stationarity's residual
  add_product(p.Q, start.z, gradient);
  start.objective = p.c0;
  for (std::size_t j = 0; j < gradient.size(); ++j) {
    start.objective += (0.5 * gradient[j] + p.g[j]) * start.z[j];
    gradient[j] += p.g[j];
  }
  start.reference_objective = start.objective;  // a cold start's objective is unknown
  add_transposed(p.A, start.equality_multipliers, 1.0, gradient);
  add_transposed(p.C, start.inequality_multipliers, -1.0, gradient);
  add_transposed(p.L, start.complementarity_multipliers_L, -1.0, gradient);
  std::vector<double> slack = p.d, right = p.r;
  add_product(p.C, start.z, slack);
  add_product(p.R, start.z, right);
  for (const DualTerm& term : nl.reduced_costs) {
    double& rest = gradient[at(term.of)];
    const double value = term.sign * rest;
    if (term.block == Block::inequality && (value < 0.0 || slack[at(term.index)] > kAtBound)) continue;
    if (term.block == Block::right && std::abs(right[at(term.index)]) > kAtBound) continue;
    set(term, value);
    rest = 0.0;
  }
  return start;
}

}  // namespace marble::formats
