#include "schedule.h"

#include <algorithm>
#include <cmath>

namespace marble {
namespace {

constexpr double kLargestRegularization = 1e10;
constexpr double kFastInitialKappa = 10.0;  // measured: .01 to 10 is a robust window, ≥ 20 finds other minima
constexpr double kPaperInitialKappa = 0.1;
constexpr double kFastCentrality = 10.0;  // the fast path follows κ down as soon as ‖r‖∞ ≤ 10κ

constexpr double kShortestWay =
    0.9;  // a retreat that leaves κ above this much of its last value is a failure

}  // namespace

bool Regularization::raise() {
  current_ = current_ > base_ ? 8.0 * current_ : std::max(first_, last_ / 3.0);
  return current_ <= kLargestRegularization;
}

Schedule::Schedule(const Options& options, Subproblem& sub) : options_(options) {
  const bool fast = options.path == Path::fast;
  const double own_kappa = fast ? kFastInitialKappa : kPaperInitialKappa;
  sub.kappa = std::max(options.kappa_initial > 0.0 ? options.kappa_initial : own_kappa, options.kappa_min);
  sub.rho = fast ? options.rho_max : std::min(options.rho_initial, options.rho_max);
}

bool Schedule::inner_converged(const Subproblem& sub, double residual_norm) const {
  if (options_.path == Path::paper) return residual_norm <= options_.inner_tolerance;
  return residual_norm <= std::max(kFastCentrality * sub.kappa, options_.stationarity_tolerance);
}

void Schedule::advance(Subproblem& sub, const Iterate& x) {
  if (sub.rho < options_.rho_max) {
    sub.rho = std::min(options_.rho_factor * sub.rho, options_.rho_max);
    return;
  }
  const double next = options_.path == Path::fast ? std::min(0.1 * sub.kappa, std::pow(sub.kappa, 1.5))
                                                  : options_.kappa_factor * sub.kappa;
  sub.kappa = std::max(next, options_.kappa_min);
  sub.take_estimates(x);
}

bool Schedule::retreat(Subproblem& sub, double kappa_before) const {
  sub.kappa = std::sqrt(sub.kappa * kappa_before);
  return sub.kappa < kShortestWay * kappa_before;
}

bool Schedule::exhausted(const Subproblem& sub) const {
  return sub.rho >= options_.rho_max && sub.kappa <= options_.kappa_min;
}

}  // namespace marble
