#include "research/scholtes.h"

#include <algorithm>
#include <cmath>

#include "path/keep_positive.h"
#include "path/termination.h"
#include "research/newton_system.h"
#include "research/tuning.h"

namespace marble {

ScholtesRelaxation::ScholtesRelaxation(const ScaledProblem& problem, Kkt& kkt, const Options& options)
    : problem_(problem),
      kkt_(kkt),
      options_(options),
      weights_(problem),
      x_(problem),
      d_(problem),
      images_(problem),
      slack_(problem.layout),
      slack_step_(problem.layout),
      nu_(problem.layout),
      nu_step_(problem.layout),
      force_(problem.layout),
      rhs_(problem.layout),
      u_(problem.pairs()),
      u_step_(problem.pairs()),
      xi_(problem.pairs()),
      xi_step_(problem.pairs()),
      product_residual_(problem.pairs()),
      gradient_(problem.variables()) {}

void ScholtesRelaxation::start(ConstVectorRef initial_z) {
  tau_ = tuning::interior_first_kappa;
  kappa_ = tuning::scholtes_factor * tau_;
  delta_ = 0.0;
  short_steps_ = steps_here_ = 0;
  x_.all.setZero();
  x_.z() = initial_z;
  images_.evaluate(problem_, x_);
  slack_.all = images_.rows.all.cwiseMax(std::sqrt(tau_));
  nu_.all = kappa_ * slack_.all.cwiseInverse();
  u_ = (tau_ - slack_.s().cwiseProduct(slack_.t()).array()).cwiseMax(kappa_).matrix();
  xi_ = kappa_ * u_.cwiseInverse();
  evaluate();
}

// Computes the whole residual, with λ = −force as multipliers of the rows.
void ScholtesRelaxation::evaluate() {
  force_.all = nu_.all;
  force_.s() -= xi_.cwiseProduct(slack_.t());
  force_.t() -= xi_.cwiseProduct(slack_.s());
  x_.lambda() = -force_.all;
  images_.evaluate(problem_, x_);
  product_residual_ = (tau_ - slack_.s().cwiseProduct(slack_.t()).array()).matrix() - u_;
  residual_ =
      std::max({max_abs(images_.stationarity), max_abs(images_.equality), max_abs(product_residual_)});
  for (Index row = 0; row < problem_.layout.size(); ++row) {
    const double gap = std::abs(images_.rows.all[row] - slack_.all[row]);
    residual_ = std::max({residual_, gap, std::abs(slack_.all[row] * nu_.all[row] - kappa_)});
  }
  for (Index i = 0; i < problem_.pairs(); ++i)
    residual_ = std::max(residual_, std::abs(u_[i] * xi_[i] - kappa_));
}

// Computes the weights W of the rows and, for the right-hand side, W(Jz + c − w) minus the part of the
// eliminated complementarity rows.
void ScholtesRelaxation::weigh() {
  weights_.rho = tuning::interior_rho;
  weights_.delta = std::max(tuning::exact_delta, delta_);
  rhs_.all = images_.rows.all - slack_.all;
  weights_.rows.inequality() = nu_.inequality().cwiseQuotient(slack_.inequality());
  rhs_.inequality() = rhs_.inequality().cwiseProduct(weights_.rows.inequality()) -
                      (kappa_ * slack_.inequality().cwiseInverse() - nu_.inequality());
  for (Index i = 0; i < problem_.pairs(); ++i) {
    const double s = slack_.s()[i], t = slack_.t()[i], xi = xi_[i], ratio = xi / u_[i];
    const PairBlock block(s, t, nu_.s()[i] / s, nu_.t()[i] / t, xi, ratio);
    block.put(i, weights_);
    const double pull = kappa_ / u_[i] - xi - ratio * product_residual_[i];
    const double e_s = rhs_.s()[i], e_t = rhs_.t()[i];
    rhs_.s()[i] = block.first * e_s + block.coupling * e_t - (kappa_ / s - nu_.s()[i]) + t * pull;
    rhs_.t()[i] = block.coupling * e_s + block.second * e_t - (kappa_ / t - nu_.t()[i]) + s * pull;
  }
}

bool ScholtesRelaxation::direction() {
  gradient_ = images_.stationarity;
  add_transposed(problem_.rows, rhs_.all, gradient_);
  d_.z() = -gradient_;
  d_.y() = -images_.equality;
  if (!kkt_.solve(d_.z(), d_.y()) || !d_.z().allFinite() || !d_.y().allFinite()) return false;
  multiply(problem_.rows, d_.z(), slack_step_.all);
  slack_step_.all += images_.rows.all - slack_.all;
  nu_step_.all = (kappa_ * slack_.all.cwiseInverse() - nu_.all) -
                 nu_.all.cwiseQuotient(slack_.all).cwiseProduct(slack_step_.all);
  u_step_ =
      product_residual_ - slack_.t().cwiseProduct(slack_step_.s()) - slack_.s().cwiseProduct(slack_step_.t());
  xi_step_ = (kappa_ * u_.cwiseInverse() - xi_) - xi_.cwiseQuotient(u_).cwiseProduct(u_step_);
  return true;
}

// Steps at most to the boundary, with separate primal and dual lengths.
void ScholtesRelaxation::move() {
  const double part = tuning::interior_fraction;
  double primal = 1.0, dual = 1.0;
  for (Index row = 0; row < problem_.layout.size(); ++row) {
    keep_positive(part * slack_.all[row], slack_step_.all[row], primal);
    keep_positive(part * nu_.all[row], nu_step_.all[row], dual);
  }
  for (Index i = 0; i < problem_.pairs(); ++i) {
    keep_positive(part * u_[i], u_step_[i], primal);
    keep_positive(part * xi_[i], xi_step_[i], dual);
  }
  x_.z() += primal * d_.z();
  slack_.all += primal * slack_step_.all;
  u_ += primal * u_step_;
  x_.y() += dual * d_.y();
  nu_.all += dual * nu_step_.all;
  xi_ += dual * xi_step_;
  // If the product leaves more slack than u, u is set to it.
  for (Index i = 0; i < problem_.pairs(); ++i) u_[i] = std::max(u_[i], tau_ - slack_.s()[i] * slack_.t()[i]);
  step_length_ = std::min(primal, dual);
}

ReferenceMethod::State ScholtesRelaxation::step(Run& run) {
  const double first_delta = options_.regularization_initial;
  if (!factor_regularized(run, kkt_, weights_, first_delta, delta_, [this] { weigh(); }) || !direction())
    return State::failed;
  move();
  ++run.iterations;
  evaluate();
  if (!std::isfinite(residual_) || max_abs(x_.z()) > tuning::runaway) return State::failed;
  short_steps_ = step_length_ < tuning::path_least_step ? short_steps_ + 1 : 0;
  if (short_steps_ > tuning::patience) return State::failed;
  ++steps_here_;
  const bool centered = residual_ <= tuning::scholtes_factor * kappa_;
  if (!centered && steps_here_ < tuning::engine_budget) return State::going_on;
  if (within_tolerances(violations(problem_, images_), options_) &&
      kappa_ <= options_.stationarity_tolerance && residual_ <= options_.stationarity_tolerance)
    return State::ended;
  if (tau_ <= tuning::scholtes_least) return State::given_up;
  tau_ *= tuning::scholtes_factor;
  kappa_ = tuning::scholtes_factor * tau_;
  steps_here_ = 0;
  evaluate();
  return State::going_on;
}

}  // namespace marble
