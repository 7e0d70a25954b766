#include "active_set.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tuning.h"

namespace marble {

ActiveSet::ActiveSet(const ScaledProblem& problem, Kkt& kkt)
    : problem_(problem),
      kkt_(kkt),
      weights_(problem),
      set_(problem),
      factored_set_(problem),
      x_(problem),
      d_(problem),
      center_(problem),
      images_(problem),
      direction_images_(problem),
      gradient_(problem.variables()),
      anchor_(Vector::Zero(problem.variables())) {
  breakpoints_.reserve(static_cast<std::size_t>(problem.inequalities()) +
                       static_cast<std::size_t>(problem.pairs()));
}

void ActiveSet::start_from_path(const Iterate& iterate) {
  x_.all = iterate.all;
  images_.evaluate(problem_, x_);
  for (Index i = 0; i < problem_.inequalities(); ++i)
    set_.held[i] = iterate.v()[i] < 0.0;  // p(v) < p(−v): the slack is smaller than its multiplier
  const Vector& value = images_.rows.all;
  for (Index i = 0; i < problem_.pairs(); ++i) {
    const RowLayout& rows = problem_.layout;
    const bool left = value[rows.left(i)] < value[rows.right(i)];
    const Index free = left ? rows.right(i) : rows.left(i);
    set_.fix(i, left, value[free] < -iterate.lambda()[free]);
  }
  set_.clear_others(x_.lambda());
}

// Of two numbers whose product should be 0, the smaller one was: a slack against its own multiplier.
void ActiveSet::start_from_solution(const Iterate& solution) {
  x_.all = solution.all;
  images_.evaluate(problem_, x_);
  const Vector& value = images_.rows.all;
  const auto lambda = x_.lambda();
  for (Index i = 0; i < problem_.inequalities(); ++i) set_.held[i] = value[i] < -lambda[i];
  for (Index i = 0; i < problem_.pairs(); ++i) {
    const Index left = problem_.layout.left(i);
    const Index right = problem_.layout.right(i);
    const bool left_fixed = value[left] - std::abs(lambda[left]) < value[right] - std::abs(lambda[right]);
    const Index free = left_fixed ? right : left;
    set_.fix(i, left_fixed, value[free] < -lambda[free]);
  }
  set_.clear_others(x_.lambda());
}

void ActiveSet::restore(const Iterate& iterate, const WorkingSet& set) {
  x_.all = iterate.all;
  set_ = set;
  images_.evaluate(problem_, x_);
}

void ActiveSet::set_weights(double rho, double delta) {
  weights_.rho = rho;
  weights_.delta = delta;
  for (Index row = 0; row < problem_.layout.size(); ++row)
    weights_.rows.all[row] = set_.held[row] ? rho : 0.0;
}

bool ActiveSet::factor(Run& run, double rho, double delta) {
  set_weights(rho, delta);
  factored_set_ = set_;
  ++run.factorizations;
  return run.timed(&Times::factorization_s, [&] { return kkt_.factor(weights_); });
}

// With the active rows as equalities: Newton on (Qz + g + Jᵀλ, J_active z + c) with the regularized factor,
// repeated. The residuals carry no regularization, so the fixed point is exact; each sweep gains about eight
// digits.
bool ActiveSet::solve_equalities(double tolerance) {
  double last = std::numeric_limits<double>::infinity();
  for (int sweep = 0; sweep < tuning::exact_sweeps; ++sweep) {
    images_.evaluate(problem_, x_);
    double error = std::max(max_abs(images_.stationarity), max_abs(images_.equality));
    gradient_ = images_.stationarity;
    // dλ = ρ(J dz + c): the part ρc goes to the right-hand side.
    d_.lambda() = weights_.rows.all.cwiseProduct(images_.rows.all);
    for (Index row = 0; row < problem_.layout.size(); ++row) {
      if (set_.held[row]) error = std::max(error, std::abs(images_.rows.all[row]));
    }
    if (!std::isfinite(error) || !(max_abs(x_.z()) <= tuning::runaway)) return false;
    if (error <= tolerance) return true;
    if (error > 0.5 * last) return error <= tuning::wrong_sign;  // as exact as it gets
    last = error;
    add_transposed(problem_.rows, d_.lambda(), gradient_);
    d_.z() = -gradient_;
    d_.y() = -images_.equality;
    if (!kkt_.solve(d_.z(), d_.y())) return false;
    direction_images_.evaluate_rows(problem_, d_.z());
    d_.lambda() += weights_.rows.all.cwiseProduct(direction_images_.rows.all);
    x_.all += d_.all;
  }
  images_.evaluate(problem_, x_);
  return true;
}

// Active rows that pull (λ > 0) leave, violated ones enter. True if nothing changed.
bool ActiveSet::exchange() {
  bool changed = false;
  const double scale = 1.0 + max_abs(x_.all);
  set_.for_each_free_row([&](Index row) {
    std::uint8_t& held = set_.held[row];
    if (!(held ? x_.lambda()[row] > tuning::wrong_sign * scale : images_.rows.all[row] < -tuning::wrong_sign))
      return;
    held ^= 1U;
    if (held == 0) x_.lambda()[row] = 0.0;
    changed = true;
  });
  return !changed;
}

bool ActiveSet::solve(Run& run, int budget) {
  const int last = run.factorizations + budget;
  set_.clear_others(x_.lambda());  // they may be of another branch
  center_.all = x_.all;            // where the fallback starts
  for (int round = 0; round < tuning::exact_exchanges; ++round) {
    if (run.factorizations >= last || run.interrupted()) return false;
    if (!factor(run, tuning::exact_rho, tuning::exact_delta)) return false;
    if (!solve_equalities(tuning::rounding)) break;
    if (exchange()) return error() <= tuning::wrong_sign;
  }
  return augmented_lagrangian(run, last - run.factorizations);
}

// The residual of rows that are held at zero, by the factor at hand: all but 1/ρ of it.
bool ActiveSet::project(VectorRef direction) {
  direction_images_.evaluate_rows(problem_, direction);
  gradient_.setZero();
  add_transposed(problem_.rows, weights_.rows.all.cwiseProduct(direction_images_.rows.all), gradient_);
  d_.z() = -gradient_;
  d_.y() = -direction_images_.equality;
  if (!kkt_.solve(d_.z(), d_.y())) return false;
  direction += d_.z();
  return true;
}

bool ActiveSet::sharpen() { return solve_equalities(0.0); }

void ActiveSet::start_from_point(ConstVectorRef z) {
  x_.all.setZero();
  x_.z() = z;
  images_.evaluate(problem_, x_);
  for (Index i = 0; i < problem_.pairs(); ++i) {
    const bool free_side_held = set_.held[set_.free_row(i)] != 0;
    set_.fix(i, images_.rows.left()[i] < images_.rows.right()[i], free_side_held);
  }
}

bool ActiveSet::relax(Run& run, double rho, bool trust_set, int budget) {
  center_.all.setZero();
  center_.z() = anchor_;
  const int last = run.factorizations + budget;
  const double delta = rho >= tuning::exact_rho
                           ? tuning::exact_delta
                           : tuning::elastic_delta;  // there the exact solve's factor serves too
  if (!minimize(run, rho, delta, trust_set, last)) return false;
  if ((weights_.rho != rho || weights_.delta != delta || factored_set_ != set_) && !factor(run, rho, delta))
    return false;
  const double violation_cost = x_.y().squaredNorm() + x_.lambda_w().squaredNorm() +
                                x_.lambda_L().squaredNorm() + x_.lambda_R().squaredNorm();
  images_.objective = x_.z().dot(0.5 * images_.gradient + problem_.g);
  elastic_objective_ =
      images_.objective + 0.5 * delta * (x_.z() - anchor_).squaredNorm() + 0.5 / rho * violation_cost;
  return std::isfinite(elastic_objective_);
}

// λ(z) = α + ρc, clipped at 0 for free rows, and the gradient; d_ holds the unclipped values.
void ActiveSet::evaluate_penalty(double rho, double delta, bool choose_rows) {
  images_.evaluate_rows(problem_, x_.z());
  images_.equality += problem_.b;
  images_.rows.all += problem_.offset;
  x_.y() = center_.y() + rho * images_.equality;
  d_.lambda() = center_.lambda() + rho * images_.rows.all;
  const double tie = tuning::elastic_tie * rho;
  const double* const unclipped = d_.lambda().data();
  double* const lambda = x_.lambda().data();
  std::uint8_t* const held = set_.held.data();
  if (choose_rows) set_.for_each_free_row([=](Index row) { held[row] = unclipped[row] < tie; });
  for (Index row = 0; row < problem_.layout.size(); ++row) lambda[row] = held[row] ? unclipped[row] : 0.0;
  images_.evaluate_duals(problem_, x_);
  gradient_ = images_.stationarity + problem_.g + delta * (x_.z() - center_.z());
}

// min over z of f(z) + ½δ‖z − z_c‖² + Σ ½ρ(c + α/ρ)² over fixed rows and equalities, with min(0, ·) over free
// rows, by semismooth Newton with exact line search. After a full step that changes no row it is solved.
bool ActiveSet::minimize(Run& run, double rho, double delta, bool trust_set, int last) {
  evaluate_penalty(rho, delta, !trust_set);
  for (bool full_step = false;; trust_set = false) {
    const double size = (1.0 + tuning::elastic_rounding * rho) * (1.0 + max_abs(images_.stationarity));
    if (!trust_set &&
        (max_abs(gradient_) <= tuning::augmented_tolerance * size || (full_step && set_ == factored_set_)))
      return true;
    const bool factored =
        trust_set && set_ == factored_set_ && rho == weights_.rho && delta == weights_.delta;
    if (run.interrupted() || (!factored && (run.factorizations >= last || !factor(run, rho, delta))))
      return false;
    d_.z() = -gradient_;
    d_.y().setZero();
    if (!kkt_.solve(d_.z(), d_.y())) return false;
    direction_images_.evaluate_rows(problem_, d_.z());
    double alpha = 1.0;
    if (!trust_set) {
      const double slope = gradient_.dot(d_.z());
      if (!(slope < 0.0)) return false;
      multiply(problem_.Q, d_.z(), direction_images_.gradient);
      const double curvature = d_.z().dot(direction_images_.gradient) + delta * d_.z().squaredNorm() +
                               rho * direction_images_.equality.squaredNorm();
      alpha = exact_step(rho, slope, curvature);
    }
    full_step = std::abs(alpha - 1.0) <= tuning::elastic_full_step;
    x_.z() += alpha * d_.z();
    if (!(max_abs(x_.z()) <= tuning::runaway)) return false;
    evaluate_penalty(rho, delta, true);
  }
}

// Minimises, then α ← λ, z_c ← z, until neither moves.
bool ActiveSet::augmented_lagrangian(Run& run, int budget) {
  const int last = run.factorizations + budget;
  x_.all = center_.all;
  double outer_error = std::numeric_limits<double>::infinity();
  int outer_without_progress = 0;
  while (true) {
    if (!minimize(run, tuning::augmented_rho, tuning::augmented_delta, false, last)) return false;
    const double outer = std::max((x_.all - center_.all).lpNorm<Eigen::Infinity>() / tuning::augmented_rho,
                                  tuning::augmented_delta * (x_.z() - center_.z()).lpNorm<Eigen::Infinity>());
    if (outer <= tuning::augmented_tolerance) break;
    // If the multipliers only grow, the piece is infeasible.
    outer_without_progress = outer > 0.5 * outer_error ? outer_without_progress + 1 : 0;
    if (outer_without_progress >= tuning::augmented_patience) return false;
    outer_error = std::min(outer, outer_error);
    center_.all = x_.all;
  }
  // The active set is known: make the point exact.
  if (run.factorizations >= last || run.interrupted()) return false;
  for (int round = 0; round < tuning::augmented_rounds && run.factorizations < last; ++round) {
    if (!factor(run, tuning::exact_rho, tuning::exact_delta) || !solve_equalities(tuning::rounding))
      return false;
    if (exchange()) return error() <= tuning::wrong_sign;
  }
  return false;
}

// Root of the derivative of the piecewise quadratic along the step: linear between breakpoints, ascending.
double ActiveSet::exact_step(double rho, double slope, double curvature) {
  breakpoints_.clear();
  const double* const rates = direction_images_.rows.all.data();
  const double* const unclipped = d_.lambda().data();
  const std::uint8_t* const held = set_.held.data();
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
    bends(problem_.layout.left(i), set_.left_fixed[i] != 0);
    bends(problem_.layout.right(i), set_.left_fixed[i] == 0);
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

double ActiveSet::error() const {
  double error = std::max(max_abs(images_.stationarity), max_abs(images_.equality));
  set_.for_each_free_row([&](Index row) { error = std::max(error, -images_.rows.all[row]); });
  for (Index i = 0; i < problem_.pairs(); ++i)
    error = std::max(error, std::abs(images_.rows.all[set_.fixed_row(i)]));
  return error;
}

}  // namespace marble
