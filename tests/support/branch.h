// Provides one branch of a problem as a separate problem without pairs.
#pragma once

#include <vector>

#include "marble/problem.h"

namespace marble::testing {

/// s_i = 0 and t_i ≥ 0 if s_zero[i], else the reverse.
[[nodiscard]] inline OwnedProblem branch(const OwnedProblem& p, const std::vector<bool>& s_zero) {
  OwnedProblem out = p;
  const auto n = static_cast<Index>(p.g.size());
  Triplets equalities, inequalities;
  // Appends row `row` of m, or all rows, from row `to` on.
  const auto append = [](const SparseMatrix& m, Index row, Index to, Triplets& entries) {
    for (Index j = 0; j < m.columns; ++j) {
      for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k) {
        if (row < 0) entries.add(m.row_indices[k], j, m.values[k]);
        if (row == m.row_indices[k]) entries.add(to, j, m.values[k]);
      }
    }
  };
  append(p.A, -1, 0, equalities);
  append(p.C, -1, 0, inequalities);
  for (std::size_t i = 0; i < p.l.size(); ++i) {
    const bool s_side = s_zero[i];
    const auto row = static_cast<Index>(i);
    append(s_side ? p.L : p.R, row, static_cast<Index>(out.b.size()), equalities);
    out.b.push_back(s_side ? p.l[i] : p.r[i]);
    append(s_side ? p.R : p.L, row, static_cast<Index>(out.d.size()), inequalities);
    out.d.push_back(s_side ? p.r[i] : p.l[i]);
  }
  out.A = compress(static_cast<Index>(out.b.size()), n, equalities, "A").value();
  out.C = compress(static_cast<Index>(out.d.size()), n, inequalities, "C").value();
  out.L = out.R = {};
  out.l.clear();
  out.r.clear();
  return out;
}

/// The same with bits: bit i of `s_fixed` is s_zero[i]. Up to 32 pairs.
[[nodiscard]] inline OwnedProblem branch(const OwnedProblem& p, unsigned s_fixed) {
  std::vector<bool> s_zero(p.l.size());
  for (std::size_t i = 0; i < s_zero.size(); ++i) s_zero[i] = (s_fixed >> i & 1U) != 0;
  return branch(p, s_zero);
}

}  // namespace marble::testing
