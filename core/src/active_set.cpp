#include "active_set.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace marble {
namespace {

constexpr int kExactSweeps = 6;
constexpr double kExactTolerance = 1e-12;
constexpr double kSignTolerance =
    1e-9;                          // a row or multiplier this little on the wrong side stays where it is
constexpr double kRunaway = 1e12;  // a point this far out left along a direction nothing bounds

// The globally convergent fallback.
constexpr double kSafeRho =
    1e7;  // at 1e5 feasible pieces with large multipliers look infeasible (gates, rocket)
constexpr double kSafeDelta = 1e-7;
constexpr double kSafeTolerance = 1e-9;
constexpr double kRounding = 1e-6;  // ρ times a row's rounding shows in the gradient
constexpr double kTie =
    1e-14;  // a slack this small counts as active: rows at 0 would come and go by rounding
constexpr double kFullStep = 1e-3;  // only rounding keeps the minimum of one set of rows from a step of 1
constexpr double kElasticDelta = 1e-6;
constexpr int kExchanges = 8;  // plain exchanges before the fallback takes over

}  // namespace

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

// The rows that may hold with equality: `active` points to a row's flag, or is null where the partition fixes
// it.
template <class Visit>
void ActiveSet::for_each_row(Visit&& visit) {
  auto lambda_w = x_.lambda_w();
  auto lambda_L = x_.lambda_L();
  auto lambda_R = x_.lambda_R();
  auto d_w = d_.lambda_w();
  auto d_L = d_.lambda_L();
  auto d_R = d_.lambda_R();
  for (Eigen::Index i = 0; i < lambda_w.size(); ++i) {
    visit(images_.inequality[i], direction_images_.inequality[i], lambda_w[i], d_w[i],
          &set_.active_inequality[i]);
  }
  for (Eigen::Index i = 0; i < lambda_L.size(); ++i) {
    std::uint8_t* free_side = &set_.active_free_side[i];
    visit(images_.left[i], direction_images_.left[i], lambda_L[i], d_L[i],
          set_.left_fixed[i] ? nullptr : free_side);
    visit(images_.right[i], direction_images_.right[i], lambda_R[i], d_R[i],
          set_.left_fixed[i] ? free_side : nullptr);
  }
}

void ActiveSet::start_from_path(const Iterate& iterate) {
  x_.all = iterate.all;
  images_.evaluate(problem_, x_);
  for (Eigen::Index i = 0; i < images_.inequality.size(); ++i) {
    set_.active_inequality[i] =
        iterate.v()[i] < 0.0;  // p(v) < p(−v): the slack is smaller than its multiplier
  }
  for (Eigen::Index i = 0; i < images_.left.size(); ++i) {
    const bool left = images_.left[i] < images_.right[i];
    set_.left_fixed[i] = left;
    const double side = left ? images_.right[i] : images_.left[i];
    const double multiplier = left ? iterate.lambda_R()[i] : iterate.lambda_L()[i];
    set_.active_free_side[i] = side < -multiplier;
  }
  clear_inactive_multipliers();
}

// Of two numbers whose product should be 0, the smaller one was: a slack against its own multiplier.
void ActiveSet::start_from_solution(const Iterate& solution) {
  x_.all = solution.all;
  images_.evaluate(problem_, x_);
  for (Eigen::Index i = 0; i < images_.inequality.size(); ++i)
    set_.active_inequality[i] = images_.inequality[i] < -x_.lambda_w()[i];
  for (Eigen::Index i = 0; i < images_.left.size(); ++i) {
    const double left = images_.left[i] - std::abs(x_.lambda_L()[i]);
    const double right = images_.right[i] - std::abs(x_.lambda_R()[i]);
    set_.left_fixed[i] = left < right;
    set_.active_free_side[i] =
        left < right ? images_.right[i] < -x_.lambda_R()[i] : images_.left[i] < -x_.lambda_L()[i];
  }
  clear_inactive_multipliers();
}

void ActiveSet::restore(const Iterate& iterate, const WorkingSet& set) {
  x_.all = iterate.all;
  set_ = set;
  images_.evaluate(problem_, x_);
}

void ActiveSet::clear_inactive_multipliers() {
  for_each_row([](double, double, double& lambda, double, const std::uint8_t* active) {
    if (active != nullptr && *active == 0) lambda = 0.0;
  });
}

