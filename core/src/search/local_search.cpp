#include "search/local_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/tuning.h"

namespace marble {

LocalSearch::LocalSearch(const ScaledProblem& problem, Kkt& kkt, ElasticRelaxation& elastic)
    : problem_(problem),
      elastic_(elastic),
      parametric_(problem, kkt),
      before_(problem),
      next_(problem),
      failed_multiplier_(problem.pairs()),
      failed_slack_(problem.pairs()),
      reporter_(problem),
      blocks_(problem.pairs() >= tuning::large_pairs),
      taken_(blocks_ ? static_cast<std::size_t>(problem.layout.size()) : 0) {
  candidates_.reserve(static_cast<std::size_t>(problem.pairs()));
  companions_.reserve(static_cast<std::size_t>(problem.pairs()));
  failed_exchanges_.reserve(4 * tuning::exchange_candidates * tuning::exchange_companions);
}

bool LocalSearch::run(Run& run, const SearchPlan& plan, int last_factorization) {
  const Run::Searching searching(run);
  accepted_ = 0;
  lost_ = false;
  if (plan.resumes) {
    // The anchor is kept.
  } else if (plan.from_exact) {
    elastic_.anchor_here();
  } else {
    elastic_.anchor_at_zero();
  }
  bool rows_hold = plan.from_exact || plan.resumes;
  bool first = !plan.resumes || rho_ <= plan.rho_first;
  bool resumes = plan.resumes;
  for (double rho = plan.resumes ? rho_ : plan.rho_first;;
       rho = std::min(rho * plan.rho_factor, plan.rho_last)) {
    rho_ = rho;
    const int budget = std::min(tuning::engine_budget, last_factorization - run.factorizations);
    const auto rows = rows_hold ? ElasticRelaxation::Rows::held : ElasticRelaxation::Rows::violated;
    if (!elastic_.solve(run, rho, rows, budget)) return false;
    parametric_.start(elastic_);
    if (!std::exchange(resumes, false)) {
      switch_failures_ = exchange_failures_ = 0;
      failed_exchanges_.clear();
      failed_multiplier_.setConstant(std::numeric_limits<double>::infinity());
    }
    const bool last = rho >= plan.rho_last || largest_violation() < tuning::near;
    const bool switches = first || last || rho <= plan.rho_soft;
    int before = 0;
    do {
      before = accepted_;
      if (rho >= plan.rho_exchange) search_exchanges(run, plan.exchange_patience, last_factorization);
      const int patience = first ? plan.first_patience : plan.switch_patience;
      if (switches && blocks_) {
        search_blocks(run, patience, last_factorization);
      } else if (switches) {
        search_switches(run, patience, last_factorization);
      }
      if (!run.interrupted()) switch_failures_ = 0;
    } while (rho >= plan.rho_exchange && accepted_ > before && !lost_ && !run.interrupted() &&
             run.factorizations < last_factorization);
    if (last || lost_) return !lost_;
    if (first && elastic_.objective() > plan.cutoff) return false;
    if (run.interrupted()) return false;
    first = rows_hold = false;
  }
}

double LocalSearch::least_improvement() const {
  return tuning::near * std::max(1.0, std::abs(elastic_.objective()));
}

double LocalSearch::largest_violation() const {
  const Iterate& x = elastic_.point().x;
  return std::max(max_abs(x.y()), max_abs(x.lambda())) / elastic_.rho();
}

int LocalSearch::pulling(const Iterate& x, const WorkingSet& set) {
  int count = 0;
  for (Index pair = 0; pair < set.layout.pairs; ++pair) {
    if (x.lambda()[set.fixed_row(pair)] > tuning::pull) ++count;
  }
  return count;
}

void LocalSearch::sort_candidates() {
  std::sort(candidates_.begin(), candidates_.end(), [](const Candidate& a, const Candidate& b) {
    return a.rank != b.rank ? a.rank < b.rank : a.pair < b.pair;
  });
}

// Lists pairs whose fixed side has a wrong-sign multiplier, ordered by that multiplier relative to the
// distance of the other side from zero.
void LocalSearch::rank_switches() {
  candidates_.clear();
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    const double multiplier = parametric_.multiplier(parametric_.fixed_row(pair));
    const double slack = parametric_.slack(parametric_.free_row(pair));
    if (multiplier > -tuning::pull) continue;
    const bool alike =
        std::abs(multiplier - failed_multiplier_[pair]) <= tuning::alike * std::abs(multiplier) &&
        std::abs(slack - failed_slack_[pair]) <= tuning::alike * (slack + tuning::near);
    if (!alike) candidates_.push_back({pair, multiplier / (tuning::near + slack)});
  }
  sort_candidates();
}

