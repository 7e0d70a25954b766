#include "search/further_starts.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <new>

#include "model/tuning.h"

namespace marble {

FurtherStarts::Engine::Engine(const ScaledProblem& problem, std::unique_ptr<Kkt> own_kkt)
    : kkt(std::move(own_kkt)), branch(problem, *kkt), search(problem, *kkt, branch.elastic) {}

FurtherStarts::FurtherStarts(const ScaledProblem& problem, const Options& options, BranchEngines& branch,
                             LocalSearch& search)
    : problem_(problem),
      options_(options),
      branch_(branch),
      search_(search),
      attempts_(tuning::further_round, Attempt(problem)),
      reporter_(problem) {
  for (std::size_t i = 0; i < attempts_.size(); ++i) tasks_.emplace_back([this, i] { make(attempts_[i]); });
}

double FurtherStarts::extra_bytes(const Options& options, double engine_bytes) {
  return engine_bytes * std::max(0, std::min(options.num_starts - 1, tuning::further_round) - 1);
}

void FurtherStarts::make(Attempt& attempt) {
  Run& run = *attempt.run;
  if (run.interrupted()) return;
  try {
    attempt.branch->point.restore(attempt.begin->x, attempt.begin->set);
    const int last = run.factorizations + tuning::engine_budget + options_.max_local_search_factorizations;
    attempt.succeeded =
        attempt.search->run(run, attempt.plan, last) &&
        solve_exactly(problem_, options_, attempt.branch->exact, run, tuning::engine_budget, attempt.found);
  } catch (const std::bad_alloc&) {
    attempt.out_of_memory = true;
  }
  whole_->set_done(Phase::starts, ++made_, options_.num_starts);
}

// Makes an engine for every concurrent search except one, with the problem's current values. Returns false if
// one is refused.
bool FurtherStarts::make_engines(Run& run, std::size_t count) {
  while (engines_.size() < count) {
    std::unique_ptr<Kkt> kkt = make_kkt(problem_, run.interrupt());
    if (kkt == nullptr) return false;
    engines_.push_back(std::make_unique<Engine>(problem_, std::move(kkt)));
  }
  for (const auto& engine : engines_) {
    engine->kkt->attend(run.interrupt());
    engine->kkt->load(problem_);
  }
  return true;
}

bool FurtherStarts::round(Run& run, const SearchPlan& plan, int first, int count, Incumbent& incumbent,
                          const std::function<void()>& settle) {
  const auto searches = static_cast<std::size_t>(std::min(count, tuning::further_round));
  const bool at_once = run.runner() != nullptr && searches > 1;
  if (at_once && !make_engines(run, searches - 1)) return false;
  const ExactSolution& best = incumbent.best();
  for (std::size_t i = 0; i < searches; ++i) {
    Attempt& attempt = attempts_[i];
    const bool own_engine = at_once && i > 0;
    attempt.branch = own_engine ? &engines_[i - 1]->branch : &branch_;
    attempt.search = own_engine ? &engines_[i - 1]->search : &search_;
    attempt.plan = plan;
    attempt.plan.rho_first *= std::pow(tuning::further_softer, first + static_cast<int>(i));
    attempt.begin = &best;
    attempt.run.emplace(run.part(searches > 1));
    attempt.succeeded = attempt.out_of_memory = false;
  }
  whole_ = &run;
  made_ = first;
  const std::span<const std::function<void()>> tasks(tasks_.data(), searches);
  if (at_once) {
    run.runner()->run(tasks);
  } else {
    for (const auto& task : tasks) task();
  }
  bool better = false;
  for (std::size_t i = 0; i < searches; ++i) {
    Attempt& attempt = attempts_[i];
    run.add_part(*attempt.run);
    if (attempt.out_of_memory) throw std::bad_alloc();
    if (!attempt.succeeded ||
        attempt.found.objective >= best.objective - tuning::rounding * std::abs(best.objective))
      continue;
    better = true;
    attempt.found.origin = "further start, local search";
    incumbent.replace(attempt.found);
    if (settle) settle();
  }
  if (!better) return false;
  reporter_.report(run, best.x.z(), best.objective, best.violations, {.step_length = 1.0});
  return true;
}

}  // namespace marble
