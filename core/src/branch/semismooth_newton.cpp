#include "branch/semismooth_newton.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/tuning.h"

namespace marble {

SemismoothNewton::SemismoothNewton(const ScaledProblem& problem, Kkt& kkt, BranchPoint& point)
    : center(problem), problem_(problem), kkt_(kkt), point_(point), unclipped_(problem.layout.size()) {
  breakpoints_.reserve(static_cast<std::size_t>(problem.inequalities()) +
                       static_cast<std::size_t>(problem.pairs()));
}

bool SemismoothNewton::minimize(Run& run, const Penalty& penalty, int last) {
  evaluate_multipliers(penalty);
  choose_rows(penalty);
  evaluate_gradient(penalty);
  return iterate(run, penalty, last, false);
}

bool SemismoothNewton::minimize_from_rows(Run& run, const Penalty& penalty, int last) {
  evaluate_multipliers(penalty);
  evaluate_gradient(penalty);
  const bool factored = point_.is_factored(penalty.rho, penalty.delta);
  if (run.interrupted() ||
      (!factored && (run.factorizations >= last || !point_.factor(run, penalty.rho, penalty.delta))))
    return false;
  return find_step() && move(penalty, 1.0) && iterate(run, penalty, last, true);
}

// The problem is solved after a full step that changes no row.
bool SemismoothNewton::iterate(Run& run, const Penalty& penalty, int last, bool full_step) {
  while (true) {
    const double size = 1.0 + max_abs(point_.images.stationarity);
    if (max_abs(point_.workspace.gradient) <= tuning::exactness * size) return true;
    if (full_step && point_.is_factored(penalty.rho, penalty.delta)) return true;
    if (run.interrupted() || run.factorizations >= last || !point_.factor(run, penalty.rho, penalty.delta))
      return false;
    if (!find_step()) return false;
    const double length = exact_length(penalty);
    lost_descent_ = length == 0.0;
    if (lost_descent_ || !move(penalty, length)) return false;
    full_step = std::abs(length - 1.0) <= tuning::near;
  }
}

bool SemismoothNewton::find_step() {
  auto& [step, step_images, gradient] = point_.workspace;
  step.z() = -gradient;
  step.y().setZero();
  if (!kkt_.solve(step.z(), step.y())) return false;
  step_images.evaluate_rows(problem_, step.z());
  return true;
}

// Returns false if the point diverges.
bool SemismoothNewton::move(const Penalty& penalty, double length) {
  point_.x.z() += length * point_.workspace.step.z();
  if (!(max_abs(point_.x.z()) <= tuning::runaway)) return false;
  evaluate_multipliers(penalty);
  choose_rows(penalty);
  evaluate_gradient(penalty);
  return true;
}

void SemismoothNewton::evaluate_multipliers(const Penalty& penalty) {
  Images& images = point_.images;
  images.evaluate_rows(problem_, point_.x.z());
  images.equality += problem_.b;
  images.rows.all += problem_.offset;
  point_.x.y() = center.y() + penalty.rho * images.equality;
  unclipped_ = center.lambda() + penalty.rho * images.rows.all;
}

// Selects the free rows that are below zero.
void SemismoothNewton::choose_rows(const Penalty& penalty) {
  const double tie = tuning::roundoff * penalty.rho;
  const double* const unclipped = unclipped_.data();
  std::uint8_t* const held = point_.set.held.data();
  point_.set.for_each_free_row([=](Index row) { held[row] = unclipped[row] < tie; });
}

void SemismoothNewton::evaluate_gradient(const Penalty& penalty) {
  const double* const unclipped = unclipped_.data();
  const std::uint8_t* const held = point_.set.held.data();
  double* const lambda = point_.x.lambda().data();
  for (Index row = 0; row < problem_.layout.size(); ++row) lambda[row] = held[row] ? unclipped[row] : 0.0;
  point_.images.evaluate_duals(problem_, point_.x);
  point_.workspace.gradient =
      point_.images.stationarity + problem_.g + penalty.delta * (point_.x.z() - center.z());
}

// Returns the root of the derivative of the piecewise quadratic along the step. The derivative increases and
// is linear between breakpoints. Returns 0 if the step is not a descent direction.
double SemismoothNewton::exact_length(const Penalty& penalty) {
  auto& [step, step_images, gradient] = point_.workspace;
  double slope = gradient.dot(step.z());
  if (!(slope < 0.0)) return 0.0;
  multiply(problem_.Q, step.z(), step_images.gradient);
  double curvature = step.z().dot(step_images.gradient) + penalty.delta * step.z().squaredNorm() +
                     penalty.rho * step_images.equality.squaredNorm();
  breakpoints_.clear();
  const double* const rates = step_images.rows.all.data();
  const double* const unclipped = unclipped_.data();
  const std::uint8_t* const held = point_.set.held.data();
  const double rho = penalty.rho;
  const auto bends = [&](Index row, bool fixed) {
    const double rate = rates[row];
    const double bend = rho * rate * rate;
    if (held[row] != 0) curvature += bend;
    if (fixed || rate == 0.0 || (held[row] != 0) != (rate > 0.0)) return;
    const double at = std::max(0.0, -unclipped[row] / (rho * rate));  // where α + ρc changes its sign
    breakpoints_.push_back({at, held[row] != 0 ? -bend : bend});
  };
  for (Index row = 0; row < problem_.inequalities(); ++row) bends(row, false);
  for (Index i = 0; i < problem_.pairs(); ++i) {
    bends(problem_.layout.s(i), point_.set.s_fixed[i] != 0);
    bends(problem_.layout.t(i), point_.set.s_fixed[i] == 0);
  }
  std::sort(breakpoints_.begin(), breakpoints_.end(),
            [](const Breakpoint& a, const Breakpoint& b) { return a.step < b.step; });
  double position = 0.0;
  for (const Breakpoint& breakpoint : breakpoints_) {
    const double next = slope + curvature * (breakpoint.step - position);
    if (next >= 0.0) break;
    slope = next;
    position = breakpoint.step;
    curvature += breakpoint.slope;
  }
  return curvature > 0.0 ? position - slope / curvature : position + 1.0;
}

bool SemismoothNewton::converge(Run& run, const Penalty& penalty, int last) {
  Iterate& x = point_.x;
  x.all = center.all;
  lost_descent_ = false;
  double least_error = std::numeric_limits<double>::infinity();
  int without_progress = 0;
  while (true) {
    if (!minimize(run, penalty, last)) return false;
    const double error = std::max((x.all - center.all).lpNorm<Eigen::Infinity>() / penalty.rho,
                                  penalty.delta * (x.z() - center.z()).lpNorm<Eigen::Infinity>());
    if (error <= tuning::exactness) return true;
    // If the multipliers only grow, the branch is infeasible.
    without_progress = error > 0.5 * least_error ? without_progress + 1 : 0;
    if (without_progress >= tuning::augmented_patience) return false;
    least_error = std::min(error, least_error);
    center.all = x.all;
  }
}

}  // namespace marble
