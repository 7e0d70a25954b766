#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "marble/composite/coupled.h"
#include "model/check_matrix.h"
#include "model/entries.h"

namespace marble {
namespace {

// A matrix with blocks along the diagonal, built column by column.
class Diagonal {
 public:
  void add(const SparseMatrixView& m, Index rows, Index columns) {
    for (Index j = 0; j < columns; ++j) {
      append(m, j, matrix_.rows);
      end();
    }
    matrix_.rows += rows;
  }
  void append(const SparseMatrixView& m, Index j, Index first) {
    for_column(m, j, [&](Index row, double value) {
      matrix_.row_indices.push_back(first + row);
      matrix_.values.push_back(value);
    });
  }
  void end() {
    ++matrix_.columns;
    matrix_.column_pointers.push_back(static_cast<Index>(matrix_.values.size()));
  }
  void add_rows(Index rows) { matrix_.rows += rows; }
  [[nodiscard]] SparseMatrix take() { return matrix_.rows == 0 ? SparseMatrix{} : std::move(matrix_); }

 private:
  SparseMatrix matrix_{0, 0, {0}, {}, {}};
};

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
  Diagonal Q, A, C, L, R;
  Index equalities = 0;
  for (const CoupledBlock& block : view.blocks) {
    const ProblemView& own = block.problem;
    const auto n = static_cast<Index>(own.g.size());
    for (Index j = 0; j < n; ++j) {
      A.append(own.A, j, equalities);
      A.append(block.coupling, j, coupling_begins);
      A.end();
    }
    SparseMatrix upper{n, n, {0}, {}, {}};
    for (Index j = 0; j < n; ++j) {
      for_column(own.Q, j, [&](Index row, double value) {
        if (row > j) return;
        upper.row_indices.push_back(row);
        upper.values.push_back(value);
      });
      upper.column_pointers.push_back(static_cast<Index>(upper.values.size()));
    }
    Q.add(upper.view(), n, n);
    C.add(own.C, static_cast<Index>(own.d.size()), n);
    L.add(own.L, static_cast<Index>(own.l.size()), n);
    R.add(own.R, static_cast<Index>(own.r.size()), n);
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