// Returns whether the switch of a pair improves the objective; nothing if its multiplier has the right sign
// by now. It counts as failed until it is made.
std::optional<bool> LocalSearch::follow_switch(Index pair) {
  const Index fixed = parametric_.fixed_row(pair);
  const Index free = parametric_.free_row(pair);
  const double multiplier = parametric_.multiplier(fixed);
  if (multiplier > -tuning::pull) return std::nullopt;
  failed_multiplier_[pair] = multiplier;
  failed_slack_[pair] = parametric_.slack(free);
  const Parametric::Move moves[] = {{fixed, false}, {free, true}};
  return parametric_.follow(moves, elastic_.objective() - least_improvement(), 0.0).has_value();
}

// Takes the first improvement and continues through the same list, until a whole list gives none.
void LocalSearch::search_switches(Run& run, int patience, int last_factorization) {
  for (bool any = true; any;) {
    any = false;
    rank_switches();
    for (const Candidate& candidate : candidates_) {
      if (lost_ || switch_failures_ >= patience || run.factorizations >= last_factorization ||
          run.interrupted())
        return;
      const Index pair = candidate.pair;
      const std::optional<bool> gains = follow_switch(pair);
      if (!gains) continue;
      if (*gains && take(run, {&pair, 1})) {
        any = true;
        switch_failures_ = 0;
        failed_multiplier_[pair] = std::numeric_limits<double>::infinity();
      } else {
        ++switch_failures_;
      }
    }
  }
}

// In a large problem most switches do not affect each other. Those that gain by themselves and change
// different rows are made together, with one solve. As above, the first improvements are taken, until a whole
// list gives none.
void LocalSearch::search_blocks(Run& run, int patience, int last_factorization) {
  const auto most = static_cast<std::size_t>(problem_.pairs() / tuning::large_block);
  const auto stops = [&] {
    return lost_ || switch_failures_ >= patience || run.factorizations >= last_factorization ||
           run.interrupted();
  };
  for (bool any = true; any && !stops();) {
    any = false;
    rank_switches();
    for (auto next = candidates_.begin(); next != candidates_.end() && !stops();) {
      block_.clear();
      block_rows_.clear();
      std::fill(taken_.begin(), taken_.end(), std::uint8_t{0});
      for (; next != candidates_.end() && block_.size() < most && !stops(); ++next) {
        const std::optional<bool> gains = follow_switch(next->pair);
        if (!gains) continue;
        if (*gains) {
          if (add_to_block(next->pair)) switch_failures_ = 0;
        } else {
          ++switch_failures_;
        }
      }
      any = take_block(run) || any;
    }
  }
}

// Adds a pair that Parametric has just switched, if its rows are not those of other members.
bool LocalSearch::add_to_block(Index pair) {
  const std::size_t begin = block_rows_.size();
  parametric_.read_changed_rows(block_rows_);
  const auto rows = std::span(block_rows_).subspan(begin);
  if (std::any_of(rows.begin(), rows.end(), [this](Index row) { return taken_[row] != 0; })) {
    block_rows_.resize(begin);
    failed_multiplier_[pair] = std::numeric_limits<double>::infinity();
    return false;
  }
  for (const Index row : rows) taken_[row] = 1;
  block_.push_back({pair, block_rows_.size()});
  return true;
}

// Makes the moves of the block, or those of its first half, or of its first quarter, and so on.
bool LocalSearch::take_block(Run& run) {
  if (block_.empty()) return false;
  if (run.interrupted()) {  // a run that resumes tries them again
    for (const Member& member : block_)
      failed_multiplier_[member.pair] = std::numeric_limits<double>::infinity();
    return false;
  }
  before_ = elastic_.point().set;
  bool better = false;
  for (std::size_t count = block_.size(); count > 0 && !better && !lost_; count /= 2)
    better = take_first(run, count);
  if (lost_) return false;
  parametric_.start(elastic_);
  if (!better) ++switch_failures_;
  return better;
}

bool LocalSearch::take_first(Run& run, std::size_t count) {
  const double rho = elastic_.rho();
  const double target = elastic_.objective() - 0.5 * least_improvement();
  WorkingSet& set = elastic_.point().set;
  for (std::size_t k = 0; k < count; ++k) set.switch_pair(block_[k].pair);
  for (std::size_t k = 0; k < block_[count - 1].end; ++k) {
    const Index row = block_rows_[k];
    if (!set.is_fixed(row)) set.held[row] = before_.held[row] ^ 1U;
  }
  if (elastic_.solve(run, rho, ElasticRelaxation::Rows::held, tuning::engine_budget) &&
      elastic_.objective() < target) {
    accepted_ += static_cast<int>(count);
    ++run.iterations;
    report(run);
    for (std::size_t k = 0; k < count; ++k)
      failed_multiplier_[block_[k].pair] = std::numeric_limits<double>::infinity();
    return true;
  }
  set = before_;
  lost_ = !elastic_.solve(run, rho, ElasticRelaxation::Rows::held, tuning::engine_budget);
  return false;
}

