#include "hard_families.h"

#include <Eigen/Core>
#include <cstdint>
#include <utility>

#include "marble/published_examples.h"
#include "model.h"
#include "noise.h"
#include "support/box_qp.h"
#include "support/portfolio.h"

namespace marble::suite {
namespace {

using examples::Model;
using examples::Term;
using examples::Terms;

Eigen::MatrixXd random_matrix(Noise& noise, Index rows, Index columns) {
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return noise.uniform(); });
}

Terms row_of(const Eigen::MatrixXd& matrix, Index row, Index first_variable, double factor = 1.0) {
  Terms terms;
  for (Index j = 0; j < matrix.cols(); ++j) terms.push_back({first_variable + j, factor * matrix(row, j)});
  return terms;
}

// Adds a linear cost to every other problem: feasibility must not depend on it.
void add_cost(OwnedProblem& p, Noise& noise, std::uint64_t seed) {
  if (seed / 2 % 2 == 0) return;
  for (double& entry : p.g) entry = noise.uniform();
}

// aᵀx = b, 0 ≤ x ⊥ 1 − x ≥ 0, where b is attained by some x in {0, 1}ⁿ.
OwnedProblem subset_sum(Index n, std::uint64_t seed) {
  Noise noise(seed);
  Model model("subset sum", n);
  Terms sum;
  double b = 0.0;
  for (Index j = 0; j < n; ++j) {
    const double weight = 1.5 + noise.uniform();
    sum.push_back({j, weight});
    if (noise.uniform() > 0.0) b += weight;
    model.complementary({{j, 1.0}}, 0.0, {{j, -1.0}}, 1.0);
  }
  model.equal_zero(sum, -b);
  OwnedProblem p = model.problem();
  add_cost(p, noise, seed);
  return p;
}

// KKT system of min ½ xᵀHx + cᵀx on 0 ≤ x ≤ 1: Hx + c − λ + μ = 0, x ⊥ λ, 1 − x ⊥ μ. On it ½ (cᵀx − Σμ) is
// the QP's objective (Giannessi and Tomasin 1973).
OwnedProblem box_qp(Index n, std::uint64_t seed) {
  Noise noise(seed);
  const Eigen::MatrixXd any = random_matrix(noise, n, n);
  const Eigen::MatrixXd H = any + any.transpose();
  Model model("box QP", 3 * n);
  std::vector<double> c;
  for (Index i = 0; i < n; ++i) {
    Terms stationarity = row_of(H, i, 0);
    stationarity.push_back({n + i, -1.0});
    stationarity.push_back({2 * n + i, 1.0});
    c.push_back(noise.uniform());
    model.equal_zero(stationarity, c.back());
    model.complementary({{i, 1.0}}, 0.0, {{n + i, 1.0}}, 0.0);
    model.complementary({{i, -1.0}}, 1.0, {{2 * n + i, 1.0}}, 0.0);
  }
  OwnedProblem p = model.problem();
  for (Index i = 0; i < n && seed / 2 % 2 == 1; ++i) {
    p.g[static_cast<std::size_t>(i)] = 0.5 * c[static_cast<std::size_t>(i)];
    p.g[static_cast<std::size_t>(2 * n + i)] = -0.5;
  }
  return p;
}

// Equilibria of two players with n strategies each: x ⊥ u − A y ≥ 0, y ⊥ v − Bᵀx ≥ 0, both on simplices.
OwnedProblem game(Index n, std::uint64_t seed) {
  Noise noise(seed);
  const Eigen::MatrixXd A = random_matrix(noise, n, n);
  const Eigen::MatrixXd Bt = random_matrix(noise, n, n);
  Model model("game", 2 * n + 2);
  Terms x, y;
  for (Index i = 0; i < n; ++i) {
    x.push_back({i, 1.0});
    y.push_back({n + i, 1.0});
    Terms first = row_of(A, i, n, -1.0);
    first.push_back({2 * n, 1.0});
    Terms second = row_of(Bt, i, 0, -1.0);
    second.push_back({2 * n + 1, 1.0});
    model.complementary({{i, 1.0}}, 0.0, first, 0.0);
    model.complementary({{n + i, 1.0}}, 0.0, second, 0.0);
  }
  model.equal_zero(x, -1.0);
  model.equal_zero(y, -1.0);
  OwnedProblem p = model.problem();
  if (seed / 2 % 2 == 1) p.g[2 * static_cast<std::size_t>(n)] = p.g.back() = -1.0;  // maximize the sum
  return p;
}

