#include "local_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace marble {
namespace {

constexpr double kImprovement = 1e-6;  // least relative fall of the objective
constexpr double kSmallObjective = 1e-2;
constexpr double kLeastMultiplier = 1e-5;  // a fixed side that pulls less is left alone
constexpr double kNear = 1e-3;     // a free side below this is as good as zero when candidates are ranked
constexpr double kAlike = 0.05;    // relative change that makes a failed candidate worth another try
constexpr int kFirstRelax = 200;   // factorizations for the first elastic optimum
constexpr int kRelax = 60;         // for one at a new ρ
constexpr int kTake = 20;          // for one after a move
constexpr double kSettled = 1e-7;  // violation at which a higher ρ would change nothing
constexpr double kLeastFinalRho = 1e6;

constexpr double kLeastExchangeMultiplier = 1e-4;
constexpr std::size_t kMostExchanged = 12;
constexpr std::size_t kMostCompanions = 3;
constexpr double kClimb = 2.0;            // of the whole objective, that an exchange may rise on its way
constexpr double kStiffCompanion = 0.05;  // of the driven row's own stiffness
constexpr double kFastCompanion = 0.3;    // of the fastest companion's rate

}  // namespace

LocalSearch::LocalSearch(const ScaledProblem& problem, Kkt& kkt, ActiveSet& active_set)
    : problem_(problem),
      active_set_(active_set),
      parametric_(problem, kkt),
      before_(problem),
      next_(problem),
      failed_multiplier_(problem.pairs()),
      failed_slack_(problem.pairs()),
      reporter_(problem) {
  candidates_.reserve(static_cast<std::size_t>(problem.pairs()));
  companions_.reserve(static_cast<std::size_t>(problem.pairs()));
  failed_exchanges_.reserve(4 * kMostExchanged * kMostCompanions);
}

bool LocalSearch::run(Run& run, const SearchPlan& plan, int last_factorization) {
  accepted_ = 0;
  lost_ = false;
  if (plan.from_exact) {
    active_set_.anchor_here();
  } else {
    active_set_.anchor_at_zero();
  }
  bool first = true;
  for (double rho = plan.rho_first;; rho = std::min(rho * plan.rho_factor, plan.rho_last)) {
    const int budget = std::min(first ? kFirstRelax : kRelax, last_factorization - run.factorizations);
    if (!active_set_.relax(run, rho, first && plan.from_exact, budget)) return false;
    parametric_.start(active_set_);
    failed_exchanges_.clear();
    failed_multiplier_.setConstant(std::numeric_limits<double>::infinity());
    const bool last = rho >= plan.rho_last || (rho >= kLeastFinalRho && largest_violation() < kSettled);
    const bool flips = first || last || rho <= plan.rho_soft;
    int before = 0;
    do {
      before = accepted_;
      if (rho >= plan.rho_exchange) search_exchanges(run, plan.exchange_patience, last_factorization);
      if (flips) search_flips(run, first ? plan.first_patience : plan.flip_patience, last_factorization);
    } while (rho >= plan.rho_exchange && accepted_ > before && !lost_ && !run.interrupted() &&
             run.factorizations < last_factorization);
    if (last || lost_) return !lost_;
    first = false;
  }
}

double LocalSearch::least_improvement() const {
  return kImprovement * std::max(kSmallObjective, std::abs(active_set_.elastic_objective()));
}

double LocalSearch::largest_violation() const {
  const Iterate& x = active_set_.x();
  return std::max({max_abs(x.y()), max_abs(x.lambda_w()), max_abs(x.lambda_L()), max_abs(x.lambda_R())}) /
         active_set_.rho();
}

int LocalSearch::pulling(const Iterate& x, const WorkingSet& set) {
  int count = 0;
  for (std::size_t i = 0; i < set.left_fixed.size(); ++i) {
    const auto pair = static_cast<Index>(i);
    if ((set.left_fixed[i] ? x.lambda_L()[pair] : x.lambda_R()[pair]) > kLeastMultiplier) ++count;
  }
  return count;
}

void LocalSearch::sort_candidates() {
  std::sort(candidates_.begin(), candidates_.end(), [](const Candidate& a, const Candidate& b) {
    return a.rank != b.rank ? a.rank < b.rank : a.pair < b.pair;
  });
}

// Pairs whose fixed side pulls, by how hard it pulls against how far its other side is from zero.
void LocalSearch::rank_flips() {
  candidates_.clear();
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    const double multiplier = parametric_.multiplier(parametric_.fixed_row(pair));
    const double slack = parametric_.slack(parametric_.free_row(pair));
    if (multiplier > -kLeastMultiplier) continue;
    const bool alike = std::abs(multiplier - failed_multiplier_[pair]) <= kAlike * std::abs(multiplier) &&
                       std::abs(slack - failed_slack_[pair]) <= kAlike * (slack + 1e-6);
    if (!alike) candidates_.push_back({pair, multiplier / (kNear + slack)});
  }
  sort_candidates();
}

