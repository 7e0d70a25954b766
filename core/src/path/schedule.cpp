#include "path/schedule.h"

#include <algorithm>
#include <cmath>

#include "model/printed.h"
#include "model/tuning.h"

namespace marble {

Regularization::Regularization(const Options& options)
    : base_(options.path == Path::fast ? tuning::least_delta : 0.0),
      first_(is_printed(options) ? tuning::printed_first_delta : options.regularization_initial),
      factor_(is_printed(options) ? tuning::printed_delta_raise : tuning::delta_raise),
      remembers_(!is_printed(options)) {}

bool Regularization::raise() {
  const double first = remembers_ ? std::max(first_, last_ / tuning::delta_lower) : first_;
  current_ = current_ > base_ ? factor_ * current_ : std::max(first, factor_ * base_);
  return current_ <= tuning::runaway;
}

void Schedule::begin(Subproblem& sub) const {
  const bool fast = options_.path == Path::fast;
  sub.retraction = options_.retraction;
  const double own_kappa = fast ? tuning::path_first_kappa : tuning::paper_first_kappa;
  const double first_kappa = options_.kappa_initial > 0.0 ? options_.kappa_initial : own_kappa;
  sub.kappa = std::max(first_kappa, options_.kappa_min);
  sub.rho = fast ? options_.rho_max : std::min(options_.rho_initial, options_.rho_max);
}

bool Schedule::inner_converged(const Subproblem& sub, double residual_norm) const {
  if (options_.path != Path::fast) return residual_norm <= options_.inner_tolerance;
  return residual_norm <= std::max(tuning::centrality * sub.kappa, options_.stationarity_tolerance);
}

void Schedule::advance(Subproblem& sub, const Iterate& x) const {
  if (sub.rho < options_.rho_max) {
    sub.rho = std::min(options_.rho_factor * sub.rho, options_.rho_max);
    return;
  }
  const double next = options_.path == Path::fast ? std::min(tuning::path_kappa_factor * sub.kappa,
                                                             std::pow(sub.kappa, tuning::path_kappa_power))
                                                  : options_.kappa_factor * sub.kappa;
  sub.kappa = std::max(next, options_.kappa_min);
  sub.take_estimates(x);
}

bool Schedule::retreat(Subproblem& sub, double kappa_before) const {
  sub.kappa = std::sqrt(sub.kappa * kappa_before);
  return sub.kappa < tuning::progress * kappa_before;
}

bool Schedule::exhausted(const Subproblem& sub) const {
  return sub.rho >= options_.rho_max && sub.kappa <= options_.kappa_min;
}

}  // namespace marble
