#include <Eigen/Core>
#include <cmath>
#include <random>
#include <string>

#include "marble/examples.h"

namespace marble::examples {
namespace {

using Matrix = Eigen::MatrixXd;
using Column = Eigen::VectorXd;

// Uses only the standard's engines, because its distributions differ between libraries.
class Source {
 public:
  explicit Source(std::uint64_t seed) : engine_(seed) {}
  double unit() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double symmetric() { return 2.0 * unit() - 1.0; }
  Matrix matrix(Index rows, Index columns) {
    Matrix m(rows, columns);
    for (double& entry : m.reshaped()) entry = symmetric();
    return m;
  }

 private:
  std::mt19937_64 engine_;
};

SparseMatrix sparse(const Matrix& m, const char* name) {
  Triplets entries;
  for (Index j = 0; j < m.cols(); ++j) {
    for (Index i = 0; i < m.rows(); ++i) {
      if (m(i, j) != 0.0) entries.add(i, j, m(i, j));
    }
  }
  return compress(static_cast<Index>(m.rows()), static_cast<Index>(m.cols()), entries, name).value();
}

std::vector<double> values(const Column& v) { return {v.data(), v.data() + v.size()}; }

}  // namespace

OwnedProblem qpec(const QpecParameters& p, std::uint64_t seed) {
  Source source(seed);
  const Index n_x = p.upper_variables;
  const Index n_y = p.lower_variables;
  const Index n = n_x + n_y;

  const Matrix root = source.matrix(n, n);
  const Matrix lower_root = source.matrix(n_y, n_y);
  const double size = 3.0 / n_y;  // entries of variance 1/3
  const Matrix M = size * lower_root * lower_root.transpose() + 0.1 * Matrix::Identity(n_y, n_y) +
                   0.3 * std::sqrt(size) * (lower_root - lower_root.transpose());
  const Matrix N = source.matrix(n_y, n_x);
  const Matrix C = source.matrix(p.constraints, n_x);

  // A feasible point: in each pair y > 0, or both are 0 (degenerate), or w > 0.
  Column x(n_x);
  for (double& entry : x) entry = source.symmetric();
  Column y = Column::Zero(n_y);
  Column w = Column::Zero(n_y);
  const Index positive = (n_y - p.degenerate_pairs) / 2;
  for (Index i = 0; i < positive; ++i) y[i] = source.unit();
  for (Index i = positive + p.degenerate_pairs; i < n_y; ++i) w[i] = source.unit();
  Column slack = Column::Zero(p.constraints);
  for (double& entry : slack) entry = source.unit() < 0.5 ? 0.0 : source.unit();

  OwnedProblem q;
  q.name = "qpec-" + std::to_string(n) + "-" + std::to_string(seed);
  // The rounding of the product is not symmetric. If a sum cancels, a mirror image differs by more than
  // Problem accepts.
  const Matrix Q = 3.0 / n * root * root.transpose() + 0.1 * Matrix::Identity(n, n);
  q.Q = sparse(Q.selfadjointView<Eigen::Upper>(), "Q");
  q.g.resize(static_cast<std::size_t>(n));
  for (double& entry : q.g) entry = 2.0 * source.symmetric();
  Matrix upper = Matrix::Zero(p.constraints, n);
  upper.leftCols(n_x) = C;
  q.C = sparse(upper, "C");
  q.d = values(slack - C * x);
  Matrix left = Matrix::Zero(n_y, n);
  left.rightCols(n_y).setIdentity();
  Matrix right(n_y, n);
  right << N, M;
  q.L = sparse(left, "L");
  q.R = sparse(right, "R");
  q.l.assign(static_cast<std::size_t>(n_y), 0.0);
  q.r = values(w - N * x - M * y);
  return q;
}

}  // namespace marble::examples