void ActiveSet::set_weights(double rho, double delta) {
  weights_.rho = rho;
  weights_.delta = delta;
  for (Eigen::Index i = 0; i < weights_.inequality.size(); ++i) {
    weights_.inequality[i] = set_.active_inequality[i] ? rho : 0.0;
  }
  for (Eigen::Index i = 0; i < weights_.first.size(); ++i) {  // first: L, second: R
    weights_.cosine[i] = 1.0;
    weights_.sine[i] = 0.0;
    weights_.first[i] = set_.left_fixed[i] || set_.active_free_side[i] ? rho : 0.0;
    weights_.second[i] = !set_.left_fixed[i] || set_.active_free_side[i] ? rho : 0.0;
  }
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
  for (int sweep = 0; sweep < kExactSweeps; ++sweep) {
    images_.evaluate(problem_, x_);
    double error = std::max(max_abs(images_.stationarity), max_abs(images_.equality));
    gradient_ = images_.stationarity;
    // dλ = ρ(J dz + c): the part ρc goes to the right-hand side.
    for (Eigen::Index i = 0; i < weights_.inequality.size(); ++i) {
      d_.lambda_w()[i] = weights_.inequality[i] * images_.inequality[i];
      if (weights_.inequality[i] > 0.0) error = std::max(error, std::abs(images_.inequality[i]));
    }
    for (Eigen::Index i = 0; i < weights_.first.size(); ++i) {
      d_.lambda_L()[i] = weights_.first[i] * images_.left[i];
      d_.lambda_R()[i] = weights_.second[i] * images_.right[i];
      if (weights_.first[i] > 0.0) error = std::max(error, std::abs(images_.left[i]));
      if (weights_.second[i] > 0.0) error = std::max(error, std::abs(images_.right[i]));
    }
    if (!std::isfinite(error) || !(max_abs(x_.z()) <= kRunaway)) return false;
    if (error <= tolerance) return true;
    if (error > 0.5 * last) return error <= kSignTolerance;  // as exact as it gets
    last = error;
    add_transposed(problem_.C, d_.lambda_w(), gradient_);
    add_transposed(problem_.L, d_.lambda_L(), gradient_);
    add_transposed(problem_.R, d_.lambda_R(), gradient_);
    d_.z() = -gradient_;
    d_.y() = -images_.equality;
    if (!kkt_.solve(d_.z(), d_.y())) return false;
    direction_images_.evaluate_rows(problem_, d_.z());
    d_.lambda_w() += weights_.inequality.cwiseProduct(direction_images_.inequality);
    d_.lambda_L() += weights_.first.cwiseProduct(direction_images_.left);
    d_.lambda_R() += weights_.second.cwiseProduct(direction_images_.right);
    x_.all += d_.all;
  }
  images_.evaluate(problem_, x_);
  return true;
}

// Active rows that pull (λ > 0) leave, violated ones enter. True if nothing changed.
bool ActiveSet::exchange() {
  bool changed = false;
  const double scale = 1.0 + max_abs(x_.all);
  for_each_row([&](double image, double, double& lambda, double, std::uint8_t* active) {
    if (active == nullptr) return;
    if (*active ? lambda > kSignTolerance * scale : image < -kSignTolerance) {
      *active ^= 1U;
      if (*active == 0) lambda = 0.0;
      changed = true;
    }
  });
  return !changed;
}

bool ActiveSet::solve(Run& run, int budget) {
  const int last = run.factorizations + budget;
  center_.all = x_.all;  // where the fallback starts
  for (int round = 0; round < kExchanges; ++round) {
    if (run.factorizations >= last || run.interrupted()) return false;
    if (!factor(run, kExactRho, kExactDelta)) return false;
    if (!solve_equalities(kExactTolerance)) break;
    if (exchange()) return error() <= kSignTolerance;
  }
  return augmented_lagrangian(run, last - run.factorizations);
}

// The residual of rows that are held at zero, by the factor at hand: all but 1/ρ of it.
bool ActiveSet::project(VectorRef direction) {
  direction_images_.evaluate_rows(problem_, direction);
  gradient_.setZero();
  add_transposed(problem_.C, weights_.inequality.cwiseProduct(direction_images_.inequality), gradient_);
  add_transposed(problem_.L, weights_.first.cwiseProduct(direction_images_.left), gradient_);
  add_transposed(problem_.R, weights_.second.cwiseProduct(direction_images_.right), gradient_);
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
  for (Eigen::Index i = 0; i < images_.left.size(); ++i)
    set_.left_fixed[i] = images_.left[i] < images_.right[i];
}

