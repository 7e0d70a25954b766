#include "search/further_starts.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <new>

#include "model/tuning.h"
#include "path/noise.h"

namespace marble {

FurtherStarts::Engine::Engine(const ScaledProblem& problem, std::unique_ptr<Kkt> own_kkt)
    : kkt(std::move(own_kkt)),
      branch(problem, *kkt),
      search(problem, *kkt, branch.elastic),
      interior(problem, *kkt) {}

FurtherStarts::FurtherStarts(const ScaledProblem& problem, const Options& options, BranchEngines& branch,
                             LocalSearch& search, InteriorEngine& interior)
    : problem_(problem),
      options_(options),
      branch_(branch),
      search_(search),
      interior_(interior),
      center_(Vector::Zero(problem.variables())),
      attempts_(tuning::further_round, Attempt(problem)),
      reporter_(problem) {
  for (std::size_t i = 0; i < attempts_.size(); ++i) tasks_.emplace_back([this, i] { make(attempts_[i]); });
}

double FurtherStarts::extra_bytes(const Options& options, double engine_bytes) {
  return engine_bytes * std::max(0, std::min(options.num_starts - 1, tuning::further_round) - 1);
}

// Sets the point and the branch from which the search begins.
bool FurtherStarts::begin(Attempt& attempt) {
  BranchPoint& point = attempt.branch->point;
  if (attempt.kind == Kind::softened) {
    point.restore(attempt.begin->x, attempt.begin->set);
    return true;
  }
  if (!attempt.interior->run(*attempt.run, attempt.point)) return false;
  point.start_from_point(attempt.interior->z());
  return true;
}

void FurtherStarts::make(Attempt& attempt) {
  Run& run = *attempt.run;
  if (run.interrupted()) return;
  try {
    const int last = run.factorizations + attempt.most_factorizations;
    attempt.succeeded =
        begin(attempt) && attempt.search->run(run, attempt.plan, last) &&
        solve_exactly(problem_, options_, attempt.branch->exact, run, tuning::engine_budget, attempt.found);
  } catch (const std::bad_alloc&) {
    attempt.out_of_memory = true;
  }
  whole_->set_done(Phase::starts, ++made_, asked_);
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

void FurtherStarts::set_up(Attempt& attempt, const Start& start, const Plans& plans) const {
  attempt.kind = start.kind;
  attempt.most_factorizations = plans.most_factorizations;
  if (start.kind == Kind::softened) {
    attempt.plan = plans.softened;
    attempt.plan.rho_first *= std::pow(tuning::further_softer, start.number);
    return;
  }
  attempt.plan = plans.random;
  attempt.plan.cutoff = attempt.begin->objective;
  const auto number = static_cast<std::uint64_t>(start.number);
  for (Index j = 0; j < center_.size(); ++j)
    attempt.point[j] =
        center_[j] + tuning::random_spread * signed_noise(number, static_cast<std::uint64_t>(j));
}

FurtherStarts::Gains FurtherStarts::round(Run& run, const Plans& plans, std::span<const Start> starts,
                                          Incumbent& incumbent, const std::function<void()>& settle) {
  const std::size_t searches = std::min(starts.size(), attempts_.size());
  const bool at_once = run.runner() != nullptr && searches > 1;
  if (at_once && !make_engines(run, searches - 1)) return {};
  const ExactSolution& best = incumbent.best();
  for (std::size_t i = 0; i < searches; ++i) {
    Attempt& attempt = attempts_[i];
    const bool own_engine = at_once && i > 0;
    attempt.branch = own_engine ? &engines_[i - 1]->branch : &branch_;
    attempt.search = own_engine ? &engines_[i - 1]->search : &search_;
    attempt.interior = own_engine ? &engines_[i - 1]->interior : &interior_;
    attempt.begin = &best;
    set_up(attempt, starts[i], plans);
    attempt.run.emplace(run.part(searches > 1));
    attempt.succeeded = attempt.out_of_memory = false;
  }
  whole_ = &run;
  made_ = plans.made;
  asked_ = plans.asked;
  const std::span<const std::function<void()>> tasks(tasks_.data(), searches);
  if (at_once) {
    run.runner()->run(tasks);
  } else {
    for (const auto& task : tasks) task();
  }
  Gains gains;
  for (std::size_t i = 0; i < searches; ++i) {
    Attempt& attempt = attempts_[i];
    run.add_part(*attempt.run);
    if (attempt.out_of_memory) throw std::bad_alloc();
    if (!attempt.succeeded ||
        attempt.found.objective >= best.objective - tuning::rounding * std::abs(best.objective))
      continue;
    ++(attempt.kind == Kind::softened ? gains.softened : gains.random);
    attempt.found.origin = attempt.kind == Kind::softened ? "further start, local search"
                                                          : "random point, interior point, local search";
    incumbent.replace(attempt.found);
    if (settle) settle();
  }
  if (gains.softened + gains.random == 0) return gains;
  reporter_.report(run, best.x.z(), best.objective, best.violations, {.step_length = 1.0});
  return gains;
}

}  // namespace marble
