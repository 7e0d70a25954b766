#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "coupled/entries.h"
#include "marble/composite/coupled.h"

namespace marble {
namespace {

// A matrix of blocks along the diagonal, its columns one after the other.
class Diagonal {
 public:
  void add(const SparseMatrixView& m, Index rows, Index columns) {
    for (Index j = 0; j < columns; ++j) {
      if (m.columns > 0) append(m, j, matrix_.rows);
      end();
    }
    matrix_.rows += rows;
  }
  void append(const SparseMatrixView& m, Index j, Index first) {
    for (Index k = m.column_pointers[at(j)]; k < m.column_pointers[at(j) + 1]; ++k) {
      matrix_.row_indices.push_back(first + m.row_indices[at(k)]);
      matrix_.values.push_back(m.values[at(k)]);
    }
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

std::vector<BlockPlace> joint_places(const CoupledView& view) {
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

OwnedProblem joint_problem(const CoupledView& view) {
  const Index coupling_begins = joint_places(view).back().equalities;
  OwnedProblem p;
  p.name = "joint";
  // Where one block gives one triangle only, so does the joint problem.
  p.hessian_form = HessianForm::upper_triangle;
  Diagonal Q, A, C, L, R;
  Index equalities = 0;
  for (const CoupledBlock& block : view.blocks) {
    const ProblemView& own = block.problem;
    const auto n = static_cast<Index>(own.g.size());
    for (Index j = 0; j < n; ++j) {
      if (own.A.columns > 0) A.append(own.A, j, equalities);
      if (block.coupling.columns > 0) A.append(block.coupling, j, coupling_begins);
      A.end();
    }
    SparseMatrix upper{n, n, {0}, {}, {}};
    for (Index j = 0; j < n; ++j) {
      for (Index k = own.Q.columns > 0 ? own.Q.column_pointers[at(j)] : 0;
           own.Q.columns > 0 && k < own.Q.column_pointers[at(j) + 1]; ++k) {
        if (own.Q.row_indices[at(k)] > j) continue;
        upper.row_indices.push_back(own.Q.row_indices[at(k)]);
        upper.values.push_back(own.Q.values[at(k)]);
      }
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
  for (const double e : view.total) p.b.push_back(-e);
  A.add_rows(static_cast<Index>(p.b.size()));
  p.Q = Q.take(), p.A = A.take(), p.C = C.take(), p.L = L.take(), p.R = R.take();
  return p;
}

Expected<void> check(const CoupledView& view) {
  const auto m = view.total.size();
  if (view.blocks.empty()) return unexpected(invalid("blocks", "must be at least one"));
  if (view.blocks.size() > kMostBlocks) {
    return unexpected(invalid("blocks", std::to_string(view.blocks.size()),
                              "must be at most " + std::to_string(kMostBlocks)));
  }
  if (m > at(kMostCouplingRows)) {
    return unexpected(invalid("total", std::to_string(m),
                              "rows tie the blocks; must be at most " + std::to_string(kMostCouplingRows)));
  }
  if (auto valid = check_numbers(view.total, m, "total"); !valid) return valid;
  std::int64_t variables = 0;
  for (std::size_t k = 0; k < view.blocks.size(); ++k) {
    const CoupledBlock& block = view.blocks[k];
    const std::string prefix = "blocks[" + std::to_string(k) + "]";
    if (auto valid = Problem::create(block.problem); !valid)
      return unexpected(inside(prefix + ".problem", valid.error()));
    variables += static_cast<std::int64_t>(block.problem.g.size());
    if (block.coupling.rows == 0 && block.coupling.columns == 0) continue;
    // As a block's equalities it is checked as they are.
    const std::vector<double> zeros(m, 0.0);
    ProblemView rows;
    rows.g = block.problem.g, rows.A = block.coupling, rows.b = zeros;
    if (auto valid = Problem::create(rows); !valid) {
      Error error = valid.error();
      if (error.field.starts_with("A")) error.field.replace(0, 1, "coupling");
      if (error.field == "b") error.field = "coupling.rows";
      return unexpected(inside(prefix, std::move(error)));
    }
  }
  if (variables > std::numeric_limits<Index>::max()) {
    return unexpected(
        invalid("blocks", std::to_string(variables),
                "variables together; must be at most " + std::to_string(std::numeric_limits<Index>::max())));
  }
  return {};
}

}  // namespace marble
