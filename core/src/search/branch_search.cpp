#include "search/branch_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "model/tuning.h"

namespace marble {
namespace {

// The plans of local searches, by their starting point.
SearchPlan near_exact(int patience) {
  return {.rho_first = tuning::exact_rho, .from_exact = true, .first_patience = patience};
}

SearchPlan from_soft() {
  return {.rho_first = tuning::soft_rho,
          .rho_soft = tuning::middle_rho,
          .first_patience = tuning::search_patience,
          .switch_patience = tuning::search_patience};
}

// The first penalty of a soft start would lose the incumbent's basin.
SearchPlan from_relaxed_incumbent() {
  SearchPlan plan = from_soft();
  plan.rho_first *= plan.rho_factor;
  return plan;
}

SearchPlan from_penalty_end() {
  return {.rho_first = tuning::middle_rho,
          .rho_soft = tuning::middle_rho,
          .first_patience = tuning::search_patience,
          .switch_patience = tuning::search_patience};
}

SearchPlan from_interior_point(bool search) {
  return {.rho_first = tuning::middle_rho,
          .rho_last = tuning::interior_rho,
          .rho_exchange = tuning::interior_rho,
          .switch_patience = search ? tuning::search_patience : 0,
          .exchange_patience = search ? tuning::search_patience : 0};
}

FurtherStarts::Plans plans(int most_factorizations, int made, int asked) {
  return {from_soft(), from_interior_point(true), most_factorizations, made, asked};
}

int start_budget(const Options& options) {
  return tuning::engine_budget + options.max_local_search_factorizations;
}

int pulling(const Incumbent& incumbent) {
  return LocalSearch::pulling(incumbent.best().x, incumbent.best().set);
}

}  // namespace

BranchSearch::BranchSearch(const ScaledProblem& problem, Kkt& kkt, const Options& options, PathEngine& path,
                           BranchEngines& branch, Incumbent& incumbent)
    : problem_(problem),
      options_(options),
      path_(path),
      point_(branch.point),
      incumbent_(incumbent),
      interior_(problem, kkt),
      search_(problem, kkt, branch.elastic),
      further_starts_(problem, options, branch, search_, interior_),
      homotopy_(PenaltyHomotopy::applies(problem.pairs()) ? std::make_unique<PenaltyHomotopy>(problem, kkt)
                                                          : nullptr) {}

// With few wrong-sign multipliers, better branches are a switch or two away. With many, they are found from a
// soft start.
bool BranchSearch::improve(Run& run, ConstVectorRef initial_z) {
  const Run::Polishing polishing(run);
  const Run::Searching searching(run);
  const int last = run.factorizations + options_.max_local_search_factorizations;
  const int pull = pulling(incumbent_);
  if (pull == 0 || options_.max_local_search_factorizations == 0 || run.interrupted()) return false;
  const double before = incumbent_.best().objective;
  const bool soft = pull >= tuning::many_pulling && options_.path == Path::fast;
  if (soft) from_soft_start(run, initial_z, last);
  if (incumbent_.best().objective < before) return soft;
  point_.restore(incumbent_.best().x, incumbent_.best().set);
  switch_near_incumbent(run, tuning::search_patience, last, "path, local search");
  return soft;
}

// Switches pairs from the incumbent's branch, at which the point is.
void BranchSearch::switch_near_incumbent(Run& run, int patience, int last_factorization, const char* origin) {
  if (search_.run(run, near_exact(patience), last_factorization) && search_.accepted() > 0)
    static_cast<void>(incumbent_.solve_branch(run, origin, tuning::engine_budget));
}

bool BranchSearch::find(Run& run, ConstVectorRef initial_z, Stage& stage) {
  const Run::Polishing polishing(run);
  const bool resumes_soft = stage == Stage::soft_search;
  if (!resumes_soft) {
    const bool found = from_interior(run, initial_z, stage);
    if (stage != Stage::beginning) return false;
    if (found && pulling(incumbent_) < tuning::many_pulling_after_interior) return false;
  }
  stage = Stage::beginning;
  from_soft_start(run, initial_z, run.factorizations + options_.max_local_search_factorizations,
                  resumes_soft);
  if (!incumbent_.exists() && run.interrupted()) stage = Stage::soft_search;
  return true;
}

void BranchSearch::search_beside_segments(Run& run, ConstVectorRef initial_z) {
  const Run::Polishing polishing(run);
  search_below_incumbent(run, initial_z, run.factorizations + options_.max_local_search_factorizations);
}

bool BranchSearch::from_interior(Run& run, ConstVectorRef initial_z, Stage& stage) {
  const Stage from = std::exchange(stage, Stage::beginning);
  if (problem_.pairs() == 0) return false;
  SearchPlan plan = from_interior_point(options_.max_local_search_factorizations > 0);
  plan.resumes = from == Stage::interior_search;
  if (!plan.resumes) {
    if (!interior_.run(run, initial_z, from == Stage::interior_point)) {
      if (run.interrupted()) stage = Stage::interior_point;
      return false;
    }
    point_.start_from_point(interior_.z());
  }
  const int last = run.factorizations + 2 * tuning::engine_budget + options_.max_local_search_factorizations;
  const bool found = search_.run(run, plan, last) &&
                     incumbent_.solve_branch(run, "interior point, local search", tuning::engine_budget) ==
                         Incumbent::Outcome::kept;
  if (!found && run.interrupted()) stage = Stage::interior_search;
  return found;
}

void BranchSearch::from_soft_start(Run& run, ConstVectorRef initial_z, int last_factorization, bool resumes,
                                   double cutoff) {
  const Run::Searching searching(run);
  SearchPlan plan = from_soft();
  plan.resumes = resumes;
  plan.cutoff = cutoff;
  if (!resumes) {
    path_.lean(run, initial_z, tuning::soft_rho);
    point_.start_from_point(path_.iterate().z());
  }
  if (search_.run(run, plan, last_factorization))
    static_cast<void>(incumbent_.solve_branch(run, "soft start, local search", tuning::engine_budget));
}

// After a soft start, a second way to a branch: it ends in another basin, often a better one. It may take at
// most as many factorizations as everything before it.
void BranchSearch::from_penalties(Run& run, ConstVectorRef initial_z) {
  if (homotopy_ == nullptr || run.nonconvex || run.interrupted() ||
      options_.max_local_search_factorizations == 0)
    return;
  const Run::Polishing polishing(run);
  const Run::Searching searching(run);
  Run part = run.part(true);
  const int most = std::min(run.factorizations, options_.max_local_search_factorizations);
  const bool ended = homotopy_->run(part, initial_z, part.factorizations + most);
  part.iterations = run.iterations;  // steps of its QPs are not iterations of the solve and are not reported
  run.add_part(part);
  if (!ended) return;
  point_.start_from_point(homotopy_->z());
  if (search_.run(run, from_penalty_end(), run.factorizations + options_.max_local_search_factorizations) &&
      incumbent_.solve_branch(run, "penalties, local search", tuning::engine_budget) ==
          Incumbent::Outcome::kept)
    repeat(run, 0, std::numeric_limits<int>::max());
}

void BranchSearch::begin(ConstVectorRef z) {
  further_ = 1;
  softened_ = {.number = 1};
  random_ = {};
  further_starts_.center_at(z);
}

void BranchSearch::repeat_soft_start(Run& run, bool after_soft_start) {
  further_ = 1;
  if (after_soft_start) further_ = repeat(run, 1, tuning::cheap_search);
  softened_.number = further_;
}

// Runs further starts one by one, from number `first` on, as long as they gain. Returns the number of the
// next start.
int BranchSearch::repeat(Run& run, int first, int most_factorizations) {
  const Run::Polishing polishing(run);
  const Run::Searching searching(run);
  int number = first;
  for (int useless = 0; incumbent_.exists() && !run.interrupted() && number < tuning::further_round &&
                        useless < tuning::useless_starts && run.factorizations < most_factorizations;) {
    const FurtherStarts::Start start{FurtherStarts::Kind::softened, number++};
    const int gains =
        further_starts_.round(run, plans(start_budget(options_), number, 0), {&start, 1}, incumbent_)
            .softened;
    ++softened_.tries;
    softened_.gains += gains;
    useless = gains > 0 ? 0 : useless + 1;
  }
  return number;
}

// The kind that has gained more often; of equals the one that was tried less often.
FurtherStarts::Start BranchSearch::next_start() {
  const int softened = (1 + softened_.gains) * (1 + random_.tries);
  const int random = (1 + random_.gains) * (1 + softened_.tries);
  const bool soften = softened > random || (softened == random && softened_.tries <= random_.tries);
  Tried& kind = soften ? softened_ : random_;
  ++kind.tries;
  return {soften ? FurtherStarts::Kind::softened : FurtherStarts::Kind::random, kind.number++};
}

bool BranchSearch::run_round(Run& run, int count, int most_factorizations, int made, int asked,
                             const std::function<void()>& settle) {
  const Run::Polishing polishing(run);
  const Run::Searching searching(run);
  std::vector<FurtherStarts::Start> starts(static_cast<std::size_t>(count));
  for (FurtherStarts::Start& start : starts) start = next_start();
  const FurtherStarts::Gains gains =
      further_starts_.round(run, plans(most_factorizations, made, asked), starts, incumbent_, settle);
  softened_.gains += gains.softened;
  random_.gains += gains.random;
  return gains.softened + gains.random > 0;
}

void BranchSearch::start_again(Run& run, const std::function<void()>& settle) {
  const PhaseScope phase(run.activity(), Phase::starts);
  const double before = std::min(run.factorizations, options_.max_local_search_factorizations);
  const double last = run.factorizations + options_.effort * before;
  const double most_useless = tuning::useless_restarts * std::max(1.0, options_.effort);
  int useless = 0;
  for (int made = 0;
       useless < most_useless && run.factorizations < last && incumbent_.exists() && !run.interrupted();
       ++made) {
    const int left = static_cast<int>(last) - run.factorizations;
    useless = run_round(run, 1, left, made, 0, settle) ? 0 : useless + 1;
  }
}

void BranchSearch::start_further(Run& run, const std::function<void()>& settle) {
  const PhaseScope phase(run.activity(), Phase::starts);
  while (further_ < options_.num_starts && incumbent_.exists() && !run.interrupted()) {
    run.set_done(Phase::starts, further_, options_.num_starts);
    static_cast<void>(
        start_round(run, std::min(options_.num_starts - further_, tuning::further_round), settle));
  }
}

bool BranchSearch::start_round(Run& run, int count, const std::function<void()>& settle) {
  const bool better = run_round(run, count, start_budget(options_), further_, options_.num_starts, settle);
  further_ += count;
  return better;
}

void BranchSearch::prepare(Run& run, const Iterate& solution) {
  point_.start_from_solution(solution);
  point_.factor_ahead(run, tuning::exact_rho, tuning::exact_delta);
}

bool BranchSearch::take_branch_of(Run& run, const Iterate& solution, int budget) {
  const Run::Polishing polishing(run);
  point_.start_from_solution(solution);
  return incumbent_.solve_branch(run, "warm start", budget, &search_.parametric()) ==
         Incumbent::Outcome::kept;
}

// Without the soft start, a box at rest stays at rest: its plan is a local optimum, and few switches away
// from it all plans are worse.
void BranchSearch::search_near(Run& run, ConstVectorRef initial_z) {
  if (options_.max_local_search_factorizations == 0 || pulling(incumbent_) == 0) return;
  const Run::Polishing polishing(run);
  const int last = run.factorizations + options_.max_local_search_factorizations;
  point_.restore(incumbent_.best().x, incumbent_.best().set);
  switch_near_incumbent(run, tuning::search_patience, last, "warm start, local search");
  if (pulling(incumbent_) >= tuning::many_pulling)
    search_below_incumbent(run, initial_z, std::min(last, run.factorizations + tuning::engine_budget));
}

bool BranchSearch::may_improve(Run& run) {
  const Run::Polishing polishing(run);
  const ExactSolution& best = incumbent_.best();
  point_.restore(best.x, best.set);
  if (!point_.is_factored(tuning::exact_rho, tuning::exact_delta) &&
      !point_.factor(run, tuning::exact_rho, tuning::exact_delta))
    return true;
  return search_.parametric().may_gain(point_, tuning::exactness * std::max(1.0, std::abs(best.objective)));
}

void BranchSearch::switch_pulling(Run& run) {
  const Run::Polishing polishing(run);
  const Run::Searching searching(run);
  point_.restore(incumbent_.best().x, incumbent_.best().set);
  switch_near_incumbent(run, tuning::search_patience, run.factorizations + tuning::engine_budget,
                        "warm start, local search");
}

// From a soft start, as long as that may still end below the incumbent.
void BranchSearch::search_below_incumbent(Run& run, ConstVectorRef initial_z, int last_factorization) {
  from_soft_start(run, initial_z, last_factorization, false, incumbent_.best().objective);
}

// The branch of a sequence's last solution stays feasible for a long time while better ones appear
// elsewhere, as when the next stair comes into the horizon. So a search follows every few steps, or when the
// objective has risen.
bool BranchSearch::start_from(Run& run, const Iterate& solution, double reference_objective, Stage& stage) {
  has_searched_ = false;
  const bool resumes = std::exchange(stage, Stage::beginning) == Stage::mending;
  const int before = run.factorizations;
  const bool moved = !resumes && take_branch_of(run, solution, tuning::engine_budget);
  if (!moved && !restore_feasibility(run, solution, resumes, stage)) return false;
  const double objective = problem_.user_objective(incumbent_.best().objective);
  const auto has_risen = [&](double by) {
    const double rise = std::isfinite(reference_objective) ? by * std::abs(reference_objective) : 0.0;
    return objective > reference_objective + rise;
  };
  const bool small_change = moved && run.factorizations - before <= tuning::warm_tiny_change;
  const bool is_worse = !small_change && has_risen(tuning::alike);
  if (pulling(incumbent_) < tuning::many_pulling || options_.max_local_search_factorizations == 0 ||
      !std::isfinite(reference_objective))
    return !is_worse;
  if (!is_search_due(solution) && !is_worse && !has_risen(tuning::warm_rise)) return true;
  search_around_incumbent(run);
  steps_ = 0;
  has_searched_ = !run.interrupted();  // a search that was cut off is no reference for later objectives
  return true;
}

// The solutions have no order in time, so that no objective is a reference.
bool BranchSearch::start_near(Run& run, std::span<const Iterate> solutions, bool compares_more) {
  const Run::Polishing polishing(run);
  const int most = compares_more ? tuning::near_branches_kept : tuning::near_branches;
  int tried = 0;
  for (std::size_t k = 0; k < solutions.size() && tried < most && !run.interrupted(); ++k) {
    point_.start_from_solution(solutions[k]);
    if (incumbent_.exists() && point_.set.s_fixed == incumbent_.best().set.s_fixed) {
      if (!compares_more) ++tried;
    } else if (incumbent_.solve_branch(run, "near solution", tuning::warm_tiny_change,
                                       &search_.parametric()) != Incumbent::Outcome::not_exact) {
      ++tried;
    }
  }
  Stage stage = Stage::beginning;
  if (!incumbent_.exists() && !restore_feasibility(run, solutions.front(), false, stage)) return false;
  if (options_.max_local_search_factorizations == 0 || pulling(incumbent_) == 0) return true;
  const int budget = std::min(tuning::engine_budget, options_.max_local_search_factorizations);
  point_.restore(incumbent_.best().x, incumbent_.best().set);
  switch_near_incumbent(run, tuning::search_patience, run.factorizations + budget,
                        "near solution, local search");
  return true;
}

void BranchSearch::search_around_incumbent(Run& run) {
  const Run::Polishing polishing(run);
  const ExactSolution& best = incumbent_.best();
  SearchPlan plan = from_relaxed_incumbent();
  plan.cutoff = best.objective;
  searched_z_ = best.x.z();
  point_.restore(best.x, best.set);
  const int budget = std::min(2 * tuning::engine_budget, options_.max_local_search_factorizations);
  if (search_.run(run, plan, run.factorizations + budget))
    static_cast<void>(incumbent_.solve_branch(run, "warm start, relaxed", tuning::engine_budget));
}

// Few better branches appear while the solution stays where it is.
bool BranchSearch::is_search_due(const Iterate& last) {
  if (steps_ == 0) searched_z_ = last.z();
  const double moved = (incumbent_.best().x.z() - searched_z_).norm();
  return ++steps_ >= tuning::warm_search_steps && moved > tuning::alike * searched_z_.norm();
}

// Restores feasibility near the last solution.
bool BranchSearch::restore_feasibility(Run& run, const Iterate& solution, bool resumes, Stage& stage) {
  if (run.interrupted()) return false;
  const Run::Polishing polishing(run);
  if (!resumes) point_.start_from_solution(solution);
  SearchPlan plan = near_exact(tuning::short_patience);
  plan.resumes = resumes;
  const int last = run.factorizations + tuning::engine_budget + options_.max_local_search_factorizations;
  const bool restored =
      search_.run(run, plan, last) &&
      incumbent_.solve_branch(run, "warm start, restored", tuning::engine_budget) == Incumbent::Outcome::kept;
  if (!restored && run.interrupted()) stage = Stage::mending;
  return restored;
}

}  // namespace marble
