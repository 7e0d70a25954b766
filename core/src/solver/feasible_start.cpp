// The strategy's guarantee for a feasible start: no solution is infeasible, or above the start.
#include <algorithm>
#include <cmath>
#include <utility>

#include "horizon/segments.h"
#include "model/text_of.h"
#include "model/tuning.h"
#include "path/termination.h"
#include "search/dense_search.h"
#include "solver/strategy.h"

namespace marble {

// Takes z as the start if it is feasible.
bool Strategy::take_start(ConstVectorRef z) {
  if (problem_.pairs() == 0 || !options_.polish || options_.path != Path::fast) return false;
  BranchPoint& point = branch_.point;
  point.set = WorkingSet(problem_);
  point.start_from_point(z);
  const Violations at_start = violations(problem_, point.images);
  if (!within_tolerances(at_start, options_)) return false;
  start_.emplace(problem_);
  start_->x.all = point.x.all;
  start_->set = point.set;
  start_->objective = point.images.objective;
  start_->violations = at_start;
  start_->origin = "start";
  start_is_exact_ = false;
  return true;
}

// Replaces the start by the exact solution of its branch, if it has one.
void Strategy::solve_branch_of_start(Run& run) {
  using Outcome = Incumbent::Outcome;
  const Run::Searching searching(run);
  const Run::Polishing polishing(run);
  branch_.point.restore(start_->x, start_->set);
  Outcome outcome = incumbent_.solve_branch(run, "start", tuning::engine_budget);
  if (outcome == Outcome::not_exact && !incumbent_.exists() && DenseSearch::fits(problem_)) {
    DenseSearch(problem_, incumbent_).solve_branch(run, start_->set);
    if (incumbent_.exists()) outcome = Outcome::kept;
  }
  if (outcome == Outcome::not_exact) {
    QuadraticEngine engine(problem_, kkt_);
    engine.start(start_->x.z(), start_->set);
    if (incumbent_.solve_branch(run, engine)) outcome = Outcome::kept;
  }
  if (outcome == Outcome::not_exact) return;
  const ExactSolution& exact = outcome == Outcome::kept ? incumbent_.best() : incumbent_.other();
  if (exact.objective > start_->objective + loss_to_violations(exact) + noise_of_start()) return;
  start_is_exact_ = true;
  *start_ = exact;
}

// The exact solution x of a convex branch is above a point z that violates its rows by no more than
// f(x) − f(z) ≤ −∇f(x)ᵀ(z − x) ≤ Σ |multiplier · violation|.
double Strategy::loss_to_violations(const ExactSolution& exact) const {
  Images at_start(problem_);
  at_start.evaluate(problem_, start_->x);
  double loss = at_start.equality.cwiseAbs().dot(exact.x.y().cwiseAbs());
  for (Index row = 0; row < problem_.layout.size(); ++row) {
    const double value = at_start.rows.all[row];
    loss +=
        std::abs(exact.x.lambda()[row]) * (exact.set.is_fixed(row) ? std::abs(value) : std::max(0.0, -value));
  }
  return loss;
}

double Strategy::noise_of_start() const { return tuning::exactness * (1.0 + std::abs(start_->objective)); }

// Solves the branch of the start before anything else, so that there is a solution however the run ends.
void Strategy::solve_start(Run& run) {
  incumbent_.clear();
  if (run.interrupted()) return;
  solve_branch_of_start(run);
  run.add_incumbent(problem_.user_objective(start_->objective));
}

// A step of a sequence with a feasible start, which was taken, such as a roll-out, needs no cold start: the
// branch of the last solution or that of the start has a solution that is not above the start, and a better
// one may be a few switches away. Returns nothing if neither branch has an exact solution.
std::optional<Strategy::Answer> Strategy::step_from_start(Run& run, ConstVectorRef z,
                                                          const WarmStart& warm_start) {
  incumbent_.clear();
  search_.begin(z);
  const auto is_found = [this] {
    return incumbent_.exists() && incumbent_.best().objective <= start_->objective + noise_of_start();
  };
  const bool small_change =
      search_.take_branch_of(run, *warm_start.solution, tuning::warm_tiny_change) && is_found();
  if (!small_change) {
    if (run.interrupted()) return std::nullopt;
    solve_branch_of_start(run);
    if (!is_found()) return std::nullopt;
    search_.search_near(run, z);
  }
  Answer answer = finish_exact(run, run.factorizations + tuning::warm_small_change);
  answer.stayed_warm = true;
  return answer;
}

// If the start's branch is lower than the solution found, searches around it and returns the result.
Strategy::Answer Strategy::not_above_start(Run& run, Answer answer, ConstVectorRef z, bool warm) {
  const Status status = answer.ending.status;
  if (status == Status::unbounded) return answer;
  Images images(problem_);
  images.evaluate(problem_, *answer.x);
  const bool feasible = within_tolerances(violations(problem_, images), options_);
  const bool ended = is_solved(status) || ended_by_force(status);
  if (ended && feasible && images.objective <= start_->objective + noise_of_start()) return answer;
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
  if (take_start(kept)) solve_start(run);
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
  if (stays_a_start && take_start(x.z())) solve_start(run);
  return incumbent_.exists() && outcome != Incumbent::Outcome::no_better;
}

}  // namespace marble
