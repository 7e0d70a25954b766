#include "polish.h"

#include <algorithm>
#include <cmath>

namespace marble {
namespace {

constexpr double kWrongSign = 1e-7;      // a fixed side's multiplier this far on the wrong side shows descent
constexpr double kLeastDecrease = 1e-9;  // relative fall of the objective that counts
constexpr int kTrialBudget = 10;         // factorizations one changed partition may cost
constexpr std::size_t kSingleTrials = 8;  // flips tried one by one when all together do not help

}  // namespace

Polish::Polish(const ScaledProblem& problem, Kkt& kkt)
    : active_set_(problem, kkt), best_(problem), best_set_(problem) {
  candidates_.reserve(static_cast<std::size_t>(problem.pairs()));
}

bool Polish::run(const Iterate& iterate, Run& run, int budget) {
  const int last_factorization = run.factorizations + budget;
  active_set_.start_from_path(iterate);
  if (!active_set_.solve(run, budget)) return false;
  while (improve(run, last_factorization)) {
  }
  return true;
}

void Polish::collect_wrong_signs() {
  candidates_.clear();
  const WorkingSet& set = active_set_.set();
  for (std::size_t i = 0; i < set.left_fixed.size(); ++i) {
    if (!set.active_free_side[i]) continue;
    const auto pair = static_cast<Index>(i);
    const double lambda =
        set.left_fixed[i] ? active_set_.x().lambda_L()[pair] : active_set_.x().lambda_R()[pair];
    if (lambda > kWrongSign) candidates_.push_back({pair, lambda});
  }
  std::sort(candidates_.begin(), candidates_.end(), [](const Candidate& a, const Candidate& b) {
    return a.descent != b.descent ? a.descent > b.descent : a.pair < b.pair;
  });
}

// One better partition, or false.
bool Polish::improve(Run& run, int last_factorization) {
  collect_wrong_signs();
  if (candidates_.empty() || run.factorizations >= last_factorization) return false;
  best_.all = active_set_.x().all;
  best_set_ = active_set_.set();
  best_objective_ = active_set_.images().objective;
  if (try_flips(run, last_factorization)) return true;
  active_set_.restore(best_, best_set_);
  return false;
}

bool Polish::try_flips(Run& run, int last_factorization) {
  const auto better = [&] {
    const int budget = std::min(kTrialBudget, last_factorization - run.factorizations);
    return active_set_.solve(run, budget) &&
           active_set_.images().objective <
               best_objective_ - kLeastDecrease * (1.0 + std::abs(best_objective_));
  };
  for (const Candidate& candidate : candidates_) active_set_.flip(candidate.pair);
  if (better()) return true;
  if (candidates_.size() == 1) return false;
  for (std::size_t i = 0; i < std::min(kSingleTrials, candidates_.size()); ++i) {
    if (run.factorizations >= last_factorization) return false;
    active_set_.restore(best_, best_set_);
    active_set_.flip(candidates_[i].pair);
    if (better()) return true;
  }
  return false;
}

}  // namespace marble
