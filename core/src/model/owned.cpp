#include "marble/owned.h"

namespace marble {

SparseMatrix owned(const SparseMatrixView& view) {
  return {view.rows,
          view.columns,
          {view.column_pointers.begin(), view.column_pointers.end()},
          {view.row_indices.begin(), view.row_indices.end()},
          {view.values.begin(), view.values.end()}};
}

OwnedProblem owned(const ProblemView& view) {
  OwnedProblem problem;
  problem.hessian_form = view.hessian_form;
  problem.c0 = view.c0;
#define MARBLE_VECTOR(letter, field) problem.letter.assign(view.letter.begin(), view.letter.end());
#define MARBLE_MATRIX(letter, field, update, vector) problem.letter = owned(view.letter);
#include "marble/contract.def"
  return problem;
}

}  // namespace marble
