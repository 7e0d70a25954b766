#include "research/relaxed_qp.h"

#include <algorithm>

#include "research/tuning.h"
#include "search/without_pairs.h"

namespace marble {

bool is_complementary(const RowLayout& layout, const Vector& rows) {
  for (Index i = 0; i < layout.pairs; ++i) {
    if (!(std::min(rows[layout.s(i)], rows[layout.t(i)]) <= tuning::zero)) return false;
  }
  return true;
}

RelaxedQp::RelaxedQp(const ScaledProblem& problem, Kkt& kkt)
    : problem_(problem),
      relaxed_(without_pairs(problem)),
      point_(relaxed_, kkt, problem),
      newton_(relaxed_, kkt, point_),
      interior_(relaxed_, kkt, problem),
      exact_(point_, newton_, interior_),
      no_rows_(relaxed_) {}

void RelaxedQp::start(ConstVectorRef z) {
  relaxed_ = problem_;
  relaxed_.layout = no_rows_.layout;
  point_.set = no_rows_;
  point_.x.all.setZero();
  point_.x.z() = z;
  has_rows_ = false;
}

bool RelaxedQp::solve(Run& run, ConstVectorRef costs) {
  relaxed_.g = problem_.g;
  add_transposed(problem_.rows, costs, relaxed_.g);
  has_rows_ = (has_rows_ && exact_.solve(run, tuning::engine_budget)) || solve_from_inside(run) ||
              solve_by_multipliers(run);
  return has_rows_;
}

// Reports no progress, because the relaxed problem has no meaning for the caller.
bool RelaxedQp::solve_from_inside(Run& run) {
  Run part = run.part(true);
  interior_.start(point_.x.z(), no_rows_);
  const bool solved = interior_.find_rows(part, part.factorizations + tuning::engine_budget, [&](int budget) {
    point_.restore(interior_.iterate(), interior_.set());
    return exact_.solve(part, budget);
  });
  run.add_part(part);
  return solved;
}

// If the rows never settle, because slack and multiplier both vanish or too many rows are held, runs the
// proximal method of multipliers from the end of the last attempt.
bool RelaxedQp::solve_by_multipliers(Run& run) {
  for (const double delta : {tuning::exact_delta, tuning::elastic_delta}) {
    point_.restore(interior_.iterate(), interior_.set());
    point_.set.clear_others(point_.x.lambda());
    newton_.center.all = point_.x.all;
    if (!newton_.converge(run, {tuning::homotopy_rho, delta}, run.factorizations + tuning::reference_budget))
      continue;
    point_.images.evaluate(relaxed_, point_.x);
    if (point_.error() <= tuning::zero * (1.0 + max_abs(point_.x.all))) return true;
  }
  return false;
}

}  // namespace marble
