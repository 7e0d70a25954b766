#include "path/interior.h"

#include <algorithm>
#include <cmath>

#include "model/tuning.h"
#include "path/keep_positive.h"

namespace marble {

InteriorEngine::InteriorEngine(const ScaledProblem& problem, Kkt& kkt)
    : problem_(problem),
      kkt_(kkt),
      weights_(problem),
      x_(problem),
      d_(problem),
      images_(problem),
      slack_(problem.layout),
      slack_step_(problem.layout),
      nu_(problem.inequalities()),
      rhs_(problem.layout),
      gradient_(problem.variables()),
      reporter_(problem) {}

bool InteriorEngine::run(Run& run, ConstVectorRef initial_z, bool resumes) {
  if (!resumes) start(initial_z);
  for (int i = 0; i < tuning::engine_budget && kappa_ > tuning::last_kappa; ++i) {
    if (run.interrupted()) return false;
    const double length = step(run);
    if (length == 0.0) return i > 0 && !run.interrupted();
    if (length > tuning::interior_good_step && primal_residual_ < tuning::centrality * kappa_)
      kappa_ *= tuning::interior_kappa_factor;
  }
  evaluate();
  report(run);
  return true;
}

// Slacks are at least √κ; multipliers begin on their own central path.
void InteriorEngine::start(ConstVectorRef initial_z) {
  x_.all.setZero();
  x_.z() = initial_z;
  kappa_ = tuning::interior_first_kappa;
  images_.evaluate(problem_, x_);
  const double least = std::sqrt(kappa_);
  slack_.all = images_.rows.all.cwiseMax(least);
  nu_ = kappa_ * slack_.inequality().cwiseInverse();
}

void InteriorEngine::evaluate() {
  images_.evaluate(problem_, x_);
  const double gap = slack_.all.size() == 0 ? 0.0 : (images_.rows.all - slack_.all).lpNorm<Eigen::Infinity>();
  primal_residual_ = std::max(max_abs(images_.equality), gap);
}

// Computes the weights of the rows, and their contributions to the right-hand side.
void InteriorEngine::weigh() {
  weights_.rho = tuning::interior_rho;
  weights_.delta = std::max(tuning::least_delta, tuning::interior_delta_factor * kappa_);
  const auto w = slack_.inequality();
  weights_.rows.inequality() = nu_.cwiseQuotient(w);
  rhs_.inequality() =
      weights_.rows.inequality().cwiseProduct(images_.rows.inequality() - w) - kappa_ * w.cwiseInverse();
  for (Index i = 0; i < problem_.pairs(); ++i) {  // the row (t, s)·(ds, dt) = κ − st, of norm 1
    const double s = slack_.s()[i];
    const double t = slack_.t()[i];
    const double norm = std::hypot(s, t);
    const double cosine = weights_.cosine[i] = t / norm;
    const double sine = weights_.sine[i] = s / norm;
    weights_.rows.s()[i] = tuning::interior_rho;
    weights_.rows.t()[i] = 0.0;
    const double residual =
        cosine * (images_.rows.s()[i] - s) + sine * (images_.rows.t()[i] - t) - (kappa_ - s * t) / norm;
    rhs_.s()[i] = tuning::interior_rho * cosine * residual;
    rhs_.t()[i] = tuning::interior_rho * sine * residual;
  }
}

// Takes one Newton step; returns its length, 0 if the factorization or the step failed.
double InteriorEngine::step(Run& run) {
  evaluate();
  report(run);
  weigh();
  ++run.factorizations;
  if (!run.timed(&Times::factorization_s, [&] { return kkt_.factor(weights_); })) return 0.0;
  gradient_ = images_.gradient;
  add_transposed(problem_.rows, rhs_.all, gradient_);
  d_.z() = -gradient_;
  d_.y() = -images_.equality -
           x_.y() / tuning::interior_rho;  // the second half of the solution is then y itself, not its step
  if (!kkt_.solve(d_.z(), d_.y())) return 0.0;
  if (!d_.z().allFinite() || !d_.y().allFinite()) return 0.0;
  multiply(problem_.rows, d_.z(), slack_step_.all);
  slack_step_.all += images_.rows.all - slack_.all;
  ++run.iterations;
  return step_length_ = move();
}

double InteriorEngine::move() {
  const Index inequalities = problem_.inequalities();
  Vector& slack = slack_.all;
  const Vector& change = slack_step_.all;
  double primal = 1.0;
  double dual = 1.0;
  const auto dual_step = [&](Index i) { return kappa_ / slack[i] - nu_[i] - nu_[i] / slack[i] * change[i]; };
  const double part = tuning::interior_fraction;
  for (Index row = 0; row < slack.size(); ++row) keep_positive(part * slack[row], change[row], primal);
  for (Index i = 0; i < inequalities; ++i) keep_positive(part * nu_[i], dual_step(i), dual);
  for (Index i = 0; i < inequalities; ++i) nu_[i] += dual * dual_step(i);
  slack = (slack + primal * change).cwiseMax(tuning::roundoff);
  for (Index i = 0; i < inequalities; ++i) {
    nu_[i] = std::clamp(nu_[i], kappa_ / (tuning::runaway * slack[i]), tuning::runaway * kappa_ / slack[i]);
  }
  x_.z() += primal * d_.z();
  x_.y() += primal * (d_.y() - x_.y());
  return std::min(primal, dual);
}

void InteriorEngine::report(Run& run) {
  reporter_.report(run, x_.z(), images_.objective, violations(problem_, images_),
                   {.kkt_residual = primal_residual_,
                    .kappa = kappa_,
                    .rho = tuning::interior_rho,
                    .step_length = step_length_,
                    .regularization = weights_.delta});
}

}  // namespace marble
