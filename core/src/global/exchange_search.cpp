#include "global/exchange_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "model/tuning.h"
#include "path/noise.h"
#include "search/row_access.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

ExchangeSearch::ExchangeSearch(const ScaledProblem& problem, BranchPoint& point, Incumbent& incumbent)
    : problem_(problem), point_(point), incumbent_(incumbent) {}

bool ExchangeSearch::applies(const ScaledProblem& problem) {
  const RowAccess rows(problem);
  const RowLayout& layout = problem.layout;
  std::vector<Index> pair_of(static_cast<std::size_t>(problem.variables()), -1);
  for (Index pair = 0; pair < layout.pairs; ++pair) {
    for (const Index side : {layout.s(pair), layout.t(pair)})
      rows.for_each_entry(rows.first_row() + side, [&](Index column, double) { pair_of[column] = pair; });
  }
  std::vector<Index> last_row(static_cast<std::size_t>(layout.pairs), -1);
  for (Index row = 0; row < rows.first_row() + layout.inequalities; ++row) {
    Index tied = 0;
    rows.for_each_entry(row, [&](Index column, double) {
      const Index pair = pair_of[column];
      if (pair >= 0 && std::exchange(last_row[pair], row) != row) ++tied;
    });
    if (2 * tied >= layout.pairs) return true;
  }
  return false;
}

bool ExchangeSearch::prepare(Run& run, double most_bytes) {
  const double bytes = most_bytes - Gram::most_bytes(problem_);
  KktCost least;
  std::unique_ptr<Kkt> kkt = make_kkt(problem_, {bytes, kInfinity}, run.interrupt(), least);
  if (kkt == nullptr) return false;
  gram_ = std::make_unique<Gram>(problem_);
  engine_ = std::make_unique<Relaxation>(problem_, std::move(kkt), *gram_);
  box_.emplace(problem_, reach_from(problem_, incumbent_.best().x.z()));
  return engine_->bytes() <= bytes && engine_->prepare(run);
}

std::int64_t ExchangeSearch::run(Run& run, std::int64_t most_points, double most_bytes) {
  const Run::Polishing polishing(run);
  bounded_ = 0;
  most_points_ = most_points;
  if (most_points <= 0 || !prepare(run, most_bytes) || !start(run)) return bounded_;
  while (descend(run)) {
    if (!perturb(run)) break;
  }
  return bounded_;
}

// Solves the incumbent's branch by the engine.
bool ExchangeSearch::start(Run& run) {
  const ExactSolution& best = incumbent_.best();
  sides_ = best.set.s_fixed;
  if (!engine_->start(best.x.z())) return false;
  for (Index pair = 0; pair < problem_.pairs(); ++pair) engine_->fix(best.set.fixed_row(pair));
  ++bounded_;
  if (engine_->solve(*box_, kInfinity, run.interrupt()) != NodeEngine::End::optimal) return false;
  objective_ = engine_->bound();
  engine_->save();
  return true;
}

Index ExchangeSearch::draw_pair() { return static_cast<Index>(noise(0, draws_++) * problem_.pairs()); }

// A gain must be more than what the engine's bounds leave open.
double ExchangeSearch::cutoff() const {
  return objective_ - tuning::exchange_gain * (1.0 + std::abs(objective_));
}

// Moves to the branch `to` if its objective is below the cutoff, or stays.
bool ExchangeSearch::move(Run& run, const Sides& to, double cutoff) {
  std::vector<Index> released, fixed;
  const RowLayout& rows = problem_.layout;
  for (Index pair = 0; pair < rows.pairs; ++pair) {
    if (to[pair] == sides_[pair]) continue;
    released.push_back(rows.s(pair));
    fixed.push_back(rows.t(pair));
    if (to[pair] != 0) std::swap(released.back(), fixed.back());
  }
  ++bounded_;
  bool better = engine_->release(released);
  if (better) {
    for (const Index row : fixed) engine_->fix(row);
    better = engine_->solve(*box_, cutoff, run.interrupt()) == NodeEngine::End::optimal &&
             engine_->bound() < cutoff;
  }
  if (!better) {
    engine_->restore();
    return false;
  }
  objective_ = engine_->bound();
  sides_ = to;
  engine_->save();
  return true;
}

