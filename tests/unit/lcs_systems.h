// Systems for the tests of planners: random ones, and a cart-pole between soft walls.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include "marble/lcs.h"

namespace marble::testing {

using Values = std::vector<double>;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Owns the numbers of a view.
struct OwnedSystem {
  Index states = 0, inputs = 0, pairs = 0;
  Values A, B, D, d, E, F, H, c;
  [[nodiscard]] LcsView view() const { return {states, inputs, pairs, A, B, D, d, E, F, H, c}; }
};

inline Values numbers(std::mt19937& random, std::size_t count, double size = 1.0) {
  std::normal_distribution<double> normal(0.0, size);
  Values made(count);
  for (double& value : made) value = normal(random);
  return made;
}

/// F is positive definite and not symmetric, so that each stage has exactly one λ. stages: 0: constant parts.
inline OwnedSystem random_system(unsigned seed, Index states, Index inputs, Index pairs, Index stages = 0) {
  std::mt19937 random(seed);
  const auto nx = static_cast<std::size_t>(states), nu = static_cast<std::size_t>(inputs),
             nl = static_cast<std::size_t>(pairs), count = static_cast<std::size_t>(stages == 0 ? 1 : stages);
  OwnedSystem s;
  s.states = states, s.inputs = inputs, s.pairs = pairs;
  s.A = numbers(random, count * nx * nx, 0.4);
  s.B = numbers(random, count * nx * nu);
  s.D = numbers(random, count * nx * nl, 0.3);
  s.d = numbers(random, count * nx, 0.1);
  s.E = numbers(random, count * nl * nx);
  s.H = numbers(random, count * nl * nu);
  s.c = numbers(random, count * nl);
  for (std::size_t k = 0; k < count; ++k) {
    const Values root = numbers(random, nl * nl), skew = numbers(random, nl * nl);
    const Eigen::Map<const Rows> g(root.data(), pairs, pairs), h(skew.data(), pairs, pairs);
    const Rows f = g * g.transpose() + 0.1 * Rows::Identity(pairs, pairs) + h - h.transpose();
    s.F.insert(s.F.end(), f.data(), f.data() + f.size());
  }
  return s;
}

/// The cart-pole between two soft walls of Aydinoglu, Wei, Huang and Posa, "Consensus complementarity control
/// for multi-contact MPC" (2024), at 0.01 s: states are cart, pole and their speeds.
inline OwnedSystem cart_pole() {
  const double mp = 0.411, mc = 0.978, lp = 0.6, lc = 0.4267, wall = 0.35, stiffness = 100.0, g = 9.81,
               h = 0.01;
  const double on_cart = -1.0 / mc + lp / (mc * lc);
  const double on_pole = -1.0 / (mc * lc) + lp * (mc + mp) / (mc * mp * lc * lc);
  OwnedSystem s;
  s.states = 4, s.inputs = 1, s.pairs = 2;
  s.A = {1, 0, h, 0, 0, 1, 0, h, 0, h * g * mp / mc, 1, 0, 0, h * g * (mc + mp) / (lc * mc), 0, 1};
  s.B = {0, 0, h / mc, h / (lc * mc)};
  s.D = {0, 0, 0, 0, h * on_cart, -h * on_cart, h * on_pole, -h * on_pole};
  s.d = Values(4, 0.0);
  s.E = {-1, lp, 0, 0, 1, -lp, 0, 0};
  s.F = {1 / stiffness, 0, 0, 1 / stiffness};
  s.H = {0, 0};
  s.c = {wall, wall};
  return s;
}

inline Values diagonal(const Values& entries) {
  Values made(entries.size() * entries.size(), 0.0);
  for (std::size_t i = 0; i < entries.size(); ++i) made[i * entries.size() + i] = entries[i];
  return made;
}

inline LcsTask cart_pole_task(Index stages) {
  return {.stages = stages, .Q = diagonal({10, 2, 1, 1}), .R = {1}};
}

/// The largest |min(λ, E x + F λ + H u + c)| and dynamics error of a trajectory, by plain loops.
inline double residual(const OwnedSystem& s, const LcsTrajectory& t) {
  const std::size_t nx = static_cast<std::size_t>(s.states), nu = static_cast<std::size_t>(s.inputs),
                    nl = static_cast<std::size_t>(s.pairs), stages = t.u.size() / nu;
  const auto entry = [&](const Values& part, std::size_t rows, std::size_t columns, std::size_t k,
                         std::size_t i, std::size_t j) {
    const std::size_t stage = part.size() > rows * columns ? k : 0;
    return part[(stage * rows + i) * columns + j];
  };
  double worst = 0.0;
  for (std::size_t k = 0; k < stages; ++k) {
    const double *x = &t.x[k * nx], *u = &t.u[k * nu], *lam = t.lam.data() + k * nl;
    for (std::size_t i = 0; i < nx; ++i) {
      double sum = entry(s.d, nx, 1, k, i, 0) - t.x[(k + 1) * nx + i];
      for (std::size_t j = 0; j < nx; ++j) sum += entry(s.A, nx, nx, k, i, j) * x[j];
      for (std::size_t j = 0; j < nu; ++j) sum += entry(s.B, nx, nu, k, i, j) * u[j];
      for (std::size_t j = 0; j < nl; ++j) sum += entry(s.D, nx, nl, k, i, j) * lam[j];
      worst = std::max(worst, std::abs(sum));
    }
    for (std::size_t i = 0; i < nl; ++i) {
      double gap = entry(s.c, nl, 1, k, i, 0);
      for (std::size_t j = 0; j < nx; ++j) gap += entry(s.E, nl, nx, k, i, j) * x[j];
      for (std::size_t j = 0; j < nl; ++j) gap += entry(s.F, nl, nl, k, i, j) * lam[j];
      for (std::size_t j = 0; j < nu; ++j) gap += entry(s.H, nl, nu, k, i, j) * u[j];
      worst = std::max(worst, std::abs(std::min(gap, lam[i])));
    }
  }
  return worst;
}

}  // namespace marble::testing
