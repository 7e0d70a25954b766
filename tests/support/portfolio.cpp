#include "support/portfolio.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>
#include <random>
#include <vector>

namespace marble::testing {
namespace {

constexpr double kUnit = 100.0;

struct Market {
  Eigen::MatrixXd S;
  Eigen::VectorXd m;
};

Market draw(Index n, std::uint64_t seed) {
  std::mt19937_64 engine(1000 * static_cast<std::uint64_t>(n) + seed);
  const auto uniform = [&engine](double low, double high) {
    return low + (high - low) * static_cast<double>(engine() >> 11) * 0x1p-53;
  };
  Eigen::MatrixXd factors(n, 5);
  for (double& loading : factors.reshaped()) {  // nearly normal
    loading = -6.0;
    for (int k = 0; k < 12; ++k) loading += uniform(0.0, 1.0);
  }
  Market market{factors * factors.transpose() / 20.0, Eigen::VectorXd(n)};
  for (Index i = 0; i < n; ++i) market.S(i, i) += uniform(0.05, 0.2);
  for (double& mean : market.m) mean = uniform(0.02, 0.12);
  return market;
}

// The least cost with all of these assets and no other, if none of them is negative.
double cost(const Market& market, const std::vector<Index>& assets) {
  const auto k = static_cast<Eigen::Index>(assets.size());
  Eigen::MatrixXd K = Eigen::MatrixXd::Ones(k + 1, k + 1);
  K.topLeftCorner(k, k) = 2.0 * market.S(assets, assets);
  K(k, k) = 0.0;
  Eigen::VectorXd right(k + 1);
  right << 0.5 * market.m(assets), 1.0;
  const Eigen::VectorXd x = K.partialPivLu().solve(right).head(k);
  if (x.minCoeff() < 0.0) return std::numeric_limits<double>::infinity();
  return kUnit * (x.dot(market.S(assets, assets) * x) - 0.5 * market.m(assets).dot(x));
}

double best_of(const Market& market, std::vector<Index>& assets, Index next, Index most) {
  double best = std::numeric_limits<double>::infinity();
  if (most == 0) return best;
  for (; next < market.m.size(); ++next) {
    assets.push_back(next);
    best = std::min({best, cost(market, assets), best_of(market, assets, next + 1, most - 1)});
    assets.pop_back();
  }
  return best;
}

}  // namespace

OwnedProblem portfolio(Index n, Index most, std::uint64_t seed) {
  const Market market = draw(n, seed);
  OwnedProblem p;
  p.name = "portfolio";
  p.g.assign(static_cast<std::size_t>(2 * n), 0.0);
  Triplets Q, A, C, L, R;
  for (Index i = 0; i < n; ++i) {
    p.g[static_cast<std::size_t>(i)] = -0.5 * kUnit * market.m[i];
    for (Index j = 0; j < n; ++j) Q.add(i, j, 2.0 * kUnit * market.S(i, j));
    A.add(0, i, 1.0);
    C.add(0, n + i, 1.0);
    C.add(1 + i, n + i, -1.0);
    L.add(i, i, 1.0);
    R.add(i, n + i, 1.0);
  }
  p.Q = compress(2 * n, 2 * n, Q, "Q").value();
  p.A = compress(1, 2 * n, A, "A").value();
  p.C = compress(n + 1, 2 * n, C, "C").value();
  p.L = compress(n, 2 * n, L, "L").value();
  p.R = compress(n, 2 * n, R, "R").value();
  p.b = {-1.0};
  p.d.assign(static_cast<std::size_t>(n + 1), 1.0);
  p.d[0] = static_cast<double>(most - n);
  p.l = p.r = std::vector<double>(static_cast<std::size_t>(n), 0.0);
  return p;
}

double best_portfolio(Index n, Index most, std::uint64_t seed) {
  std::vector<Index> assets;
  return best_of(draw(n, seed), assets, 0, most);
}

}  // namespace marble::testing
