// Whether a feasible point is found depends on the constraints, not on the objective; what has none is
// refuted, and what has one never is.
#include "global/feasibility.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <string>
#include <utility>

#include "global/lemke.h"
#include "marble/solver.h"
#include "support/dense_matrix.h"
#include "support/independent_check.h"
#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::judge;
using testing::sparse;
using testing::Workbench;

std::vector<double> values(const Eigen::VectorXd& v) { return {v.data(), v.data() + v.size()}; }

Eigen::MatrixXd random_matrix(std::mt19937_64& random, Index rows, Index columns) {
  std::uniform_real_distribution<double> entry(-1.0, 1.0);
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return entry(random); });
}

// aᵀx = b, 0 ≤ x ⊥ 1 − x ≥ 0.
OwnedProblem subset_sum(const Eigen::VectorXd& weights, double b) {
  const Index n = static_cast<Index>(weights.size());
  OwnedProblem p;
  p.g.assign(static_cast<std::size_t>(n), 0.0);
  p.A = sparse(weights.transpose());
  p.b = {-b};
  p.L = sparse(Eigen::MatrixXd::Identity(n, n));
  p.l.assign(static_cast<std::size_t>(n), 0.0);
  p.R = sparse(-Eigen::MatrixXd::Identity(n, n));
  p.r.assign(static_cast<std::size_t>(n), 1.0);
  return p;
}

// A sum of some of the weights, and half of the least one more than all.
std::pair<OwnedProblem, OwnedProblem> sums(Index n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const Eigen::VectorXd weights = random_matrix(random, n, 1).col(0).array() + 1.5;
  double some = 0.0;
  for (Index j = 0; j < n; j += 2) some += weights[j];
  return {subset_sum(weights, some), subset_sum(weights, 0.5 * weights.minCoeff())};
}

void expect_solved(const OwnedProblem& p, const std::string& what, const Options& options = {}) {
  const Solution s = solve_in_process(p.view(), options).value();
  EXPECT_TRUE(is_solved(s.status)) << what << ": " << to_string(s.status) << ", " << s.detail;
  EXPECT_LE(judge(p.view(), s).infeasibility(), 1e-6) << what;
}

TEST(Feasibility, IsFoundWhateverTheObjective) {
  for (const Index n : {3, 5, 9}) {
    OwnedProblem p = sums(n, 7).first;
    std::mt19937_64 random(11);
    for (int objective = 0; objective < 12; ++objective) {
      expect_solved(p, "n = " + std::to_string(n) + ", objective " + std::to_string(objective));
      const double scale = std::pow(10.0, objective % 5 - 2);
      p.g = values(scale * random_matrix(random, n, 1).col(0));
    }
  }
}

TEST(Feasibility, SumsThatNoSubsetHasAreRefuted) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const OwnedProblem p = sums(6, seed).second;
    const Solution s = solve_in_process(p.view()).value();
    EXPECT_EQ(s.status, Status::infeasible) << s.detail;
    EXPECT_TRUE(s.certificate.empty());
    EXPECT_NE(s.detail.find("every branch"), std::string::npos) << s.detail;
  }
}

TEST(Feasibility, ContradictionsThatNeedNoSearchAreProved) {
  const Eigen::MatrixXd one = Eigen::MatrixXd::Ones(1, 1);
  OwnedProblem apart;  // z = 0 and z = 1
  apart.g = {0.0};
  apart.A = sparse(Eigen::MatrixXd::Ones(2, 1));
  apart.b = {0.0, -1.0};
  OwnedProblem constants;  // 3 ⊥ 2
  constants.g = {1.0};
  constants.Q = sparse(one);
  constants.L = constants.R = sparse(Eigen::MatrixXd::Zero(1, 1));
  constants.l = {3.0};
  constants.r = {2.0};
  OwnedProblem fixed;  // z = (1, 2), z₀ ⊥ z₁
  fixed.g = {0.0, 0.0};
  fixed.A = sparse(Eigen::MatrixXd::Identity(2, 2));
  fixed.b = {-1.0, -2.0};
  fixed.L = sparse(Eigen::RowVector2d(1.0, 0.0));
  fixed.R = sparse(Eigen::RowVector2d(0.0, 1.0));
  fixed.l = fixed.r = {0.0};
  for (const OwnedProblem* p : {&apart, &constants, &fixed}) {
    const Solution s = solve_in_process(p->view()).value();
    EXPECT_EQ(s.status, Status::infeasible) << s.detail;
  }
}

TEST(Feasibility, ASideAlongWhichTheObjectiveFallsIsUnbounded) {
  OwnedProblem p;  // −x² + y², x ⊥ y
  p.g = {0.0, 0.0};
  p.Q = sparse(Eigen::Vector2d(-2.0, 2.0).asDiagonal().toDenseMatrix());
  p.L = sparse(Eigen::RowVector2d(1.0, 0.0));
  p.R = sparse(Eigen::RowVector2d(0.0, 1.0));
  p.l = p.r = {0.0};
  const Solution s = solve_in_process(p.view()).value();
  EXPECT_EQ(s.status, Status::unbounded) << s.detail;
}

