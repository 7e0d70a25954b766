// A cold solve as a table of stages: from the path to the best exact solution of a branch.
#include <utility>

#include "global/pair_newton.h"
#include "horizon/segments.h"
#include "model/text_of.h"
#include "model/tuning.h"
#include "path/certificate.h"
#include "solver/strategy.h"

namespace marble {

// Each stage adds to what the earlier ones have found. In their order, with what limits each of them beside
// the time and max_iterations.
const std::array<Strategy::ColdStage, 8> Strategy::kColdStages = {{
    {&Strategy::has_no_pairs, &Strategy::solve_without_pairs},    // tuning::engine_budget
    {&Strategy::always, &Strategy::follow_path_to_branch},        // tuning::engine_budget for the branch
    {&Strategy::starts_search, &Strategy::search_in_segments},    // max_local_search_factorizations
    {&Strategy::has_branch, &Strategy::search_near_branch},       // the same
    {&Strategy::lacks_branch, &Strategy::find_branch},            // twice the same
    {&Strategy::searches, &Strategy::search_elsewhere},           // at most as much as all before it
    {&Strategy::lacks_solution, &Strategy::follow_rest_of_path},  // max_iterations alone
    {&Strategy::is_at_end_of_path, &Strategy::solve_branch_at_end_of_path},  // tuning::engine_budget
}};

// Returns how the path ended, or nothing if an exact solution was found before its end. Begins at the stage
// at which the last run was interrupted, and records its own.
std::optional<Ending> Strategy::solve_cold(Run& run, ConstVectorRef initial_z, Stage from) {
  Cold cold{.initial_z = initial_z, .from = from};
  for (const ColdStage& stage : kColdStages) {
    if ((this->*stage.applies)(cold) && (this->*stage.run)(run, cold)) break;
  }
  return std::move(cold.end);
}

bool Strategy::has_no_pairs(const Cold& cold) const {
  return problem_.pairs() == 0 && options_.polish && options_.path == Path::fast &&
         cold.from <= Stage::quadratic;
}

bool Strategy::searches(const Cold& cold) const { return options_.polish && cold.from != Stage::end_of_path; }

bool Strategy::starts_search(const Cold& cold) const { return options_.polish && cold.from <= Stage::path; }

bool Strategy::has_branch(const Cold& cold) const {
  return searches(cold) && !cold.searched && cold.branch == PathBranch::exact;
}

bool Strategy::lacks_branch(const Cold& cold) const {
  return searches(cold) && !cold.searched && cold.branch != PathBranch::exact && options_.path == Path::fast;
}

bool Strategy::lacks_solution(const Cold& cold) const {
  const bool exact = incumbent_.exists() && cold.branch != PathBranch::path_is_lower;
  return !searches(cold) || !(exact || (cold.end && is_solved(cold.end->status)));
}

bool Strategy::solve_without_pairs(Run& run, Cold& cold) {
  if (cold.from == Stage::quadratic) {
    branch_.interior.resume();
  } else {
    branch_.interior.start(cold.initial_z, branch_.point.set);
  }
  {
    const PhaseScope phase(run.activity(), Phase::path);
    if (incumbent_.solve_branch(run, branch_.interior) || take_interior(run)) return true;
  }
  if (looks_for_contradiction_ &&
      ContradictionScreen(problem_).suggests_infeasible(problem_, branch_.interior.iterate())) {
    cold.end = prove_early(run, branch_.interior.iterate());
  }
  cold.interior_interrupted = run.interrupted().has_value();
  return cold.end.has_value();
}

// Follows the path to a κ that shows the branch, and solves that branch exactly.
bool Strategy::follow_path_to_branch(Run& run, Cold& cold) {
  if (cold.from == Stage::path || cold.from == Stage::end_of_path) {
    path_.resume();
  } else {
    path_.start(cold.interior_interrupted ? ConstVectorRef(branch_.interior.iterate().z()) : cold.initial_z);
  }
  if (cold.from > Stage::path) return false;
  for (const double kappa : {tuning::branch_kappa, tuning::last_kappa}) {
    cold.end = follow_path(run, kappa);
    if (cold.end && (ended_by_force(cold.end->status) || is_proof(cold.end->status))) break;
    if (options_.polish) cold.branch = solve_path_branch(run, options_.path == Path::fast);
    if (cold.end || path_.is_lost() || cold.branch == PathBranch::exact) break;
  }
  if (!cold.end) return false;
  if (ended_by_force(cold.end->status)) stage_ = cold.interior_interrupted ? Stage::quadratic : Stage::path;
  return ended_by_force(cold.end->status) || is_proof(cold.end->status);
}

bool Strategy::search_in_segments(Run& run, Cold& cold) {
  if (start_in_segments(run, cold.branch)) {
    cold.searched = true;
    stage_ = Stage::beginning;
    cold.path_borrowed = problem_.pairs() < tuning::segmented_alone;
    if (cold.path_borrowed) search_.search_beside_segments(run, cold.initial_z);
  } else if (may_have_segments(problem_) && run.interrupted() && !incumbent_.exists()) {
    cold.searched = true;
    stage_ = Stage::path;
  }
  return false;
}

bool Strategy::search_near_branch(Run& run, Cold& cold) {
  cold.path_borrowed = search_.improve(run, cold.initial_z);
  return false;
}

bool Strategy::find_branch(Run& run, Cold& cold) {
  stage_ = cold.from <= Stage::path ? Stage::beginning : cold.from;
  cold.path_borrowed = search_.find(run, cold.initial_z, stage_);
  return false;
}

// From other starting points, which end in other basins.
bool Strategy::search_elsewhere(Run& run, Cold& cold) {
  search_.repeat_soft_start(run, cold.path_borrowed);
  show_incumbent(run);
  if (cold.path_borrowed) search_.from_penalties(run, cold.initial_z);
  return false;
}

bool Strategy::follow_rest_of_path(Run& run, Cold& cold) {
  cold.at_end_of_path = true;
  if (!cold.end) {
    if (cold.path_borrowed) path_.start(cold.initial_z);
    cold.end = follow_path(run, options_.kappa_min);
    if (ended_by_force(cold.end->status) && stage_ == Stage::beginning) stage_ = Stage::end_of_path;
  }
  return ended_by_force(cold.end->status) || stage_ != Stage::beginning;
}

// The fast path relies on a polish. If it fails without one, a branch is better than no solution.
bool Strategy::solve_branch_at_end_of_path(Run& run, Cold& cold) {
  if (options_.polish) {
    static_cast<void>(solve_path_branch(run, false));
  } else if (options_.path == Path::fast && !is_solved(cold.end->status) && !is_proof(cold.end->status)) {
    if (solve_path_branch(run, true) == PathBranch::not_exact)
      static_cast<void>(search_.find(run, cold.initial_z));
  }
  return true;
}

// If the path seems to end in a proof, it ends so only if the proof is found.
std::optional<Ending> Strategy::follow_path(Run& run, double kappa_end) {
  const PhaseScope phase(run.activity(), Phase::path);
  std::optional<Ending> end = path_.follow(run, kappa_end);
  if (path_.suspects_contradiction()) {
    if (std::optional<Ending> proved = prove_early(run, path_.iterate())) return proved;
    end = path_.follow(run, kappa_end);
  }
  const Iterate& x = end ? path_.iterate() : path_.best();
  const Violations& violations = end ? path_.violations_at() : path_.best_violations();
  // A path that was restarted and cut short may be worse than the point of the first one.
  const bool cut_short = end && ended_by_force(end->status);
  if (cut_short && largest(path_point_.violations) < largest(violations)) return end;
  path_point_.x.all = x.all;
  path_point_.violations = violations;
  path_point_.objective = end ? path_.objective() : path_.best_objective();
  if (!end || !is_proof(end->status)) return end;
  if (std::optional<Ending> proved = prove(run, end->status)) return proved;
  return Ending{Status::numerical_failure, "no acceptable step; " + describe(violations), {}};
}

Strategy::PathBranch Strategy::solve_path_branch(Run& run, bool exchanges_pairs) {
  const Run::Polishing polishing(run);
  const double objective = path_.objective();
  const auto solve = [&](const char* origin) {
    return incumbent_.solve_branch(run, origin, tuning::engine_budget) != Incumbent::Outcome::not_exact;
  };
  branch_.point.start_from_path(path_.iterate());
  bool exact = solve("path");
  if (!exact && exchanges_pairs && pair_newton_applies(problem_)) {
    branch_.point.start_from_path(path_.iterate());
    exact = pair_newton(run, problem_, branch_.point) && solve("path, Newton's method on the pairs");
  }
  if (!exact) return PathBranch::not_exact;
  show_incumbent(run);
  return path_is_lower(path_.feasible(), objective) ? PathBranch::path_is_lower : PathBranch::exact;
}

}  // namespace marble
