#include "research/aladin_beta.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/retraction.h"
#include "path/termination.h"
#include "research/tuning.h"

namespace marble {

AladinBeta::Copy::Copy(double x, double lambda, double cost, double mu, double r) {
  const double sigma = tuning::aladin_sigma;
  const double tau = Softplus(r + x + (lambda - cost) / sigma, mu / sigma).positive;
  value = tau - r;
  slope = cost - mu / tau;
  curvature = std::min(mu / (tau * tau), tuning::scale_range);
}

AladinBeta::AladinBeta(const ScaledProblem& problem, Kkt& kkt, const Options& options)
    : problem_(problem),
      options_(options),
      qp_(problem, kkt, options),
      fallback_(problem, kkt, options, L1Barrier::Schedule::every_problem),
      x_(problem),
      local_(problem),
      images_(problem),
      local_images_(problem),
      alpha_(SplitStep::split_size(problem.layout)),
      local_alpha_(alpha_.size()),
      lambda_(alpha_.size()),
      copy_(alpha_.size()),
      slope_(alpha_.size()),
      curvature_(alpha_.size()),
      kappa_(problem.pairs()),
      best_z_(problem.variables()),
      merits_(static_cast<std::size_t>(tuning::aladin_merit_window)) {}

// Equal sides would stay equal in exact arithmetic; the first multipliers break the tie.
void AladinBeta::start(ConstVectorRef initial_z) {
  const Index rows = problem_.layout.size(), pairs = problem_.pairs();
  mu_ = tuning::barrier_first;
  rho_ = tuning::barrier_first;
  iterations_ = 0;
  why_back_ = nullptr;
  x_.all.setZero();
  x_.z() = initial_z;
  images_.evaluate(problem_, x_);
  alpha_.head(rows) = images_.rows.all;
  for (Index i = 0; i < pairs; ++i) {
    const double product = images_.rows.s()[i] * images_.rows.t()[i];
    alpha_[rows + i] = std::max(product, tuning::interior_inside);
    alpha_[rows + pairs + i] = std::max(-product, tuning::interior_inside);
  }
  lambda_.setZero();
  problem_.layout.t_part(lambda_).setConstant(tuning::barrier_tie);
  kappa_.setZero();
  best_z_ = initial_z;
  best_merit_ = merit();
  std::ranges::fill(merits_, std::numeric_limits<double>::infinity());  // μ is not small yet
}

// Solves (12) by Newton's method, from α⁻ with its κ. γ⁻ is (q, m)⁻, so Σ and P have the same centre.
bool AladinBeta::solve_local(Run& run) {
  const Index rows = problem_.layout.size(), pairs = problem_.pairs();
  const double sigma = tuning::aladin_sigma, pull = tuning::aladin_prox + sigma;
  local_.all.setZero();
  local_.z() = x_.z();
  local_.y() = x_.y();
  local_alpha_ = alpha_;
  local_images_.evaluate(problem_, local_);
  for (int step = 0; step < tuning::aladin_local_steps; ++step) {
    qp_.curvature.head(rows).setConstant(sigma);
    qp_.curvature.tail(2 * pairs).setConstant(pull);
    qp_.slope = lambda_ + qp_.curvature.cwiseProduct(local_alpha_ - alpha_);
    qp_.coupling = kappa_.cwiseMin(sigma).cwiseMax(-sigma);  // Σ keeps it convex
    qp_.product = local_images_.rows.s().cwiseProduct(local_images_.rows.t()) -
                  local_alpha_.segment(rows, pairs) + local_alpha_.tail(pairs);
    if (!qp_.solve(run, local_images_)) return false;
    local_.z() += qp_.z_step;
    local_.y() += qp_.y_step;
    local_images_.evaluate(problem_, local_);
    local_alpha_.head(rows) = local_images_.rows.all;
    local_alpha_.tail(2 * pairs) += qp_.step.tail(2 * pairs);
    kappa_ = qp_.multiplier;
    if (max_abs(qp_.z_step) <= tuning::roundoff * (1.0 + max_abs(local_.z()))) break;
  }
  return true;
}

// Evaluates (13) and (14), then (15) to (17) and the new λ.
bool AladinBeta::coordinate(Run& run) {
  const Index rows = problem_.layout.size(), pairs = problem_.pairs();
  const double r = std::min(tuning::aladin_r, mu_);  // with a fixed r, active values would end at −r
  for (Index i = 0; i < alpha_.size(); ++i) {
    const Copy copy(alpha_[i], lambda_[i], i < rows ? 0.0 : rho_, mu_, r);
    copy_[i] = copy.value, slope_[i] = copy.slope, curvature_[i] = copy.curvature;
  }
  qp_.step = local_alpha_ - copy_;
  coupling_gap_ = max_abs(qp_.step);
  qp_.curvature = curvature_;
  qp_.slope = slope_ + curvature_.cwiseProduct(qp_.step);
  const double prox = tuning::aladin_prox;
  qp_.curvature.tail(2 * pairs).array() += prox;
  qp_.slope.tail(2 * pairs) += prox * (local_alpha_ - alpha_).tail(2 * pairs);
  qp_.coupling = kappa_;
  qp_.product = local_images_.rows.s().cwiseProduct(local_images_.rows.t()) -
                local_alpha_.segment(rows, pairs) + local_alpha_.tail(pairs);
  if (!qp_.solve(run, local_images_)) return false;
  x_.all = local_.all;
  x_.z() += qp_.z_step;
  x_.y() += qp_.y_step;
  kappa_ = qp_.multiplier;
  images_.evaluate(problem_, x_);
  alpha_.head(rows) = images_.rows.all;
  alpha_.tail(2 * pairs) = (local_alpha_ + qp_.step).tail(2 * pairs);
  lambda_ = slope_ + curvature_.cwiseProduct(alpha_ - copy_);
  x_.lambda() = lambda_.head(rows);
  x_.lambda_L() += kappa_.cwiseProduct(images_.rows.t());
  x_.lambda_R() += kappa_.cwiseProduct(images_.rows.s());
  Vector& stationarity = images_.stationarity;  // its own part, without the rows, as an iteration expects it
  add_transposed(problem_.rows, x_.lambda(), stationarity);
  stationarity_ = max_abs(stationarity);
  return true;
}

// f plus all violations times the largest penalty.
double AladinBeta::merit() const {
  double violation = images_.equality.cwiseAbs().sum() - images_.rows.all.cwiseMin(0.0).sum();
  for (Index i = 0; i < problem_.pairs(); ++i)
    violation += std::abs(std::min(images_.rows.s()[i], images_.rows.t()[i]));
  return images_.objective + tuning::barrier_rho_most_stepwise * violation;
}

bool AladinBeta::converged() const {
  return within_tolerances(violations(problem_, images_), options_) &&
         std::max({mu_, coupling_gap_, stationarity_}) <= options_.stationarity_tolerance;
}

// Returns null, or the reason why the iteration failed.
const char* AladinBeta::iterate_once(Run& run) {
  if (!solve_local(run) || !coordinate(run)) return "a system of it had no solution";
  const double merit_now = merit();
  const double most = *std::ranges::max_element(merits_);
  if (!(merit_now <= most + tuning::exactness * (1.0 + std::abs(most)))) return "its merit did not fall";
  merits_[static_cast<std::size_t>(iterations_) % merits_.size()] = merit_now;
  if (merit_now < best_merit_) {
    best_merit_ = merit_now;
    best_z_ = x_.z();
  }
  return nullptr;
}

ReferenceMethod::State AladinBeta::step(Run& run) {
  if (fell_back()) return fallback_.step(run);
  const char* why = iterations_ < tuning::aladin_iterations ? iterate_once(run) : "it did not converge";
  if (why != nullptr && run.interrupted()) return State::failed;
  ++run.iterations;
  if (why != nullptr) {
    fallback_.start(best_z_);
    why_back_ = why;
    return State::going_on;
  }
  ++iterations_;
  if (converged()) return State::ended;
  mu_ = std::max(tuning::barrier_least, tuning::barrier_factor * mu_);
  rho_ = std::min(tuning::barrier_rho_most_stepwise, tuning::barrier_rho_factor * rho_);
  return State::going_on;
}

std::string AladinBeta::remark() const {
  return fell_back() ? std::string(why_back_) + " after " + std::to_string(iterations_) +
                           " iterations, and l1_barrier went on from the best point"
                     : std::string();
}

}  // namespace marble
