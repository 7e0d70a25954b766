#include "path/quadratic.h"

#include <algorithm>
#include <cmath>

#include "model/tuning.h"
#include "path/keep_positive.h"

namespace marble {

QuadraticEngine::QuadraticEngine(const ScaledProblem& problem, Kkt& kkt, const ScaledProblem& of_kkt)
    : problem_(problem),
      kkt_(kkt),
      set_(problem),
      weights_(of_kkt),
      x_(problem),
      d_(problem),
      images_(problem),
      slack_(problem.layout.size()),
      slack_step_(problem.layout.size()),
      product_(problem.layout.size()),
      rate_(problem.layout.size()),
      center_(problem.variables()),
      reporter_(problem) {
  shown_.reserve(set_.held.size());
}

void QuadraticEngine::start(ConstVectorRef initial_z, const WorkingSet& branch) {
  softness_ = 0.0;
  weights_.rho = tuning::exact_rho;
  weights_.delta = tuning::exact_delta;
  begin(initial_z, branch);
}

void QuadraticEngine::resume() {
  shown_.clear();
  short_steps_ = 0;
  evaluate();
}

void QuadraticEngine::start_elastic(ConstVectorRef initial_z, const WorkingSet& branch, double rho,
                                    double delta, ConstVectorRef center) {
  softness_ = 1.0 / rho;
  weights_.rho = rho;
  weights_.delta = delta;
  center_ = center;
  begin(initial_z, branch);
}

// Sets ν as large as the violation of the constraints: multipliers grow with it, and steps are short if ν
// starts below them.
void QuadraticEngine::begin(ConstVectorRef initial_z, const WorkingSet& branch) {
  set_ = branch;
  shown_.clear();
  short_steps_ = 0;
  x_.all.setZero();
  x_.z() = initial_z;
  images_.evaluate(problem_, x_);
  const Vector& rows = images_.rows.all;
  double violation = max_abs(images_.equality);
  for (Index i = 0; i < rows.size(); ++i)
    violation = std::max(violation, set_.is_fixed(i) ? std::abs(rows[i]) : -rows[i]);
  slack_.setZero();
  set_.for_each_free_row([&](Index row) {
    slack_[row] = std::max(1.0, rows[row]);
    x_.lambda()[row] = -std::max(1.0, tuning::quadratic_start * violation);
  });
  evaluate();
}

void QuadraticEngine::evaluate() {
  images_.evaluate(problem_, x_);
  if (softness_ > 0.0) {
    images_.stationarity += weights_.delta * (x_.z() - center_);
    images_.equality -= softness_ * x_.y();
    images_.rows.all -= softness_ * x_.lambda();
  }
  kappa_ = -slack_.dot(x_.lambda()) / free_rows();
}

double QuadraticEngine::free_rows() const {
  return std::max<double>(1.0, problem_.inequalities() + problem_.pairs());
}

// Newton's method on (Qz + g + Aᵀy + Jᵀλ, Az + b, Jz + c − w, w∘ν − κ + product) over the rows [C; L; R]; the
// last two eliminate dν. A fixed side has w = 0 and dλ = ρ times its residual after the step. With a softness
// ε, the rows are Az + b − εy and Jz + c + εν − w.
bool QuadraticEngine::direction(double kappa, bool correct) {
  rate_.setZero();
  set_.for_each_free_row([&](Index row) {
    rate_[row] = ((kappa - (correct ? product_[row] : 0.0)) / slack_[row] + x_.lambda()[row]) /
                 (1.0 - softness_ * x_.lambda()[row] / slack_[row]);
  });
  auto dz = d_.z();
  dz = -images_.stationarity;
  const Vector& weight = weights_.rows.all;
  slack_step_ = rate_ - weight.cwiseProduct(images_.rows.all - slack_);
  add_transposed(problem_.rows, slack_step_, dz);
  d_.y() = -images_.equality;
  if (!kkt_.solve(dz, d_.y()) || !dz.allFinite() || !d_.y().allFinite()) return false;
  multiply(problem_.rows, dz, slack_step_);
  slack_step_ += images_.rows.all - slack_;
  d_.lambda() = weight.cwiseProduct(slack_step_) - rate_;
  slack_step_ -= softness_ * d_.lambda();
  return true;
}

double QuadraticEngine::longest_step() const {
  double length = 1.0;
  set_.for_each_free_row([&](Index row) {
    keep_positive(slack_[row], slack_step_[row], length);
    keep_positive(-x_.lambda()[row], -d_.lambda()[row], length);
  });
  return length;
}

// Near the end, weights of 1/κ leave only rounding in a flat direction, and the inertia may seem wrong. The
// effect of a larger proximal term still vanishes with the step, since steps are short there.
bool QuadraticEngine::factor(Run& run) {
  while (true) {
    ++run.factorizations;
    if (run.timed(&Times::factorization_s, [&] { return kkt_.factor(weights_); })) return true;
    const bool at_end =
        kappa_ > 0.0 && kappa_ <= tuning::last_kappa && problem_.pairs() == 0 && softness_ == 0.0;
    if (!at_end || weights_.delta >= tuning::branch_kappa || run.interrupted()) return false;
    weights_.delta *= tuning::delta_raise * tuning::delta_raise;
  }
}

bool QuadraticEngine::step(Run& run) {
  if (run.interrupted()) return false;
  report(run);
  weights_.rows.all.setConstant(weights_.rho);
  set_.for_each_free_row([&](Index row) {
    weights_.rows.all[row] = x_.lambda()[row] / (softness_ * x_.lambda()[row] - slack_[row]);
  });
  if (!factor(run) || !direction(0.0, false)) return false;
  const double affine = longest_step();
  double affine_products = 0.0;
  set_.for_each_free_row([&](Index row) {
    affine_products -=
        (slack_[row] + affine * slack_step_[row]) * (x_.lambda()[row] + affine * d_.lambda()[row]);
  });
  const double kappa_affine = affine_products / free_rows();
  const double centering = kappa_ > 0.0 ? std::pow(std::max(0.0, kappa_affine) / kappa_, 3) : 0.0;
  product_ = -slack_step_.cwiseProduct(d_.lambda());
  if (!direction(centering * kappa_, true)) return false;
  step_length_ = std::min(1.0, tuning::interior_fraction * longest_step());
  x_.all += step_length_ * d_.all;
  set_.for_each_free_row([&](Index row) { slack_[row] += step_length_ * slack_step_[row]; });
  ++run.iterations;
  evaluate();
  read_rows();
  short_steps_ = step_length_ < tuning::path_least_step ? short_steps_ + 1 : 0;
  return short_steps_ <= tuning::short_patience && max_abs(x_.all) <= tuning::runaway;
}

bool QuadraticEngine::shows_new_rows() {
  if (!settled_ || shown_ == set_.held) return false;
  shown_ = set_.held;
  return true;
}

void QuadraticEngine::read_rows() {
  settled_ = kappa_ <= tuning::branch_kappa;
  set_.for_each_free_row([&](Index row) {
    const std::uint8_t held = slack_[row] < -x_.lambda()[row];
    if (held != set_.held[row]) settled_ = false;
    set_.held[row] = held;
  });
}

void QuadraticEngine::report(Run& run) {
  if (run.sink() == nullptr) return;
  reporter_.report(run, x_.z(), images_.objective, violations(problem_, images_),
                   {.kkt_residual = max_abs(images_.stationarity),
                    .kappa = kappa_,
                    .rho = weights_.rho,
                    .step_length = step_length_,
                    .regularization = weights_.delta});
}

}  // namespace marble
