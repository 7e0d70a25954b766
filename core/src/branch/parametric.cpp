#include "branch/parametric.h"

#include <algorithm>
#include <cmath>

#include "model/tuning.h"

namespace marble {
namespace {

// Number of responses to keep: those of all rows if they fit, otherwise enough for at least two candidates.
double responses_kept(Index pairs, double rows) {
  if (pairs == 0) return 0.0;
  return std::min(rows,
                  std::max(2.0 * tuning::rows_apart, tuning::large_bytes / (8.0 * std::max(1.0, rows))));
}

}  // namespace

double Parametric::response_bytes(Index pairs, double rows) {
  return 8.0 * rows * responses_kept(pairs, rows);
}

Parametric::Parametric(const ScaledProblem& problem, Kkt& kkt)
    : problem_(problem),
      kkt_(kkt),
      rows_(problem.layout.size()),
      start_(problem),
      start_state_(rows_),
      state_(rows_),
      start_value_(rows_),
      value_(rows_),
      value_rate_(rows_),
      change_(rows_),
      capacity_(static_cast<Index>(responses_kept(problem.pairs(), rows_))),
      responses_(new double[static_cast<std::size_t>(capacity_) * rows_]),
      response_of_row_(rows_),
      displacement_(problem.variables()),
      bordered_(std::min(tuning::rows_apart, rows_)),
      right_side_(tuning::rows_apart) {
  keep_blas_to_one_thread();
  changed_.reserve(tuning::rows_apart + 2);  // direction() fails only beyond this size
}

void Parametric::start(const ElasticRelaxation& optimum) {
  start_objective_ = optimum.objective();
  read_values(optimum.point(), start_value_);
  start(optimum.point());
}

void Parametric::start(const BranchPoint& point) {
  rho_ = point.rho();
  start_ = point.set;
  for (Index row = 0; row < rows_; ++row) {
    start_state_[row].fixed = start_.is_fixed(row);
    if (!start_state_[row].fixed) start_value_[row] = std::max(0.0, start_value_[row]);
  }
  std::fill(response_of_row_.begin(), response_of_row_.end(), -1);
  used_ = 0;
}

void Parametric::read_values(const BranchPoint& point, Vector& values) const {
  for (Index row = 0; row < rows_; ++row)
    values[row] = point.set.held[row] ? -point.x.lambda()[row] : point.images.rows.all[row];
}

void Parametric::begin_change(const BranchPoint& point) { read_values(point, start_value_); }

// The remembered values are optimal for the problem's numbers shifted by some difference, which goes to 0.
void Parametric::follow_change(BranchPoint& point) {
  start(point);
  reset();
  read_values(point, change_);
  change_ -= start_value_;
  double left = 1.0;
  for (Index event = 0; event >= 0 && events_ <= tuning::rows_apart && direction(change_.data(), 1.0, -1);) {
    double length = left;
    event = first_event(length, -1);
    advance(length);
    left -= length;
    if (event >= 0) toggle(event);
  }
  read_active_rows(point.set);
  start_value_ = value_;
  for (const Changed& changed : changed_) start_value_[changed.row] = changed.value;
}

void Parametric::reset() {
  value_ = start_value_;
  state_ = start_state_;
  changed_.clear();
  bordered_.clear();
  objective_ = start_objective_;
  events_ = 0;
  lost_ = false;
  if (used_ + tuning::rows_apart > capacity_ && capacity_ < rows_) {  // space for at least one candidate
    std::fill(response_of_row_.begin(), response_of_row_.end(), -1);
    used_ = 0;
  }
}

// A force f along row j adds f·e_j to the right-hand side. A slack θ in an active row, u + ν/ρ = θ, adds
// ρθ·e_j.
const double* Parametric::response(Index row) {
  if (response_of_row_[row] >= 0) return kept_response(row);
  if (used_ == capacity_) return nullptr;
  const RowMatrix& matrix = problem_.rows;
  const auto begin = static_cast<std::size_t>(matrix.row_pointers[row]);
  const auto count = static_cast<std::size_t>(matrix.row_size(row));
  if (!kkt_.solve_sparse({matrix.column_indices.data() + begin, count}, {matrix.values.data() + begin, count},
                         displacement_))
    return nullptr;
  double* out = responses_.get() + static_cast<std::size_t>(used_) * rows_;
  multiply(matrix, displacement_, Eigen::Map<Vector>(out, rows_));
  const double force = start_.held[row] ? rho_ : 1.0;
  const double factors[] = {force, -rho_ * force};  // a table: which rows are active is hard to predict
  for (Index i = 0; i < rows_; ++i) out[i] *= factors[start_.held[i] & 1U];
  if (start_.held[row]) out[row] += rho_;
  response_of_row_[row] = used_++;
  return out;
}

// Computes the rates of all values while the prescribed row's slack changes at its rate, or the driven row's
// slack falls at rate 1. All other changed rows stay as they are: zero slack if they were inactive, zero
// multiplier if active.
bool Parametric::direction(Index prescribed, double prescribed_rate, Index driven) {
  const double* fixed_part = prescribed < 0 ? nullptr : response(prescribed);
  if (prescribed >= 0 && fixed_part == nullptr) return false;
  return direction(fixed_part, prescribed_rate, driven);
}

// The same for rates without the changed rows: those of a response, or of a change of the numbers.
bool Parametric::direction(const double* fixed_part, double fixed_rate, Index driven) {
  const int count = static_cast<int>(changed_.size());
  if (count > tuning::rows_apart || kkt_.interrupt().requested()) return false;
  while (bordered_.size() < count) {
    const Index last = bordered_.size();
    const Index row = changed_[last].row;
    if (response(row) == nullptr) return false;
    bordered_.append([&](Index a, Index b) {
      const double own = a == b && !start_.held[row] ? 1.0 / rho_ : 0.0;
      return kept_response(changed_[b].row)[changed_[a].row] + own;
    });
  }
  auto rate = right_side_.head(count);
  for (int a = 0; a < count; ++a) {
    const Index row = changed_[a].row;
    rate[a] = (row == driven ? -1.0 : 0.0) - (fixed_part == nullptr ? 0.0 : fixed_rate * fixed_part[row]);
  }
  if (!bordered_.solve(rate)) return false;
  if (fixed_part != nullptr) {
    value_rate_ = fixed_rate * Eigen::Map<const Vector>(fixed_part, rows_);
  } else {
    value_rate_.setZero();
  }
  for (int a = 0; a < count; ++a) {
    changed_[a].rate = rate[a];
    if (!std::isfinite(rate[a])) return false;
  }
  const auto column = [this](int a) {
    return Eigen::Map<const Vector>(kept_response(changed_[a].row), rows_);
  };
  int a = 0;
  for (; a + 4 <= count; a += 4) {  // four at a time: the sum is limited by memory bandwidth
    value_rate_ += rate[a] * column(a) + rate[a + 1] * column(a + 1) + rate[a + 2] * column(a + 2) +
                   rate[a + 3] * column(a + 3);
  }
  for (; a < count; ++a) value_rate_ += rate[a] * column(a);
  return true;
}

// Returns the first row that changes sign within `length`, which is shortened to that point; -1 if none does.
Index Parametric::first_event(double& length, Index driven) const {
  Index first = -1;
  const double* value = value_.data();
  const double* rate = value_rate_.data();
  const RowState* state = state_.data();
  const auto look = [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      if (value[i] + length * rate[i] >= 0.0 || rate[i] >= -tuning::rounding || state[i].changed ||
          state[i].fixed)
        continue;
      const double at = std::max(0.0, value[i]) / -rate[i];
      if (at < length) {
        length = at;
        first = i;
      }
    }
  };
  constexpr Index group = 8;  // few groups have a row that changes sign
  Index i = 0;
  for (; i + group <= rows_; i += group) {
    const Eigen::Map<const Eigen::Array<double, group, 1>> values(value + i), rates(rate + i);
    if ((values + length * rates).minCoeff() < 0.0) look(i, i + group);
  }
  look(i, rows_);
  for (const Changed& changed : changed_) {
    if (changed.row == driven || state[changed.row].fixed || changed.rate >= -tuning::rounding) continue;
    const double at = std::max(0.0, changed.value) / -changed.rate;
    if (at < length) {
      length = at;
      first = changed.row;
    }
  }
  return first;
}

