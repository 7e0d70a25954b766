#include "model/residual.h"

#include <algorithm>
#include <cmath>

#include "model/retraction.h"

namespace marble {

Images::Images(const ScaledProblem& p)
    : equality(p.equalities()), rows(p.layout), gradient(p.variables()), stationarity(p.variables()) {}

void Images::evaluate_rows(const ScaledProblem& p, ConstVectorRef z) {
  multiply(p.A, z, equality);
  multiply(p.rows, z, rows.all);
}

void Images::evaluate_duals(const ScaledProblem& p, const Iterate& step) {
  multiply(p.Q, step.z(), gradient);
  stationarity = gradient;
  add_transposed(p.A, step.y(), stationarity);
  add_transposed(p.rows, step.lambda(), stationarity);
}

void Images::evaluate(const ScaledProblem& p, const Iterate& x) {
  evaluate_rows(p, x.z());
  equality += p.b;
  rows.all += p.offset;
  evaluate_duals(p, x);
  objective = 0.5 * x.z().dot(gradient) + p.g.dot(x.z());
  gradient += p.g;
  stationarity += p.g;
}

void Images::advance(double alpha, const Images& direction, ConstVectorRef dz) {
  objective += alpha * (gradient.dot(dz) + 0.5 * alpha * direction.gradient.dot(dz));
  equality += alpha * direction.equality;
  rows.all += alpha * direction.rows.all;
  gradient += alpha * direction.gradient;
  stationarity += alpha * direction.stationarity;
}

void residual(const Subproblem& sub, const Images& images, const Iterate& x, Iterate& r) {
  const double kappa = sub.kappa;
  const double softness = 1.0 / sub.rho;
  r.z() = images.stationarity;
  r.y() = images.equality + softness * (sub.equality_estimate - x.y());
  const auto inequality = images.rows.inequality();
  const auto s = images.rows.s();
  const auto t = images.rows.t();
  for (Eigen::Index i = 0; i < inequality.size(); ++i) {
    const Softplus w(x.v()[i], kappa);
    r.v()[i] = x.lambda_w()[i] + w.negative;
    r.lambda_w()[i] =
        softness * (sub.row_estimate.inequality()[i] - x.lambda_w()[i]) + inequality[i] - w.positive;
  }
  for (Eigen::Index i = 0; i < s.size(); ++i) {
    const PairCurve h(sub.retraction, x.sigma()[i], kappa);
    r.sigma()[i] = h.b() * x.lambda_R()[i] - h.a() * x.lambda_L()[i];
    r.lambda_L()[i] = softness * (sub.row_estimate.s()[i] - x.lambda_L()[i]) + s[i] - h.s;
    r.lambda_R()[i] = softness * (sub.row_estimate.t()[i] - x.lambda_R()[i]) + t[i] - h.t;
  }
}

namespace {

// Unlike std::max, keeps a NaN, so that an invalid point never looks feasible.
void raise(double& worst, double value) {
  if (value > worst || std::isnan(value)) worst = value;
}

// Returns the largest violations, given the values of equalities and rows by number.
Violations worst_of(const RowLayout& rows, Eigen::Index equalities, auto&& equality, auto&& value) {
  Violations worst;
  for (Eigen::Index i = 0; i < equalities; ++i) raise(worst.equality, std::abs(equality(i)));
  for (Index row = 0; row < rows.inequalities; ++row) raise(worst.inequality, -value(row));
  for (Index pair = 0; pair < rows.pairs; ++pair) {
    const double s = value(rows.s(pair));
    const double t = value(rows.t(pair));
    raise(worst.complementarity, std::abs(t < s || std::isnan(t) ? t : s));
  }
  return worst;
}

}  // namespace

Violations violations(const ScaledProblem& p, const Images& images) {
  return worst_of(
      p.layout, p.equalities(), [&](Eigen::Index i) { return images.equality[i] / p.equality_scale[i]; },
      [&](Index row) { return images.rows.all[row] / p.row_scale[row]; });
}

Violations scaled_violations(const RowLayout& rows, const Images& images) {
  return worst_of(
      rows, images.equality.size(), [&](Eigen::Index i) { return images.equality[i]; },
      [&](Index row) { return images.rows.all[row]; });
}

}  // namespace marble
