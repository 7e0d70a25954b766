#include "solver/strategy.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "global/exchange_search.h"
#include "global/implied_bounds.h"
#include "horizon/segments.h"
#include "model/text_of.h"
#include "model/tuning.h"
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
  std::optional<Answer> step;
  if (how.keeps_start && take_start(initial_z)) {
    if (warm_start) {
      step = step_from_start(run, initial_z, *warm_start);
    } else {
      solve_start(run);
    }
  }
  if (!how.near.empty()) step = step_near(run, how);
  Answer local = step ? *std::move(step)
                      : run_locally(run, initial_z, warm_start, how.resumes ? last : Stage::beginning);
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
  search_.begin(initial_z);
  if (from >= Stage::path) {
    judge_path_point();
  } else {
    path_point_.violations.equality = std::numeric_limits<double>::infinity();  // no point yet
  }
  looked_for_ = {};
  if (warm_start && from <= Stage::mending) {
    if (search_.start_from(run, *warm_start->solution, warm_start->reference_objective, from)) {
      Answer answer = finish_step(run);
      answer.has_searched = answer.has_searched || search_.has_searched();
      return answer;
    }
  }
  looks_for_contradiction_ =
      options_.path == Path::fast && !start_ && !(warm_start && judged(warm_start->solution->z()).feasible);
  path_.look_for_contradiction(looks_for_contradiction_);
  search_.forget_steps();
  const bool late = run.interrupted().has_value();  // the cold start then gets no further than `from`
  const std::optional<Ending> path_end = solve_cold(run, initial_z, from);
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

// From solutions of other elements of a batch. Returns nothing if no feasible branch is near.
std::optional<Strategy::Answer> Strategy::step_near(Run& run, const How& how) {
  incumbent_.clear();
  search_.begin(how.near.front().z());
  if (!search_.start_near(run, how.near, how.compares_more)) return std::nullopt;
  return finish_exact(run, run.factorizations + tuning::warm_small_change);
}

// With the current numbers.
void Strategy::judge_path_point() {
  Images images(problem_);
  images.evaluate(problem_, path_point_.x);
  path_point_.violations = violations(problem_, images);
  path_point_.objective = images.objective;
}

// The end of a warm step. Where Q is convex and no pair pulls, the branch's solution is the optimum without
// complementarity too, so none is better. Where few pull, most often switching each of them shows the same;
// otherwise a tree compares the branches of a small problem, and in a larger one pairs are switched.
Strategy::Answer Strategy::finish_step(Run& run) {
  const int pull = LocalSearch::pulling(incumbent_.best().x, incumbent_.best().set);
  const bool few = pull > 0 && pull < tuning::many_pulling && may_search_on() && options_.effort > 0.0 &&
                   !run.interrupted() && search_.may_improve(run);
  const std::int64_t work = small_problem_work();
  TreeResult tree;
  const bool tree_is_cheap = problem_.pairs() < tuning::many_pulling && work > 0 && is_small(run);
  if (few && tree_is_cheap && optimality_.convex(run)) {
    tree = search_small_tree(run, incumbent_.best().x.z(), true, work);
  } else if (few) {
    search_.switch_pulling(run);
  }
  if (tree.ray) return {unbounded_along(*std::move(tree.ray)), &path_point_.x};
  Answer answer = finish_exact(run);
  answer.stayed_warm = true;
  answer.has_searched = few && !run.interrupted();
  if (!tree.remark.empty()) answer.ending.detail += "; max_small_problem_nodes: " + tree.remark;
  if (tree.end != TreeResult::End::none) add_tree(answer, std::move(tree));
  return answer;
}