void Parametric::advance(double length) {
  value_ += length * value_rate_;
  for (Changed& changed : changed_) changed.value += length * changed.rate;
}

std::size_t Parametric::find(Index row) const {
  std::size_t k = 0;
  while (changed_[k].row != row) ++k;
  return k;
}

void Parametric::unchange(std::size_t k) {
  if (bordered_.size() == std::ssize(changed_)) {
    bordered_.remove(static_cast<Index>(k));
  } else {
    bordered_.clear();  // rows were added after the last direction: rare
  }
  changed_[k] = changed_.back();
  changed_.pop_back();
}

void Parametric::toggle(Index row) {
  ++events_;
  value_[row] = 0.0;
  if (state_[row].changed) {
    unchange(find(row));
  } else {
    changed_.push_back({row, 0.0});
  }
  state_[row].changed = !state_[row].changed;
}

bool Parametric::has_direction(Index prescribed, double prescribed_rate, Index driven) {
  lost_ = events_ > tuning::rows_apart || !direction(prescribed, prescribed_rate, driven);
  return !lost_;
}

// Raises the slack of a fixed active row until its negative multiplier has become 0.
bool Parametric::release(Index row) {
  state_[row].fixed = false;
  if (value_[row] >= -tuning::pull) {
    value_[row] = std::max(0.0, value_[row]);
    return true;
  }
  double slack = 0.0;
  state_[row].changed = true;
  for (Index event = row; event >= 0;) {
    if (!has_direction(row, 1.0, -1)) return false;
    const double rate = value_rate_[row];
    lost_ = rate <= tuning::roundoff;
    if (lost_) return false;
    double length = -value_[row] / rate;
    event = first_event(length, -1);
    objective_ += length * (value_[row] + 0.5 * rate * length);
    slack += length;
    advance(length);
    if (event >= 0) toggle(event);
  }
  value_[row] = 0.0;
  changed_.push_back({row, slack});
  return true;
}