// The tree alone, on problems that have a feasible point: a proof would be false.
TEST(Feasibility, AFeasibleProblemIsNeverRefuted) {
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Workbench bench(testing::random_problem({}, seed));
    PairTree tree(bench.problem);
    const auto feasible = [&](ConstVectorRef, const WorkingSet&) { return true; };
    const PairTree::End end = tree.run(bench.run, bench.zero(), 2000, feasible);
    EXPECT_NE(end, PairTree::End::refuted) << seed;
    found += end == PairTree::End::found;
  }
  EXPECT_GE(found, 38);
}

// 0 ≤ x ⊥ Mx + q ≥ 0 with a full M of no class: hardly one way of Lemke's method in ten ends in a solution.
TEST(Feasibility, ComplementarityProblemsOfNoClassAreSolvedUpToFortyPairs) {
  constexpr Index kPairs = 40;
  int solved = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    std::mt19937_64 random(seed);
    const Eigen::MatrixXd M = random_matrix(random, kPairs, kPairs);
    Eigen::VectorXd x = random_matrix(random, kPairs, 1).col(0);
    const Eigen::VectorXd w = (-x).cwiseMax(0.0);
    x = x.cwiseMax(0.0);
    OwnedProblem p;
    p.g.assign(kPairs, 0.0);
    p.L = sparse(Eigen::MatrixXd::Identity(kPairs, kPairs));
    p.l.assign(kPairs, 0.0);
    p.R = sparse(M);
    p.r = values(w - M * x);
    solved += is_solved(solve_in_process(p.view()).value().status) ? 1 : 0;
  }
  EXPECT_GE(solved, 9);
}

TEST(Feasibility, ItsBudgetIsKeptAndNoneSwitchesItOff) {
  const OwnedProblem p = sums(14, 3).second;
  Options options;
  options.max_feasibility_factorizations = 0;
  const Solution without = solve_in_process(p.view(), options).value();
  EXPECT_EQ(without.status, Status::locally_infeasible) << without.detail;
  options.max_feasibility_factorizations = 200;
  const Solution little = solve_in_process(p.view(), options).value();
  EXPECT_GE(little.factorizations, without.factorizations);
  // One engine may be under way when it ends.
  EXPECT_LE(little.factorizations,
            without.factorizations + 200 + options.max_local_search_factorizations + 300);
}

// 0 ≤ x ⊥ u − A y ≥ 0, 0 ≤ y ⊥ v − Bᵀx ≥ 0, x and y on simplices: every game has an equilibrium, and the
// paths of Lemke and Howson end in one.
OwnedProblem game(Index n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(2 * n, 2 * n + 2);
  L.leftCols(2 * n).setIdentity();
  Eigen::MatrixXd R = Eigen::MatrixXd::Zero(2 * n, 2 * n + 2);
  R.block(0, n, n, n) = -random_matrix(random, n, n);
  R.block(n, 0, n, n) = -random_matrix(random, n, n);
  R.block(0, 2 * n, n, 1).setOnes();
  R.block(n, 2 * n + 1, n, 1).setOnes();
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(2, 2 * n + 2);
  A.block(0, 0, 1, n).setOnes();
  A.block(1, n, 1, n).setOnes();
  OwnedProblem p;
  p.g.assign(2 * static_cast<std::size_t>(n) + 2, 0.0);
  p.A = sparse(A);
  p.b = {-1.0, -1.0};
  p.L = sparse(L);
  p.R = sparse(R);
  p.l.assign(2 * static_cast<std::size_t>(n), 0.0);
  p.r = p.l;
  return p;
}

TEST(Feasibility, LemkesFirstPathEndsInAnEquilibriumOfEveryGame) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Workbench bench(game(10, seed));
    Lemke<double> lemke(bench.problem);
    ASSERT_TRUE(lemke.applies());
    WorkingSet branch(bench.problem);
    EXPECT_TRUE(lemke.run(bench.run, 0, bench.zero(), branch)) << seed;
    const auto kkt = make_kkt(bench.problem);
    BranchEngines engines(bench.problem, *kkt);
    engines.point.restore(Iterate(bench.problem), branch);
    ExactSolution solution(bench.problem);
    EXPECT_TRUE(solve_exactly(bench.problem, bench.options, engines.exact, bench.run, 50, solution)) << seed;
  }
}

TEST(Feasibility, TheTreeOverThePairsTakesItsMemoryFromTheRun) {
  const OwnedProblem p = sums(6, 1).second;
  Workbench bench(p);
  const auto search = [&](double bytes) {
    bench.run.bytes_left = bytes;
    PairTree tree(bench.problem);
    const PairTree::End end =
        tree.run(bench.run, bench.zero(), 100000, [](ConstVectorRef, const WorkingSet&) { return false; });
    return std::pair(end, tree.nodes());
  };
  EXPECT_EQ(search(1e9).first, PairTree::End::refuted);
  const double taken = 1e9 - bench.run.bytes_left;
  EXPECT_GT(taken, 0.0);
  EXPECT_EQ(search(taken).first, PairTree::End::refuted);
  for (const double share : {0.0, 0.1, 0.9}) {
    EXPECT_EQ(search(share * taken), std::pair(PairTree::End::stopped, 0)) << share;
  }
}

}  // namespace
}  // namespace marble
