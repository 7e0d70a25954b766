#include "path/quadratic.h"

#include <algorithm>
#include <cmath>

#include "tuning.h"

namespace marble {

QuadraticEngine::QuadraticEngine(const ScaledProblem& problem, Kkt& kkt)
    : problem_(problem),
      kkt_(kkt),
      weights_(problem),
      x_(problem),
      d_(problem),
      images_(problem),
      slack_(problem.inequalities()),
      slack_step_(problem.inequalities()),
      product_(problem.inequalities()),
      rate_(problem.inequalities()),
      held_(static_cast<std::size_t>(problem.inequalities())),
      reporter_(problem) {}

// ν as large as the constraints are violated: multipliers grow with that, and from below it steps are short.
void QuadraticEngine::start(ConstVectorRef initial_z) {
  x_.all.setZero();
  x_.z() = initial_z;
  images_.evaluate(problem_, x_);
  slack_ = images_.rows.all.cwiseMax(1.0);
  const double violation = std::max(max_abs(images_.equality), max_abs(images_.rows.all.cwiseMin(0.0)));
  x_.lambda().setConstant(-std::max(1.0, tuning::quadratic_start * violation));
  shown_.clear();
  short_steps_ = 0;
  evaluate();
}

void QuadraticEngine::evaluate() {
  images_.evaluate(problem_, x_);
  kappa_ = slack_.size() == 0 ? 0.0 : -slack_.dot(x_.lambda()) / static_cast<double>(slack_.size());
}

// Newton on (Qz + g + Aᵀy + Cᵀλ, Az + b, Cz + d − w, w∘ν − κ + product); dν is eliminated by the last two.
bool QuadraticEngine::direction(double kappa, bool correct) {
  rate_ = (kappa + slack_.cwiseProduct(x_.lambda()).array()).matrix();
  if (correct) rate_ -= product_;
  auto dz = d_.z();
  dz = -images_.stationarity;
  const Vector& weight = weights_.rows.all;
  slack_step_ = rate_.cwiseQuotient(slack_) - weight.cwiseProduct(images_.rows.all - slack_);
  add_transposed(problem_.rows, slack_step_, dz);
  d_.y() = -images_.equality;
  if (!kkt_.solve(dz, d_.y()) || !dz.allFinite() || !d_.y().allFinite()) return false;
  multiply(problem_.rows, dz, slack_step_);
  slack_step_ += images_.rows.all - slack_;
  d_.lambda() = weight.cwiseProduct(slack_step_) - rate_.cwiseQuotient(slack_);
  return true;
}

double QuadraticEngine::longest_step() const {
  double length = 1.0;
  for (Eigen::Index i = 0; i < slack_.size(); ++i) {
    if (slack_step_[i] < 0.0) length = std::min(length, -slack_[i] / slack_step_[i]);
    if (d_.lambda()[i] > 0.0) length = std::min(length, -x_.lambda()[i] / d_.lambda()[i]);
  }
  return length;
}

bool QuadraticEngine::step(Run& run) {
  if (run.interrupted()) return false;
  report(run);
  weights_.rho = tuning::exact_rho;
  weights_.delta = tuning::exact_delta;
  weights_.rows.all = -x_.lambda().cwiseQuotient(slack_);
  ++run.factorizations;
  if (!run.timed(&Times::factorization_s, [&] { return kkt_.factor(weights_); })) return false;
  if (!direction(0.0, false)) return false;
  const double affine = longest_step();
  const double kappa_affine = -(slack_ + affine * slack_step_).dot(x_.lambda() + affine * d_.lambda()) /
                              std::max<double>(1.0, static_cast<double>(slack_.size()));
  const double centering = kappa_ > 0.0 ? std::pow(std::max(0.0, kappa_affine) / kappa_, 3) : 0.0;
  product_ = -slack_step_.cwiseProduct(d_.lambda());
  if (!direction(centering * kappa_, true)) return false;
  step_length_ = std::min(1.0, tuning::interior_fraction * longest_step());
  x_.all += step_length_ * d_.all;
  slack_ += step_length_ * slack_step_;
  ++run.iterations;
  evaluate();
  read_rows();
  short_steps_ = step_length_ < tuning::path_least_step ? short_steps_ + 1 : 0;
  return short_steps_ <= tuning::quadratic_short_steps && max_abs(x_.all) <= tuning::runaway;
}

bool QuadraticEngine::shows_new_rows() {
  if (!settled_ || shown_ == held_) return false;
  shown_ = held_;
  return true;
}

void QuadraticEngine::read_rows() {
  settled_ = kappa_ <= tuning::branch_kappa;
  for (Eigen::Index i = 0; i < slack_.size(); ++i) {
    const bool held = slack_[i] < -x_.lambda()[i];
    if (held != held_[static_cast<std::size_t>(i)]) settled_ = false;
    held_[static_cast<std::size_t>(i)] = held;
  }
}

void QuadraticEngine::report(Run& run) {
  reporter_.tell(run, x_.z(), images_.objective, violations(problem_, images_),
                 {.kkt_residual = max_abs(images_.stationarity),
                  .kappa = kappa_,
                  .rho = weights_.rho,
                  .step_length = step_length_,
                  .regularization = weights_.delta});
}

}  // namespace marble