// Makes the moves that Parametric has just followed, or undoes them if its prediction was wrong.
bool LocalSearch::take(Run& run, std::span<const Index> pairs) {
  before_ = next_ = elastic_.point().set;
  const double rho = elastic_.rho();
  const double target = elastic_.objective() - 0.5 * least_improvement();
  for (const Index pair : pairs) next_.switch_pair(pair);
  parametric_.read_active_rows(next_);
  elastic_.point().set = next_;
  const bool better = elastic_.solve(run, rho, ElasticRelaxation::Rows::held, tuning::engine_budget) &&
                      elastic_.objective() < target;
  if (better) {
    ++accepted_;
    ++run.iterations;
    report(run);
  } else {
    elastic_.point().set = before_;
    lost_ = !elastic_.solve(run, rho, ElasticRelaxation::Rows::held, tuning::engine_budget);
    if (lost_) return false;
  }
  parametric_.start(elastic_);
  return better;
}

// An accepted move is an iteration of the search.
void LocalSearch::report(Run& run) {
  const Images& images = elastic_.point().images;
  reporter_.report(run, elastic_.point().x.z(), images.objective, violations(problem_, images),
                   {.rho = elastic_.rho(), .step_length = 1.0});
}

// Lists pairs with the largest wrong-sign multipliers whose other side is not at zero.
void LocalSearch::rank_exchanges() {
  candidates_.clear();
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    const double multiplier = parametric_.multiplier(parametric_.fixed_row(pair));
    if (multiplier < -tuning::pull && parametric_.slack(parametric_.free_row(pair)) > 0.0)
      candidates_.push_back({pair, multiplier});
  }
  sort_candidates();
  if (candidates_.size() > tuning::exchange_candidates) candidates_.resize(tuning::exchange_candidates);
}

// Lists the pairs whose multiplier gets the wrong sign as `pair` changes sides, which can take its place.
// Those nearest to their corner come first.
void LocalSearch::find_companions(Index pair) {
  companions_.clear();
  if (!parametric_.probe(parametric_.fixed_row(pair), parametric_.free_row(pair))) return;
  double fastest = 0.0;
  for (Index other = 0; other < problem_.pairs(); ++other) {
    if (other != pair) fastest = std::max(fastest, -parametric_.probed_rate(parametric_.fixed_row(other)));
  }
  if (fastest < tuning::exchange_stiffness * parametric_.probed_stiffness()) return;
  for (Index other = 0; other < problem_.pairs(); ++other) {
    if (other != pair &&
        -parametric_.probed_rate(parametric_.fixed_row(other)) > tuning::exchange_speed * fastest)
      companions_.push_back({other, parametric_.slack(parametric_.free_row(other))});
  }
  std::sort(companions_.begin(), companions_.end(), [](const Candidate& a, const Candidate& b) {
    return a.rank != b.rank ? a.rank < b.rank : a.pair < b.pair;
  });
  if (companions_.size() > tuning::exchange_companions) companions_.resize(tuning::exchange_companions);
}

bool LocalSearch::failed_before(const Candidate& candidate, const Candidate& companion) const {
  const auto alike = [](const Candidate& a, const Candidate& b) {
    return a.pair == b.pair && std::abs(a.rank - b.rank) <= tuning::alike * std::abs(b.rank);
  };
  return std::any_of(failed_exchanges_.begin(), failed_exchanges_.end(), [&](const auto& failed) {
    return alike(candidate, failed.first) && alike(companion, failed.second);
  });
}

void LocalSearch::search_exchanges(Run& run, int patience, int last_factorization) {
  while (exchange_some(run, patience, last_factorization)) {
  }
  if (!run.interrupted()) exchange_failures_ = 0;
}

// Exchanges a pair and its companion, which both switch. The companion leaves its corner first, so that
// little else has to change on the way.
bool LocalSearch::exchange_some(Run& run, int patience, int last_factorization) {
  rank_exchanges();
  for (const Candidate& candidate : candidates_) {
    find_companions(candidate.pair);
    for (const Candidate& companion : companions_) {
      if (lost_ || exchange_failures_ >= patience || run.factorizations >= last_factorization ||
          run.interrupted())
        return false;
      if (failed_before(candidate, companion)) continue;
      const Index pairs[] = {candidate.pair, companion.pair};
      const Parametric::Move exchange[] = {{parametric_.fixed_row(pairs[1]), false},
                                           {parametric_.free_row(pairs[0]), true},
                                           {parametric_.free_row(pairs[1]), true},
                                           {parametric_.fixed_row(pairs[0]), false}};
      const double climb =
          tuning::exchange_climb * std::abs(elastic_.objective() + problem_.c0 * problem_.cost_scale);
      if (parametric_.follow(exchange, elastic_.objective() - least_improvement(), climb) &&
          take(run, pairs)) {
        exchange_failures_ = 0;
        return true;
      }
      ++exchange_failures_;
      if (failed_exchanges_.size() < failed_exchanges_.capacity())
        failed_exchanges_.push_back({candidate, companion});
    }
  }
  return false;
}

}  // namespace marble
