#include "global/dual_active_set.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "model/tuning.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

DualActiveSet::DualActiveSet(GramColumns& gram)
    : gram_(gram),
      kind_(static_cast<std::size_t>(gram.size()), RowKind::inequality),
      place_(static_cast<std::size_t>(gram.size()), -1),
      mu_(Vector::Zero(gram.size())),
      v_(Vector::Zero(gram.size())),
      mu_center_(Vector::Zero(gram.size())),
      v_center_(Vector::Zero(gram.size())) {}

void DualActiveSet::start(ConstVectorRef multipliers, ConstVectorRef slacks) {
  mu_ = mu_center_ = multipliers;
  v_ = v_center_ = slacks;
  held_.clear();
  std::ranges::fill(place_, -1);
  factor_.clear();
  gain_ = 0.0;
}

bool DualActiveSet::recenter(ConstVectorRef slacks) {
  mu_center_ = mu_;
  v_center_ = slacks;
  gain_ = 0.0;
  return solve_held();
}

bool DualActiveSet::hold(const std::vector<Index>& rows) {
  held_ = rows;
  gain_ = 0.0;
  return refactor() && solve_held();
}

// Rows that depend on others are left out.
bool DualActiveSet::refactor() {
  std::ranges::fill(place_, -1);
  const auto size = static_cast<Eigen::Index>(held_.size());
  matrix_.resize(size, size);
  for (Eigen::Index j = 0; j < size; ++j) {
    const double* const column = gram_(held_[j]);
    if (column == nullptr) return false;
    for (Eigen::Index i = j; i < size; ++i) matrix_(i, j) = column[held_[i]];
  }
  if (factor_.factorize(matrix_)) {
    for (Eigen::Index i = 0; i < size; ++i) place_[held_[i]] = static_cast<Index>(i);
    return true;
  }
  std::vector<Index> rows;
  rows.swap(held_);
  for (const Index row : rows) {
    if (!direction(row, 1.0)) return false;
    if (!dependent_) append(row);
  }
  return true;
}

// Computes the multipliers that keep the held rows at zero; all others are 0. Rows with a wrong sign are
// removed, the worst first.
bool DualActiveSet::solve_held() {
  const double wrong = -tuning::rounding * (1.0 + max_abs(mu_));
  while (true) {
    for (Index row = 0; row < gram_.size(); ++row) {
      if (!is_held(row)) mu_[row] = 0.0;
    }
    const auto size = static_cast<Eigen::Index>(held_.size());
    rates_.resize(size);
    for (Eigen::Index i = 0; i < size; ++i) rates_[i] = -v_center_[held_[i]];
    for (Index row = 0; row < gram_.size(); ++row) {
      if (is_held(row) || mu_center_[row] == 0.0) continue;
      const double* const column = gram_(row);
      if (column == nullptr) return false;
      for (Eigen::Index i = 0; i < size; ++i) rates_[i] += mu_center_[row] * column[held_[i]];
    }
    factor_.solve_lower(rates_);
    factor_.solve_upper(rates_);
    Eigen::Index worst = -1;
    double least = wrong;
    for (Eigen::Index i = 0; i < size; ++i) {
      const Index row = held_[i];
      mu_[row] = mu_center_[row] + rates_[i];
      if (kind_[row] != RowKind::fixed && mu_[row] < least) {
        least = mu_[row];
        worst = i;
      }
    }
    if (worst < 0) return evaluate_slacks();
    drop(worst);
  }
}

// Adds four columns in one pass over the slacks, which are larger than the first cache. Each slack gets its
// terms in the same order as by one column after the other: the same bits.
bool DualActiveSet::evaluate_slacks() {
  struct Term {
    double moved;
    const double* column;
  };
  std::array<Term, 4> terms;
  std::size_t count = 0;
  v_ = v_center_;
  const auto scaled = [&](const Term& term) {
    return term.moved * Eigen::Map<const Vector>(term.column, gram_.size());
  };
  for (Index row = 0; row < gram_.size(); ++row) {
    const double moved = mu_[row] - mu_center_[row];
    if (moved == 0.0) continue;
    terms[count++] = {moved, gram_(row)};
    if (terms[count - 1].column == nullptr) return false;
    if (count < terms.size()) continue;
    v_ = (((v_ + scaled(terms[0])) + scaled(terms[1])) + scaled(terms[2])) + scaled(terms[3]);
    count = 0;
  }
  for (std::size_t k = 0; k < count; ++k) v_ += scaled(terms[k]);
  for (const Index row : held_) v_[row] = 0.0;
  return true;
}

