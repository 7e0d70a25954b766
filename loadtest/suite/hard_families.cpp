#include "hard_families.h"

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

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

// Provides small problems from the literature with their published optima; none is among the 39 benchmarks.
namespace marble::suite {
namespace {

using examples::Model;
using examples::Terms;

struct Row {
  Terms terms;
  double constant;
};

// The leader, whose variables come first, minimizes `cost`; the follower minimizes `own` over its variables
// with rows ≥ 0. The follower's optimality: own = Σ λ_i of its part of row i, λ_i ⊥ row i.
OwnedProblem leader_and_follower(Index leaders, const std::vector<double>& cost,
                                 const std::vector<double>& own, const std::vector<Row>& rows,
                                 const std::vector<Row>& of_leader = {}) {
  const auto variables = static_cast<Index>(cost.size());
  Model model("leader and follower", variables + static_cast<Index>(rows.size()));
  for (Index j = 0; j < variables; ++j) model.add_linear(cost[static_cast<std::size_t>(j)], j);
  for (const Row& row : of_leader) model.at_least_zero(row.terms, row.constant);
  std::vector<Terms> stationarity(own.size());
  Index multiplier = variables;
  for (const Row& row : rows) {
    model.complementary(row.terms, row.constant, {{multiplier, 1.0}}, 0.0);
    for (const auto& [variable, factor] : row.terms) {
      if (variable >= leaders)
        stationarity[static_cast<std::size_t>(variable - leaders)].push_back({multiplier, -factor});
    }
    ++multiplier;
  }
  for (std::size_t i = 0; i < own.size(); ++i) model.equal_zero(stationarity[i], own[i]);
  return model.problem();
}

Row row(Terms terms, double constant) { return {std::move(terms), constant}; }

// Rows of Bialas and Karwan 1984, in x and y.
std::vector<Row> five_rows() {
  return {row({{0, 1.0}, {1, 2.0}}, -10.0), row({{0, -1.0}, {1, 2.0}}, 6.0), row({{0, -2.0}, {1, 1.0}}, 21.0),
          row({{0, -1.0}, {1, -2.0}}, 38.0), row({{0, 1.0}, {1, -2.0}}, 18.0)};
}

// min x² + y² + 2 factor xy with 0 ≤ x ⊥ y ≥ 0.
OwnedProblem product(double factor) {
  Model model("ralph2", 2);
  model.add_square(2.0 - 2.0 * factor, {{0, 1.0}});
  model.add_square(2.0 - 2.0 * factor, {{1, 1.0}});
  model.add_square(2.0 * factor, {{0, 1.0}, {1, 1.0}});
  model.complementary({{0, 1.0}}, 0.0, {{1, 1.0}}, 0.0);
  return model.problem();
}

}  // namespace

void add_published(std::vector<HardProblem>& all) {
  const auto add = [&](OwnedProblem problem, double optimum) {
    all.push_back({"published", std::move(problem), {}, optimum});
  };
  // Anandalingam and White, "A solution method for the linear static Stackelberg problem using penalty
  // functions", 1990: (16, 11); at (0, 5) is a local optimum of −15.
  const Row x_positive = row({{0, 1.0}}, 0.0);
  const Row y_positive = row({{1, 1.0}}, 0.0);
  std::vector<Row> rows = five_rows();
  rows.push_back(y_positive);
  add(leader_and_follower(1, {-1.0, -3.0}, {1.0}, rows, {x_positive}), -49.0);
  // Bialas and Karwan, "Two-level linear programming", 1984: (16, 11).
  add(leader_and_follower(1, {0.0, -1.0}, {1.0}, rows, {x_positive}), -11.0);
  // Candler and Townsley, "A linear two-level programming problem", 1982: x = (0, .9), y = (0, .6, .4).
  rows = {row({{2, 1.0}, {3, -1.0}, {4, -1.0}}, 1.0), row({{0, -2.0}, {2, 1.0}, {3, -2.0}, {4, 0.5}}, 1.0),
          row({{1, -2.0}, {2, -2.0}, {3, 1.0}, {4, 0.5}}, 1.0)};
  for (const Index j : {2, 3, 4}) rows.push_back(row({{j, 1.0}}, 0.0));
  add(leader_and_follower(2, {-8.0, -4.0, 4.0, -40.0, -4.0}, {1.0, 1.0, 2.0}, rows, {x_positive, y_positive}),
      -29.2);
  // Bard and Falk, "An explicit solution to the multi-level programming problem", 1982: x = (2, 0),
  // y = (1.5, 0).
  rows = {row({{0, 2.0}, {2, -1.0}, {3, 1.0}}, -2.5), row({{0, -1.0}, {1, 3.0}, {3, -1.0}}, 2.0),
          row({{0, -1.0}, {1, -1.0}}, 2.0)};
  for (const Index j : {2, 3}) rows.push_back(row({{j, 1.0}}, 0.0));
  add(leader_and_follower(2, {-2.0, 1.0, 0.5, 0.0}, {-4.0, 1.0}, rows, {x_positive, y_positive}), -3.25);
  // Of MacMPEC: kth1, ralph1 (no multiplier makes 0 strongly stationary), ralph2 (Q is not convex).
  Model kth1("kth1", 2);
  kth1.add_linear(1.0, 0);
  kth1.add_linear(1.0, 1);
  kth1.complementary({{0, 1.0}}, 0.0, {{1, 1.0}}, 0.0);
  add(kth1.problem(), 0.0);
  Model ralph1("ralph1", 2);
  ralph1.add_linear(2.0, 0);
  ralph1.add_linear(-1.0, 1);
  ralph1.at_least_zero({{0, 1.0}});
  ralph1.complementary({{1, 1.0}}, 0.0, {{0, -1.0}, {1, 1.0}}, 0.0);
  add(ralph1.problem(), 0.0);
  add(product(-2.0), 0.0);
}

}  // namespace marble::suite

