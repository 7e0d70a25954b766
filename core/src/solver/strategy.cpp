#include "solver/strategy.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "global/pair_newton.h"
#include "horizon/segments.h"
#include "model/text_of.h"
#include "model/tuning.h"
#include "path/certificate.h"
#include "search/multistart.h"

namespace marble {

Strategy::Strategy(const ScaledProblem& problem, Kkt& kkt, const Options& options,
                   const ReferenceMethods* methods)
    : problem_(problem),
      options_(options),
      methods_(methods),
      kkt_(kkt),
      path_(problem, kkt, options),
      branch_(problem, kkt),
      incumbent_(problem, options, branch_.exact),
      search_(problem, kkt, options, path_, branch_, incumbent_),
      optimality_(problem, kkt, options, branch_.point, incumbent_),
      path_point_(problem) {}

Strategy::Answer Strategy::run(Run& run, ConstVectorRef initial_z, const std::optional<WarmStart>& warm_start,
                               How how) {
  const Stage last = std::exchange(stage_, Stage::beginning);
  if (options_.method != Method::marble)
    return run_reference(run, warm_start ? ConstVectorRef(warm_start->solution->z()) : initial_z);
  start_.reset();
  if (how.keeps_start) solve_start(run, initial_z);
  Answer local = run_locally(run, initial_z, warm_start, how.resumes ? last : Stage::beginning);
  if (start_) local = not_above_start(run, std::move(local), initial_z, warm_start.has_value());
  const bool goes_on =
      how.resumes && ended_by_force(local.ending.status);  // the caller still has the warm start
  if (!start_ && warm_start && !local.stayed_warm && !goes_on)
    local = not_above_warm_start(run, std::move(local), warm_start->solution->z());
  local = solve_densely(run, std::move(local));
  if (!ended_by_force(local.ending.status)) stage_ = Stage::beginning;
  return options_.global_search ? search_globally(run, std::move(local), warm_start.has_value()) : local;
}

Strategy::Answer Strategy::run_reference(Run& run, ConstVectorRef initial_z) {
  const PhaseScope phase(run.activity(), Phase::path);
  if (reference_ == nullptr) reference_ = methods_->create(problem_, kkt_, options_, branch_);
  return {reference_->run(run, initial_z), &reference_->iterate()};
}

// Runs a tree over the pairs, starting from the local solution. Proofs and interrupted solves are returned
// unchanged.
Strategy::Answer Strategy::search_globally(Run& run, Answer local, bool warm) {
  if (is_proof(local.ending.status) || ended_by_force(local.ending.status)) return local;
  if (tree_ == nullptr) tree_ = std::make_unique<Tree>(problem_, options_, branch_.point, incumbent_);
  const Tree::Room room{tree_bytes_, keeps_tree_ ? kept_tree_bytes_ : 0.0, warm && keeps_tree_};
  const double before =
      incumbent_.exists() ? incumbent_.best().objective : std::numeric_limits<double>::infinity();
  TreeResult found = tree_->search(run, local.x->z(), optimality_.known_convex(), room,
                                   [this](Run& own) { return start_for_tree(own); });
  Answer answer = std::move(local);
  if (found.ray) {
    answer = {unbounded_along(*std::exchange(found.ray, {})), &path_point_.x};
    answer.tree = std::move(found);
    return answer;
  }
  // The path's point may be within the tolerances although no branch near it has an exact solution.
  const bool path_stays = answer.x == &path_point_.x && answer.ending.status == Status::solved &&
                          found.end != TreeResult::End::none &&
                          (!incumbent_.exists() || path_point_.objective < incumbent_.best().objective);
  if (found.end == TreeResult::End::limit) {
    answer.ending.status = found.limit;
    if (!path_stays && incumbent_.exists() && incumbent_.best().objective < before) take_incumbent(answer);
  } else if (path_stays) {
    // The path's point remains the solution.
  } else if (incumbent_.exists() && found.end != TreeResult::End::none) {
    const bool stayed_warm = answer.stayed_warm;
    answer = finish_exact(run);
    answer.stayed_warm = stayed_warm;
  } else if (found.end == TreeResult::End::infeasible && answer.ending.status != Status::solved) {
    answer.ending.status = Status::infeasible;
  }
  if (path_stays) found.answer_is(problem_.user_objective(path_point_.objective), options_);
  if (found.proved && is_solved(answer.ending.status)) answer.b_stationary = true;
  answer.ending.detail = found.remark + "; " + answer.ending.detail;
  answer.tree = std::move(found);
  return answer;
}

// Runs a round of further starts without helpers: those need engines, whose memory a tree does not count.
bool Strategy::start_for_tree(Run& run) {
  const Run::Searching searching(run);
  Run part = run.part(true);
  const bool better =
      search_.start_round(part, tuning::further_round, [&] { static_cast<void>(optimality_.judge(part)); });
  run.add_part(part);
  return better;
}

// Used where there is no time to judge the incumbent.
void Strategy::take_incumbent(Answer& answer) const {
  const ExactSolution& best = incumbent_.best();
  answer.x = &best.x;
  answer.b_stationary.reset();
  answer.second_order = SecondOrder::unknown;
  answer.ending.detail = std::string(best.origin) + "; " + describe(best.violations);
}

Strategy::Answer Strategy::run_locally(Run& run, ConstVectorRef initial_z,
                                       const std::optional<WarmStart>& warm_start, Stage from) {
  incumbent_.clear();
  search_.count_from_first();
  if (from >= Stage::path) {
    judge_path_point();
  } else {
    path_point_.violations.equality = std::numeric_limits<double>::infinity();  // no point yet
  }
  looked_for_ = {};
  if (warm_start && from <= Stage::mending) {
    if (search_.start_from(run, *warm_start->solution, warm_start->reference_objective, from)) {
      Answer answer = finish_exact(run);
      answer.stayed_warm = true;
      return answer;
    }
  }
  looks_for_contradiction_ =
      options_.path == Path::fast && !start_ && !(warm_start && judged(warm_start->solution->z()).feasible);
  path_.look_for_contradiction(looks_for_contradiction_);
  const bool late = run.interrupted().has_value();  // the cold start then gets no further than `from`
  const std::optional<Ending> path_end = cold(run, initial_z, from);
  if (late) stage_ = from;
  if (!incumbent_.exists()) return finish_path(run, initial_z, *path_end);
  const bool path_solved = path_end && is_solved(path_end->status);
  if (!path_solved ||
      !path_is_lower(within_tolerances(path_point_.violations, options_), path_point_.objective))
    return finish_cold(run, !warm_start);
  search_.start_further(run, {});
  if (incumbent_.best().objective <= path_point_.objective) return finish_exact(run);
  incumbent_.clear();
  return finish_path(run, initial_z, *path_end);
}

// Follows the path to a κ that shows the branch, solves it exactly and searches for better branches. If that
// branch is infeasible, searches for a feasible one. If no exact solution is found, follows the rest of the
// path. Returns how the path ended, or nothing if an exact solution was found before its end. Begins at the
// stage at which the last run was interrupted, and records its own.
std::optional<Ending> Strategy::cold(Run& run, ConstVectorRef initial_z, Stage from) {
  const bool quadratic = problem_.pairs() == 0 && options_.polish && options_.path == Path::fast;
  if (quadratic && from <= Stage::quadratic) {
    if (from == Stage::quadratic) {
      branch_.interior.resume();
    } else {
      branch_.interior.start(initial_z, branch_.point.set);
    }
    const PhaseScope phase(run.activity(), Phase::path);
    if (incumbent_.solve_branch(run, branch_.interior) || take_interior(run)) return std::nullopt;
  }
  if (quadratic && from <= Stage::quadratic && looks_for_contradiction_ &&
      ContradictionScreen(problem_).suggests_infeasible(problem_, branch_.interior.iterate())) {
    if (std::optional<Ending> proved = prove_early(run, branch_.interior.iterate())) return proved;
  }
  const bool quadratic_interrupted = quadratic && from <= Stage::quadratic && run.interrupted();
  if (from == Stage::path || from == Stage::end_of_path) {
    path_.resume();
  } else {
    path_.start(quadratic_interrupted ? ConstVectorRef(branch_.interior.iterate().z()) : initial_z);
  }
  std::optional<Ending> end;
  auto branch = PathBranch::not_exact;
  if (from <= Stage::path) {
    end = follow_to_branch(run, branch);
    if (end && ended_by_force(end->status)) stage_ = quadratic_interrupted ? Stage::quadratic : Stage::path;
    if (end && (ended_by_force(end->status) || is_proof(end->status))) return end;
  }
  bool path_borrowed = false;
  if (options_.polish && from != Stage::end_of_path) {
    const bool in_segments = from <= Stage::path && start_in_segments(run, branch);
    if (in_segments) {
      stage_ = Stage::beginning;
      path_borrowed = problem_.pairs() < tuning::segmented_alone;
      if (path_borrowed) search_.search_beside_segments(run, initial_z);
    } else if (from <= Stage::path && may_have_segments(problem_) && run.interrupted() &&
               !incumbent_.exists()) {
      stage_ = Stage::path;
    } else if (branch == PathBranch::exact) {
      path_borrowed = search_.improve(run, initial_z);
    } else if (options_.path == Path::fast) {
      stage_ = from <= Stage::path ? Stage::beginning : from;
      path_borrowed = search_.find(run, initial_z, stage_);
    }
    search_.repeat_soft_start(run, path_borrowed);
    show_incumbent(run);
    if (path_borrowed) search_.from_penalties(run, initial_z);
    const bool exact = incumbent_.exists() && branch != PathBranch::path_is_lower;
    if (exact || (end && is_solved(end->status))) return end;
  }
  if (!end) {
    if (path_borrowed) path_.start(initial_z);
    end = follow_path(run, options_.kappa_min);
    if (ended_by_force(end->status) && stage_ == Stage::beginning) stage_ = Stage::end_of_path;
  }
  if (ended_by_force(end->status) || stage_ != Stage::beginning) return end;
  if (options_.polish) {
    static_cast<void>(solve_path_branch(run, false));
  } else if (options_.path == Path::fast && !is_solved(end->status) && !is_proof(end->status)) {
    // The fast path relies on a polish. If it fails without one, a branch is better than no solution.
    if (solve_path_branch(run, true) == PathBranch::not_exact)
      static_cast<void>(search_.find(run, initial_z));
  }
  return end;
}

// Follows the path until it shows a branch, and solves that branch exactly.
std::optional<Ending> Strategy::follow_to_branch(Run& run, PathBranch& branch) {
  std::optional<Ending> end;
  for (const double kappa : {tuning::branch_kappa, tuning::last_kappa}) {
    end = follow_path(run, kappa);
    if (end && (ended_by_force(end->status) || is_proof(end->status))) break;
    if (options_.polish) branch = solve_path_branch(run, options_.path == Path::fast);
    if (end || path_.is_lost() || branch == PathBranch::exact) break;
  }
  return end;
}

// With the current numbers.
void Strategy::judge_path_point() {
  Images images(problem_);
  images.evaluate(problem_, path_point_.x);
  path_point_.violations = violations(problem_, images);
  path_point_.objective = images.objective;
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

// A feasible path point that is clearly lower than the exact solution near it is the better solution.
bool Strategy::path_is_lower(bool feasible, double objective) const {
  return feasible &&
         incumbent_.best().objective > objective + tuning::path_loss * std::max(1.0, std::abs(objective));
}

void Strategy::show_incumbent(const Run& run) const {
  if (incumbent_.exists()) run.add_incumbent(problem_.user_objective(incumbent_.best().objective));
}

// If a solution is not unique, in z or in its multipliers, the path may end at any of them. A solution that
// is far out is replaced by the one nearest to 0.
void Strategy::bring_near(Run& run) {
  const ExactSolution& best = incumbent_.best();
  const double size = max_abs(best.x.all);
  if (!(size > tuning::far_answer) || run.interrupted()) return;
  const Run::Polishing polishing(run);
  branch_.point.restore(Iterate(problem_), best.set);
  ExactSolution near(problem_);
  near.origin = best.origin;
  if (!solve_exactly(problem_, options_, branch_.exact, run, tuning::far_answer_budget, near)) return;
  const double noise = tuning::rounding * (1.0 + std::abs(best.objective));
  if (near.objective <= best.objective + noise && max_abs(near.x.all) < 0.5 * size) incumbent_.replace(near);
}

// The text is made only here: the end of an engine need not be the end of the run.
Strategy::Answer Strategy::finish_exact(Run& run) {
  const Run::Searching searching(run);
  show_incumbent(run);
  const Run::Polishing polishing(run);
  Optimality::Verdict verdict = optimality_.judge(run);
  if (verdict.unbounded) return {unbounded_along(*std::move(verdict.unbounded)), &path_point_.x};
  const ExactSolution& best = incumbent_.best();
  std::string detail;
  detail.reserve(256);
  detail.append(best.origin).append("; ").append(describe(best.violations));
  return {{Status::solved, std::move(detail), {}}, &best.x, verdict.b_stationary, verdict.second_order};
}

// The same for a cold solve, which also has the time to decide B-stationarity where many pairs are biactive.
Strategy::Answer Strategy::finish_exact_cold(Run& run) {
  Answer answer = finish_exact(run);
  for (int better = 0; better < tuning::escapes; ++better) {
    if (answer.b_stationary || answer.ending.status != Status::solved || run.interrupted() ||
        options_.max_local_search_factorizations == 0)
      break;
    const std::optional<bool> decided = optimality_.search_tangent_cone(run);
    if (!decided) break;
    if (*decided) {
      answer.b_stationary = true;
    } else {
      answer = finish_exact(run);
    }
  }
  return answer;
}

bool Strategy::is_small(const Run& run) const {
  const double size = problem_.variables() + problem_.equalities() + problem_.layout.size();
  return (problem_.pairs() > 0 || run.nonconvex) && problem_.pairs() <= tuning::small_pairs &&
         size <= tuning::small_size && options_.path == Path::fast && options_.polish &&
         options_.max_local_search_factorizations > 0 && options_.max_small_problem_nodes > 0 &&
         !options_.global_search;
}

// The part of a cold solve after its first solution: global search if the problem is small, and the requested
// starts. Each result is settled at once, so that later steps do not depend on how many starts remain: more
// starts never end worse.
Strategy::Answer Strategy::finish_cold(Run& run, bool small_too) {
  const Run::Searching searching(run);
  bring_near(run);
  Answer answer = finish_exact_cold(run);
  const bool small = small_too && is_small(run);
  if (!incumbent_.exists() || run.interrupted() || (!small && options_.num_starts == 1)) return answer;
  const double before = incumbent_.best().objective;
  const bool known_convex = optimality_.convex(run);
  TreeResult tree;
  if (small) tree = search_small_tree(run, incumbent_.best().x.z(), known_convex);
  if (tree.ray) return {unbounded_along(*std::move(tree.ray)), &path_point_.x};
  const bool convex = known_convex || tree.end != TreeResult::End::none;
  std::optional<Multistart> elsewhere;
  if (!convex) elsewhere.emplace(problem_, kkt_, branch_.point, incumbent_);
  std::optional<UnboundedRay> ray;
  const auto settle = [&] {
    if (std::optional<UnboundedRay> found = optimality_.judge(run).unbounded) ray = std::move(found);
    show_incumbent(run);
  };
  const auto start_elsewhere = [&](int count, int last) {
    const PhaseScope phase(run.activity(), Phase::starts);
    for (int start = 0; start < count && run.factorizations < last && !run.interrupted(); ++start) {
      run.set_done(Phase::starts, start, count);
      if (elsewhere->next(run, std::min(last, run.factorizations + options_.max_local_search_factorizations)))
        settle();
    }
  };
  // For a small problem, one start covers as many starting points as the budget has factorizations.
  const auto start_small = [&] {
    start_elsewhere(options_.max_small_problem_nodes, run.factorizations + options_.max_small_problem_nodes);
  };
  if (small && !convex) start_small();
  if (!tree.proved) search_.start_further(run, settle);
  for (int start = 1; start < options_.num_starts && small && !convex && !run.interrupted(); ++start)
    start_small();
  if (!small && !convex) start_elsewhere(options_.num_starts - 1, std::numeric_limits<int>::max());
  if (ray) return {unbounded_along(*std::move(ray)), &path_point_.x};
  if (incumbent_.best().objective < before) answer = finish_exact_cold(run);
  if (small)
    answer.ending.detail += "; max_small_problem_nodes: " + (convex ? tree.remark : "starts elsewhere");
  if (tree.proved) {
    answer.b_stationary = true;
  } else if (std::isfinite(tree.bound)) {
    tree.measure(problem_.user_objective(incumbent_.best().objective));
  }
  answer.tree = std::move(tree);
  return answer;
}

// Returns what the tree proves, and its counters.
TreeResult Strategy::search_small_tree(Run& run, ConstVectorRef z, bool known_convex) {
  Options few = options_;
  few.node_limit = options_.max_small_problem_nodes;
  // A small objective needs as many digits: a cost in other units is the same problem.
  if (incumbent_.exists()) {
    const double size =
        std::max(1.0 / problem_.cost_scale, std::abs(problem_.user_objective(incumbent_.best().objective)));
    few.relative_gap_tolerance *= std::min(1.0, size);
  }
  const PhaseScope phase(run.activity(), Phase::tree);
  Tree tree(problem_, few, branch_.point, incumbent_);
  Run part = run.part(true);
  const TreeResult found = tree.search(part, z, known_convex, {tree_bytes_, 0.0, false});
  run.add_part(part);
  return {.end = found.end,
          .ray = found.ray,
          .proved = found.proved,
          .bound = found.bound,
          .gap = found.gap,
          .nodes = found.nodes,
          .open_nodes = found.open_nodes,
          .remark = found.remark};
}

}  // namespace marble
