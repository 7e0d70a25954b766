#include "path/line_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/retraction.h"
#include "model/tuning.h"

namespace marble {

FilterLineSearch::FilterLineSearch(const ScaledProblem&) : capacity_(tuning::filter_capacity) {
  filter_.reserve(capacity_);
}

void FilterLineSearch::reset() {
  filter_.clear();
  started_ = false;
}

Measures measure(const Subproblem& sub, const Images& at, const Images& along, const Iterate& x,
                 const Iterate& d, double alpha) {
  const double softness = 1.0 / sub.rho;
  Measures m{0.0, at.objective + alpha * (at.gradient.dot(d.z()) + 0.5 * alpha * along.gradient.dot(d.z()))};
  // Adds θ and the terms of φ from e = (λ − α)/ρ, for one constraint with value c(z) − h.
  const auto add_constraint = [&](double value, double estimate, double lambda) {
    const double e = softness * (lambda - estimate);
    m.theta += std::abs(value - e);
    m.phi += e * (estimate + 0.5 * sub.rho * e);
  };
  for (Eigen::Index i = 0; i < at.equality.size(); ++i) {
    add_constraint(at.equality[i] + alpha * along.equality[i], sub.equality_estimate[i],
                   x.y()[i] + alpha * d.y()[i]);
  }
  double log_sum = 0.0;
  for (Eigen::Index i = 0; i < at.rows.inequality().size(); ++i) {
    const Softplus w(x.v()[i] + alpha * d.v()[i], sub.kappa);
    log_sum += std::log(w.positive);
    add_constraint(at.rows.all[i] + alpha * along.rows.all[i] - w.positive, sub.row_estimate.all[i],
                   x.lambda_w()[i] + alpha * d.lambda_w()[i]);
  }
  m.phi -= sub.kappa * log_sum;
  for (Eigen::Index i = 0; i < at.rows.s().size(); ++i) {
    const PairCurve h(sub.retraction, x.sigma()[i] + alpha * d.sigma()[i], sub.kappa);
    add_constraint(at.rows.s()[i] + alpha * along.rows.s()[i] - h.s, sub.row_estimate.s()[i],
                   x.lambda_L()[i] + alpha * d.lambda_L()[i]);
    add_constraint(at.rows.t()[i] + alpha * along.rows.t()[i] - h.t, sub.row_estimate.t()[i],
                   x.lambda_R()[i] + alpha * d.lambda_R()[i]);
  }
  return m;
}

double phi_slope(const Subproblem& sub, const Images& at, const Iterate& x, const Iterate& d) {
  // d/dα of φ at 0; ∂φ/∂λ = (α + ρe)/ρ = λ/ρ.
  double slope = at.gradient.dot(d.z());
  for (Eigen::Index i = 0; i < at.rows.inequality().size(); ++i) {
    slope -= sub.kappa * d.v()[i] / Softplus(x.v()[i], sub.kappa).root;  // p′/p = 1/√(v² + 4κ)
  }
  const double from_multipliers = x.y().dot(d.y()) + x.lambda_w().dot(d.lambda_w()) +
                                  x.lambda_L().dot(d.lambda_L()) + x.lambda_R().dot(d.lambda_R());
  return slope + from_multipliers / sub.rho;
}

bool FilterLineSearch::acceptable(const Measures& trial) const {
  return trial.theta <= theta_max_ &&
         std::none_of(filter_.begin(), filter_.end(), [&](const Measures& entry) {
           return trial.theta >= entry.theta && trial.phi >= entry.phi;
         });
}

void FilterLineSearch::add(const Measures& current) {
  if (filter_.size() == capacity_) filter_.erase(filter_.begin());
  filter_.push_back({(1.0 - tuning::filter_theta_fraction) * current.theta,
                     current.phi - tuning::filter_phi_fraction * current.theta});
}

double FilterLineSearch::search(const Subproblem& sub, const Images& at, const Images& along,
                                const Iterate& x, const Iterate& d) {
  const Measures current = measure(sub, at, along, x, d, 0.0);
  if (!started_) {
    theta_max_ = tuning::filter_theta_max * std::max(1.0, current.theta);
    theta_min_ = std::max(1.0, current.theta) / tuning::filter_theta_max;
    started_ = true;
  }
  const double descent = phi_slope(sub, at, x, d);
  // Differences below this are rounding: near a solution, no decrease of either measure is visible.
  const double noise = tuning::roundoff * std::abs(current.phi);
  const double theta_noise = tuning::roundoff * static_cast<double>(x.all.size());
  for (double alpha = 1.0; alpha >= tuning::exactness; alpha *= 0.5) {
    const Measures trial = measure(sub, at, along, x, d, alpha);
    if (!std::isfinite(trial.theta) || !std::isfinite(trial.phi) || !acceptable(trial)) continue;
    const bool switching = descent < 0.0 && current.theta <= theta_min_ &&
                           alpha * std::pow(-descent, tuning::filter_switch_phi) >
                               std::pow(current.theta, tuning::filter_switch_theta);
    if (switching) {
      if (trial.phi <= current.phi + tuning::filter_phi_fraction * alpha * descent + noise) return alpha;
      continue;
    }
    if (trial.theta <= (1.0 - tuning::filter_theta_fraction) * current.theta + theta_noise ||
        trial.phi <= current.phi - tuning::filter_phi_fraction * current.theta + noise) {
      add(current);
      return alpha;
    }
  }
  return 0.0;
}

double residual_norm(const Subproblem& sub, const Images& at, const Images& along, const Iterate& x,
                     const Iterate& d, double alpha) {
  const double softness = 1.0 / sub.rho;
  double norm = (at.stationarity + alpha * along.stationarity).cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
  const auto take = [&norm](double value) {  // unlike std::max, keeps a NaN
    const double size = std::abs(value);
    if (size > norm || std::isnan(size)) norm = size;
  };
  const auto primal = [&](double value, double estimate, double lambda) {
    take(value + softness * (estimate - lambda));
  };
  for (Eigen::Index i = 0; i < at.equality.size(); ++i) {
    primal(at.equality[i] + alpha * along.equality[i], sub.equality_estimate[i], x.y()[i] + alpha * d.y()[i]);
  }
  for (Eigen::Index i = 0; i < at.rows.inequality().size(); ++i) {
    const Softplus w(x.v()[i] + alpha * d.v()[i], sub.kappa);
    const double lambda = x.lambda_w()[i] + alpha * d.lambda_w()[i];
    take(lambda + w.negative);
    primal(at.rows.all[i] + alpha * along.rows.all[i] - w.positive, sub.row_estimate.all[i], lambda);
  }
  const auto s_at = at.rows.s();
  const auto t_at = at.rows.t();
  const auto s_along = along.rows.s();
  const auto t_along = along.rows.t();
  const auto s_estimate = sub.row_estimate.s();
  const auto t_estimate = sub.row_estimate.t();
  for (Eigen::Index i = 0; i < s_at.size(); ++i) {
    const PairCurve h(sub.retraction, x.sigma()[i] + alpha * d.sigma()[i], sub.kappa);
    const double lambda_L = x.lambda_L()[i] + alpha * d.lambda_L()[i];
    const double lambda_R = x.lambda_R()[i] + alpha * d.lambda_R()[i];
    take(h.b() * lambda_R - h.a() * lambda_L);
    primal(s_at[i] + alpha * s_along[i] - h.s, s_estimate[i], lambda_L);
    primal(t_at[i] + alpha * t_along[i] - h.t, t_estimate[i], lambda_R);
  }
  return norm;
}

}  // namespace marble