Index DualActiveSet::most_violated() const {
  double worst = tuning::zero;
  Index result = -1;
  for (Index row = 0; row < gram_.size(); ++row) {
    if (violation(row) <= worst) continue;
    worst = violation(row);
    result = row;
  }
  return result;
}

// Computes how the held multipliers move when that of `row` moves by `sign`.
bool DualActiveSet::direction(Index row, double sign) {
  const double* const column = gram_(row);
  if (column == nullptr) return false;
  const auto size = static_cast<Eigen::Index>(held_.size());
  column_.resize(size);
  for (Eigen::Index i = 0; i < size; ++i) column_[i] = column[held_[i]];
  factor_.solve_lower(column_);
  pivot_ = column[row] - column_.squaredNorm();
  dependent_ = !(pivot_ > tuning::rounding * column[row] + tuning::exactness);
  rates_ = -sign * column_;
  factor_.solve_upper(rates_);
  return true;
}

void DualActiveSet::append(Index row) {
  factor_.append(column_, std::sqrt(pivot_));
  place_[row] = static_cast<Index>(held_.size());
  held_.push_back(row);
}

void DualActiveSet::drop(Eigen::Index at) {
  factor_.remove(at);
  mu_[held_[at]] = 0.0;
  place_[held_[at]] = -1;
  held_.erase(held_.begin() + at);
  for (auto i = static_cast<std::size_t>(at); i < held_.size(); ++i) place_[held_[i]] = static_cast<Index>(i);
}

DualActiveSet::Taken DualActiveSet::take(Index row, double enough, int most_steps) {
  double v = v_[row];
  const double sign = v < 0.0 ? 1.0 : -1.0;
  while (true) {
    if (!direction(row, sign) || --most_steps < 0) return Taken::stopped;
    ++steps_;
    double length = dependent_ ? kInfinity : std::abs(v) / pivot_;
    Eigen::Index leaving = -1;
    for (Eigen::Index i = 0; i < rates_.size(); ++i) {
      if (rates_[i] >= 0.0 || kind_[held_[i]] == RowKind::fixed) continue;
      const double until = std::max(0.0, mu_[held_[i]]) / -rates_[i];
      if (until >= length) continue;
      length = until;
      leaving = i;
    }
    if (!std::isfinite(length) && std::abs(v) <= tuning::near) {  // a contradiction due to rounding
      kind_[row] = RowKind::ignored;
      return Taken::held;
    }
    if (!std::isfinite(length)) {
      blocked_ = row;
      ray_.setZero(gram_.size());
      for (Eigen::Index i = 0; i < rates_.size(); ++i) ray_[held_[i]] = rates_[i];
      ray_[row] = sign;
      return Taken::infeasible;
    }
    for (Eigen::Index i = 0; i < rates_.size(); ++i) mu_[held_[i]] += length * rates_[i];
    mu_[row] += length * sign;
    const double rate = dependent_ ? 0.0 : pivot_;
    gain_ += length * (std::abs(v) - 0.5 * length * rate);
    v += length * sign * rate;
    if (leaving < 0) {
      append(row);
      return Taken::held;
    }
    drop(leaving);
    if (gain_ >= enough) return Taken::enough;
  }
}

// Chooses the most violated rows, besides the one that is added first.
void DualActiveSet::choose_candidates(Index first) {
  candidates_.clear();
  if (most_candidates_ < 2) return;
  for (Index row = 0; row < gram_.size(); ++row) {
    if (row != first && violation(row) > tuning::zero) candidates_.push_back(row);
  }
  const auto more = [this](Index a, Index b) { return violation(a) > violation(b); };
  if (candidates_.size() >= static_cast<std::size_t>(most_candidates_)) {
    std::ranges::nth_element(candidates_, candidates_.begin() + most_candidates_ - 1, more);
    candidates_.resize(static_cast<std::size_t>(most_candidates_) - 1);
  }
}

