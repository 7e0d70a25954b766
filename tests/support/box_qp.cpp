#include "support/box_qp.h"

#include <Eigen/Core>
#include <algorithm>
#include <random>

namespace marble::testing {
namespace {

struct BoxQp {
  Eigen::MatrixXd H;
  Eigen::VectorXd c;
};

BoxQp draw(Index n, std::uint64_t seed) {
  std::mt19937_64 engine(1000 * static_cast<std::uint64_t>(n) + seed);
  const auto entry = [&engine] { return static_cast<double>(engine() % 101) - 50.0; };
  BoxQp qp{Eigen::MatrixXd(n, n), Eigen::VectorXd(n)};
  for (Index i = 0; i < n; ++i) {
    for (Index j = i; j < n; ++j) qp.H(i, j) = qp.H(j, i) = entry();
  }
  for (Index i = 0; i < n; ++i) qp.c[i] = entry();
  return qp;
}

// The minimum of ½ a x² + b x over 0 ≤ x ≤ 1.
double best_coordinate(double a, double b) {
  double best = 0.5 * a + b < 0.0 ? 1.0 : 0.0;
  if (a > 0.0) best = std::clamp(-b / a, 0.0, 1.0);
  return best;
}

double descend(const BoxQp& qp, Eigen::VectorXd x) {
  for (bool moved = true; moved;) {
    moved = false;
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      const double a = qp.H(i, i);
      const double b = qp.H.row(i).dot(x) - a * x[i] + qp.c[i];
      const double to = best_coordinate(a, b);
      if (0.5 * a * (x[i] * x[i] - to * to) + b * (x[i] - to) <= 1e-9) continue;
      x[i] = to;
      moved = true;
    }
  }
  return 0.5 * x.dot(qp.H * x) + qp.c.dot(x);
}

}  // namespace

OwnedProblem box_qp(Index n, std::uint64_t seed) {
  const BoxQp qp = draw(n, seed);
  OwnedProblem p;
  p.name = "box QP";
  p.g.assign(static_cast<std::size_t>(3 * n), 0.0);
  Triplets A, L, R;
  for (Index i = 0; i < n; ++i) {
    p.g[static_cast<std::size_t>(i)] = 0.5 * qp.c[i];
    p.g[static_cast<std::size_t>(2 * n + i)] = -0.5;
    for (Index j = 0; j < n; ++j) {
      if (qp.H(i, j) != 0.0) A.add(i, j, qp.H(i, j));
    }
    A.add(i, n + i, -1.0);
    A.add(i, 2 * n + i, 1.0);
    L.add(i, i, 1.0);
    R.add(i, n + i, 1.0);
    L.add(n + i, i, -1.0);
    R.add(n + i, 2 * n + i, 1.0);
  }
  p.Q = compress(3 * n, 3 * n, {}, "Q").value();
  p.A = compress(n, 3 * n, A, "A").value();
  p.b.assign(qp.c.begin(), qp.c.end());
  p.C = compress(0, 3 * n, {}, "C").value();
  p.L = compress(2 * n, 3 * n, L, "L").value();
  p.R = compress(2 * n, 3 * n, R, "R").value();
  p.l.assign(static_cast<std::size_t>(2 * n), 0.0);
  std::fill(p.l.begin() + n, p.l.end(), 1.0);
  p.r.assign(static_cast<std::size_t>(2 * n), 0.0);
  return p;
}

double box_qp_descent(Index n, std::uint64_t seed, int starts) {
  const BoxQp qp = draw(n, seed);
  std::mt19937_64 engine(seed);
  double best = 0.0;
  for (int start = 0; start < starts; ++start) {
    Eigen::VectorXd x(n);
    for (double& value : x) {
      value = static_cast<double>(engine() >> 11) * 0x1p-53;
      if (start % 2 == 1) value = value < 0.5 ? 0.0 : 1.0;
    }
    best = std::min(best, descend(qp, std::move(x)));
  }
  return best;
}

}  // namespace marble::testing