// First improvement, and on from there through the same list until a whole list has nothing.
void LocalSearch::search_flips(Run& run, int patience, int last_factorization) {
  int failures = 0;
  for (bool any = true; any;) {
    any = false;
    rank_flips();
    for (const Candidate& candidate : candidates_) {
      if (lost_ || failures >= patience || run.factorizations >= last_factorization || run.interrupted())
        return;
      const Index pair = candidate.pair;
      const Index fixed = parametric_.fixed_row(pair);
      const Index free = parametric_.free_row(pair);
      const double multiplier = parametric_.multiplier(fixed);
      if (multiplier > -kLeastMultiplier) continue;
      failed_multiplier_[pair] = multiplier;
      failed_slack_[pair] = parametric_.slack(free);
      const Parametric::Move flip[] = {{fixed, false}, {free, true}};
      if (parametric_.follow(flip, active_set_.elastic_objective() - least_improvement(), 0.0) &&
          take(run, {&pair, 1})) {
        any = true;
        failures = 0;
        failed_multiplier_[pair] = std::numeric_limits<double>::infinity();
      } else {
        ++failures;
      }
    }
  }
}

// Makes the moves that Parametric has just followed, or takes them back if its word was wrong.
bool LocalSearch::take(Run& run, std::span<const Index> pairs) {
  before_ = next_ = active_set_.set();
  const double rho = active_set_.rho();
  const double target = active_set_.elastic_objective() - 0.5 * least_improvement();
  for (const Index pair : pairs) next_.left_fixed[pair] ^= 1U;
  parametric_.read_active_rows(next_);
  active_set_.set_working_set(next_);
  const bool better = active_set_.relax(run, rho, true, kTake) && active_set_.elastic_objective() < target;
  if (better) {
    ++accepted_;
    ++run.iterations;
    report(run);
  } else {
    active_set_.set_working_set(before_);
    lost_ = !active_set_.relax(run, rho, true, kTake);
    if (lost_) return false;
  }
  parametric_.start(active_set_);
  return better;
}

// An accepted move is an iteration of the search.
void LocalSearch::report(Run& run) {
  Progress progress;
  progress.objective = active_set_.images().objective / problem_.cost_scale + problem_.c0;
  progress.violations = violations(problem_, active_set_.images());
  progress.rho = active_set_.rho();
  progress.step_length = 1.0;
  reporter_.tell(run, active_set_.x().z(), progress);
}

// Pairs that pull hardest, their other side not at zero.
void LocalSearch::rank_exchanges() {
  candidates_.clear();
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    const double multiplier = parametric_.multiplier(parametric_.fixed_row(pair));
    if (multiplier < -kLeastExchangeMultiplier && parametric_.slack(parametric_.free_row(pair)) > 0.0)
      candidates_.push_back({pair, multiplier});
  }
  sort_candidates();
  if (candidates_.size() > kMostExchanged) candidates_.resize(kMostExchanged);
}

// Pairs that begin to pull as `pair` changes sides: those it takes the place of. Nearest to their corner
// first.
void LocalSearch::find_companions(Index pair) {
  companions_.clear();
  if (!parametric_.probe(parametric_.fixed_row(pair), parametric_.free_row(pair))) return;
  double fastest = 0.0;
  for (Index other = 0; other < problem_.pairs(); ++other) {
    if (other != pair) fastest = std::max(fastest, -parametric_.probed_rate(parametric_.fixed_row(other)));
  }
  if (fastest < kStiffCompanion * parametric_.probed_stiffness()) return;
  for (Index other = 0; other < problem_.pairs(); ++other) {
    if (other != pair && -parametric_.probed_rate(parametric_.fixed_row(other)) > kFastCompanion * fastest)
      companions_.push_back({other, parametric_.slack(parametric_.free_row(other))});
  }
  std::sort(companions_.begin(), companions_.end(), [](const Candidate& a, const Candidate& b) {
    return a.rank != b.rank ? a.rank < b.rank : a.pair < b.pair;
  });
  if (companions_.size() > kMostCompanions) companions_.resize(kMostCompanions);
}

bool LocalSearch::failed_before(const Candidate& candidate, const Candidate& companion) const {
  const auto alike = [](const Candidate& a, const Candidate& b) {
    return a.pair == b.pair && std::abs(a.rank - b.rank) <= kAlike * std::abs(b.rank);
  };
  return std::any_of(failed_exchanges_.begin(), failed_exchanges_.end(), [&](const auto& failed) {
    return alike(candidate, failed.first) && alike(companion, failed.second);
  });
}

void LocalSearch::search_exchanges(Run& run, int patience, int last_factorization) {
  int failures = 0;
  while (exchange_some(run, failures, patience, last_factorization)) {
  }
}

// A pair and one that takes its place, both flipped: the companion leaves its corner first, so that little
// else has to change on the way.
bool LocalSearch::exchange_some(Run& run, int& failures, int patience, int last_factorization) {
  rank_exchanges();
  for (const Candidate& candidate : candidates_) {
    find_companions(candidate.pair);
    for (const Candidate& companion : companions_) {
      if (lost_ || failures >= patience || run.factorizations >= last_factorization || run.interrupted())
        return false;
      if (failed_before(candidate, companion)) continue;
      const Index pairs[] = {candidate.pair, companion.pair};
      const Parametric::Move exchange[] = {{parametric_.fixed_row(pairs[1]), false},
                                           {parametric_.free_row(pairs[0]), true},
                                           {parametric_.free_row(pairs[1]), true},
                                           {parametric_.fixed_row(pairs[0]), false}};
      const double climb =
          kClimb * std::abs(active_set_.elastic_objective() + problem_.c0 * problem_.cost_scale);
      if (parametric_.follow(exchange, active_set_.elastic_objective() - least_improvement(), climb) &&
          take(run, pairs)) {
        failures = 0;
        return true;
      }
      ++failures;
      if (failed_exchanges_.size() < failed_exchanges_.capacity())
        failed_exchanges_.push_back({candidate, companion});
    }
  }
  return false;
}

}  // namespace marble
