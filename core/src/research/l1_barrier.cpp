#include "research/l1_barrier.h"

#include <algorithm>
#include <cmath>

#include "path/keep_positive.h"
#include "path/termination.h"
#include "research/newton_system.h"
#include "research/tuning.h"

namespace marble {

// ρ(p + n) − μ(ln p + ln n) over p − n = v: 2ρ = μ/p + μ/n.
L1Barrier::Elastic::Elastic(double product, double rho, double mu)
    : p(0.5 * (product * rho + mu + std::hypot(product * rho, mu)) / rho), n(mu * p / (2.0 * rho * p - mu)) {}

L1Barrier::L1Barrier(const ScaledProblem& problem, Kkt& kkt, const Options& options, Schedule schedule)
    : problem_(problem),
      kkt_(kkt),
      options_(options),
      schedule_(schedule),
      relaxed_by_(schedule == Schedule::no_penalty ? tuning::barrier_least : 0.0),
      rho_most_(schedule == Schedule::every_step ? tuning::barrier_rho_most_stepwise
                                                 : tuning::barrier_rho_most),
      weights_(problem),
      x_(problem),
      d_(problem),
      images_(problem),
      slack_(problem.layout),
      slack_step_(problem.layout),
      nu_(problem.layout),
      nu_step_(problem.layout),
      gap_(problem.layout),
      force_(problem.layout),
      rhs_(problem.layout),
      p_(problem.pairs()),
      n_(problem.pairs()),
      p_step_(problem.pairs()),
      n_step_(problem.pairs()),
      pi_p_(problem.pairs()),
      pi_n_(problem.pairs()),
      kappa_(problem.pairs()),
      kappa_step_(problem.pairs()),
      product_residual_(problem.pairs()),
      pull_(problem.pairs()),
      w_(problem.pairs()),
      gradient_(problem.variables()) {}

// Equal sides would stay equal in exact arithmetic; the first multipliers break the tie.
void L1Barrier::start(ConstVectorRef initial_z) {
  mu_ = tuning::barrier_first;
  rho_ = tuning::barrier_first;
  delta_ = 0.0;
  steps_here_ = 0;
  x_.all.setZero();
  x_.z() = initial_z;
  images_.evaluate(problem_, x_);
  slack_.all = images_.rows.all.cwiseMax(tuning::interior_inside);
  nu_.all = mu_ * slack_.all.cwiseInverse();
  nu_.t().array() += tuning::barrier_tie;
  for (Index i = 0; i < problem_.pairs(); ++i) {
    const Elastic at(s(i) * t(i), rho_, mu_);
    p_[i] = at.p, n_[i] = at.n;
    pi_p_[i] = mu_ / at.p, pi_n_[i] = mu_ / at.n;
    kappa_[i] = elastic() ? rho_ - pi_p_[i] : 0.0;
  }
  evaluate();
}

// Computes the whole residual, with λ = −force as multipliers of the rows.
void L1Barrier::evaluate() {
  force_.all = nu_.all;
  for (Index i = 0; i < problem_.pairs(); ++i) {
    force_.s()[i] -= kappa_[i] * t(i);
    force_.t()[i] -= kappa_[i] * s(i);
  }
  x_.lambda() = -force_.all;
  images_.evaluate(problem_, x_);
  gap_.all = (images_.rows.all - slack_.all).array() + relaxed_by_;
  residual_ = std::max({max_abs(images_.stationarity), max_abs(images_.equality), max_abs(gap_.all)});
  for (Index row = 0; row < problem_.layout.size(); ++row)
    residual_ = std::max(residual_, std::abs(slack_.all[row] * nu_.all[row] - mu_));
  for (Index i = 0; i < problem_.pairs(); ++i) {
    product_residual_[i] = s(i) * t(i) - (elastic() ? p_[i] - n_[i] : 0.0);
    residual_ = std::max(residual_, std::abs(product_residual_[i]));
    if (!elastic()) continue;
    residual_ = std::max({residual_, std::abs(p_[i] * pi_p_[i] - mu_), std::abs(n_[i] * pi_n_[i] - mu_),
                          std::abs(rho_ - kappa_[i] - pi_p_[i]), std::abs(rho_ + kappa_[i] - pi_n_[i])});
  }
}

// Computes the weights of the rows, and the part of the eliminated rows in the right-hand side. For these,
// dp = (p/π_p)(μ/p − ρ + κ + dκ), and dn likewise, so dκ = W(t ds + s dt) + pull.
void L1Barrier::weigh() {
  weights_.rho = tuning::interior_rho;
  weights_.delta = std::max(tuning::exact_delta, delta_);
  weights_.rows.inequality() = nu_.inequality().cwiseQuotient(slack_.inequality());
  rhs_.inequality() = gap_.inequality().cwiseProduct(weights_.rows.inequality()) -
                      (mu_ * slack_.inequality().cwiseInverse() - nu_.inequality());
  for (Index i = 0; i < problem_.pairs(); ++i) {
    if (elastic()) {
      const double by_p = p_[i] / pi_p_[i], by_n = n_[i] / pi_n_[i];
      p_step_[i] = by_p * (mu_ / p_[i] - rho_ + kappa_[i]);
      n_step_[i] = by_n * (mu_ / n_[i] - rho_ - kappa_[i]);
      w_[i] = 1.0 / (by_p + by_n);
      pull_[i] = w_[i] * (product_residual_[i] - p_step_[i] + n_step_[i]);
    } else {
      w_[i] = tuning::exact_rho;
      pull_[i] = w_[i] * product_residual_[i];
    }
    const PairBlock block(s(i), t(i), nu_.s()[i] / slack_.s()[i], nu_.t()[i] / slack_.t()[i], kappa_[i],
                          w_[i]);
    block.put(i, weights_);
    const double e_s = gap_.s()[i], e_t = gap_.t()[i];
    rhs_.s()[i] =
        block.first * e_s + block.coupling * e_t - (mu_ / slack_.s()[i] - nu_.s()[i]) + t(i) * pull_[i];
    rhs_.t()[i] =
        block.coupling * e_s + block.second * e_t - (mu_ / slack_.t()[i] - nu_.t()[i]) + s(i) * pull_[i];
  }
}

bool L1Barrier::direction() {
  gradient_ = images_.stationarity;
  add_transposed(problem_.rows, rhs_.all, gradient_);
  d_.z() = -gradient_;
  d_.y() = -images_.equality;
  if (!kkt_.solve(d_.z(), d_.y()) || !d_.z().allFinite() || !d_.y().allFinite()) return false;
  multiply(problem_.rows, d_.z(), slack_step_.all);
  slack_step_.all += gap_.all;
  nu_step_.all = (mu_ * slack_.all.cwiseInverse() - nu_.all) -
                 nu_.all.cwiseQuotient(slack_.all).cwiseProduct(slack_step_.all);
  for (Index i = 0; i < problem_.pairs(); ++i) {
    kappa_step_[i] = w_[i] * (t(i) * slack_step_.s()[i] + s(i) * slack_step_.t()[i]) + pull_[i];
    if (!elastic()) continue;
    p_step_[i] += p_[i] / pi_p_[i] * kappa_step_[i];
    n_step_[i] -= n_[i] / pi_n_[i] * kappa_step_[i];
  }
  return true;
}

// Steps at most to the boundary, with separate primal and dual lengths.
void L1Barrier::move() {
  const double part = tuning::interior_fraction;
  double primal = 1.0, dual = 1.0;
  for (Index row = 0; row < problem_.layout.size(); ++row) {
    keep_positive(part * slack_.all[row], slack_step_.all[row], primal);
    keep_positive(part * nu_.all[row], nu_step_.all[row], dual);
  }
  const auto pi_step = [this](double value, double pi, double step) {
    return mu_ / value - pi - pi / value * step;
  };
  for (Index i = 0; i < problem_.pairs() && elastic(); ++i) {
    keep_positive(part * p_[i], p_step_[i], primal);
    keep_positive(part * n_[i], n_step_[i], primal);
    keep_positive(part * pi_p_[i], pi_step(p_[i], pi_p_[i], p_step_[i]), dual);
    keep_positive(part * pi_n_[i], pi_step(n_[i], pi_n_[i], n_step_[i]), dual);
  }
  for (Index i = 0; i < problem_.pairs() && elastic(); ++i) {
    pi_p_[i] += dual * pi_step(p_[i], pi_p_[i], p_step_[i]);
    pi_n_[i] += dual * pi_step(n_[i], pi_n_[i], n_step_[i]);
    p_[i] += primal * p_step_[i];
    n_[i] += primal * n_step_[i];
  }
  x_.z() += primal * d_.z();
  slack_.all += primal * slack_step_.all;
  x_.y() += dual * d_.y();
  nu_.all += dual * nu_step_.all;
  kappa_ += dual * kappa_step_;
}

// ρ − κ and ρ + κ rise with ρ.
void L1Barrier::next_problem() {
  mu_ = std::max(tuning::barrier_least, tuning::barrier_factor * mu_);
  const double rho = std::min(rho_most_, tuning::barrier_rho_factor * rho_);
  pi_p_.array() += rho - rho_;
  pi_n_.array() += rho - rho_;
  rho_ = rho;
  steps_here_ = 0;
}

ReferenceMethod::State L1Barrier::step(Run& run) {
  const double first_delta = options_.regularization_initial;
  if (!factor_regularized(run, kkt_, weights_, first_delta, delta_, [this] { weigh(); }) || !direction())
    return State::failed;
  move();
  ++run.iterations;
  evaluate();
  if (!std::isfinite(residual_) || max_abs(x_.z()) > tuning::runaway) return State::failed;
  ++steps_here_;
  const bool feasible = within_tolerances(violations(problem_, images_), options_);
  if (feasible && std::max(mu_, residual_) <= options_.stationarity_tolerance) return State::ended;
  const bool last = mu_ <= tuning::barrier_least && rho_ >= rho_most_;
  // Scaling for large multipliers: WB (5) and (6).
  const double mean = nu_.all.size() == 0 ? 0.0
                                          : (nu_.all.sum() + kappa_.cwiseAbs().sum()) /
                                                static_cast<double>(nu_.all.size() + kappa_.size());
  const double scale = std::max(1.0, mean / tuning::barrier_multiplier);
  const bool over = residual_ <= tuning::centrality * scale * mu_ || steps_here_ >= tuning::engine_budget;
  if (last && over) return feasible ? State::failed : State::given_up;
  if (!last && (over || schedule_ == Schedule::every_step)) {
    next_problem();
    evaluate();
  }
  return State::going_on;
}

}  // namespace marble
