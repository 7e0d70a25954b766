#include "branch/branch_point.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "model/tuning.h"

namespace marble {

BranchPoint::BranchPoint(const ScaledProblem& problem, Kkt& kkt, const ScaledProblem& of_kkt)
    : x(problem),
      images(problem),
      set(problem),
      workspace(problem),
      problem_(problem),
      kkt_(kkt),
      weights_(of_kkt),
      factored_set_(problem) {}

void BranchPoint::start_from_path(const Iterate& iterate) {
  x.all = iterate.all;
  images.evaluate(problem_, x);
  for (Index i = 0; i < problem_.inequalities(); ++i)
    set.held[i] = iterate.v()[i] < 0.0;  // p(v) < p(−v): the slack is smaller than its multiplier
  const Vector& value = images.rows.all;
  for (Index i = 0; i < problem_.pairs(); ++i) {
    const RowLayout& rows = problem_.layout;
    const bool s_smaller = value[rows.s(i)] < value[rows.t(i)];
    const Index free = s_smaller ? rows.t(i) : rows.s(i);
    set.fix(i, s_smaller, value[free] < -iterate.lambda()[free]);
  }
  set.clear_others(x.lambda());
}

// Of two numbers whose product should be 0, the smaller one is taken as 0: a slack against its own
// multiplier.
void BranchPoint::start_from_solution(const Iterate& solution) {
  x.all = solution.all;
  images.evaluate(problem_, x);
  const Vector& value = images.rows.all;
  const auto lambda = x.lambda();
  for (Index i = 0; i < problem_.inequalities(); ++i) set.held[i] = value[i] < -lambda[i];
  for (Index i = 0; i < problem_.pairs(); ++i) {
    const Index s = problem_.layout.s(i);
    const Index t = problem_.layout.t(i);
    const bool s_fixed = value[s] - std::abs(lambda[s]) < value[t] - std::abs(lambda[t]);
    const Index free = s_fixed ? t : s;
    set.fix(i, s_fixed, value[free] < -lambda[free]);
  }
  set.clear_others(x.lambda());
}

void BranchPoint::start_from_point(ConstVectorRef z) {
  x.all.setZero();
  x.z() = z;
  images.evaluate(problem_, x);
  for (Index i = 0; i < problem_.pairs(); ++i) {
    const bool free_side_held = set.held[set.free_row(i)] != 0;
    set.fix(i, images.rows.s()[i] < images.rows.t()[i], free_side_held);
  }
}

void BranchPoint::restore(const Iterate& iterate, const WorkingSet& working_set) {
  x.all = iterate.all;
  set = working_set;
  images.evaluate(problem_, x);
  converged_ = false;
}

bool BranchPoint::factor(Run& run, double rho, double delta) {
  if (std::exchange(ahead_, false) && is_factored(rho, delta)) {
    ++run.factorizations;
    return true;
  }
  weights_.rho = rho;
  weights_.delta = delta;
  for (Index row = 0; row < problem_.layout.size(); ++row) weights_.rows.all[row] = set.held[row] ? rho : 0.0;
  factored_set_ = set;
  ++run.factorizations;
  convex_ = run.timed(&Times::factorization_s, [&] { return kkt_.factor(weights_); });
  factor_ = kkt_.factors();
  return convex_;
}

void BranchPoint::factor_ahead(Run& run, double rho, double delta) {
  ahead_ = false;
  ahead_ = factor(run, rho, delta);
}

bool BranchPoint::is_factored(double rho, double delta) const {
  return kkt_.factors() == factor_ && weights_.rho == rho && weights_.delta == delta && factored_set_ == set;
}

bool BranchPoint::has_factor(double rho, double delta) const {
  return kkt_.factors() == factor_ && convex_ && weights_.rho == rho && weights_.delta == delta &&
         factored_set_.held == set.held;
}

// Solves with the active rows as equalities: repeated Newton steps on (Qz + g + Jᵀλ, J_active z + c) with the
// regularized factor. The residuals contain no regularization, so the fixed point is exact. Each sweep gains
// about eight digits, or only part of one digit if rows are nearly dependent.
bool BranchPoint::sharpen(double tolerance) {
  auto& [step, step_images, gradient] = workspace;
  double last = std::numeric_limits<double>::infinity();
  converged_ = false;
  for (int sweep = 0; sweep < tuning::exact_sweeps; ++sweep) {
    images.evaluate(problem_, x);
    double error = std::max(max_abs(images.stationarity), max_abs(images.equality));
    gradient = images.stationarity;
    // dλ = ρ(J dz + c): the part ρc goes to the right-hand side.
    step.lambda() = weights_.rows.all.cwiseProduct(images.rows.all);
    for (Index row = 0; row < problem_.layout.size(); ++row) {
      if (set.held[row]) error = std::max(error, std::abs(images.rows.all[row]));
    }
    if (!std::isfinite(error) || !(max_abs(x.z()) <= tuning::runaway)) return false;
    if (error <= tolerance) return converged_ = true;
    const bool is_exact = error <= tuning::exactness;
    if (error > (is_exact ? 0.5 : tuning::exact_slowest) * last) return is_exact;  // as exact as possible
    last = error;
    add_transposed(problem_.rows, step.lambda(), gradient);
    step.z() = -gradient;
    step.y() = -images.equality;
    if (!kkt_.solve(step.z(), step.y())) return false;
    step_images.evaluate_rows(problem_, step.z());
    step.lambda() += weights_.rows.all.cwiseProduct(step_images.rows.all);
    x.all += step.all;
  }
  images.evaluate(problem_, x);
  return true;
}

// Removes the change of the held rows with the current factor, except for a part 1/ρ of it.
bool BranchPoint::project(VectorRef direction) {
  auto& [step, step_images, gradient] = workspace;
  step_images.evaluate_rows(problem_, direction);
  gradient.setZero();
  add_transposed(problem_.rows, weights_.rows.all.cwiseProduct(step_images.rows.all), gradient);
  step.z() = -gradient;
  step.y() = -step_images.equality;
  if (!kkt_.solve(step.z(), step.y())) return false;
  direction += step.z();
  return true;
}

double BranchPoint::error() const { return std::max(max_abs(images.stationarity), violation()); }

double BranchPoint::violation() const {
  double error = max_abs(images.equality);
  set.for_each_free_row([&](Index row) { error = std::max(error, -images.rows.all[row]); });
  for (Index i = 0; i < problem_.pairs(); ++i)
    error = std::max(error, std::abs(images.rows.all[set.fixed_row(i)]));
  return error;
}

}  // namespace marble
