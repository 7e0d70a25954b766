// The strategy's guarantee for a feasible start: no solution is infeasible, or above the start.
#include <cmath>
#include <utility>

#include "horizon/segments.h"
#include "model/text_of.h"
#include "model/tuning.h"
#include "path/termination.h"
#include "search/dense_search.h"
#include "solver/strategy.h"

namespace marble {

// Solves the branch of a feasible start before anything else, so that there is a solution however the run
// ends.
void Strategy::solve_start(Run& run, ConstVectorRef z) {
  if (problem_.pairs() == 0 || !options_.polish || options_.path != Path::fast) return;
  const bool ended = run.interrupted().has_value();
  const Run::Searching searching(run);
  const Run::Polishing polishing(run);
  BranchPoint& point = branch_.point;
  point.set = WorkingSet(problem_);
  point.start_from_point(z);
  const Violations at_start = violations(problem_, point.images);
  if (!within_tolerances(at_start, options_)) return;
  start_.emplace(problem_);
  start_->x.all = point.x.all;
  start_->set = point.set;
  start_->objective = point.images.objective;
  start_->violations = at_start;
  start_->origin = "start";
  incumbent_.clear();
  start_is_exact_ = false;
  if (ended) return;
  if (incumbent_.solve_branch(run, "start", tuning::engine_budget) != Incumbent::Outcome::kept) {
    QuadraticEngine engine(problem_, kkt_);
    engine.start(start_->x.z(), start_->set);
    static_cast<void>(incumbent_.solve_branch(run, engine));
  }
  if (!incumbent_.exists() && DenseSearch::fits(problem_))
    DenseSearch(problem_, incumbent_).solve_branch(run, start_->set);
  start_is_exact_ = incumbent_.exists() && incumbent_.best().objective <= start_->objective;
  if (start_is_exact_) *start_ = incumbent_.best();
  run.add_incumbent(problem_.user_objective(start_->objective));
}

// If the start's branch is lower than the solution found, searches around it and returns the result.
Strategy::Answer Strategy::not_above_start(Run& run, Answer answer, ConstVectorRef z, bool warm) {
  const Status status = answer.ending.status;
  if (status == Status::unbounded) return answer;
  Images images(problem_);
  images.evaluate(problem_, *answer.x);
  const bool feasible = within_tolerances(violations(problem_, images), options_);
  // The start's branch, solved again from elsewhere, has the same objective up to exactness.
  const double noise =
      (start_is_exact_ ? tuning::exactness : tuning::rounding) * (1.0 + std::abs(start_->objective));
  const bool ended = is_solved(status) || ended_by_force(status);
  if (ended && feasible && images.objective <= start_->objective + noise) return answer;
  if (ended_by_force(status))
    return {{status, "stopped early; the start's branch; " + describe(start_->violations), {}}, &start_->x};
  incumbent_.clear();
  if (start_is_exact_) {
    ExactSolution solution = *start_;
    incumbent_.replace(solution);
    static_cast<void>(search_.improve(run, z));
    return finish_cold(run, !warm);
  }
  path_point_.x.all = start_->x.all;
  path_point_.violations = start_->violations;
  path_point_.objective = start_->objective;
  Optimality::Descended descended = optimality_.descend(run, start_->x, start_->set, Vector());
  if (descended.unbounded) return {unbounded_along(*std::move(descended.unbounded)), &path_point_.x};
  if (incumbent_.exists()) return finish_cold(run, !warm);
  return {{Status::numerical_failure,
           "the start is feasible, and nothing lower was found; " + describe(start_->violations),
           {}},
          &path_point_.x};
}

Strategy::Judged Strategy::judged(ConstVectorRef z) const {
  Iterate x(problem_);
  x.z() = z;
  Images images(problem_);
  images.evaluate(problem_, x);
  return {within_tolerances(violations(problem_, images), options_), images.objective};
}

// The same for a feasible warm start that was abandoned and is lower than the solution found elsewhere.
Strategy::Answer Strategy::not_above_warm_start(Run& run, Answer answer, ConstVectorRef z) {
  if (answer.ending.status == Status::unbounded) return answer;
  const auto [start_is_feasible, start] = judged(z);
  if (!start_is_feasible) return answer;
  const auto [is_feasible, objective] = judged(answer.x->z());
  if (is_feasible && objective <= start + tuning::rounding * (1.0 + std::abs(start))) return answer;
  path_point_.x.all = answer.x->all;  // the solution may be the incumbent, which the start's branch replaces
  answer.x = &path_point_.x;
  const Vector kept = z;
  solve_start(run, kept);
  return start_ ? not_above_start(run, std::move(answer), kept, true) : answer;
}

// If a problem is long, and a better branch is more than a few switches away from the path's: solves the
// segments one after the other and takes their branch. If that cannot be solved exactly, their point is a
// feasible start.
bool Strategy::start_in_segments(Run& run, PathBranch branch) {
  if (!may_have_segments(problem_) || options_.path != Path::fast ||
      options_.max_local_search_factorizations == 0)
    return false;
  if (branch == PathBranch::exact &&
      LocalSearch::pulling(incumbent_.best().x, incumbent_.best().set) < tuning::many_pulling)
    return false;
  const Run::Searching searching(run);
  const Run::Polishing polishing(run);
  const std::optional<Solution> swept = solve_in_segments(problem_, options_, run, tree_bytes_);
  if (!swept) return false;
  Iterate x(problem_);
  take(problem_, *swept, x);
  branch_.point.start_from_solution(x);
  const Incumbent::Outcome outcome = incumbent_.solve_branch(run, "segments", tuning::engine_budget);
  const bool stays_a_start = outcome == Incumbent::Outcome::not_exact && !start_ && !incumbent_.exists();
  if (stays_a_start) solve_start(run, x.z());
  return incumbent_.exists() && outcome != Incumbent::Outcome::no_better;
}

}  // namespace marble
