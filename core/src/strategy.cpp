#include "strategy.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "descent.h"
#include "proof.h"
#include "second_order.h"
#include "stationarity.h"
#include "tuning.h"

namespace marble {
namespace {

// How a local search begins, by where it comes from.
SearchPlan near_exact(int patience) {
  return {.rho_first = tuning::exact_rho, .from_exact = true, .first_patience = patience};
}

SearchPlan from_soft() {
  return {.rho_first = tuning::soft_rho,
          .rho_soft = tuning::soft_last_rho,
          .first_patience = tuning::soft_patience,
          .flip_patience = tuning::soft_patience};
}

SearchPlan from_interior_point(bool search) {
  return {.rho_first = tuning::interior_search_rho,
          .rho_last = tuning::interior_search_last_rho,
          .rho_exchange = tuning::interior_search_last_rho,
          .flip_patience = search ? tuning::interior_flip_patience : 0,
          .exchange_patience = search ? tuning::interior_exchange_patience : 0};
}

SearchPlan refresh() {
  return {.rho_first = tuning::refresh_rho,
          .rho_factor = tuning::refresh_rho_factor,
          .first_patience = tuning::refresh_patience};
}

SearchPlan mend() {
  return {.rho_first = tuning::exact_rho, .from_exact = true, .first_patience = tuning::mend_patience};
}

bool ended_by_force(Status status) {
  return status == Status::cancelled || status == Status::time_limit || status == Status::iteration_limit;
}

bool is_proof(Status status) { return status == Status::infeasible || status == Status::unbounded; }

}  // namespace

Strategy::Strategy(const ScaledProblem& problem, Kkt& kkt, const Options& options)
    : problem_(problem),
      kkt_(kkt),
      options_(options),
      path_(problem, kkt, options),
      interior_(problem, kkt),
      active_set_(problem, kkt),
      search_(problem, kkt, active_set_),
      initial_z_(problem.variables()),
      fallback_(problem),
      further_starts_(problem, options, active_set_, search_),
      exact_(problem),
      candidate_(problem),
      branch_base_(problem),
      branch_set_(problem),
      finish_images_(problem) {}

Ending Strategy::run(Run& run, ConstVectorRef initial_z, const std::optional<WarmStart>& warm_start) {
  initial_z_ = initial_z;
  has_exact_ = branch_infeasible_ = has_fallback_ = false;
  b_stationary_.reset();
  second_order_ = SecondOrder::unknown;
  tried_infeasible_ = tried_unbounded_ = false;
  searched_soft_ = false;
  if (convexity_ == Convexity::unknown && diagonally_dominant(problem_)) convexity_ = Convexity::dominant;
  stayed_warm_ = warm_start && options_.polish && from_solution(run, *warm_start);
  if (stayed_warm_) return finish_exact(run);
  Ending end = cold(run);
  if (has_exact_ && is_solved(end.status) && is_lower(fallback_violations_, fallback_objective_))
    has_exact_ = false;
  if (has_exact_) return finish_exact(run);
  if (const auto reason = run.interrupted(); reason && !is_solved(end.status) && !is_proof(end.status))
    return {*reason, "stopped early; " + describe(fallback_violations_), {}};
  if (is_solved(end.status) || end.status == Status::numerical_failure) {
    if (std::optional<Ending> unbounded = descend_from_path(run)) return *unbounded;
    if (has_exact_) return finish_exact(run);
  }
  if (end.status == Status::numerical_failure || end.status == Status::locally_infeasible) {
    for (const Status status : {Status::infeasible, Status::unbounded}) {
      if (std::optional<Ending> proved = prove(run, status)) return *proved;
      if (end.status == Status::locally_infeasible) break;
    }
  }
  const double rounding =
      tuning::rounding * (1.0 + max_abs(fallback_.z().cwiseProduct(problem_.variable_scale)));
  if (end.status == Status::numerical_failure && branch_infeasible_ &&
      largest(fallback_violations_) > rounding)
    return {Status::locally_infeasible, "no feasible branch near; " + end.detail, {}};
  if (is_solved(end.status) && known_convex()) second_order_ = SecondOrder::minimum;
  if (end.detail.empty()) end.detail = "path; " + describe(fallback_violations_);
  return end;
}

// The path down to a κ that shows the branch, an exact solution of it, and better branches. Where that branch
// is infeasible, one that is not by way of an interior point method. If nothing exact comes of it, the rest
// of the path.
Ending Strategy::cold(Run& run) {
  path_.start(initial_z_);
  std::optional<Ending> end;
  Outcome outcome = Outcome::not_exact;
  for (const double kappa : {tuning::branch_kappa, tuning::branch_last_kappa}) {
    end = follow_path(run, kappa);
    if (end && (ended_by_force(end->status) || is_proof(end->status))) return *end;
    if (options_.polish) outcome = from_path(run);
    if (end || path_.is_lost() || is_answer(outcome)) break;
  }
  if (options_.polish) {
    if (is_answer(outcome)) {
      improve(run, run.factorizations + options_.local_search_budget);
    } else if (options_.path == Path::fast) {
      const bool feasible = from_interior(run);
      if (!feasible || LocalSearch::pulling(exact_.x, exact_.set) >= tuning::many_pulling_after_interior)
        improve_from_soft(run, run.factorizations + options_.local_search_budget);
    }
    start_again(run);
    const bool exact = has_exact_ && outcome != Outcome::path_is_lower;
    if (exact || (end && is_solved(end->status))) return end.value_or(Ending{});
  }
  if (!end) {
    if (searched_soft_) path_.start(initial_z_);  // it was borrowed
    end = follow_path(run, options_.kappa_min);
  }
  if (!ended_by_force(end->status) && options_.polish) static_cast<void>(from_path(run));
  return *end;
}

// A path that seems to end in a proof ends so only if there is one.
std::optional<Ending> Strategy::follow_path(Run& run, double kappa_end) {
  std::optional<Ending> end = path_.follow(run, kappa_end);
  const Iterate& x = end ? path_.iterate() : path_.best();
  const Violations& violations = end ? path_.violations_at() : path_.best_violations();
  // A path that began again and was cut short may be worse than where the first one was.
  const bool cut_short = end && ended_by_force(end->status);
  if (cut_short && has_fallback_ && largest(fallback_violations_) < largest(violations)) return end;
  fallback_.all = x.all;
  fallback_violations_ = violations;
  fallback_objective_ = end ? path_.objective() : path_.best_objective();
  has_fallback_ = true;
  if (!end || !is_proof(end->status)) return end;
  if (std::optional<Ending> proved = prove(run, end->status)) return proved;
  return Ending{Status::numerical_failure, "no acceptable step; " + describe(violations), {}};
}

// Once a solve each.
std::optional<Ending> Strategy::prove(Run& run, Status status) {
  bool& tried = status == Status::infeasible ? tried_infeasible_ : tried_unbounded_;
  if (std::exchange(tried, true)) return std::nullopt;
  if (status == Status::unbounded) return prove_unbounded_from(run, fallback_.z(), fallback_.z());
  std::optional<FarkasProof> proof = prove_infeasible(problem_, fallback_.z(), run);
  if (!proof) return std::nullopt;
  char radius[64];
  std::snprintf(radius, sizeof radius, ": no z with |z| <= %.1e is feasible; ", proof->radius);
  return Ending{Status::infeasible,
                "the constraints contradict each other even without complementarity" +
                    (radius + describe(fallback_violations_)),
                std::move(proof->multipliers)};
}

std::optional<Ending> Strategy::prove_unbounded_from(Run& run, ConstVectorRef z, ConstVectorRef direction) {
  std::optional<UnboundedRay> ray = prove_unbounded(problem_, options_, z, direction, run);
  if (!ray) return std::nullopt;
  has_exact_ = false;
  fallback_.all.setZero();
  fallback_.z() = ray->origin;
  finish_images_.evaluate(problem_, fallback_);
  fallback_violations_ = violations(problem_, finish_images_);
  return Ending{Status::unbounded,
                "the objective falls without bound along the certificate; " + describe(fallback_violations_),
                std::move(ray->direction)};
}

// A branch that stays feasible after a small change is near the best one. Else it is mended; and a cold start
// has its say where that fails, or where answers have become clearly worse than a cold start's was.
bool Strategy::from_solution(Run& run, const WarmStart& warm_start) {
  const Run::Polishing polishing(run);
  const int before = run.factorizations;
  const int last = before + tuning::exact_budget + options_.local_search_budget;
  active_set_.start_from_solution(*warm_start.solution);
  bool small_change = make_exact(run, "warm start", tuning::warm_budget) == Outcome::kept;
  if (small_change) {
    const int work = run.factorizations - before;
    small_change = work <= tuning::warm_small_change;
    const bool search = work > tuning::warm_tiny_change && options_.local_search_budget > 0;
    const int pulling = search ? LocalSearch::pulling(exact_.x, exact_.set) : 0;
    const SearchPlan plan =
        small_change || pulling < tuning::many_pulling ? near_exact(tuning::warm_patience) : refresh();
    if (pulling > 0 && search_.run(run, plan, last) && search_.accepted() > 0)
      static_cast<void>(make_exact(run, "warm start, local search", tuning::exact_budget));
  } else {
    active_set_.start_from_solution(*warm_start.solution);
    if (!search_.run(run, mend(), last) ||
        make_exact(run, "warm start, mended", tuning::exact_budget) != Outcome::kept)
      return false;
  }
  const double objective = exact_.objective / problem_.cost_scale + problem_.c0;
  return small_change ||
         objective <= warm_start.cold_objective + tuning::warm_loss * std::abs(warm_start.cold_objective);
}

// Solves the branch at hand exactly and keeps the point if it is feasible and the best so far.
Strategy::Outcome Strategy::make_exact(Run& run, const char* origin, int budget) {
  if (!solve_exactly(problem_, options_, active_set_, run, budget, candidate_)) {
    if (!run.interrupted()) branch_infeasible_ = true;
    return Outcome::not_exact;
  }
  const double least_gain = tuning::rounding * std::abs(exact_.objective);
  if (has_exact_ && candidate_.objective >= exact_.objective - least_gain) return Outcome::no_better;
  std::swap(exact_, candidate_);
  has_exact_ = true;
  origin_ = origin;
  return Outcome::kept;
}

Strategy::Outcome Strategy::from_path(Run& run) {
  const Run::Polishing polishing(run);
  const double objective = path_.objective();
  active_set_.start_from_path(path_.iterate());
  const Outcome outcome = make_exact(run, "path", tuning::exact_budget);
  const bool lower = outcome != Outcome::not_exact && is_lower(path_.violations_at(), objective);
  return lower ? Outcome::path_is_lower : outcome;
}

// A feasible path point that is clearly lower than its exact neighbour is the better answer.
bool Strategy::is_lower(const Violations& violations, double objective) const {
  return within_tolerances(violations, options_) &&
         exact_.objective > objective + tuning::path_loss * std::max(1.0, std::abs(objective));
}

bool Strategy::from_interior(Run& run) {
  const Run::Polishing polishing(run);
  if (problem_.pairs() == 0 || !interior_.run(run, initial_z_)) return false;
  active_set_.start_from_point(interior_.z());
  const SearchPlan plan = from_interior_point(options_.local_search_budget > 0);
  const int last = run.factorizations + 2 * tuning::exact_budget + options_.local_search_budget;
  return search_.run(run, plan, last) &&
         make_exact(run, "interior point, local search", tuning::exact_budget) == Outcome::kept;
}

// Few pairs that pull: better branches are a flip or two away. Many: they are found where all is soft still.
void Strategy::improve(Run& run, int last_factorization) {
  const Run::Polishing polishing(run);
  const int pulling = LocalSearch::pulling(exact_.x, exact_.set);
  if (pulling == 0 || options_.local_search_budget == 0 || run.interrupted()) return;
  const double before = exact_.objective;
  if (pulling >= tuning::many_pulling && options_.path == Path::fast)
    improve_from_soft(run, last_factorization);
  if (exact_.objective < before) return;
  active_set_.restore(exact_.x, exact_.set);
  if (search_.run(run, near_exact(tuning::near_patience), last_factorization) && search_.accepted() > 0)
    static_cast<void>(make_exact(run, "path, local search", tuning::exact_budget));
}

void Strategy::improve_from_soft(Run& run, int last_factorization) {
  const Run::Polishing polishing(run);
  searched_soft_ = true;
  path_.lean(run, initial_z_, tuning::soft_rho);
  active_set_.start_from_point(path_.iterate().z());
  if (search_.run(run, from_soft(), last_factorization))
    static_cast<void>(make_exact(run, "soft start, local search", tuning::exact_budget));
}

// Where a soft search was cheap, a few more while they gain; and the starts asked for, in rounds.
void Strategy::start_again(Run& run) {
  const Run::Polishing polishing(run);
  int done = 1;
  for (int useless = 0; searched_soft_ && has_exact_ && !run.interrupted() && done < tuning::free_starts &&
                        useless < tuning::useless_starts && run.factorizations < tuning::cheap_search;
       ++done) {
    useless = start_further(run, done, 1) ? 0 : useless + 1;
  }
  while (done < options_.starts && has_exact_ && !run.interrupted()) {
    const int count = std::min(options_.starts - done, tuning::further_round);
    static_cast<void>(start_further(run, done, count));
    done += count;
  }
}

bool Strategy::start_further(Run& run, int first, int count) {
  if (!further_starts_.round(run, from_soft(), first, count, exact_)) return false;
  origin_ = "further start, local search";
  return true;
}

// Where a path ended without an exact solution of its branch, Q may have negative curvature there; where it
// ended infeasible for that reason, the nearest feasible point is one to descend from.
std::optional<Ending> Strategy::descend_from_path(Run& run) {
  if (!options_.polish || options_.local_search_budget == 0 || known_convex()) return std::nullopt;
  const Run::Polishing polishing(run);
  if (within_tolerances(fallback_violations_, options_)) {
    active_set_.start_from_path(fallback_);
  } else {
    if (!run.nonconvex) return std::nullopt;
    const Vector z = fallback_.z();
    const std::optional<Vector> point = feasible_point(problem_, options_, z, z, run);
    if (!point) return std::nullopt;
    active_set_.set_working_set(WorkingSet(problem_));
    active_set_.start_from_point(*point);
  }
  const Iterate x = active_set_.x();
  const WorkingSet set = active_set_.set();
  return descend(run, x, set, Vector());
}

// To a local minimum, which becomes the exact solution, or to the proof that there is none.
std::optional<Ending> Strategy::descend(Run& run, const Iterate& x, const WorkingSet& set,
                                        ConstVectorRef direction) {
  Descent descent(problem_, kkt_, active_set_);
  const Descent::End end = descent.run(run, x, set, direction, options_.local_search_budget);
  run.nonconvex = run.nonconvex || descent.began_at_saddle();
  if (descent.began_at_saddle()) second_order_ = SecondOrder::saddle;
  if (end == Descent::End::unbounded) return prove_unbounded_from(run, descent.x().z(), descent.direction());
  candidate_.x.all = descent.x().all;
  candidate_.set = descent.set();
  finish_images_.evaluate(problem_, candidate_.x);
  candidate_.objective = finish_images_.objective;
  candidate_.violations = violations(problem_, finish_images_);
  const bool better = !has_exact_ || candidate_.objective < exact_.objective;
  if (end != Descent::End::minimum || !better || !within_tolerances(candidate_.violations, options_))
    return std::nullopt;
  std::swap(exact_, candidate_);
  has_exact_ = true;
  origin_ = "descent along negative curvature";
  return std::nullopt;
}

// Text is made only at the end: what ends an engine need not end the run.
Ending Strategy::finish_exact(Run& run) {
  const Run::Polishing polishing(run);
  for (int escapes = 0;; ++escapes) {
    b_stationary_.reset();
    decide_b_stationarity(run);
    const CriticalCurvature curvature = decide_second_order(run);
    if (curvature.kind != SecondOrder::saddle || escapes == tuning::escapes || run.interrupted() ||
        options_.local_search_budget == 0)
      break;
    const double before = exact_.objective;
    const Iterate x = exact_.x;
    if (std::optional<Ending> unbounded = descend(run, x, curvature.set, curvature.direction))
      return *unbounded;
    if (exact_.objective >= before) break;
  }
  return explain_exact();
}

// Strongly stationary points are B-stationary; of others, those with few biactive pairs are tried on each
// branch.
void Strategy::decide_b_stationarity(Run& run) {
  Images& images = finish_images_;
  images.evaluate(problem_, exact_.x);
  const std::vector<Index> biactive = biactive_pairs(images);
  if (classify(images, exact_.x) == Stationarity::strong) {
    b_stationary_ = true;
  } else if (biactive.size() <= tuning::biactive_pairs_tried && options_.local_search_budget > 0) {
    for (int better = 0; better < tuning::better_branches; ++better) {
      const double before = exact_.objective;
      const bool all = solves_its_branches(run, biactive);
      if (all) b_stationary_ = true;
      if (all || exact_.objective >= before || run.interrupted()) break;
    }
    images.evaluate(problem_, exact_.x);  // it may be another one now
    if (classify(images, exact_.x) == Stationarity::strong) b_stationary_ = true;
  }
}

// Costs a factorization only where rows of the exact solution's working set have no multiplier and Q is not
// known to be convex: of Q itself, once for all solves with it, and with the active rows.
CriticalCurvature Strategy::decide_second_order(Run& run) {
  CriticalCurvature curvature{SecondOrder::minimum, {}, exact_.set};
  if (!known_convex() && has_weakly_active_rows(problem_, exact_.x, exact_.set) && !is_convex(run))
    curvature = critical_curvature(problem_, kkt_, exact_.x, exact_.set, run);
  // Where the multipliers of a branch pull, its cone is not that of the others.
  if (curvature.kind == SecondOrder::minimum && classify(finish_images_, exact_.x) != Stationarity::strong &&
      !is_convex(run))
    curvature.kind = SecondOrder::necessary;
  second_order_ = curvature.kind;
  return curvature;
}

bool Strategy::is_convex(Run& run) {
  if (known_convex()) return true;
  if (convexity_ == Convexity::unknown && run.nonconvex) convexity_ = Convexity::indefinite;
  if (convexity_ == Convexity::unknown) {
    ++run.factorizations;
    const bool convex =
        run.timed(&Times::factorization_s, [this] { return convex_by_inertia(problem_, kkt_); });
    if (!convex && run.interrupted()) return false;  // not known, then
    convexity_ = convex ? Convexity::convex : Convexity::indefinite;
  }
  return known_convex();
}

// Whether no branch that meets in the point has a better one; else goes there.
bool Strategy::solves_its_branches(Run& run, std::span<const Index> biactive) {
  branch_base_ = exact_.set;
  const double objective = exact_.objective;
  bool decided = true;
  for (unsigned branch = 1; branch < 1U << biactive.size(); ++branch) {
    branch_set_ = branch_base_;
    for (std::size_t k = 0; k < biactive.size(); ++k) {
      if ((branch >> k & 1U) != 0) branch_set_.flip(biactive[k]);
    }
    active_set_.restore(exact_.x, branch_set_);
    const Outcome outcome = make_exact(run, "neighbouring branch", tuning::branch_budget);
    if (exact_.objective < objective - tuning::branch_gain * (1.0 + std::abs(objective))) return false;
    // Where Q is not convex the solution of another branch may be a stationary point elsewhere.
    const double moved = max_abs(exact_.x.z() - candidate_.x.z());
    const bool here = moved <= tuning::same_point * (1.0 + max_abs(exact_.x.z()));
    decided = decided && outcome != Outcome::not_exact && (here || is_convex(run));
  }
  return decided;
}

Ending Strategy::explain_exact() const {
  std::string detail;
  detail.reserve(256);
  detail.append(origin_).append("; ").append(describe(exact_.violations));
  return {Status::solved, std::move(detail), {}};
}

}  // namespace marble
