#include "support/random_problem.h"

#include <Eigen/Core>
#include <algorithm>
#include <random>

#include "support/dense_matrix.h"

namespace marble::testing {
namespace {

class Source {
 public:
  explicit Source(std::uint64_t seed) : engine_(seed) {}
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double symmetric() { return 2.0 * uniform() - 1.0; }

 private:
  std::mt19937_64 engine_;
};

Eigen::MatrixXd random_matrix(Source& source, Index rows, Index columns, double density) {
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(rows, columns);
  for (Index i = 0; i < rows; ++i) {
    for (Index j = 0; j < columns; ++j) {
      if (source.uniform() < density) m(i, j) = source.symmetric();
    }
    m(i, i % columns) += 1.0;  // no zero rows
  }
  return m;
}

std::vector<double> values(const Eigen::VectorXd& v) { return {v.data(), v.data() + v.size()}; }

}  // namespace

OwnedProblem random_problem(const RandomSizes& sizes, std::uint64_t seed) {
  Source source(seed);
  const Index n = sizes.variables;
  Eigen::VectorXd z(n);
  for (double& entry : z) entry = source.symmetric();

  OwnedProblem p;
  p.name = "random " + std::to_string(seed);
  const Eigen::MatrixXd root = random_matrix(source, n, n, sizes.density);
  Eigen::MatrixXd Q = root * root.transpose();
  if (sizes.indefinite) Q.diagonal().array() -= 2.0;
  Q = 0.5 * (Q + Q.transpose()).eval();
  p.Q = sparse(Q);
  for (Index i = 0; i < n; ++i) p.g.push_back(source.symmetric());
  p.c0 = source.symmetric();

  const Eigen::MatrixXd A = random_matrix(source, sizes.equalities, n, sizes.density);
  const Eigen::MatrixXd C = random_matrix(source, sizes.inequalities, n, sizes.density);
  const Eigen::MatrixXd L = random_matrix(source, sizes.pairs, n, sizes.density);
  const Eigen::MatrixXd R = random_matrix(source, sizes.pairs, n, sizes.density);
  p.A = sparse(A);
  p.b = values(-A * z);
  p.C = sparse(C);
  Eigen::VectorXd d = -C * z;
  for (double& entry : d) entry += source.uniform() < 0.5 ? 0.0 : source.uniform();
  p.d = values(d);
  Eigen::VectorXd l = -L * z;
  Eigen::VectorXd r = -R * z;
  for (Index i = 0; i < sizes.pairs; ++i) {
    const double kind = source.uniform();
    if (kind < 0.4) l[i] += source.uniform();
    if (kind > 0.6) r[i] += source.uniform();
  }
  p.L = sparse(L);
  p.l = values(l);
  p.R = sparse(R);
  p.r = values(r);
  return p;
}

OwnedProblem filling_problem(Index n) {
  std::mt19937_64 random(1);
  const auto any = [&] { return static_cast<Index>(random() % static_cast<std::uint64_t>(n)); };
  Triplets entries;
  for (Index i = 0; i < n; ++i) {
    entries.add(i, i, 100.0);
    for (int k = 0; k < 3; ++k) {
      const Index a = any();
      const Index b = any();
      entries.add(std::min(a, b), std::max(a, b), 1.0);
    }
  }
  OwnedProblem p;
  p.name = "filling";
  p.Q = compress(n, n, entries, "Q").value();
  p.hessian_form = HessianForm::upper_triangle;
  p.g.assign(static_cast<std::size_t>(n), 1.0);
  return p;
}

}  // namespace marble::testing
