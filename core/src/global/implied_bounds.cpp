#include "global/implied_bounds.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "global/dual_bound.h"
#include "global/row_activity.h"
#include "model/careful_sum.h"
#include "model/tuning.h"
#include "proof/row_problem.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double entries(const ScaledProblem& p) {
  return static_cast<double>(p.A.values.size()) + static_cast<double>(p.rows.values.size());
}

}  // namespace

bool ImpliedBounds::is_affordable(const ScaledProblem& problem) {
  return problem.pairs() > 0 && entries(problem) * problem.pairs() <= tuning::implied_most_work;
}

// Ends at the first side without a largest value, which in most problems is the first one.
bool ImpliedBounds::only_pairs_bound(const ScaledProblem& p, const Options& options) {
  if (!is_affordable(p) || Box(p, 1.0).is_bounded()) return false;
  ImpliedBounds implied(p, options);
  if (!implied.narrow_all()) return false;
  bool gained = false;
  for (Index row = p.inequalities(); row < p.layout.size(); ++row) {
    if (std::isfinite(implied.largest(implied.bounds_, row))) continue;
    if (!implied.probe_side(row, gained)) return false;
    if (!std::isfinite(implied.most_[row]) && !is_fixed(p.layout, implied.bounds_.sides, row)) return false;
  }
  return implied.bounds_.lower.allFinite() && implied.bounds_.upper.allFinite();
}

ImpliedBounds::ImpliedBounds(const ScaledProblem& p, const Options& options) : problem_(p) {
  rows_.columns = p.variables();
  append_rows(p.A, rows_);
  append_rows(p.rows, rows_);
  offset_.resize(rows_.rows);
  offset_ << p.b, p.offset;
  tolerance_.resize(rows_.rows);
  tolerance_ << options.equality_tolerance * p.equality_scale,
      options.inequality_tolerance * p.row_scale.head(p.inequalities()),
      options.complementarity_tolerance * p.row_scale.tail(2 * p.pairs());
  column_pointers_.assign(static_cast<std::size_t>(p.variables()) + 1, 0);
  for (const Index column : rows_.column_indices) ++column_pointers_[static_cast<std::size_t>(column) + 1];
  for (std::size_t j = 1; j < column_pointers_.size(); ++j) column_pointers_[j] += column_pointers_[j - 1];
  column_rows_.resize(rows_.column_indices.size());
  std::vector<Index> next = column_pointers_;
  for (Index row = 0; row < rows_.rows; ++row) {
    for (Index k = rows_.row_pointers[row]; k < rows_.row_pointers[row + 1]; ++k)
      column_rows_[static_cast<std::size_t>(next[rows_.column_indices[k]]++)] = row;
  }
  bounds_.lower.setConstant(p.variables(), -kInfinity);
  bounds_.upper.setConstant(p.variables(), kInfinity);
  bounds_.sides.assign(static_cast<std::size_t>(p.pairs()), Sides::relaxed);
  most_.setConstant(p.layout.size(), kInfinity);
}

