#include "certificate.h"

#include <algorithm>
#include <cmath>

namespace marble {
namespace {

constexpr double kTolerance = 1e-6;  // relative to the multipliers' or the direction's own size

double smallest(const Vector& values) { return values.size() == 0 ? 0.0 : values.minCoeff(); }

}  // namespace

std::vector<double> infeasibility_certificate(const ScaledProblem& p, const Iterate& x) {
  Vector y = x.y();
  Vector nu = -x.lambda_w().cwiseMin(0.0);
  Vector xi = -x.lambda_L();
  Vector eta = -x.lambda_R();
  const double size = std::max({max_abs(y), max_abs(nu), max_abs(xi), max_abs(eta)});
  if (!(size > 0.0) || !std::isfinite(size)) return {};
  if (std::min(smallest(xi), smallest(eta)) < -kTolerance * size) return {};
  xi = xi.cwiseMax(0.0);
  eta = eta.cwiseMax(0.0);
  const double gap = p.b.dot(y) - p.d.dot(nu) - p.l.dot(xi) - p.r.dot(eta);
  if (!(gap > 0.0)) return {};
  Vector combination = Vector::Zero(p.variables());
  add_transposed(p.A, y, combination);
  add_transposed(p.C, -nu, combination);
  add_transposed(p.L, -xi, combination);
  add_transposed(p.R, -eta, combination);
  // A z with bounded entries could still balance the gap: ask for Aᵀy + … small against the gap itself.
  if (max_abs(combination) > kTolerance * gap) return {};

  std::vector<double> certificate;
  certificate.reserve(static_cast<std::size_t>(y.size() + nu.size() + 2 * xi.size()));
  const auto append = [&](const Vector& multipliers, const Vector& row_scale) {
    for (Eigen::Index i = 0; i < multipliers.size(); ++i) {
      certificate.push_back(multipliers[i] * row_scale[i] / gap);
    }
  };
  append(y, p.equality_scale);
  append(nu, p.inequality_scale);
  append(xi, p.left_scale);
  append(eta, p.right_scale);
  return certificate;
}

std::vector<double> unbounded_direction(const ScaledProblem& p, const Iterate& x) {
  const double size = max_abs(x.z());
  if (!(size > 0.0) || !std::isfinite(size)) return {};
  const Vector d = x.z() / size;
  if (!(p.g.dot(d) < -kTolerance)) return {};
  Vector image(p.variables());
  multiply(p.Q, d, image);
  if (max_abs(image) > kTolerance) return {};
  image.resize(p.equalities());
  multiply(p.A, d, image);
  if (max_abs(image) > kTolerance) return {};
  image.resize(p.inequalities());
  multiply(p.C, d, image);
  if (smallest(image) < -kTolerance) return {};
  Vector left(p.pairs());
  Vector right(p.pairs());
  multiply(p.L, d, left);
  multiply(p.R, d, right);
  if (max_abs(left.cwiseMin(right)) > kTolerance) return {};

  Vector direction = d.cwiseProduct(p.variable_scale);
  direction /= max_abs(direction);
  return {direction.data(), direction.data() + direction.size()};
}

ScaledProblem feasibility_relaxation(const ScaledProblem& p) {
  ScaledProblem relaxed;
  relaxed.Q.size = p.variables();
  relaxed.Q.column_pointers.assign(static_cast<std::size_t>(p.variables()) + 1, 0);
  relaxed.g = Vector::Zero(p.variables());
  relaxed.A = p.A;
  relaxed.b = p.b;
  relaxed.C.columns = p.variables();
  for (const RowMatrix* matrix : {&p.C, &p.L, &p.R}) {
    const auto entries = static_cast<Index>(relaxed.C.values.size());
    for (Index row = 0; row < matrix->rows; ++row)
      relaxed.C.row_pointers.push_back(entries + matrix->row_pointers[row + 1]);
    relaxed.C.column_indices.insert(relaxed.C.column_indices.end(), matrix->column_indices.begin(),
                                    matrix->column_indices.end());
    relaxed.C.values.insert(relaxed.C.values.end(), matrix->values.begin(), matrix->values.end());
    relaxed.C.rows += matrix->rows;
  }
  relaxed.d.resize(relaxed.C.rows);
  relaxed.d << p.d, p.l, p.r;
  relaxed.L.columns = relaxed.R.columns = p.variables();
  return relaxed;
}

}  // namespace marble
