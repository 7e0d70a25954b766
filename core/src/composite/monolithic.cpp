#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "marble/composite/coupled.h"
#include "model/check_matrix.h"
#include "model/column_builder.h"
#include "model/entries.h"

namespace marble {
namespace {

// Adds a block on the diagonal.
void add_block(const SparseMatrixView& m, Index rows, Index columns, ColumnBuilder& to) {
  for (Index j = 0; j < columns; ++j) {
    to.add_column(m, j, to.rows());
    to.end_column();
  }
  to.add_rows(rows);
}

void append(std::span<const double> values, std::vector<double>& to) {
  to.insert(to.end(), values.begin(), values.end());
}

}  // namespace

std::vector<BlockPlace> monolithic_places(const CoupledView& view) {
  std::vector<BlockPlace> places(1);
  for (const CoupledBlock& block : view.blocks) {
    const BlockPlace& last = places.back();
    places.push_back({last.variables + static_cast<Index>(block.problem.g.size()),
                      last.equalities + static_cast<Index>(block.problem.b.size()),
                      last.inequalities + static_cast<Index>(block.problem.d.size()),
                      last.pairs + static_cast<Index>(block.problem.l.size())});
  }
  return places;
}

OwnedProblem monolithic_problem(const CoupledView& view) {
  const Index coupling_begins = monolithic_places(view).back().equalities;
  OwnedProblem p;
  p.name = "monolithic";
  // If one block gives only one triangle, the monolithic problem does so too.
  p.hessian_form = HessianForm::upper_triangle;
  ColumnBuilder Q, A, C, L, R;
  Index equalities = 0;
  for (const CoupledBlock& block : view.blocks) {
    const ProblemView& own = block.problem;
    const auto n = static_cast<Index>(own.g.size());
    for (Index j = 0; j < n; ++j) {
      A.add_column(own.A, j, equalities);
      A.add_column(block.coupling, j, coupling_begins);
      A.end_column();
      for_column(own.Q, j, [&](Index row, double value) {
        if (row <= j) Q.add(Q.rows() + row, value);
      });
      Q.end_column();
    }
    Q.add_rows(n);
    add_block(own.C, static_cast<Index>(own.d.size()), n, C);
    add_block(own.L, static_cast<Index>(own.l.size()), n, L);
    add_block(own.R, static_cast<Index>(own.r.size()), n, R);
    equalities += static_cast<Index>(own.b.size());
    p.c0 += own.c0;
    append(own.g, p.g), append(own.b, p.b), append(own.d, p.d), append(own.l, p.l), append(own.r, p.r);
  }
  for (const double e : view.coupling_rhs) p.b.push_back(-e);
  A.add_rows(static_cast<Index>(p.b.size()));
  p.Q = Q.take(), p.A = A.take(), p.C = C.take(), p.L = L.take(), p.R = R.take();
  return p;
}

Expected<void> check(const CoupledView& view) {
  const auto m = view.coupling_rhs.size();
  if (view.blocks.empty()) return unexpected(invalid("blocks", "must be at least one"));
  if (view.blocks.size() > kMostBlocks) {
    return unexpected(invalid("blocks", std::to_string(view.blocks.size()),
                              "must be at most " + std::to_string(kMostBlocks)));
  }
  if (m > at(kMostCouplingRows)) {
    return unexpected(invalid("coupling_rhs", std::to_string(m),
                              "rows tie the blocks; must be at most " + std::to_string(kMostCouplingRows)));
  }
  MARBLE_RETURN_IF_ERROR(check_numbers(view.coupling_rhs, m, "coupling_rhs"));
  std::int64_t variables = 0;
  for (std::size_t k = 0; k < view.blocks.size(); ++k) {
    const CoupledBlock& block = view.blocks[k];
    const std::string prefix = "blocks[" + std::to_string(k) + "]";
    if (auto valid = Problem::create(block.problem); !valid)
      return unexpected(inside(prefix + ".problem", valid.error()));
    variables += static_cast<std::int64_t>(block.problem.g.size());
    if (auto valid = check_matrix(block.coupling, "coupling", m, block.problem.g.size(),
                                  "entries of coupling_rhs", MayBeEmpty::always);
        !valid)
      return unexpected(inside(prefix, valid.error()));
  }
  if (variables > std::numeric_limits<Index>::max()) {
    return unexpected(
        invalid("blocks", std::to_string(variables),
                "variables together; must be at most " + std::to_string(std::numeric_limits<Index>::max())));
  }
  return {};
}

}  // namespace marble
