#include "search/null_space.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "model/tuning.h"

namespace marble {
namespace {

// Negative residual of the stationarity and of the held rows.
struct Residual {
  Vector stationarity, rows;
};

void evaluate(const ScaledProblem& p, const RowAccess& rows, const std::vector<Index>& held,
              const StationaryPoint& point, Residual& residual) {
  std::vector<CarefulSum> sums(static_cast<std::size_t>(p.variables()));
  for (Index j = 0; j < p.variables(); ++j) {
    sums[static_cast<std::size_t>(j)].add(p.g[j], 1.0);
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      const Index i = p.Q.row_indices[k];
      sums[static_cast<std::size_t>(j)].add(p.Q.values[k], point.z[i]);
      if (i != j) sums[static_cast<std::size_t>(i)].add(p.Q.values[k], point.z[j]);
    }
  }
  for (std::size_t i = 0; i < held.size(); ++i) {
    const double multiplier = point.multipliers[static_cast<Eigen::Index>(i)];
    rows.for_each_entry(held[i], [&](Index column, double value) {
      sums[static_cast<std::size_t>(column)].add(value, multiplier);
    });
    residual.rows[static_cast<Eigen::Index>(i)] = -rows.value(held[i], point.z).value;
  }
  for (Index j = 0; j < p.variables(); ++j)
    residual.stationarity[j] = -sums[static_cast<std::size_t>(j)].value();
}

}  // namespace

// Each sweep gains as many digits as the condition number of the rows allows.
bool refine(const ScaledProblem& problem, const std::vector<Index>& held, StationaryPoint& point) {
  const RowAccess rows(problem);
  const auto n = static_cast<Eigen::Index>(problem.variables());
  const auto k = static_cast<Eigen::Index>(held.size());
  if (k > n) return false;
  Eigen::MatrixXd normals(n, k);
  for (Eigen::Index i = 0; i < k; ++i) rows.copy(held[static_cast<std::size_t>(i)], normals.col(i));
  const Eigen::HouseholderQR<Eigen::MatrixXd> factor(normals);
  const Eigen::MatrixXd orthogonal = factor.householderQ() * Eigen::MatrixXd::Identity(n, n);
  const auto range = orthogonal.leftCols(k);
  const auto kernel = orthogonal.rightCols(n - k);
  const auto upper = factor.matrixQR().topLeftCorner(k, k).triangularView<Eigen::Upper>();
  if (k > 0 && !(factor.matrixQR().diagonal().head(k).cwiseAbs().minCoeff() > tuning::rounding)) return false;
  Eigen::MatrixXd hessian(n, n);
  for (Eigen::Index j = 0; j < n; ++j) multiply(problem.Q, Vector::Unit(n, j), hessian.col(j));
  Eigen::MatrixXd reduced = kernel.transpose() * hessian * kernel;
  const double largest = reduced.size() > 0 ? std::max(0.0, reduced.diagonal().maxCoeff()) : 0.0;
  const double shift = tuning::rounding * (largest > 0.0 ? largest : 1.0);
  reduced.diagonal().array() += shift;
  const Eigen::LLT<Eigen::MatrixXd> curvature(reduced);
  if (curvature.info() != Eigen::Success) return false;
  Residual residual{Vector(n), Vector(k)};
  double last = std::numeric_limits<double>::infinity();
  for (int sweep = 0; sweep < tuning::exact_sweeps; ++sweep) {
    evaluate(problem, rows, held, point, residual);
    Vector dz = range * upper.transpose().solve(residual.rows);
    const Vector right = residual.stationarity - hessian * dz;
    dz += kernel * curvature.solve(kernel.transpose() * right);
    const Vector dy = upper.solve(range.transpose() * (residual.stationarity - hessian * dz));
    const double size_z = 1.0 + max_abs(point.z), size_y = 1.0 + max_abs(point.multipliers);
    const double step = std::max(max_abs(dz) / size_z, max_abs(dy) / size_y);
    if (!std::isfinite(step)) return false;
    const bool at_rounding = step <= tuning::roundoff;
    if (!at_rounding && sweep > 1 && step > 0.5 * last) return last <= tuning::exactness;
    point.z += dz;
    point.multipliers += dy;
    if (at_rounding) return true;
    last = step;
  }
  return last <= tuning::exactness;
}

}  // namespace marble
