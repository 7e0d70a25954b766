#include "further_starts.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <new>

#include "tuning.h"

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
  for (std::size_t i = 0; i < attempts_.size(); ++i) tasks_.emplace_back([this, i] { make_attempt(i); });
}

double FurtherStarts::extra_bytes(const Options& options, double engine_bytes) {
  return engine_bytes * std::max(0, std::min(options.starts - 1, tuning::further_round) - 1);
}

void FurtherStarts::make_attempt(std::size_t number) {
  SearchPlan plan = plan_;
  plan.rho_first *= std::pow(tuning::further_softer, first_ + static_cast<int>(number));
  Attempt& attempt = attempts_[number];
  try {
    if (number == 0 || !at_once_) {
      search_from(branch_, search_, plan, attempt);
    } else {
      search_from(engines_[number - 1]->branch, engines_[number - 1]->search, plan, attempt);
    }
  } catch (const std::bad_alloc&) {
    attempt.out_of_memory = true;
  }
}

void FurtherStarts::search_from(BranchEngines& branch, LocalSearch& search, SearchPlan plan,
                                Attempt& attempt) const {
  Run& run = *attempt.run;
  if (run.interrupted()) return;
  branch.point.restore(begin_->x, begin_->set);
  const int last = run.factorizations + tuning::exact_budget + options_.local_search_budget;
  attempt.succeeded = search.run(run, plan, last) && solve_exactly(problem_, options_, branch.exact, run,
                                                                   tuning::exact_budget, attempt.found);
}

bool FurtherStarts::round(Run& run, const SearchPlan& plan, int first, int count, Incumbent& incumbent) {
  const auto searches = static_cast<std::size_t>(std::min(count, tuning::further_round));
  at_once_ = run.runner() != nullptr && searches > 1;
  while (at_once_ && engines_.size() + 1 < searches) {
    std::unique_ptr<Kkt> kkt = make_kkt(problem_, run.interrupt());
    if (kkt == nullptr) return false;
    engines_.push_back(std::make_unique<Engine>(problem_, std::move(kkt)));
  }
  for (const auto& engine : engines_) {  // of an earlier solve, perhaps with other values
    engine->kkt->attend(run.interrupt());
    engine->kkt->load(problem_);
  }
  const ExactSolution& best = incumbent.best();
  begin_ = &best;
  plan_ = plan;
  first_ = first;
  for (std::size_t i = 0; i < searches; ++i) {
    attempts_[i].run.emplace(run.part(searches > 1));
    attempts_[i].succeeded = attempts_[i].out_of_memory = false;
  }
  const std::span<const std::function<void()>> tasks(tasks_.data(), searches);
  if (at_once_) {
    run.runner()->run(tasks);
  } else {
    for (const auto& task : tasks) task();
  }
  Attempt* winner = nullptr;
  double goal = best.objective - tuning::rounding * std::abs(best.objective);
  for (std::size_t i = 0; i < searches; ++i) {
    Attempt& attempt = attempts_[i];
    run.add_part(*attempt.run);
    if (attempt.out_of_memory) throw std::bad_alloc();
    if (!attempt.succeeded || attempt.found.objective >= goal) continue;
    winner = &attempt;
    goal = attempt.found.objective;
  }
  if (winner == nullptr) return false;
  winner->found.origin = "further start, local search";
  incumbent.replace(winner->found);
  reporter_.tell(run, best.x.z(), best.objective, best.violations, {.step_length = 1.0});
  return true;
}

}  // namespace marble