// Lowers a row's slack to 0, where it stays as an equality. Returns false as soon as the objective cannot end
// below `limit`.
bool Parametric::drive(Index row, double limit) {
  state_[row].fixed = true;
  if (is_active(row)) return objective_ < limit;
  // If the row was released before, its slack is prescribed; otherwise the force that lowers it is the
  // unknown.
  const bool prescribed = start_.held[row] != 0;
  double slack = 0.0;
  if (prescribed) {
    const std::size_t k = find(row);
    slack = changed_[k].value;
    unchange(k);
  } else {
    slack = std::max(0.0, value_[row]);
    changed_.push_back({row, 0.0});
    state_[row].changed = true;
    if (slack <= tuning::rounding) value_[row] = 0.0;
  }
  while (slack > tuning::rounding) {
    if (!has_direction(prescribed ? row : -1, -1.0, row)) return false;
    const double multiplier = prescribed ? value_[row] : changed_[find(row)].value;
    const double rate = prescribed ? value_rate_[row] : changed_[find(row)].rate;
    double length = slack;
    const Index event = first_event(length, row);
    objective_ -= length * (multiplier + 0.5 * rate * length);
    slack -= length;
    advance(length);
    // The objective is convex along this path, so its tangent is a lower bound.
    if (objective_ + std::max(0.0, -(multiplier + rate * length)) * slack >= limit) return false;
    if (event < 0) break;
    toggle(event);
  }
  if (prescribed) state_[row].changed = false;
  return objective_ < limit;
}

std::optional<double> Parametric::follow(std::span<const Move> moves, double cutoff, double climb) {
  reset();
  std::size_t last_drive = 0;
  for (std::size_t k = 0; k < moves.size(); ++k) {
    if (moves[k].drive) last_drive = k;
  }
  const double limit = last_drive + 1 < moves.size() ? cutoff + climb : cutoff;
  for (const Move& move : moves) {
    if (!(move.drive ? drive(move.row, limit) : release(move.row))) return std::nullopt;
  }
  if (!(objective_ < cutoff)) return std::nullopt;
  return objective_;
}

bool Parametric::may_gain(const BranchPoint& point, double gain) {
  start_objective_ = 0.0;
  read_values(point, start_value_);
  start(point);
  std::vector<Index> pulling;
  std::vector<Move> moves;
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    const Index row = fixed_row(pair);
    if (start_value_[row] < -tuning::pull) {
      pulling.push_back(pair);
      moves.push_back({row, false});
    } else {
      start_state_[row].fixed = false;
      start_value_[row] = std::max(0.0, start_value_[row]);
    }
  }
  return std::any_of(pulling.begin(), pulling.end(), [&](Index pair) {
    const Index own = fixed_row(pair);
    std::iter_swap(std::find_if(moves.begin(), moves.end(), [&](const Move& m) { return m.row == own; }),
                   moves.end() - 1);
    moves.push_back({free_row(pair), true});
    const bool gains = follow(moves, -gain, 0.0).has_value() || lost_;
    moves.pop_back();
    return gains;
  });
}

void Parametric::read_active_rows(WorkingSet& set) const {
  set.for_each_free_row([&](Index row) { set.held[row] = is_active(row); });
}

void Parametric::read_changed_rows(std::vector<Index>& rows) const {
  for (const Changed& changed : changed_) rows.push_back(changed.row);
}

bool Parametric::probe(Index release, Index drive) {
  if (start_.held[drive]) return false;
  reset();
  changed_.push_back({release, 0.0});
  changed_.push_back({drive, 0.0});
  return direction(-1, 0.0, drive);
}

}  // namespace marble
