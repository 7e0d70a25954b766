#include "support/conflict_check.h"

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <vector>

#include "support/brute_force.h"

namespace marble::testing {
namespace {

// Rows of several matrices, stacked.
struct Rows {
  Triplets entries;
  std::vector<double> constants;

  void add(const SparseMatrixView& m, std::span<const double> offsets, Index row) {
    for (Index j = 0; j < m.columns && !m.values.empty(); ++j) {
      for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k) {
        if (m.row_indices[k] == row) entries.add(static_cast<Index>(constants.size()), j, m.values[k]);
      }
    }
    constants.push_back(offsets[row]);
  }
  [[nodiscard]] SparseMatrix matrix(Index columns) const {
    return compress(static_cast<Index>(constants.size()), columns, entries, "rows").value();
  }
};

bool has_point(const ProblemView& p, const Conflict& parts, unsigned choice) {
  const auto n = static_cast<Index>(p.g.size());
  Rows equal, at_least;
  for (const Index row : parts.equalities) equal.add(p.A, p.b, row);
  for (const Index row : parts.inequalities) at_least.add(p.C, p.d, row);
  for (const Index row : parts.left_sides) at_least.add(p.L, p.l, row);
  for (const Index row : parts.right_sides) at_least.add(p.R, p.r, row);
  for (std::size_t k = 0; k < parts.complementarities.size(); ++k) {
    const Index pair = parts.complementarities[k];
    if ((choice >> k & 1U) != 0) {
      equal.add(p.R, p.r, pair);
    } else {
      equal.add(p.L, p.l, pair);
    }
  }
  OwnedProblem rows;
  rows.g.assign(p.g.size(), 0.0);
  Triplets distance;
  for (Index j = 0; j < n; ++j) distance.add(j, j, 1.0);
  rows.Q = compress(n, n, distance, "Q").value();
  rows.A = equal.matrix(n);
  rows.b = equal.constants;
  rows.C = at_least.matrix(n);
  rows.d = at_least.constants;
  return brute_force(rows.view()).has_value();
}

}  // namespace

bool have_point(const ProblemView& problem, const Conflict& parts) {
  const std::size_t pairs = parts.complementarities.size();
  if (pairs > 12) throw std::invalid_argument("more than 12 complementarities");
  for (unsigned choice = 0; choice < (1U << pairs); ++choice) {
    if (has_point(problem, parts, choice)) return true;
  }
  return false;
}

bool is_irreducible(const ProblemView& problem, const Conflict& parts) {
  for (std::vector<Index> Conflict::*const kind :
       {&Conflict::equalities, &Conflict::inequalities, &Conflict::left_sides, &Conflict::right_sides,
        &Conflict::complementarities}) {
    for (std::size_t k = 0; k < (parts.*kind).size(); ++k) {
      Conflict rest = parts;
      (rest.*kind).erase((rest.*kind).begin() + static_cast<std::ptrdiff_t>(k));
      if (!have_point(problem, rest)) return false;
    }
  }
  return true;
}

}  // namespace marble::testing
