#include "support/ill_conditioned.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <random>
#include <string>

namespace marble::testing {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

OwnedProblem lcp(const Matrix& m, const Vector& q) {
  OwnedProblem p;
  const auto n = static_cast<Index>(q.size());
  Triplets sides, images;
  for (Index j = 0; j < n; ++j) {
    sides.add(j, j, 1.0);
    for (Index i = 0; i < n; ++i) images.add(i, j, m(i, j));
  }
  p.g.assign(static_cast<std::size_t>(n), 0.0);
  p.L = compress(n, n, sides, "L").value();
  p.R = compress(n, n, images, "R").value();
  p.l.assign(static_cast<std::size_t>(n), 0.0);
  p.r.assign(q.begin(), q.end());
  return p;
}

}  // namespace

OwnedProblem ill_conditioned_lcp(double smallest, std::uint64_t seed, bool far) {
  std::mt19937_64 engine(seed);
  const auto uniform = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  const auto n = static_cast<Eigen::Index>(2 + engine() % 9);
  const Matrix random = Matrix::NullaryExpr(n, n, [&] { return 2.0 * uniform() - 1.0; });
  const Matrix basis = random.householderQr().householderQ();
  Vector eigenvalues(n);
  for (Eigen::Index i = 0; i < n; ++i) eigenvalues[i] = std::pow(smallest, uniform());
  eigenvalues[0] = 1.0;
  eigenvalues[n - 1] = smallest;
  Matrix m = basis * eigenvalues.asDiagonal() * basis.transpose();
  m = (0.5 * (m + m.transpose())).eval();
  Vector z(n), w(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const bool open = uniform() < 0.5;
    z[i] = open ? uniform() : 0.0;
    w[i] = open ? 0.0 : uniform();
  }
  const Vector q = Vector::NullaryExpr(n, [&] { return 2.0 * uniform() - 1.0; });
  OwnedProblem p = lcp(m, far ? q : Vector(w - m * z));
  p.name = (far ? "far_lcp_" : "lcp_") + std::to_string(seed);
  return p;
}

// Forces f = (ground on the lower box, lower on the upper box), velocities after the step W f + q.
OwnedProblem stacked_boxes(double ratio, double gravity_step) {
  Matrix w(2, 2);
  w << 1.0, -1.0, -1.0, 1.0 + 1.0 / ratio;
  OwnedProblem p = lcp(w, Vector{{-gravity_step, 0.0}});
  p.name = "boxes";
  return p;
}

}  // namespace marble::testing