// Uses one row, its least value and, if it has one, its largest value. Appends the rows that must be used
// again. Returns false if no point satisfies it.
bool ImpliedBounds::narrow_row(Bounds& bounds, Index row, std::vector<Index>& changed) const {
  const RowLayout& layout = problem_.layout;
  const Index inequality = row - problem_.equalities();
  const bool is_side = inequality >= layout.inequalities;
  const double tolerance = tolerance_[row];
  double most = kInfinity;
  if (inequality < 0) {
    most = tolerance;
  } else if (is_side) {
    most = is_fixed(layout, bounds.sides, inequality) ? tolerance : most_[inequality];
  }
  RowActivity low, high;
  const Index begin = rows_.row_pointers[row], end = rows_.row_pointers[row + 1];
  for (Index k = begin; k < end; ++k) {
    const double value = rows_.values[k];
    if (value == 0.0) continue;
    const Index j = rows_.column_indices[k];
    low.add(value * (value > 0.0 ? bounds.lower[j] : bounds.upper[j]));
    high.add(value * (value > 0.0 ? bounds.upper[j] : bounds.lower[j]));
  }
  const double terms = static_cast<double>(end - begin) + 4.0;
  const double error = terms * tuning::bound_roundoff * (std::abs(offset_[row]) + low.size + high.size);
  const double least_value = low.infinite > 0 ? -kInfinity : low.sum + offset_[row] - error;
  const double largest_value = high.infinite > 0 ? kInfinity : high.sum + offset_[row] + error;
  if (largest_value < -tolerance || least_value > most) return false;
  if (is_side && least_value > tolerance) {
    const Index pair = layout.pair_of(inequality);
    const bool s = !layout.is_s(inequality);
    const Sides now = with(bounds.sides[pair], s);
    if (now != bounds.sides[pair]) {
      bounds.sides[pair] = now;
      changed.push_back(problem_.equalities() + (s ? layout.s(pair) : layout.t(pair)));
    }
  }
  if (least_value >= -tolerance && largest_value <= most) return true;
  for (Index k = begin; k < end; ++k) {
    const double value = rows_.values[k];
    if (value == 0.0) continue;
    const Index j = rows_.column_indices[k];
    const double old_lower = bounds.lower[j], old_upper = bounds.upper[j];
    const double low_term = value * (value > 0.0 ? old_lower : old_upper);
    const double high_term = value * (value > 0.0 ? old_upper : old_lower);
    double lower = -kInfinity, upper = kInfinity;
    const auto bound = [&](double term, bool at_least) {  // a z ≥ term, or ≤
      if (!std::isfinite(term)) return;
      const double at = term / value;
      const double wider = tuning::bound_roundoff * std::abs(at);
      if ((value > 0.0) == at_least) {
        lower = at - wider;
      } else {
        upper = at + wider;
      }
    };
    bound(-tolerance - offset_[row] - high.without(high_term) - error, true);
    bound(most - offset_[row] - low.without(low_term) + error, false);
    const double width = old_upper - old_lower;
    const double least_gain =
        std::isfinite(width)
            ? tuning::implied_least_gain * width
            : tuning::implied_least_gain * (1.0 + std::min(std::abs(old_lower), std::abs(old_upper)));
    bool narrower = false;
    if (lower > old_lower && (old_lower == -kInfinity || lower - old_lower > least_gain)) {
      bounds.lower[j] = lower;
      narrower = true;
    }
    if (upper < old_upper && (old_upper == kInfinity || old_upper - upper > least_gain)) {
      bounds.upper[j] = upper;
      narrower = true;
    }
    if (!narrower) continue;
    if (bounds.lower[j] > bounds.upper[j]) return false;
    for (Index r = column_pointers_[j]; r < column_pointers_[j + 1]; ++r) changed.push_back(column_rows_[r]);
  }
  return true;
}

// Uses these rows, and then those whose variables have changed, in the order of the changes.
bool ImpliedBounds::narrow_from(Bounds& bounds, const std::vector<Index>& first) const {
  std::deque<Index> queue(first.begin(), first.end());
  std::vector<std::uint8_t> waits(static_cast<std::size_t>(rows_.rows), 0);
  for (const Index row : first) waits[row] = 1;
  std::vector<Index> changed;
  std::int64_t left = static_cast<std::int64_t>(tuning::implied_passes) * rows_.rows;
  for (; !queue.empty() && left > 0; --left) {
    const Index row = queue.front();
    queue.pop_front();
    waits[row] = 0;
    changed.clear();
    if (!narrow_row(bounds, row, changed)) return false;
    for (const Index next : changed) {
      if (std::exchange(waits[next], std::uint8_t{1}) == 0) queue.push_back(next);
    }
  }
  return true;
}

// Returns the largest value of a row over bounds, rounded up; +∞ if there is none, or a useless one.
double ImpliedBounds::largest(const Bounds& bounds, Index row) const {
  const Index at = problem_.equalities() + row;
  double sum = offset_[at], size = std::abs(offset_[at]);
  for (Index k = rows_.row_pointers[at]; k < rows_.row_pointers[at + 1]; ++k) {
    const double value = rows_.values[k];
    if (value == 0.0) continue;
    const Index j = rows_.column_indices[k];
    const double term = value * (value > 0.0 ? bounds.upper[j] : bounds.lower[j]);
    sum += term;
    size += std::abs(term);
  }
  const double terms = static_cast<double>(rows_.row_size(at)) + 4.0;
  const double most = sum + terms * tuning::bound_roundoff * size;
  return most <= tuning::scale_range ? most : kInfinity;
}

// Fixes the other side of the pair at zero. Returns false if then neither side can be zero.
bool ImpliedBounds::probe_side(Index row, bool& gained) {
  const RowLayout& layout = problem_.layout;
  const Index pair = layout.pair_of(row);
  const bool s = layout.is_s(row);
  const Sides sides = bounds_.sides[pair];
  if (has(sides, s ? Sides::s_zero : Sides::t_zero)) return true;  // it is zero already
  Bounds probed = bounds_;
  const Index other = s ? layout.t(pair) : layout.s(pair);
  probed.sides[pair] = with(sides, !s);
  if (!narrow_from(probed, {problem_.equalities() + other})) {
    if (has(sides, s ? Sides::t_zero : Sides::s_zero)) return false;
    bounds_.sides[pair] = with(sides, s);
    gained = true;
    return narrow_from(bounds_, {problem_.equalities() + row});
  }
  const double most = std::max(largest(probed, row), tolerance_[problem_.equalities() + row]);
  if (most < most_[row] &&
      (most_[row] == kInfinity || most < (1.0 - tuning::tree_probing_pays) * most_[row])) {
    gained = true;
    most_[row] = most;
    return narrow_from(bounds_, {problem_.equalities() + row});
  }
  return true;
}