bool ActiveSet::relax(Run& run, double rho, bool trust_set, int budget) {
  center_.all.setZero();
  center_.z() = anchor_;
  const int last = run.factorizations + budget;
  const double delta =
      rho >= kExactRho ? kExactDelta : kElasticDelta;  // there the exact solve's factor serves too
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
  images_.inequality += problem_.d;
  images_.left += problem_.l;
  images_.right += problem_.r;
  x_.y() = center_.y() + rho * images_.equality;
  d_.lambda_w() = center_.lambda_w() + rho * images_.inequality;
  d_.lambda_L() = center_.lambda_L() + rho * images_.left;
  d_.lambda_R() = center_.lambda_R() + rho * images_.right;
  const double tie = kTie * rho;
  for_each_row([=](double, double, double& lambda, double unclipped, std::uint8_t* active) {
    if (active != nullptr && choose_rows) *active = unclipped < tie;
    lambda = active == nullptr || *active != 0 ? unclipped : 0.0;
  });
  images_.evaluate_duals(problem_, x_);
  gradient_ = images_.stationarity + problem_.g + delta * (x_.z() - center_.z());
}

// min over z of f(z) + ½δ‖z − z_c‖² + Σ ½ρ(c + α/ρ)² over fixed rows and equalities, with min(0, ·) over free
// rows, by semismooth Newton with exact line search. After a full step that changes no row it is solved.
bool ActiveSet::minimize(Run& run, double rho, double delta, bool trust_set, int last) {
  evaluate_penalty(rho, delta, !trust_set);
  for (bool full_step = false;; trust_set = false) {
    const double size = (1.0 + kRounding * rho) * (1.0 + max_abs(images_.stationarity));
    if (!trust_set && (max_abs(gradient_) <= kSafeTolerance * size || (full_step && set_ == factored_set_)))
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
    full_step = std::abs(alpha - 1.0) <= kFullStep;
    x_.z() += alpha * d_.z();
    if (!(max_abs(x_.z()) <= kRunaway)) return false;
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
    if (!minimize(run, kSafeRho, kSafeDelta, false, last)) return false;
    const double outer = std::max((x_.all - center_.all).lpNorm<Eigen::Infinity>() / kSafeRho,
                                  kSafeDelta * (x_.z() - center_.z()).lpNorm<Eigen::Infinity>());
    if (outer <= kSafeTolerance) break;
    // If the multipliers only grow, the piece is infeasible.
    outer_without_progress = outer > 0.5 * outer_error ? outer_without_progress + 1 : 0;
    if (outer_without_progress >= 5) return false;
    outer_error = std::min(outer, outer_error);
    center_.all = x_.all;
  }
  // The active set is known: make the point exact.
  if (run.factorizations >= last || run.interrupted()) return false;
  for (int round = 0; round < 3 && run.factorizations < last; ++round) {
    if (!factor(run, kExactRho, kExactDelta) || !solve_equalities(kExactTolerance)) return false;
    if (exchange()) return error() <= kSignTolerance;
  }
  return false;
}

// Root of the derivative of the piecewise quadratic along the step: linear between breakpoints, ascending.
double ActiveSet::exact_step(double rho, double slope, double curvature) {
  breakpoints_.clear();
  for_each_row([&](double, double rate, double&, double unclipped, const std::uint8_t* active) {
    const double bend = rho * rate * rate;
    if (active == nullptr || *active != 0) curvature += bend;
    if (active == nullptr || rate == 0.0 || (*active != 0) != (rate > 0.0)) return;
    const double at = std::max(0.0, -unclipped / (rho * rate));  // where α + ρc changes its sign
    breakpoints_.push_back({at, *active != 0 ? -bend : bend});
  });
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
  for (Eigen::Index i = 0; i < images_.inequality.size(); ++i)
    error = std::max(error, -images_.inequality[i]);
  for (Eigen::Index i = 0; i < images_.left.size(); ++i) {
    const bool left = set_.left_fixed[i] != 0;
    error = std::max(error, std::abs(left ? images_.left[i] : images_.right[i]));
    error = std::max(error, -(left ? images_.right[i] : images_.left[i]));
  }
  return error;
}

}  // namespace marble
