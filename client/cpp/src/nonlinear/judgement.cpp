// Evaluates a step and x in the loop: merit, KKT residual and trust region.
#include <algorithm>
#include <cmath>

#include "nonlinear/algebra.h"
#include "nonlinear/sqpcc.h"
#include "nonlinear/tuning.h"

namespace marble::nonlinear {

double Loop::predicted_decrease() const {
  const double model = restoring_ ? 0.0 : dot(at_.gradient, step_.d) + 0.5 * quadratic(B_->upper(), step_.d);
  return weights_->penalty(rows_of(point_)) - weights_->penalty(step_.rows()) - model;
}

// Computes the actual decrease over the predicted one.
Expected<void> Loop::judge() {
  for (std::size_t j = 0; j < step_.d.size(); ++j) trial_.x[j] = point_.x[j] + step_.d[j];
  MARBLE_RETURN_IF_ERROR(functions_.values(trial_));
  if (trial_.fault) return {};
  actual_ = merit(point_) - merit(trial_);
  ratio_ = std::max(predicted_, std::abs(actual_)) <= noise() ? 1.0 : actual_ / predicted_;
  return {};
}

// The rows are curved along the step: solves again with their true values at its end.
Expected<void> Loop::correct() {
  if (trial_.fault || weights_->penalty(rows_of(trial_)) <= weights_->penalty(step_.rows())) return {};
  auto& subproblem = *subproblem_[static_cast<int>(Kind::plain)];
  subproblem.correct(trial_, step_);
  MARBLE_ASSIGN_OR_RETURN(auto found, ask_prepared(Kind::plain));
  if (!found) return limit_.reset(), Expected<void>{};
  std::swap(trial_, best_trial_);
  const double ratio = ratio_, actual = actual_;
  std::swap(step_.d, tried_.d);
  auto judged = judge();
  row_.corrected = judged && !trial_.fault && ratio_ > ratio;
  if (!row_.corrected) {
    std::swap(step_.d, tried_.d), std::swap(trial_, best_trial_);
    ratio_ = ratio, actual_ = actual;
  }
  return judged;
}

// If the decrease is better than predicted, the curvature falls along the step. On the way from a pole each
// Newton step covers only a share of x, so the step is doubled while that lowers the merit and leaves no row.
// This calls only Problem::values.
Expected<void> Loop::lengthen() {
  if (ratio_ <= tuning::longer || step_.elastic || restoring_) return {};
  double most = radius_ / step_.size;
  for (std::size_t j = 0; j < step_.d.size(); ++j) {
    const double d = step_.d[j];
    const double room = d > 0.0 ? functions_.upper()[j] - point_.x[j] : point_.x[j] - functions_.lower()[j];
    if (d != 0.0) most = std::min(most, room / std::abs(d));
  }
  const double penalty = weights_->penalty(rows_of(trial_)) + noise();
  double length = 1.0, lowest = merit(trial_);
  for (double next = 2.0; next <= most; next *= 2.0) {
    for (std::size_t j = 0; j < step_.d.size(); ++j)
      best_trial_.x[j] =
          std::clamp(point_.x[j] + next * step_.d[j], functions_.lower()[j], functions_.upper()[j]);
    MARBLE_RETURN_IF_ERROR(functions_.values(best_trial_));
    if (best_trial_.fault || !(merit(best_trial_) < lowest) ||
        weights_->penalty(rows_of(best_trial_)) > penalty)
      break;
    std::swap(best_trial_, trial_);
    length = next, lowest = merit(trial_);
  }
  if (length == 1.0) return {};
  for (double& d : step_.d) d *= length;
  step_.size *= length;
  actual_ = merit(point_) - lowest;
  return {};
}

void Loop::adapt_radius() {
  if (ratio_ < tuning::reject)
    radius_ = 0.5 * (step_.size > 0.0 ? std::min(radius_, step_.size) : radius_);
  else if (ratio_ < tuning::poor)
    radius_ *= 0.5;
  else if (ratio_ > tuning::good)
    radius_ = std::min(settings_.largest_radius, std::max(radius_, 2.0 * step_.size));
}

double largest_slope(const Linearisation& at, const Multipliers& m) {
  return std::max({1.0, largest(at.gradient), largest(m.equalities), largest(m.inequalities), largest(m.G),
                   largest(m.H)});
}

void lagrangian_gradient(const Linearisation& at, const Multipliers& m, std::vector<double>& gradient) {
  gradient = at.gradient;
  add_transposed(at.equalities, m.equalities, 1.0, gradient);
  add_transposed(at.inequalities, m.inequalities, -1.0, gradient);
  add_transposed(at.G, m.G, -1.0, gradient), add_transposed(at.H, m.H, -1.0, gradient);
}

double Loop::kkt_residual() {
  lagrangian_gradient(at_, step_.multipliers, gradient_);
  for (std::size_t j = 0; j < gradient_.size(); ++j) gradient_[j] -= step_.multipliers.bounds[j];
  return largest(gradient_);
}

// Relative to the objective's slopes only: if rows are linearly dependent, multipliers are unbounded.
bool Loop::is_stationary(double share) {
  return kkt_residual() <= share * std::max(1.0, largest(at_.gradient));
}

// A step may be zero because B is too large: then x is no solution. B of bfgs is reset, since so short a step
// does not change it.
bool Loop::stalls() {
  const bool zero =
      step_is_small() && !step_.elastic && !restoring_ && violation() <= settings_.feasibility_tolerance;
  if (zero && B_->learns() && restarts_ < tuning::most_restarts && !is_stationary(stationary_))
    ++restarts_, forget_curvature_ = true;
  stalled_ = zero && std::abs(actual_) <= noise() ? stalled_ + 1 : 0;
  return stalled_ >= tuning::most_stalled;
}

}  // namespace marble::nonlinear
