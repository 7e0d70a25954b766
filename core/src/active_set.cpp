#include "active_set.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace marble {
namespace {

// Exact solves: tiny regularization, its effect removed by repeated solves with the same factor.
constexpr double kExactRho = 1e8;
constexpr double kExactDelta = 1e-8;
constexpr int kExactSweeps = 6;
constexpr double kExactTolerance = 1e-12;
constexpr double kSignTolerance =
    1e-9;                          // a row or multiplier this little on the wrong side stays where it is
constexpr double kRunaway = 1e12;  // a point this far out left along a direction nothing bounds

// The globally convergent fallback.
constexpr double kSafeRho = 1e5;
constexpr double kSafeDelta = 1e-7;
constexpr double kSafeTolerance = 1e-9;
constexpr int kExchanges = 8;  // plain exchanges before the fallback takes over

}  // namespace

ActiveSet::ActiveSet(const ScaledProblem& problem, Kkt& kkt)
    : problem_(problem),
      kkt_(kkt),
      weights_(problem),
      set_(problem),
      x_(problem),
      d_(problem),
      center_(problem),
      images_(problem),
      direction_images_(problem),
      gradient_(problem.variables()) {
  breakpoints_.reserve(static_cast<std::size_t>(problem.inequalities() + problem.pairs()));
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

void ActiveSet::restore(const Iterate& iterate, const WorkingSet& set) {
  x_.all = iterate.all;
  set_ = set;
  images_.evaluate(problem_, x_);
}

void ActiveSet::flip(Index pair) {
  set_.left_fixed[pair] ^= 1U;
  set_.active_free_side[pair] = 0;
  clear_inactive_multipliers();
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
  ++run.factorizations;
  return run.timed(&Times::factorization_s, [&] { return kkt_.factor(weights_); });
}

// With the active rows as equalities: Newton on (Qz + g + Jᵀλ, J_active z + c) with the regularized factor,
// repeated. The residuals carry no regularization, so the fixed point is exact; each sweep gains about eight
// digits.
bool ActiveSet::solve_equalities() {
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
    if (error <= kExactTolerance) return true;
    if (error > 0.5 * last) return error <= kSignTolerance;  // as exact as it gets
    last = error;
    add_transposed(problem_.C, d_.lambda_w(), gradient_);
    add_transposed(problem_.L, d_.lambda_L(), gradient_);
    add_transposed(problem_.R, d_.lambda_R(), gradient_);
    d_.z() = -gradient_;
    d_.y() = -images_.equality;
    kkt_.solve(d_.z(), d_.y());
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
    if (!solve_equalities()) break;
    if (exchange()) return error() <= kSignTolerance;
  }
  return augmented_lagrangian(run, last - run.factorizations);
}

// min over z of f(z) + ½δ‖z − z_c‖² + Σ ½ρ(c + α/ρ)² over fixed rows and equalities, with min(0, ·) over free
// rows, by semismooth Newton with exact line search; then α ← λ, z_c ← z.
bool ActiveSet::augmented_lagrangian(Run& run, int budget) {
  const int last = run.factorizations + budget;
  x_.all = center_.all;
  double outer_error = std::numeric_limits<double>::infinity();
  int outer_without_progress = 0;
  while (run.factorizations < last && !run.interrupted()) {
    // λ(z) = α + ρc, clipped at 0 for free rows; d_ holds the unclipped values meanwhile.
    images_.evaluate_rows(problem_, x_.z());
    images_.equality += problem_.b;
    images_.inequality += problem_.d;
    images_.left += problem_.l;
    images_.right += problem_.r;
    x_.y() = center_.y() + kSafeRho * images_.equality;
    d_.lambda_w() = center_.lambda_w() + kSafeRho * images_.inequality;
    d_.lambda_L() = center_.lambda_L() + kSafeRho * images_.left;
    d_.lambda_R() = center_.lambda_R() + kSafeRho * images_.right;
    for_each_row([](double, double, double& lambda, double unclipped, std::uint8_t* active) {
      if (active != nullptr) *active = unclipped < 0.0;
      lambda = active != nullptr ? std::min(0.0, unclipped) : unclipped;
    });
    images_.evaluate_duals(problem_, x_);
    gradient_ = images_.stationarity + problem_.g + kSafeDelta * (x_.z() - center_.z());

    const double size = 1.0 + max_abs(images_.stationarity);
    if (max_abs(gradient_) <= kSafeTolerance * size) {
      // Inner problem solved: is the whole one? If the multipliers only grow, the piece is infeasible.
      const double outer = std::max((x_.all - center_.all).lpNorm<Eigen::Infinity>() / kSafeRho,
                                    kSafeDelta * (x_.z() - center_.z()).lpNorm<Eigen::Infinity>());
      if (outer <= kSafeTolerance) break;
      outer_without_progress = outer > 0.5 * outer_error ? outer_without_progress + 1 : 0;
      if (outer_without_progress >= 5) return false;
      outer_error = std::min(outer, outer_error);
      center_.all = x_.all;
      continue;
    }
    if (!factor(run, kSafeRho, kSafeDelta)) return false;
    Iterate& step = d_;
    step.z() = -gradient_;
    step.y().setZero();
    kkt_.solve(step.z(), step.y());
    direction_images_.evaluate_rows(problem_, step.z());
    const double slope = gradient_.dot(step.z());
    if (!(slope < 0.0)) return false;
    multiply(problem_.Q, step.z(), direction_images_.gradient);
    const double curvature = step.z().dot(direction_images_.gradient) + kSafeDelta * step.z().squaredNorm() +
                             kSafeRho * direction_images_.equality.squaredNorm();
    x_.z() += exact_step(slope, curvature) * step.z();
    if (!(max_abs(x_.z()) <= kRunaway)) return false;
  }
  // The active set is known: make the point exact.
  if (run.factorizations >= last || run.interrupted()) return false;
  for (int round = 0; round < 3 && run.factorizations < last; ++round) {
    if (!factor(run, kExactRho, kExactDelta) || !solve_equalities()) return false;
    if (exchange()) return error() <= kSignTolerance;
  }
  return false;
}

// Root of the derivative of the piecewise quadratic along the step: linear between breakpoints, ascending.
double ActiveSet::exact_step(double slope, double curvature) {
  breakpoints_.clear();
  for_each_row([&](double, double rate, double&, double unclipped, const std::uint8_t* active) {
    const double bend = kSafeRho * rate * rate;
    if (active == nullptr || unclipped < 0.0) curvature += bend;
    if (active == nullptr || rate == 0.0) return;
    const double at = -unclipped / (kSafeRho * rate);  // where α + ρc changes its sign
    if (at > 0.0) breakpoints_.push_back({at, unclipped < 0.0 ? -bend : bend});
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