// Updates only their slacks; returns −1 if none is violated any more.
Index DualActiveSet::next_candidate() {
  Index worst = -1;
  for (const Index row : candidates_) {
    if (is_held(row)) continue;
    double v = v_center_[row];
    for (const Index held : held_) v += (mu_[held] - mu_center_[held]) * gram_(held)[row];
    v_[row] = v;
    if (violation(row) > (worst < 0 ? tuning::zero : violation(worst))) worst = row;
  }
  return worst;
}

DualActiveSet::End DualActiveSet::run(double enough, int most_steps, const Interrupt& interrupt) {
  const std::int64_t last = steps_ + most_steps;
  Checkpoint checkpoint(interrupt);
  // Every row that is added increases the dual objective. One that does not for so many rows in turn is lost
  // in rounding.
  Index stalled = 0;
  while (true) {
    Index row = most_violated();
    if (row < 0) return End::optimal;
    choose_candidates(row);
    for (; row >= 0; row = next_candidate()) {
      if (gain_ >= enough) return End::cutoff;
      const auto held = static_cast<std::int64_t>(held_.size()) + 1;
      if (steps_ >= last || stalled > gram_.size() || checkpoint.reached(held * (held + gram_.size())))
        return End::stopped;
      const double before = gain_;
      const Taken taken = take(row, enough, static_cast<int>(last - steps_));
      stalled = gain_ > before ? 0 : stalled + 1;
      if (candidates_.empty() || taken != Taken::held) {
        if (!evaluate_slacks()) return End::stopped;
      }
      if (taken == Taken::enough) return End::cutoff;
      if (taken == Taken::infeasible) return End::infeasible;
      if (taken == Taken::stopped) return End::stopped;
    }
    if (!candidates_.empty() && !evaluate_slacks()) return End::stopped;
  }
}

double DualActiveSet::first_gain(Index row) {
  const double v = v_[row];
  const double sign = v < 0.0 ? 1.0 : -1.0;
  if (is_held(row) || v == 0.0 || !direction(row, sign)) return 0.0;
  double length = dependent_ ? kInfinity : std::abs(v) / pivot_;
  for (Eigen::Index i = 0; i < rates_.size(); ++i) {
    if (rates_[i] < 0.0 && kind_[held_[i]] != RowKind::fixed)
      length = std::min(length, std::max(0.0, mu_[held_[i]]) / -rates_[i]);
  }
  if (!std::isfinite(length)) return kInfinity;
  return length * (std::abs(v) - 0.5 * length * (dependent_ ? 0.0 : pivot_));
}

// ½μ² / (S⁻¹)ᵢᵢ with S = LLᵀ, the matrix of the held rows.
double DualActiveSet::release_gain(Index row) {
  if (!is_held(row) || mu_[row] >= 0.0) return 0.0;
  rates_.setZero(factor_.size());
  rates_[place_[row]] = 1.0;
  factor_.solve_lower(rates_);
  return 0.5 * mu_[row] * mu_[row] / rates_.squaredNorm();
}

void DualActiveSet::save(State& state) const {
  state.held = held_;
  state.kind = kind_;
  state.mu = mu_;
  state.v = v_;
  state.mu_center = mu_center_;
  state.v_center = v_center_;
  state.factor.take(factor_);
}

void DualActiveSet::restore(const State& state) {
  held_ = state.held;
  kind_ = state.kind;
  mu_ = state.mu;
  v_ = state.v;
  mu_center_ = state.mu_center;
  v_center_ = state.v_center;
  factor_.take(state.factor);
  std::ranges::fill(place_, -1);
  for (std::size_t i = 0; i < held_.size(); ++i) place_[held_[i]] = static_cast<Index>(i);
  gain_ = 0.0;
}

}  // namespace marble
