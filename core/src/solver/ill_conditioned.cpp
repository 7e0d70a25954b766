// The strategy for nearly dependent rows: dense factors solve small problems, and the message names the rows.
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "model/tuning.h"
#include "path/termination.h"
#include "search/dense_search.h"
#include "search/parallel_rows.h"
#include "solver/strategy.h"

namespace marble {

// Takes the point of the interior point method for a convex QP if the method has converged, but no choice of
// rows reproduces its point.
bool Strategy::take_interior(Run& run) {
  if (run.interrupted() || !(branch_.interior.kappa() > 0.0) ||
      !(branch_.interior.kappa() <= tuning::rounding) || !optimality_.convex(run) ||
      !branch_.exact.take_interior(branch_.interior))
    return false;
  const BranchPoint& point = branch_.point;
  incumbent_.offer(point.x, point.images, point.set, "interior point");
  return incumbent_.exists();
}

// Used if the other engines have failed, or if their point has not converged to rounding while rows are
// nearly parallel. All other solutions stay unchanged.
Strategy::Answer Strategy::solve_densely(Run& run, Answer answer) {
  const Status status = answer.ending.status;
  const bool by_path = answer.x == &path_point_.x;
  const bool failed = status == Status::locally_infeasible || status == Status::numerical_failure ||
                      status == Status::almost_solved;
  const bool is_unproved =
      problem_.pairs() > 0 && is_small(run) && !answer.tree.proved && !answer.stayed_warm;
  const bool is_loose = status == Status::solved && (by_path || is_unproved || incumbent_is_loose());
  const bool out_of_steps = status == Status::iteration_limit && problem_.pairs() == 0;
  if (!failed && !is_loose && !out_of_steps) return answer;
  if (!options_.polish || options_.path != Path::fast || run.nonconvex) return answer;
  if (is_loose && !DenseSearch::fits(problem_)) return answer;
  const std::optional<ParallelRows> parallel = nearly_parallel_rows(problem_);
  const bool few_pairs = problem_.pairs() <= tuning::small_pairs;
  if (DenseSearch::fits(problem_) && (parallel || (failed && few_pairs))) {
    const Run::Searching searching(run);
    const Run::Polishing polishing(run);
    if (std::optional<Answer> found =
            is_loose ? solve_branch_densely(run, answer) : search_densely(run, answer))
      return *std::move(found);
  }
  if (!is_loose && parallel) answer.ending.detail += "; " + describe(problem_, *parallel);
  return answer;
}

// True if its residual is not known to rounding, or multipliers are so large that their signs are not.
bool Strategy::incumbent_is_loose() const {
  const ExactSolution& best = incumbent_.best();
  return !best.converged || tuning::exactness * max_abs(best.x.all) > tuning::near;
}

std::optional<Strategy::Answer> Strategy::search_densely(Run& run, const Answer& answer) {
  if (run.interrupted()) return std::nullopt;
  incumbent_.clear();
  DenseSearch(problem_, incumbent_).search(run);
  if (!incumbent_.exists()) return std::nullopt;
  Answer found = finish_exact(run);
  found.stayed_warm = answer.stayed_warm;
  return found;
}

// Solves the branch of the solution, and the other branches of a small problem. Keeps the solution if the
// result is the same point.
std::optional<Strategy::Answer> Strategy::solve_branch_densely(Run& run, const Answer& answer) {
  if (run.interrupted()) return std::nullopt;
  std::optional<ExactSolution> kept;
  if (incumbent_.exists()) kept = incumbent_.best();
  const Vector z = answer.x->z();
  WorkingSet set(problem_);
  if (answer.x == &path_point_.x) {
    branch_.point.start_from_path(path_point_.x);
    set = branch_.point.set;
  } else {
    set = incumbent_.best().set;
  }
  incumbent_.clear();
  DenseSearch search(problem_, incumbent_);
  search.solve_branch(run, set);
  if (problem_.pairs() > 0) search.search(run);
  if (incumbent_.exists() && max_abs(incumbent_.best().x.z() - z) > tuning::exactness * (1.0 + max_abs(z))) {
    Answer found = finish_exact(run);
    found.stayed_warm = answer.stayed_warm;
    return found;
  }
  incumbent_.clear();
  if (kept) incumbent_.replace(*kept);
  return std::nullopt;
}

}  // namespace marble