bool ExchangeSearch::move_to(Run& run, const Neighbour& to, double cutoff) {
  trial_ = sides_;
  trial_[to.one] ^= 1U;
  if (to.other != to.one) trial_[to.other] ^= 1U;
  return move(run, trial_, cutoff);
}

// Lists as many neighbours as there are pairs, by largest estimated decrease: what the side that becomes free
// gains by its multiplier, less what the other loses on its way to zero. A side that cannot reach zero by
// itself says nothing of its exchanges. Pairs on opposite sides are exchanged: what one gives up, the other
// may take.
void ExchangeSearch::list_neighbours() {
  const Index pairs = problem_.pairs();
  const RowLayout& rows = problem_.layout;
  std::vector<double> decrease(static_cast<std::size_t>(pairs));
  neighbours_.clear();
  for (Index pair = 0; pair < pairs; ++pair) {
    const bool s = sides_[pair] != 0;
    const double loss = engine_->first_gain(s ? rows.t(pair) : rows.s(pair));
    const double gain = engine_->release_gain(s ? rows.s(pair) : rows.t(pair));
    decrease[pair] = gain - (std::isfinite(loss) ? loss : 0.0);
    neighbours_.push_back({pair, pair, std::isfinite(loss) ? decrease[pair] : -kInfinity});
  }
  for (Index one = 0; one < pairs; ++one) {
    for (Index other = one + 1; other < pairs; ++other) {
      if (sides_[one] != sides_[other]) neighbours_.push_back({one, other, decrease[one] + decrease[other]});
    }
  }
  const auto most = neighbours_.begin() + std::min(pairs, static_cast<Index>(neighbours_.size()));
  std::ranges::partial_sort(neighbours_, most, [](const Neighbour& a, const Neighbour& b) {
    return std::tie(b.decrease, a.one, a.other) < std::tie(a.decrease, b.one, b.other);
  });
  neighbours_.erase(most, neighbours_.end());
}

// Moves to the first neighbour that is better.
bool ExchangeSearch::find_better(Run& run) {
  list_neighbours();
  for (const Neighbour& to : neighbours_) {
    if (ended(run)) return false;
    if (move_to(run, to, cutoff())) return true;
  }
  return false;
}

// Returns false if nothing is left to search with.
bool ExchangeSearch::descend(Run& run) {
  while (find_better(run)) {
  }
  if (run.interrupted()) return false;
  if (objective_ < incumbent_.best().objective - tuning::exchange_gain * (1.0 + std::abs(objective_)))
    offer(run);
  return !ended(run);
}

// Solves the present branch exactly.
void ExchangeSearch::offer(Run& run) {
  Iterate x(problem_);
  x.z() = engine_->z();
  x.y() = engine_->y();
  x.lambda() = -engine_->multipliers();
  WorkingSet set(problem_);
  for (Index row = 0; row < problem_.layout.size(); ++row) set.held[row] = engine_->is_held(row) ? 1 : 0;
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    const bool s = sides_[pair] != 0;
    set.fix(pair, s, engine_->is_held(s ? problem_.layout.t(pair) : problem_.layout.s(pair)));
  }
  point_.restore(x, set);
  static_cast<void>(incumbent_.solve_branch(run, "exchanges of pairs", tuning::engine_budget));
}

// Moves from the incumbent's branch by some random exchanges, each to a feasible branch.
bool ExchangeSearch::perturb(Run& run) {
  if (!move(run, incumbent_.best().set.s_fixed, kInfinity)) return false;
  for (int made = 0, tried = 0; made < tuning::exchange_kicks && !ended(run); ++tried) {
    if (tried > problem_.pairs()) return made > 0;
    const Index one = draw_pair(), other = draw_pair();
    if (sides_[one] == sides_[other]) continue;
    if (move_to(run, {one, other}, kInfinity)) ++made;
  }
  return !ended(run);
}

}  // namespace marble
