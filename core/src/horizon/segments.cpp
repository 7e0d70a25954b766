#include "horizon/segments.h"

#include <algorithm>
#include <cmath>

#include "horizon/stages.h"
#include "horizon/sweep.h"
#include "model/tuning.h"

namespace marble {
namespace {

SparseMatrix compressed(const RowMatrix& matrix, Index first, Index end, ConstVectorRef row_scale,
                        ConstVectorRef variable_scale) {
  Triplets entries;
  for (Index row = first; row < end; ++row) {
    for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k) {
      const Index j = matrix.column_indices[k];
      entries.add(row - first, j, matrix.values[k] / (row_scale[row] * variable_scale[j]));
    }
  }
  return compress(end - first, static_cast<Index>(variable_scale.size()), entries, "").value();
}

std::vector<double> unscaled(const Vector& values, const Vector& scale, Index first, Index end) {
  std::vector<double> result;
  for (Index i = first; i < end; ++i) result.push_back(values[i] / scale[i]);
  return result;
}

// Returns the problem in the user's units, so that the same tolerances decide what is solved.
OwnedProblem user_problem(const ScaledProblem& p) {
  const Vector& D = p.variable_scale;
  OwnedProblem user;
  user.hessian_form = HessianForm::upper_triangle;
  Triplets Q;
  for (Index j = 0; j < p.Q.size; ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      const Index i = p.Q.row_indices[k];
      Q.add(i, j, p.Q.values[k] / (p.cost_scale * D[i] * D[j]));
    }
  }
  user.Q = compress(p.variables(), p.variables(), Q, "").value();
  user.g = unscaled(p.g, p.cost_scale * D, 0, p.variables());
  user.A = compressed(p.A, 0, p.equalities(), p.equality_scale, D);
  user.b = unscaled(p.b, p.equality_scale, 0, p.equalities());
  const Index s = p.layout.s(0), t = p.layout.t(0), end = p.layout.size();
  user.C = compressed(p.rows, 0, s, p.row_scale, D);
  user.d = unscaled(p.offset, p.row_scale, 0, s);
  user.L = compressed(p.rows, s, t, p.row_scale, D);
  user.l = unscaled(p.offset, p.row_scale, s, t);
  user.R = compressed(p.rows, t, end, p.row_scale, D);
  user.r = unscaled(p.offset, p.row_scale, t, end);
  user.c0 = p.c0;
  return user;
}

// Returns the ends of segments of equal length.
std::vector<Index> segment_ends(const ScaledProblem& p, const Stages& stages) {
  const std::int64_t segments =
      std::min<std::int64_t>(std::lround(p.pairs() / tuning::segment_pairs), stages.count);
  std::vector<Index> ends;
  for (std::int64_t k = 1; k <= segments; ++k)
    ends.push_back(static_cast<Index>(k * stages.count / segments));
  return ends;
}

// Estimates the bytes of the copy of the problem and of making it.
double copy_bytes(const ScaledProblem& p) {
  const double entries = static_cast<double>(p.Q.values.size() + p.A.values.size() + p.rows.values.size());
  return tuning::coupled_cut_copies * entries * (sizeof(double) + sizeof(Index));
}

}  // namespace

bool may_have_segments(const ScaledProblem& problem) { return problem.pairs() >= tuning::segmented_pairs; }

std::optional<Solution> solve_in_segments(const ScaledProblem& problem, const Options& options, Run& run,
                                          double most_bytes) {
  const double left = most_bytes - copy_bytes(problem);
  if (left <= 0.0 || run.interrupted()) return std::nullopt;
  const std::optional<Stages> stages = find_stages(problem, run.interrupt());
  if (!stages) return std::nullopt;
  const std::vector<Index> ends = segment_ends(problem, *stages);
  const OwnedProblem user = user_problem(problem);
  const auto checked = Problem::create(user.view());
  if (!checked) return std::nullopt;
  Options own = options;
  own.num_starts = 1;
  own.global_search = false;
  own.max_feasibility_factorizations = 0;
  run.set_done(Phase::local_search, 0, std::ssize(ends));
  const auto swept = sweep(
      *checked, {.stage_of_variable = stages->of_variable, .ends = ends, .passes = tuning::sweep_passes}, own,
      run.controls_beside(), {.most_bytes = static_cast<std::int64_t>(left)});
  if (!swept) return std::nullopt;
  run.factorizations += swept->factorizations;
  run.times.factorization_s += swept->times.factorization_s;
  run.times.line_search_s += swept->times.line_search_s;
  if (!is_solved(swept->status)) return std::nullopt;
  return *swept;
}

}  // namespace marble