// 0 ≤ x ⊥ M x + q ≥ 0 with a full M of no particular class, and a q such that half of a solution x is
// positive.
OwnedProblem planted_lcp(Index n, std::uint64_t seed) {
  Noise noise(seed);
  const Eigen::MatrixXd M = random_matrix(noise, n, n);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd w = Eigen::VectorXd::Zero(n);
  for (Index i = 0; i < n; ++i) (noise.uniform() > 0.0 ? x : w)[i] = 0.5 * (1.0 + noise.uniform());
  const Eigen::VectorXd q = w - M * x;
  Model model("LCP", n);
  for (Index i = 0; i < n; ++i) model.complementary({{i, 1.0}}, 0.0, row_of(M, i, 0), q[i]);
  OwnedProblem p = model.problem();
  add_cost(p, noise, seed);
  return p;
}

// min ½ zᵀQz + gᵀz with an indefinite Q on −1 ≤ z ≤ 1, some pairs of variables shifted to 0 ≤ z + ½ ⊥.
OwnedProblem indefinite_box(Index n, Index pairs, std::uint64_t seed) {
  Noise noise(seed);
  const Eigen::MatrixXd any = random_matrix(noise, n, n);
  Model model("indefinite", n);
  for (Index i = 0; i < n; ++i) model.within({{i, 1.0}}, 1.0);
  for (Index i = 0; i < pairs; ++i) model.complementary({{2 * i, 1.0}}, 0.5, {{2 * i + 1, 1.0}}, 0.5);
  OwnedProblem p = model.problem();
  Triplets Q;
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) Q.add(i, j, any(i, j) + any(j, i));
    p.g[static_cast<std::size_t>(i)] = noise.uniform();
  }
  p.Q = compress(n, n, Q, "Q").value();
  return p;
}

// A leader x in [−1, 1]³ and a follower who solves min ½ yᵀHy + (c + Gx)ᵀy on −1 ≤ y ≤ 1, y with 12 entries:
// 24 pairs. The leader minimizes the distance to some (x, y).
OwnedProblem bilevel(std::uint64_t seed) {
  constexpr Index kLeader = 3;
  constexpr Index kFollower = 12;
  Noise noise(seed);
  const Eigen::MatrixXd root = random_matrix(noise, kFollower, kFollower);
  const Eigen::MatrixXd H = root * root.transpose() + 0.1 * Eigen::MatrixXd::Identity(kFollower, kFollower);
  const Eigen::MatrixXd G = 3.0 * random_matrix(noise, kFollower, kLeader);
  Model model("bilevel", kLeader + 3 * kFollower);
  for (Index i = 0; i < kLeader; ++i) {
    model.within({{i, 1.0}}, 1.0);
    model.add_square(0.1, {{i, 1.0}}, noise.uniform());
  }
  for (Index i = 0; i < kFollower; ++i) {
    const Index y = kLeader + i;
    const Index lower = y + kFollower;
    const Index upper = lower + kFollower;
    Terms stationarity = row_of(G, i, 0) + row_of(H, i, kLeader);
    stationarity.push_back({lower, -1.0});
    stationarity.push_back({upper, 1.0});
    model.equal_zero(stationarity, noise.uniform());
    model.complementary({{y, 1.0}}, 1.0, {{lower, 1.0}}, 0.0);
    model.complementary({{y, -1.0}}, 1.0, {{upper, 1.0}}, 0.0);
    model.add_square(1.0, {{y, 1.0}}, noise.uniform());
  }
  return model.problem();
}