// Of a tree that began at the incumbent before the last searches.
void Strategy::add_tree(Answer& answer, TreeResult tree) const {
  if (tree.proved) {
    answer.b_stationary = true;
  } else if (std::isfinite(tree.bound)) {
    tree.measure(problem_.user_objective(incumbent_.best().objective));
  }
  answer.tree = std::move(tree);
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
// Up to that count, branches are tried to decide B-stationarity.
Strategy::Answer Strategy::finish_exact(Run& run, int last_factorization) {
  const Run::Searching searching(run);
  show_incumbent(run);
  const Run::Polishing polishing(run);
  Optimality::Verdict verdict = optimality_.judge(run, last_factorization);
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

// Without being asked, after the first solution.
bool Strategy::may_search_on() const {
  return options_.path == Path::fast && options_.polish && options_.max_local_search_factorizations > 0 &&
         !options_.global_search;
}

bool Strategy::has_small_tree(const Run& run, Index most_pairs, double most_size) const {
  const double size = problem_.variables() + problem_.equalities() + problem_.layout.size();
  return may_search_on() && options_.max_small_problem_nodes > 0 && (problem_.pairs() > 0 || run.nonconvex) &&
         problem_.pairs() <= most_pairs && size <= most_size;
}

bool Strategy::is_small(const Run& run) const {
  return has_small_tree(run, tuning::small_pairs, tuning::small_size);
}

// Without bounds from the pairs, a tree has no bound, and other searches little to go by.
bool Strategy::is_small_for_its_pairs(const Run& run) const {
  return has_small_tree(run, tuning::implied_small_pairs, tuning::implied_small_size) &&
         ImpliedBounds::only_pairs_bound(problem_, options_);
}

// The part of a cold solve after its first solution: global search if the problem is small, otherwise further
// starts within effort, and the requested starts. Each result is settled at once, so that later steps
// do not depend on how many starts remain: more starts never end worse.
Strategy::Answer Strategy::finish_cold(Run& run, bool is_first) {
  const Run::Searching searching(run);
  bring_near(run);
  Answer answer = finish_exact_cold(run);
  const std::int64_t work = small_problem_work();
  const bool small = is_first && work > 0 && (is_small(run) || is_small_for_its_pairs(run));
  const bool again = is_first && may_start_again();
  const bool exchange = is_first && may_exchange();
  if (!incumbent_.exists() || run.interrupted()) return answer;
  if (!small && !again && !exchange && options_.num_starts == 1) return answer;
  const double before = incumbent_.best().objective;
  const bool known_convex = optimality_.convex(run);
  TreeResult tree;
  if (small) tree = search_small_tree(run, incumbent_.best().x.z(), known_convex, work);
  if (tree.ray) return {unbounded_along(*std::move(tree.ray)), &path_point_.x};
  const bool convex = known_convex || tree.end != TreeResult::End::none;
  std::string remark;
  if (exchange && convex && !tree.proved) remark = exchange_pairs(run);
  std::optional<Multistart> elsewhere;
  if (!convex) elsewhere.emplace(problem_, kkt_, branch_.point, incumbent_);
  std::optional<UnboundedRay> ray;
  const auto settle = [&] {
    if (std::optional<UnboundedRay> found = optimality_.judge(run).unbounded) ray = std::move(found);
    show_incumbent(run);
  };
  const auto start_elsewhere = [&](std::int64_t count, std::int64_t last) {
    const PhaseScope phase(run.activity(), Phase::starts);
    for (int start = 0; start < count && run.factorizations < last && !run.interrupted(); ++start) {
      run.set_done(Phase::starts, start, count);
      const int most = run.factorizations + options_.max_local_search_factorizations;
      if (elsewhere->next(run, static_cast<int>(std::min<std::int64_t>(last, most)))) settle();
    }
  };
  // For a small problem, one start covers as many starting points as the budget has factorizations.
  const auto start_small = [&] { start_elsewhere(work, run.factorizations + work); };
  if (small && !convex) start_small();
  if (again && !tree.proved) search_.start_again(run, settle);
  if (!tree.proved) search_.start_further(run, settle);
  for (int start = 1; start < options_.num_starts && small && !convex && !run.interrupted(); ++start)
    start_small();
  if (!small && !convex) start_elsewhere(options_.num_starts - 1, std::numeric_limits<int>::max());
  if (ray) return {unbounded_along(*std::move(ray)), &path_point_.x};
  if (incumbent_.best().objective < before) answer = finish_exact_cold(run);
  if (small)
    answer.ending.detail += "; max_small_problem_nodes: " + (convex ? tree.remark : "starts elsewhere");
  answer.ending.detail += remark;
  add_tree(answer, std::move(tree));
  return answer;
}

// Segments take the place of further starts where a problem is large enough for both.
bool Strategy::may_start_again() const {
  return may_search_on() && options_.effort > 0.0 && problem_.pairs() > tuning::small_pairs &&
         !may_have_segments(problem_);
}

// The limit max_small_problem_nodes, by option effort.
std::int64_t Strategy::small_problem_work() const {
  return static_cast<std::int64_t>(
      std::min<double>(std::numeric_limits<int>::max(), options_.effort * options_.max_small_problem_nodes));
}

bool Strategy::may_exchange() const {
  return may_search_on() && small_problem_work() > 0 && problem_.pairs() >= 2 &&
         problem_.pairs() <= tuning::exchange_pairs && ExchangeSearch::applies(problem_);
}

// Returns a remark.
std::string Strategy::exchange_pairs(Run& run) {
  const PhaseScope phase(run.activity(), Phase::tree);
  const auto most =
      static_cast<std::int64_t>(tuning::exchange_points * static_cast<double>(small_problem_work()));
  ExchangeSearch search(problem_, branch_.point, incumbent_);
  const std::int64_t bounded = search.run(run, most, tree_bytes_);
  show_incumbent(run);
  return bounded > 0 ? "; exchanges: " + std::to_string(bounded) + " branches" : "";
}

// Returns what the tree proves, and its counters.
TreeResult Strategy::search_small_tree(Run& run, ConstVectorRef z, bool known_convex, std::int64_t nodes) {
  Options few = options_;
  few.node_limit = static_cast<int>(nodes);
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
