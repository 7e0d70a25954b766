#include "research/full_jacobian.h"

#include <Eigen/SparseLU>
#include <cmath>
#include <limits>
#include <vector>

#include "model/retraction.h"
#include "research/tuning.h"

namespace marble {

Eigen::SparseMatrix<double> full_jacobian(const ScaledProblem& p, const Subproblem& sub, const Iterate& x,
                                          double delta) {
  std::vector<Eigen::Triplet<double>> entries;
  const auto add = [&entries](Index row, Index column, double value) {
    entries.emplace_back(row, column, value);
  };
  const auto symmetric = [&add](Index row, Index column, double value) {
    add(row, column, value);
    if (row != column) add(column, row, value);
  };
  const RowLayout& rows = p.layout;
  const Index sigma = p.variables(), v = sigma + rows.pairs, y = v + rows.inequalities,
              lambda = y + p.equalities();
  const Index size = lambda + rows.size();
  for (Index column = 0; column < p.Q.size; ++column) {
    for (Index k = p.Q.column_pointers[column]; k < p.Q.column_pointers[column + 1]; ++k)
      symmetric(p.Q.row_indices[k], column, p.Q.values[k]);
  }
  const auto couple = [&](const RowMatrix& matrix, Index at) {
    for (Index row = 0; row < matrix.rows; ++row) {
      for (Index k = matrix.row_pointers[row]; k < matrix.row_pointers[row + 1]; ++k)
        symmetric(at + row, matrix.column_indices[k], matrix.values[k]);
      add(at + row, at + row, -1.0 / sub.rho);
    }
  };
  couple(p.A, y);
  couple(p.rows, lambda);
  for (Index i = 0; i < p.variables(); ++i) add(i, i, delta);
  for (Index i = 0; i < rows.inequalities; ++i) {
    const Softplus w(x.v()[i], sub.kappa);
    add(v + i, v + i, -w.negative_slope());
    add(v + i, lambda + i, 1.0);
    add(lambda + i, v + i, -w.slope());
  }
  for (Index i = 0; i < rows.pairs; ++i) {
    const PairCurve h(sub.retraction, x.sigma()[i], sub.kappa);
    add(sigma + i, sigma + i, delta - h.bend(x.lambda_L()[i], x.lambda_R()[i]));
    symmetric(sigma + i, lambda + rows.s(i), -h.a());
    symmetric(sigma + i, lambda + rows.t(i), h.b());
  }
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

double condition_estimate(const Eigen::SparseMatrix<double>& matrix) {
  const double infinite = std::numeric_limits<double>::infinity();
  const Eigen::Index n = matrix.rows();
  if (n == 0) return 1.0;
  double norm = 0.0;
  for (Eigen::Index column = 0; column < n; ++column)
    norm = std::max(norm, matrix.col(column).cwiseAbs().sum());
  Eigen::SparseLU<Eigen::SparseMatrix<double>> lu(matrix);
  if (!std::isfinite(norm) || lu.info() != Eigen::Success) return infinite;
  double inverse = 0.0;
  Vector x = Vector::Constant(n, 1.0 / static_cast<double>(n));
  for (int round = 0; round < tuning::condition_rounds; ++round) {
    const Vector image = lu.solve(x);
    inverse = std::max(inverse, image.lpNorm<1>());
    const Vector sign = image.unaryExpr([](double value) { return value < 0.0 ? -1.0 : 1.0; });
    const Vector slope = lu.transpose().solve(sign);
    Eigen::Index largest = 0;
    if (!(slope.cwiseAbs().maxCoeff(&largest) > slope.dot(x))) break;
    x.setZero();
    x[largest] = 1.0;
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    const double size = 1.0 + static_cast<double>(i) / static_cast<double>(std::max<Eigen::Index>(1, n - 1));
    x[i] = i % 2 == 0 ? size : -size;
  }
  const Vector image = lu.solve(x);
  inverse = std::max(inverse, 2.0 * image.lpNorm<1>() / (3.0 * static_cast<double>(n)));
  return std::isfinite(inverse) ? norm * inverse : infinite;
}

}  // namespace marble