// Generates strictly convex QPs in which one row is another one plus e times noise, with an optimum known by
// construction.
namespace marble::suite {
namespace {

using examples::Model;
using examples::Terms;

enum class Kind { equalities, inequalities, one_of_each, pairs };

Eigen::VectorXd random_vector(Noise& noise, Index size) {
  return Eigen::VectorXd::NullaryExpr(size, [&] { return noise.uniform(); });
}

Terms terms_of(const Eigen::VectorXd& row) {
  Terms terms;
  for (Index j = 0; j < row.size(); ++j) terms.push_back({j, row[j]});
  return terms;
}

// The solution is z, with multipliers of the parallel rows that are 1/e and differ by about 1: the sum of
// their terms is again about 1. The zero sides of pairs have positive multipliers, so that z is also the
// optimum without complementarity.
HardProblem parallel_rows(const std::string& family, Kind kind, Index n, Index m, bool box,
                          std::uint64_t seed) {
  Noise noise(seed);
  const double e = std::pow(10.0, -2.0 - static_cast<double>(seed / 2 % 6));
  const Eigen::VectorXd z = random_vector(noise, n);
  Eigen::VectorXd gradient = -z;  // with Q = I
  Model model(family, n);
  for (Index j = 0; j < n; ++j) model.add_square(1.0, {{j, 1.0}});
  Eigen::VectorXd first;
  for (Index i = 0; i < m; ++i) {
    Eigen::VectorXd row = random_vector(noise, n);
    if (i == 1) row = e * row + (kind == Kind::equalities ? first : Eigen::VectorXd(-first));
    if (i == 0) first = row;
    const double multiplier = i < 2 ? 1.0 / e + (i == 0 ? 0.0 : noise.uniform()) : 1.5 + noise.uniform();
    const bool opposite = kind == Kind::equalities && i == 1;
    gradient += (opposite ? -multiplier : multiplier) * row;
    const double constant = -row.dot(z);
    if (kind == Kind::pairs) {
      const Eigen::VectorXd other = random_vector(noise, n);
      model.complementary(terms_of(row), constant, terms_of(other), 1.5 + noise.uniform() - other.dot(z));
    } else if (kind == Kind::equalities || (kind == Kind::one_of_each && i == 0)) {
      model.equal_zero(terms_of(row), constant);
    } else {
      model.at_least_zero(terms_of(row), constant);
    }
  }
  for (Index j = 0; box && j < n; ++j) model.within({{j, 1.0}}, 10.0);
  HardProblem result{family, model.problem(), {}};
  result.problem.g.assign(gradient.data(), gradient.data() + n);
  result.optimum = 0.5 * z.squaredNorm() + gradient.dot(z);
  return result;
}

}  // namespace

void add_parallel_rows(std::vector<HardProblem>& all, int seeds, bool judging) {
  struct Family {
    const char* name;
    Kind kind;
  };
  for (const auto& [name, kind] :
       {Family{"equalities", Kind::equalities}, Family{"inequalities", Kind::inequalities},
        Family{"one of each", Kind::one_of_each}, Family{"pairs", Kind::pairs}}) {
    for (const bool box : {false, true}) {
      const std::string family = "parallel " + std::string(name) + (box ? ", box" : "");
      for (int number = 0; number < seeds; ++number) {
        const auto seed = static_cast<std::uint64_t>(2 * number + (judging ? 2 : 1));
        for (const auto& [n, m] : {std::pair<Index, Index>{2, 2}, {3, 2}, {6, 3}, {20, 10}, {50, 40}})
          all.push_back(parallel_rows(family, kind, n, m, box, seed));
      }
    }
  }
}

}  // namespace marble::suite
