#include "path/newton.h"

#include <algorithm>
#include <cmath>

#include "model/retraction.h"

namespace marble {

Newton::Newton(const ScaledProblem& problem, Kkt& kkt)
    : problem_(problem), kkt_(kkt), weights_(problem), pivot_(problem.pairs()), rhs_(problem.layout) {}

bool Newton::factor(const Subproblem& sub, const Iterate& x, double delta, bool clip) {
  weights_.rho = sub.rho;
  weights_.delta = delta;
  auto omega = weights_.rows.inequality();
  for (Eigen::Index i = 0; i < omega.size(); ++i) {
    const Softplus w(x.v()[i], sub.kappa);
    omega[i] = 1.0 / (1.0 / sub.rho + w.positive / w.negative);
  }
  for (Eigen::Index i = 0; i < pivot_.size(); ++i) {
    const PairCurve h(sub.retraction, x.sigma()[i], sub.kappa);
    const double a = h.a();
    const double b = h.b();
    double q = -h.bend(x.lambda_L()[i], x.lambda_R()[i]);
    q = (clip ? std::max(q, 0.0) : q) + delta;
    const double u = std::sqrt(a * a + b * b);
    pivot_[i] = u * u + q / sub.rho;
    if (pivot_[i] <= 0.0) return false;
    weights_.rows.s()[i] = sub.rho;
    weights_.rows.t()[i] = q / pivot_[i];
    weights_.cosine[i] = b / u;
    weights_.sine[i] = a / u;
  }
  return kkt_.factor(weights_);
}

bool Newton::direction(const Subproblem& sub, const Iterate& x, const Iterate& r, Iterate& d,
                       Images& images) {
  // Computes W e + (a, −b)·r₃/π of one pair, for e = (e_L, e_R).
  const auto weight_s = weights_.rows.s();
  const auto weight_t = weights_.rows.t();
  const auto pair_image = [&](Eigen::Index i, double e_L, double e_R, double& out_L, double& out_R) {
    const PairCurve h(sub.retraction, x.sigma()[i], sub.kappa);
    const double cosine = weights_.cosine[i];
    const double sine = weights_.sine[i];
    const double across = weight_s[i] * (cosine * e_L + sine * e_R);
    const double along = weight_t[i] * (sine * e_L - cosine * e_R);
    const double from_sigma = r.sigma()[i] / pivot_[i];
    out_L = cosine * across + sine * along + h.a() * from_sigma;
    out_R = sine * across - cosine * along - h.b() * from_sigma;
  };

  const auto omega = weights_.rows.inequality();
  auto from_rows = rhs_.inequality();
  for (Eigen::Index i = 0; i < omega.size(); ++i) {
    const Softplus w(x.v()[i], sub.kappa);
    from_rows[i] = omega[i] * (r.lambda_w()[i] - w.positive / w.negative * r.v()[i]);
  }
  for (Eigen::Index i = 0; i < pivot_.size(); ++i) {
    pair_image(i, r.lambda_L()[i], r.lambda_R()[i], rhs_.s()[i], rhs_.t()[i]);
  }
  auto dz = d.z();
  dz = r.z();
  add_transposed(problem_.rows, rhs_.all, dz);
  dz = -dz;
  d.y() = -r.y();
  if (!kkt_.solve(dz, d.y())) return false;

  images.evaluate_rows(problem_, dz);
  for (Eigen::Index i = 0; i < omega.size(); ++i) {
    const Softplus w(x.v()[i], sub.kappa);
    const double reach = images.rows.all[i] + r.lambda_w()[i];  // C dz + r₄
    const double dlambda = omega[i] * (reach - w.positive / w.negative * r.v()[i]);
    d.lambda_w()[i] = dlambda;
    // Rows r₄ and r₂ both give dv; divide by the slope that is not small.
    d.v()[i] =
        x.v()[i] >= 0.0 ? (reach - dlambda / sub.rho) / w.slope() : (dlambda + r.v()[i]) / w.negative_slope();
  }
  for (Eigen::Index i = 0; i < pivot_.size(); ++i) {
    const PairCurve h(sub.retraction, x.sigma()[i], sub.kappa);
    const double e_L = images.rows.s()[i] + r.lambda_L()[i];
    const double e_R = images.rows.t()[i] + r.lambda_R()[i];
    double dL = 0.0;
    double dR = 0.0;
    pair_image(i, e_L, e_R, dL, dR);
    d.lambda_L()[i] = dL;
    d.lambda_R()[i] = dR;
    d.sigma()[i] = (h.a() * e_L - h.b() * e_R - r.sigma()[i] / sub.rho) / pivot_[i];
  }
  images.evaluate_duals(problem_, d);
  return true;
}

}  // namespace marble