bool ImpliedBounds::narrow_all() {
  std::vector<Index> all(static_cast<std::size_t>(rows_.rows));
  std::iota(all.begin(), all.end(), 0);
  return narrow_from(bounds_, all);
}

ImpliedBounds::End ImpliedBounds::probe(const Interrupt& interrupt) {
  if (!narrow_all()) return End::infeasible;
  for (int round = 0; round < tuning::implied_passes; ++round) {
    bool gained = false;
    for (Index row = problem_.inequalities(); row < problem_.layout.size(); ++row) {
      if (interrupt.requested()) return End::stopped;
      if (!probe_side(row, gained)) return End::infeasible;
    }
    if (!gained) break;
  }
  return End::bounded;
}

// A row t S + s T ≤ S T, widened by the tolerances within which one of the sides is zero, and divided by the
// larger one; or a bound of the one side that has a largest value.
void ImpliedBounds::add_row(Index pair, RowMatrix& rows, std::vector<double>& offsets) const {
  const ScaledProblem& p = problem_;
  const Index s = p.layout.s(pair), t = p.layout.t(pair);
  const bool has_most_s = std::isfinite(most_[s]), has_most_t = std::isfinite(most_[t]);
  if (bounds_.sides[pair] != Sides::relaxed || (!has_most_s && !has_most_t)) return;
  std::map<Index, CarefulSum> sums;
  double offset = 0.0, size = 0.0;
  const auto add = [&offset, &size](double term) {
    offset += term;
    size += std::abs(term);
  };
  const auto add_side = [&](Index row, double weight) {
    add(-weight * p.offset[row]);
    for (Index k = p.rows.row_pointers[row]; k < p.rows.row_pointers[row + 1]; ++k)
      sums[p.rows.column_indices[k]].add(-weight, p.rows.values[k]);
  };
  if (has_most_s && has_most_t) {
    const double larger = std::max(most_[s], most_[t]);
    const double weight_s = most_[t] / larger, weight_t = most_[s] / larger;
    add(std::min(most_[s], most_[t]));
    add(std::max(weight_s * tolerance_[p.equalities() + s], weight_t * tolerance_[p.equalities() + t]));
    add_side(s, weight_s);
    add_side(t, weight_t);
  } else {
    add(has_most_s ? most_[s] : most_[t]);
    add_side(has_most_s ? s : t, 1.0);
  }
  for (const auto& [column, sum] : sums) {
    rows.column_indices.push_back(column);
    rows.values.push_back(sum.value());
  }
  rows.row_pointers.push_back(static_cast<Index>(rows.values.size()));
  ++rows.rows;
  offsets.push_back(offset + 8.0 * tuning::bound_roundoff * size);
}

ScaledProblem ImpliedBounds::strengthened() const {
  const ScaledProblem& p = problem_;
  RowMatrix added;
  std::vector<double> offsets;
  for (Index pair = 0; pair < p.pairs(); ++pair) add_row(pair, added, offsets);
  ScaledProblem result = p;
  result.layout.inequalities += added.rows;
  const Index before = p.inequalities();
  RowMatrix& rows = result.rows;
  const Index split = p.rows.row_pointers[before];
  const auto moved = static_cast<Index>(added.values.size());
  rows.column_indices.insert(rows.column_indices.begin() + split, added.column_indices.begin(),
                             added.column_indices.end());
  rows.values.insert(rows.values.begin() + split, added.values.begin(), added.values.end());
  rows.source.insert(rows.source.begin() + split, static_cast<std::size_t>(moved), 0);
  for (std::size_t row = static_cast<std::size_t>(before); row < rows.row_pointers.size(); ++row)
    rows.row_pointers[row] += moved;
  std::vector<Index> starts;
  for (Index row = 0; row < added.rows; ++row) starts.push_back(split + added.row_pointers[row]);
  rows.row_pointers.insert(rows.row_pointers.begin() + before, starts.begin(), starts.end());
  rows.rows += added.rows;
  const auto insert = [&](Vector& values, double value, const std::vector<double>* from) {
    Vector longer(values.size() + added.rows);
    longer.head(before) = values.head(before);
    for (Index row = 0; row < added.rows; ++row)
      longer[before + row] = from != nullptr ? (*from)[row] : value;
    longer.tail(values.size() - before) = values.tail(values.size() - before);
    values = std::move(longer);
  };
  insert(result.offset, 0.0, &offsets);
  insert(result.row_scale, 1.0, nullptr);
  return result;
}

}  // namespace marble