// Adds the problems that need no search.
void add_proofs(std::vector<HardProblem>& all) {
  Model apart("equalities apart", 1);
  apart.equal_zero({{0, 1.0}});
  apart.equal_zero({{0, 1.0}}, -1.0);
  Model constants("constants", 1);
  constants.add_square(1.0, {{0, 1.0}});
  constants.complementary({}, 3.0, {}, 2.0);
  Model fixed("fixed sides", 2);
  fixed.equal_zero({{0, 1.0}}, -1.0);
  fixed.equal_zero({{1, 1.0}}, -2.0);
  fixed.complementary({{0, 1.0}}, 0.0, {{1, 1.0}}, 0.0);
  Model falls("-x^2 + y^2", 2);
  falls.add_square(-2.0, {{0, 1.0}});
  falls.add_square(2.0, {{1, 1.0}});
  falls.complementary({{0, 1.0}}, 0.0, {{1, 1.0}}, 0.0);
  for (const Model* model : {&apart, &constants, &fixed})
    all.push_back({model->problem().name, model->problem(), Status::infeasible});
  all.push_back({falls.problem().name, falls.problem(), Status::unbounded});
}

}  // namespace

std::vector<HardProblem> hard_problems(int seeds, bool judging) {
  std::vector<HardProblem> all;
  const auto add = [&](const std::string& family, auto&& make) {
    for (int number = 0; number < seeds; ++number)
      all.push_back({family, make(static_cast<std::uint64_t>(2 * number + (judging ? 2 : 1))), {}});
  };
  for (const Index n : {3, 5, 10})
    add("subset sum " + std::to_string(n), [n](std::uint64_t seed) { return subset_sum(n, seed); });
  for (const Index n : {15, 20, 40, 60})
    add("box QP " + std::to_string(n), [n](std::uint64_t seed) { return box_qp(n, seed); });
  for (const Index n : {8, 20, 40})
    add("game " + std::to_string(n), [n](std::uint64_t seed) { return game(n, seed); });
  for (const Index n : {20, 40, 100})
    add("LCP " + std::to_string(n), [n](std::uint64_t seed) { return planted_lcp(n, seed); });
  const auto add_known = [&](const std::string& family, auto&& make, auto&& optimum) {
    add(family, make);
    for (int number = 0; number < seeds; ++number) {
      all[all.size() - static_cast<std::size_t>(seeds - number)].optimum =
          optimum(static_cast<std::uint64_t>(2 * number + (judging ? 2 : 1)));
    }
  };
  for (const Index n : {8, 10, 15, 20}) {
    add_known(
        "best box QP " + std::to_string(n), [n](std::uint64_t seed) { return testing::box_qp(n, seed); },
        [n](std::uint64_t seed) { return testing::box_qp_descent(n, seed); });
  }
  for (const Index n : {20, 30, 40}) {
    add_known(
        "best portfolio " + std::to_string(n),
        [n](std::uint64_t seed) { return testing::portfolio(n, 4, seed); },
        [n](std::uint64_t seed) { return testing::best_portfolio(n, 4, seed); });
  }
  add("bilevel 24", bilevel);
  add("indefinite", [](std::uint64_t seed) {
    const auto kind = static_cast<Index>(seed / 2 % 4);
    return indefinite_box(14 + 2 * kind, 4 + kind, seed);
  });
  for (const double T : {7.0, 7.5, 8.0, 9.0}) {
    for (const double weight : {0.0, 0.01}) {
      for (const bool end_at_rest : {true, false})
        all.push_back({"cheap gates", examples::published_gates({T, weight, end_at_rest}), {}});
    }
  }
  add_parallel_rows(all, seeds, judging);
  add_published(all);
  add_proofs(all);
  return all;
}

}  // namespace marble::suite
