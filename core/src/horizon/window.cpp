#include "horizon/window.h"

#include <algorithm>
#include <limits>
#include <tuple>
#include <utility>

#include "model/entries.h"

namespace marble {

Window::Window(const ProblemView& problem, std::span<const Index> stage)
    : p_(problem),
      stage_(stage),
      variable_reach_{{stage.begin(), stage.end()}, {stage.begin(), stage.end()}},
      equality_reach_(reach({&p_.A}, p_.b.size(), stage)),
      inequality_reach_(reach({&p_.C}, p_.d.size(), stage)),
      pair_reach_(reach({&p_.L, &p_.R}, p_.l.size(), stage)) {}

// Assigns rows without variables to stage 0.
Window::Reach Window::reach(std::initializer_list<const SparseMatrixView*> matrices, std::size_t rows,
                            std::span<const Index> stage) {
  Reach result{std::vector<Index>(rows, std::numeric_limits<Index>::max()), std::vector<Index>(rows, 0)};
  for (const SparseMatrixView* m : matrices) {
    for_entries(*m, [&](Index row, Index j, double) {
      result.first[at(row)] = std::min(result.first[at(row)], stage[at(j)]);
      result.last[at(row)] = std::max(result.last[at(row)], stage[at(j)]);
    });
  }
  for (std::size_t row = 0; row < rows; ++row)
    result.first[row] = std::min(result.first[row], result.last[row]);
  return result;
}

Window::Rows Window::rows_of(const Reach& rows, Index first, Index end, End behind) {
  const std::vector<Index>& begins = behind == End::known ? rows.first : rows.last;
  Rows result;
  result.local.assign(rows.last.size(), -1);
  for (std::size_t row = 0; row < rows.last.size(); ++row) {
    if (rows.last[row] < first || begins[row] >= end) continue;
    result.local[row] = static_cast<Index>(result.kept.size());
    result.kept.push_back(static_cast<Index>(row));
  }
  return result;
}

Expected<SparseMatrix> Window::part(const SparseMatrixView& m, const Rows& rows, const std::vector<double>& z,
                                    std::span<const double> offsets, std::vector<double>& own,
                                    const char* name) const {
  for (const Index row : rows.kept) own.push_back(offsets[at(row)]);
  Triplets entries;
  for_entries(m, [&](Index row, Index j, double value) {
    const Index there = rows.local[at(row)], variable = variables_.local[at(j)];
    if (there < 0) return;
    if (variable >= 0) {
      entries.add(there, variable, value);
    } else {
      own[at(there)] += value * z[at(j)];
    }
  });
  return compress(static_cast<Index>(rows.kept.size()), static_cast<Index>(variables_.kept.size()), entries,
                  name);
}

Expected<OwnedProblem> Window::problem(Index first, Index end, End behind, const std::vector<double>& z,
                                       const Interrupt& interrupt) {
  variables_ = rows_of(variable_reach_, first, end, End::open);
  equalities_ = rows_of(equality_reach_, first, end, behind);
  inequalities_ = rows_of(inequality_reach_, first, end, behind);
  pairs_ = rows_of(pair_reach_, first, end, behind);
  const auto known = [&](Index j) { return behind == End::known || stage_[at(j)] < first; };
  OwnedProblem window;
  window.hessian_form = p_.hessian_form;
  for (const Index j : variables_.kept) window.g.push_back(p_.g[at(j)]);
  Triplets Q;
  for_entries(p_.Q, [&](Index i, Index j, double value) {
    const Index row = variables_.local[at(i)], column = variables_.local[at(j)];
    if (row >= 0 && column >= 0) Q.add(row, column, value);
    if (row >= 0 && column < 0 && known(j)) window.g[at(row)] += value * z[at(j)];
    const bool mirrored = p_.hessian_form == HessianForm::upper_triangle && i != j;
    if (mirrored && column >= 0 && row < 0 && known(i)) window.g[at(column)] += value * z[at(i)];
  });
  const auto n = static_cast<Index>(window.g.size());
  MARBLE_ASSIGN_OR_RETURN(window.Q, compress(n, n, Q, "Q"));
  for (auto& [into, m, rows, offsets, own, name] :
       {std::tuple{&window.A, &p_.A, &equalities_, p_.b, &window.b, "A"},
        std::tuple{&window.C, &p_.C, &inequalities_, p_.d, &window.d, "C"},
        std::tuple{&window.L, &p_.L, &pairs_, p_.l, &window.l, "L"},
        std::tuple{&window.R, &p_.R, &pairs_, p_.r, &window.r, "R"}}) {
    if (interrupt.requested()) return window;  // incomplete; not solved
    MARBLE_ASSIGN_OR_RETURN(*into, part(*m, *rows, z, offsets, *own, name));
  }
  return window;
}

Solution Window::part_of(const Solution& whole) const {
  Solution part;
  const auto gather = [&](const Rows& rows, std::vector<double> Solution::*values) {
    for (const Index row : rows.kept) (part.*values).push_back((whole.*values)[at(row)]);
  };
  gather(variables_, &Solution::z);
  gather(equalities_, &Solution::equality_multipliers);
  gather(inequalities_, &Solution::inequality_multipliers);
  gather(pairs_, &Solution::complementarity_multipliers_L);
  gather(pairs_, &Solution::complementarity_multipliers_R);
  return part;
}

void Window::take(const Solution& answer, Index end, Solution& whole) const {
  const auto scatter = [&](const Rows& rows, const Reach& reach, std::vector<double> Solution::*values) {
    for (std::size_t i = 0; i < rows.kept.size(); ++i) {
      const std::size_t there = at(rows.kept[i]);
      if (reach.last[there] < end) (whole.*values)[there] = (answer.*values)[i];
    }
  };
  scatter(variables_, variable_reach_, &Solution::z);
  scatter(equalities_, equality_reach_, &Solution::equality_multipliers);
  scatter(inequalities_, inequality_reach_, &Solution::inequality_multipliers);
  scatter(pairs_, pair_reach_, &Solution::complementarity_multipliers_L);
  scatter(pairs_, pair_reach_, &Solution::complementarity_multipliers_R);
}

}  // namespace marble
