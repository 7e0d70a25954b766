#include "polish.h"

#include <algorithm>
#include <cmath>

namespace marble {
namespace {

constexpr double kWrongSign = 1e-7;      // a fixed side's multiplier this far on the wrong side shows descent
constexpr double kLeastDecrease = 1e-9;  // relative fall of the objective that counts
constexpr int kTrialBudget = 12;         // factorizations one changed partition may cost
constexpr double kBiactive = 1e-3;  // a free side below this is as good as zero when candidates are ranked
constexpr std::size_t kLargestBlock = 32;

}  // namespace

Polish::Polish(const ScaledProblem& problem, Kkt& kkt)
    : active_set_(problem, kkt), best_(problem), best_set_(problem) {
  candidates_.reserve(static_cast<std::size_t>(problem.pairs()));
}

bool Polish::run(const Iterate& iterate, Run& run, int budget, int search_budget) {
  active_set_.start_from_path(iterate);
  if (!active_set_.solve(run, budget)) return false;
  const int last_factorization = run.factorizations + search_budget;
  while (improve(run, last_factorization)) {
  }
  return true;
}

// Pairs whose fixed side could be left with descent, ranked by what that promises against how far the other
// branch is.
void Polish::collect_candidates() {
  candidates_.clear();
  const WorkingSet& set = active_set_.set();
  const Iterate& x = active_set_.x();
  const Images& images = active_set_.images();
  for (std::size_t i = 0; i < set.left_fixed.size(); ++i) {
    const auto pair = static_cast<Index>(i);
    const bool left = set.left_fixed[i] != 0;
    const double lambda = left ? x.lambda_L()[pair] : x.lambda_R()[pair];
    const double other_side = left ? images.right[pair] : images.left[pair];
    if (lambda > kWrongSign) candidates_.push_back({pair, lambda / (kBiactive + std::max(0.0, other_side))});
  }
  std::sort(candidates_.begin(), candidates_.end(), [](const Candidate& a, const Candidate& b) {
    return a.rank != b.rank ? a.rank > b.rank : a.pair < b.pair;
  });
}

// One better partition, or false: blocks of the best candidates first, then one by one.
bool Polish::improve(Run& run, int last_factorization) {
  collect_candidates();
  if (candidates_.empty()) return false;
  best_.all = active_set_.x().all;
  best_set_ = active_set_.set();
  best_objective_ = active_set_.images().objective;
  const std::size_t count = candidates_.size();
  for (std::size_t block = std::min(kLargestBlock, count); block >= 2; block /= 2) {
    if (flips_help(0, block, run, last_factorization)) return true;
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (flips_help(i, 1, run, last_factorization)) return true;
  }
  return false;
}

bool Polish::flips_help(std::size_t first, std::size_t count, Run& run, int last_factorization) {
  const int budget = std::min(kTrialBudget, last_factorization - run.factorizations);
  if (budget <= 0 || run.interrupted()) return false;
  for (std::size_t i = first; i < first + count; ++i) active_set_.flip(candidates_[i].pair);
  const double target = best_objective_ - kLeastDecrease * (1.0 + std::abs(best_objective_));
  if (active_set_.solve(run, budget) && active_set_.images().objective < target) return true;
  active_set_.restore(best_, best_set_);
  return false;
}

}  // namespace marble
