#include "interior.h"

#include <algorithm>
#include <cmath>

namespace marble {
namespace {

constexpr double kRho = 1e7;
constexpr double kSmallestDelta = 1e-9;
constexpr double kProximal = 3.0;   // δ = 3κ
constexpr double kFraction = 0.99;  // of the way to the boundary
constexpr double kSpread = 1e6;     // a multiplier stays within this factor of κ/w
constexpr double kSmallestSide = 1e-13;
constexpr double kGoodStep = 0.5;  // a step this long lets κ fall
constexpr double kFirstKappa = 1.0;
constexpr double kKappaFactor = 0.3;
constexpr double kLastKappa = 1e-6;
constexpr int kMostSteps = 100;

// Shortens `length` so that value + length · change keeps 1 % of value.
void keep_positive(double value, double change, double& length) {
  if (change < 0.0) length = std::min(length, -kFraction * value / change);
}

}  // namespace

InteriorEngine::InteriorEngine(const ScaledProblem& problem, Kkt& kkt)
    : problem_(problem),
      kkt_(kkt),
      weights_(problem),
      x_(problem),
      d_(problem),
      images_(problem),
      direction_images_(problem),
      w_(problem.inequalities()),
      nu_(problem.inequalities()),
      s_(problem.pairs()),
      t_(problem.pairs()),
      inequality_rhs_(problem.inequalities()),
      left_rhs_(problem.pairs()),
      right_rhs_(problem.pairs()),
      gradient_(problem.variables()),
      reporter_(problem) {}

bool InteriorEngine::run(Run& run, ConstVectorRef initial_z) {
  start(initial_z);
  for (int i = 0; i < kMostSteps && kappa_ > kLastKappa; ++i) {
    if (run.interrupted()) return false;
    const double length = step(run);
    if (length == 0.0) return i > 0 && !run.interrupted();
    if (length > kGoodStep && primal_residual_ < 10.0 * kappa_) kappa_ *= kKappaFactor;
  }
  evaluate();
  report(run);
  return true;
}

// Slacks at least √κ, multipliers on the central path of their own.
void InteriorEngine::start(ConstVectorRef initial_z) {
  x_.all.setZero();
  x_.z() = initial_z;
  kappa_ = kFirstKappa;
  images_.evaluate(problem_, x_);
  const double least = std::sqrt(kappa_);
  w_ = images_.inequality.cwiseMax(least);
  s_ = images_.left.cwiseMax(least);
  t_ = images_.right.cwiseMax(least);
  nu_ = kappa_ * w_.cwiseInverse();
}

void InteriorEngine::evaluate() {
  images_.evaluate(problem_, x_);
  const auto gap = [](const Vector& image, const Vector& slack) {
    return image.size() == 0 ? 0.0 : (image - slack).lpNorm<Eigen::Infinity>();
  };
  primal_residual_ = std::max({max_abs(images_.equality), gap(images_.inequality, w_), gap(images_.left, s_),
                               gap(images_.right, t_)});
}

// Weights of the rows, and what they add to the right-hand side.
void InteriorEngine::weigh() {
  weights_.rho = kRho;
  weights_.delta = std::max(kSmallestDelta, kProximal * kappa_);
  weights_.inequality = nu_.cwiseQuotient(w_);
  inequality_rhs_ = weights_.inequality.cwiseProduct(images_.inequality - w_) - kappa_ * w_.cwiseInverse();
  for (Eigen::Index i = 0; i < s_.size(); ++i) {  // the row (t, s)·(ds, dt) = κ − st, of norm 1
    const double norm = std::hypot(s_[i], t_[i]);
    const double c = weights_.cosine[i] = t_[i] / norm;
    const double s = weights_.sine[i] = s_[i] / norm;
    weights_.first[i] = kRho;
    weights_.second[i] = 0.0;
    const double residual =
        c * (images_.left[i] - s_[i]) + s * (images_.right[i] - t_[i]) - (kappa_ - s_[i] * t_[i]) / norm;
    left_rhs_[i] = kRho * c * residual;
    right_rhs_[i] = kRho * s * residual;
  }
}

// One Newton step; its length, 0 if the factorization or the step is of no use.
double InteriorEngine::step(Run& run) {
  evaluate();
  report(run);
  weigh();
  ++run.factorizations;
  if (!run.timed(&Times::factorization_s, [&] { return kkt_.factor(weights_); })) return 0.0;
  gradient_ = images_.gradient;
  add_transposed(problem_.C, inequality_rhs_, gradient_);
  add_transposed(problem_.L, left_rhs_, gradient_);
  add_transposed(problem_.R, right_rhs_, gradient_);
  d_.z() = -gradient_;
  d_.y() =
      -images_.equality - x_.y() / kRho;  // the second half of the solution is then y itself, not its step
  if (!kkt_.solve(d_.z(), d_.y())) return 0.0;
  if (!d_.z().allFinite() || !d_.y().allFinite()) return 0.0;
  direction_images_.evaluate_rows(problem_, d_.z());
  ++run.iterations;
  return step_length_ = move();
}

double InteriorEngine::move() {
  // From here on direction_images_ holds the steps of w, s and t.
  direction_images_.inequality += images_.inequality - w_;
  direction_images_.left += images_.left - s_;
  direction_images_.right += images_.right - t_;
  double primal = 1.0;
  double dual = 1.0;
  const auto dual_step = [this](Eigen::Index i) {
    return kappa_ / w_[i] - nu_[i] - nu_[i] / w_[i] * direction_images_.inequality[i];
  };
  for (Eigen::Index i = 0; i < w_.size(); ++i) {
    keep_positive(w_[i], direction_images_.inequality[i], primal);
    keep_positive(nu_[i], dual_step(i), dual);
  }
  for (Eigen::Index i = 0; i < s_.size(); ++i) {
    keep_positive(s_[i], direction_images_.left[i], primal);
    keep_positive(t_[i], direction_images_.right[i], primal);
  }
  for (Eigen::Index i = 0; i < w_.size(); ++i) {
    const double multiplier = nu_[i] + dual * dual_step(i);
    w_[i] = std::max(w_[i] + primal * direction_images_.inequality[i], kSmallestSide);
    nu_[i] = std::clamp(multiplier, kappa_ / (kSpread * w_[i]), kSpread * kappa_ / w_[i]);
  }
  s_ = (s_ + primal * direction_images_.left).cwiseMax(kSmallestSide);
  t_ = (t_ + primal * direction_images_.right).cwiseMax(kSmallestSide);
  x_.z() += primal * d_.z();
  x_.y() += primal * (d_.y() - x_.y());
  return std::min(primal, dual);
}

void InteriorEngine::report(Run& run) {
  Progress progress;
  progress.objective = images_.objective / problem_.cost_scale + problem_.c0;
  progress.violations = violations(problem_, images_);
  progress.kkt_residual = primal_residual_;
  progress.kappa = kappa_;
  progress.rho = kRho;
  progress.step_length = step_length_;
  progress.regularization = weights_.delta;
  reporter_.tell(run, x_.z(), progress);
}

}  // namespace marble
