#include "proof/row_problem.h"

#include "model/tuning.h"

namespace marble {

void append_row(const RowMatrix& from, Index row, RowMatrix& to) {
  const auto begin = static_cast<std::ptrdiff_t>(from.row_pointers[row]);
  const auto end = static_cast<std::ptrdiff_t>(from.row_pointers[row + 1]);
  to.column_indices.insert(to.column_indices.end(), from.column_indices.begin() + begin,
                           from.column_indices.begin() + end);
  to.values.insert(to.values.end(), from.values.begin() + begin, from.values.begin() + end);
  to.row_pointers.push_back(static_cast<Index>(to.values.size()));
  ++to.rows;
}

void append_rows(const RowMatrix& from, RowMatrix& to) {
  for (Index row = 0; row < from.rows; ++row) append_row(from, row, to);
}

SymmetricMatrix identity(Index size) {
  SymmetricMatrix matrix;
  matrix.size = size;
  matrix.column_pointers.reserve(static_cast<std::size_t>(size) + 1);
  for (Index j = 0; j < size; ++j) {
    matrix.row_indices.push_back(j);
    matrix.values.push_back(1.0);
    matrix.column_pointers.push_back(j + 1);
  }
  return matrix;
}

ScaledProblem empty_problem(Index variables) {
  ScaledProblem p;
  p.Q.size = variables;
  p.Q.column_pointers.assign(static_cast<std::size_t>(variables) + 1, 0);
  p.g = Vector::Zero(variables);
  p.A.columns = p.rows.columns = variables;
  return p;
}

namespace {

double problem_bytes(const ScaledProblem& problem) {
  const auto entries = static_cast<double>(problem.A.values.size() + problem.rows.values.size());
  const double vectors =
      tuning::memory_iterates * (problem.variables() + problem.equalities() + problem.layout.size());
  return entries * (sizeof(double) + sizeof(Index)) + vectors * sizeof(double);
}

}  // namespace

std::unique_ptr<Kkt> make_system(const ScaledProblem& problem, const Run& run) {
  KktCost least;
  return make_kkt(problem, {run.bytes_left - problem_bytes(problem), KktCost{}.flops}, run.interrupt(),
                  least);
}

double system_bytes(const ScaledProblem& problem, const Kkt& kkt) {
  return problem_bytes(problem) + kkt.bytes();
}

}  // namespace marble
