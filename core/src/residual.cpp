#include "residual.h"

#include <algorithm>
#include <cmath>

#include "retraction.h"

namespace marble {

Images::Images(const ScaledProblem& p)
    : equality(p.equalities()),
      inequality(p.inequalities()),
      left(p.pairs()),
      right(p.pairs()),
      gradient(p.variables()),
      stationarity(p.variables()) {}

void Images::evaluate_rows(const ScaledProblem& p, ConstVectorRef z) {
  multiply(p.A, z, equality);
  multiply(p.C, z, inequality);
  multiply(p.L, z, left);
  multiply(p.R, z, right);
}

void Images::evaluate_duals(const ScaledProblem& p, const Iterate& step) {
  multiply(p.Q, step.z(), gradient);
  stationarity = gradient;
  add_transposed(p.A, step.y(), stationarity);
  add_transposed(p.C, step.lambda_w(), stationarity);
  add_transposed(p.L, step.lambda_L(), stationarity);
  add_transposed(p.R, step.lambda_R(), stationarity);
}

void Images::evaluate(const ScaledProblem& p, const Iterate& x) {
  evaluate_rows(p, x.z());
  equality += p.b;
  inequality += p.d;
  left += p.l;
  right += p.r;
  evaluate_duals(p, x);
  objective = 0.5 * x.z().dot(gradient) + p.g.dot(x.z());
  gradient += p.g;
  stationarity += p.g;
}

void Images::advance(double alpha, const Images& direction, ConstVectorRef dz) {
  objective += alpha * (gradient.dot(dz) + 0.5 * alpha * direction.gradient.dot(dz));
  equality += alpha * direction.equality;
  inequality += alpha * direction.inequality;
  left += alpha * direction.left;
  right += alpha * direction.right;
  gradient += alpha * direction.gradient;
  stationarity += alpha * direction.stationarity;
}

void residual(const Subproblem& sub, const Images& images, const Iterate& x, Iterate& r) {
  const double kappa = sub.kappa;
  const double softness = 1.0 / sub.rho;
  r.z() = images.stationarity;
  r.y() = images.equality + softness * (sub.equality_estimate - x.y());
  for (Eigen::Index i = 0; i < images.inequality.size(); ++i) {
    const Retraction w(x.v()[i], kappa);
    r.v()[i] = x.lambda_w()[i] + w.negative;
    r.lambda_w()[i] =
        softness * (sub.inequality_estimate[i] - x.lambda_w()[i]) + images.inequality[i] - w.positive;
  }
  for (Eigen::Index i = 0; i < images.left.size(); ++i) {
    const Retraction h(x.sigma()[i], kappa);
    r.sigma()[i] = h.negative_slope() * x.lambda_R()[i] - h.slope() * x.lambda_L()[i];
    r.lambda_L()[i] = softness * (sub.left_estimate[i] - x.lambda_L()[i]) + images.left[i] - h.positive;
    r.lambda_R()[i] = softness * (sub.right_estimate[i] - x.lambda_R()[i]) + images.right[i] - h.negative;
  }
}

namespace {

// Unlike std::max, lets a NaN win and stay: a broken point must never look feasible.
void raise(double& worst, double value) {
  if (value > worst || std::isnan(value)) worst = value;
}

}  // namespace

Violations violations(const ScaledProblem& p, const Images& images) {
  Violations worst;
  for (Eigen::Index i = 0; i < images.equality.size(); ++i) {
    raise(worst.equality, std::abs(images.equality[i]) / p.equality_scale[i]);
  }
  for (Eigen::Index i = 0; i < images.inequality.size(); ++i) {
    raise(worst.inequality, -images.inequality[i] / p.inequality_scale[i]);
  }
  for (Eigen::Index i = 0; i < images.left.size(); ++i) {
    const double s = images.left[i] / p.left_scale[i];
    const double t = images.right[i] / p.right_scale[i];
    raise(worst.complementarity, std::abs(t < s || std::isnan(t) ? t : s));
  }
  return worst;
}

}  // namespace marble
