#include <gtest/gtest.h>

#include "marble/examples.h"
#include "marble/solver.h"
#include "proof/balance.h"
#include "proof/convexity.h"
#include "proof/stationarity.h"
#include "support/problem_builder.h"
#include "support/random_problem.h"
#include "support/small_problems.h"
#include "workbench.h"

namespace marble {
namespace {

// What a solve records of its proofs. Whether the proofs hold is seen elsewhere
// (tests/cli/proof_files_test.py), by a program that shares nothing with the solver.
using testing::ProblemBuilder;

Options global(int node_limit = 1000000) {
  Options options;
  options.global_search = true;
  options.node_limit = node_limit;
  return options;
}

Solution solve(const OwnedProblem& p, Proof* proof, TaskRunner* runner = nullptr, int node_limit = 1000000) {
  SolveControls controls;
  controls.proof = proof;
  controls.runner = runner;
  return solve_in_process(p.view(), global(node_limit), controls).value();
}

// One after the other, the last one first.
class Backwards final : public TaskRunner {
 public:
  void run(std::span<const std::function<void()>> tasks) override {
    for (std::size_t i = tasks.size(); i-- > 0;) tasks[i]();
  }
};

// How many of all choices of a zero side, a bit a pair, no leaf is about.
std::uint32_t uncovered(const std::vector<ProofLeaf>& leaves, Index pairs) {
  std::uint32_t count = 0;
  for (std::uint32_t branch = 0; branch < 1U << static_cast<unsigned>(pairs); ++branch) {
    const auto s_is_zero = [branch](Index pair) { return (branch >> static_cast<unsigned>(pair) & 1U) != 0; };
    bool covered = false;
    for (const ProofLeaf& leaf : leaves) {
      bool in = true;
      for (const Index pair : leaf.s_zero) in = in && s_is_zero(pair);
      for (const Index pair : leaf.t_zero) in = in && !s_is_zero(pair);
      covered = covered || in;
    }
    count += covered ? 0 : 1;
  }
  return count;
}

TEST(ProofRecord, ChangesNothingOfTheAnswerOrItsWork) {
  for (const OwnedProblem& p : {examples::qpec({10, 40, 4, 4}, 3), examples::hopper({.steps = 10})}) {
    const Solution without = solve(p, nullptr, nullptr, 300);
    Proof proof;
    const Solution with = solve(p, &proof, nullptr, 300);
    EXPECT_EQ(with.z, without.z) << p.name;
    EXPECT_EQ(with.bound, without.bound) << p.name;
    EXPECT_EQ(with.nodes, without.nodes) << p.name;
    EXPECT_EQ(with.factorizations, without.factorizations) << p.name;
    EXPECT_EQ(proof.claim, Proof::Claim::bound) << p.name << proof.reason;
    EXPECT_EQ(proof.bound, with.bound) << p.name;
  }
}

TEST(ProofRecord, IsTheSameWhoeverExpandsTheNodes) {
  const OwnedProblem p = examples::qpec({10, 40, 4, 4}, 3);
  Proof alone, helped;
  Backwards runner;
  static_cast<void>(solve(p, &alone));
  static_cast<void>(solve(p, &helped, &runner));
  ASSERT_EQ(alone.leaves.size(), helped.leaves.size());
  for (std::size_t i = 0; i < alone.leaves.size(); ++i) {
    EXPECT_EQ(alone.leaves[i].s_zero, helped.leaves[i].s_zero);
    EXPECT_EQ(alone.leaves[i].t_zero, helped.leaves[i].t_zero);
    EXPECT_EQ(alone.leaves[i].y, helped.leaves[i].y);
    EXPECT_EQ(alone.leaves[i].xi, helped.leaves[i].xi);
  }
}

TEST(ProofRecord, CoversEveryBranchAlsoWhereALimitEndsTheTree) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    testing::RandomSizes sizes;
    sizes.pairs = 8;
    const OwnedProblem p = testing::random_problem(sizes, seed);
    for (const int node_limit : {1, 3, 7, 1000000}) {
      Proof proof;
      const Solution s = solve(p, &proof, nullptr, node_limit);
      if (proof.claim == Proof::Claim::none) continue;
      EXPECT_EQ(uncovered(proof.leaves, sizes.pairs), 0U) << seed << " " << node_limit << " " << s.detail;
    }
  }
}

TEST(ProofRecord, IsNoneWhereItTakesMoreThanItMay) {
  const OwnedProblem p = examples::qpec({10, 20, 4, 2}, 1);
  Proof proof;
  proof.most_bytes = 1000;
  const Solution s = solve(p, &proof);
  EXPECT_TRUE(s.proved);
  EXPECT_EQ(proof.claim, Proof::Claim::none);
  EXPECT_EQ(proof.reason, "its leaves take more than 1000 bytes");
  EXPECT_TRUE(proof.leaves.empty());
}

TEST(ProofRecord, OfRowsThatContradictEachOtherIsTheCertificate) {
  // z >= 3 and z <= 1.
  const OwnedProblem p = ProblemBuilder("clash", {1.0})
                             .at_least({1.0, -3.0})
                             .at_least({-1.0, 1.0})
                             .pair({1.0, 0.0}, {0.0, 1.0})
                             .optimum(0.0)
                             .problem;
  Proof proof;
  const Solution s = solve(p, &proof);
  ASSERT_EQ(s.status, Status::infeasible);
  ASSERT_EQ(proof.claim, Proof::Claim::infeasible) << proof.reason;
  ASSERT_EQ(proof.leaves.size(), 1U);
  EXPECT_TRUE(proof.leaves[0].contradiction);
  EXPECT_EQ(proof.leaves[0].nu, (SparseNumbers{{0, 1}, {s.certificate[0], s.certificate[1]}}));
}

TEST(ProofRecord, IsNoneOfAnUnboundedProblemAndSaysSo) {
  const OwnedProblem p =
      ProblemBuilder("runaway", {0.0, -1.0}).pair({1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}).optimum(0.0).problem;
  Proof proof;
  EXPECT_EQ(solve(p, &proof).status, Status::unbounded);
  EXPECT_EQ(proof.claim, Proof::Claim::none);
  EXPECT_FALSE(proof.reason.empty());
}

TEST(ProofRecord, OfTheSolveBeforeIsForgotten) {
  Proof proof;
  static_cast<void>(solve(examples::qpec({10, 20, 4, 2}, 1), &proof));
  ASSERT_GT(proof.leaves.size(), 1U);
  const OwnedProblem p =
      ProblemBuilder("runaway", {0.0, -1.0}).pair({1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}).optimum(0.0).problem;
  static_cast<void>(solve(p, &proof));
  EXPECT_TRUE(proof.leaves.empty());
  EXPECT_EQ(proof.bytes, 0);
}

// What is balanced in the scaled problem, and what has a digit in the user's units.

// min g z for one free variable, whose unit is 1 / scale of the user's.
struct Slope {
  Slope(double gradient, double scale) : g{gradient}, problem(scaled(g)) {
    problem.variable_scale[0] = scale;
  }
  static ScaledProblem scaled(const std::vector<double>& g) {
    ProblemView view;
    view.g = g;
    ScaledProblem problem = scale(Problem::create(view).value(), 0);
    return problem;
  }
  [[nodiscard]] Images at_zero() const {
    Images images(problem);
    images.evaluate(problem, Iterate(problem));
    return images;
  }

  std::vector<double> g;
  ScaledProblem problem;
};

TEST(Balance, AScaledResidualWithinTheToleranceMayHaveNoDigitInTheUsersUnits) {
  const Slope slope(1e-5, 1e-8);
  const Images images = slope.at_zero();
  const Iterate x(slope.problem);
  EXPECT_TRUE(is_balanced(slope.problem, {}, images, x));
  EXPECT_FALSE(is_balanced_in_user_units(slope.problem, images, x)) << "1000 of 1000";
}

TEST(Balance, WhatIsSmallInTheUsersUnitsIsBalancedThere) {
  for (const double scale : {1.0, 1e4}) {
    const Slope slope(1e-5, scale);
    EXPECT_TRUE(is_balanced_in_user_units(slope.problem, slope.at_zero(), Iterate(slope.problem))) << scale;
  }
}

TEST(Balance, AResidualIsJudgedAgainstTheTermsOfItsOwnSum) {
  Slope slope(1e-5, 1e-8);
  Images images = slope.at_zero();
  images.stationarity[0] = 1e-7;  // what is left of 1e-5
  EXPECT_TRUE(is_balanced_in_user_units(slope.problem, images, Iterate(slope.problem)));
}

// What second-order tests rely on: Q is looked at once, by one factorization at most, until it changes.
using testing::FailingKkt;
using testing::Rows;
using testing::Workbench;

// ½zᵀ[a b; b c]z, unscaled, with a pair so that it is a problem at all.
OwnedProblem quadratic(double a, double b, double c) {
  OwnedProblem p;
  p.g = {0.0, 0.0};
  p.Q = compress(2, 2, {{0, 0, 1, 1}, {0, 1, 0, 1}, {a, b, b, c}}, "Q").value();
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  return p;
}

TEST(Convexity, OfADiagonallyDominantQIsKnownAtNoCost) {
  Workbench w(quadratic(2.0, -1.0, 1.0));
  Convexity convexity(w.problem, *w.kkt);
  EXPECT_TRUE(convexity.known());
  EXPECT_TRUE(convexity.decide(w.run));
  EXPECT_EQ(w.run.factorizations, 0);
}

TEST(Convexity, OfOthersIsDecidedByOneFactorization) {
  for (const double c : {5.0, 1.0}) {  // 4 makes it singular
    Workbench w(quadratic(1.0, 2.0, c));
    Convexity convexity(w.problem, *w.kkt);
    EXPECT_FALSE(convexity.known()) << "not yet";
    EXPECT_EQ(w.run.factorizations, 0);
    EXPECT_EQ(convexity.decide(w.run), c > 4.0);
    EXPECT_EQ(convexity.known(), c > 4.0);
    EXPECT_EQ(convexity.decide(w.run), c > 4.0);
    EXPECT_EQ(w.run.factorizations, 1) << "once for all solves with it";
  }
}

TEST(Convexity, IsDecidedAnewForNewValues) {
  Workbench w(quadratic(1.0, 2.0, 5.0));
  Convexity convexity(w.problem, *w.kkt);
  EXPECT_TRUE(convexity.decide(w.run));
  for (double& value : w.problem.Q.values) value = -value;
  w.kkt->load(w.problem);
  convexity.forget();
  EXPECT_FALSE(convexity.known());
  EXPECT_FALSE(convexity.decide(w.run));
  EXPECT_EQ(w.run.factorizations, 2);
}

TEST(Convexity, NeedsNoFactorizationWhereOneHasShownNegativeCurvature) {
  Workbench w(quadratic(1.0, 2.0, 1.0));
  Convexity convexity(w.problem, *w.kkt);
  w.run.nonconvex = true;
  EXPECT_FALSE(convexity.decide(w.run));
  EXPECT_EQ(w.run.factorizations, 0);
}

TEST(Convexity, IsNotDecidedByAFactorizationThatWasInterrupted) {
  Rows rows;
  Workbench w(quadratic(1.0, 2.0, 5.0), {}, &rows);
  FailingKkt kkt(*w.kkt, 1, &rows.source);
  Convexity convexity(w.problem, kkt);
  EXPECT_FALSE(convexity.decide(w.run));
  const SolveControls controls;
  marble::Run later(w.options, controls);
  static_cast<void>(convexity.decide(later));
  EXPECT_EQ(later.factorizations, 1) << "it is looked at again";
}

// One pair (z₁, z₂) at the origin, with multipliers ξ and η.
Stationarity kind(double xi, double eta, std::vector<double> z = {0.0, 0.0}) {
  OwnedProblem p;
  p.g = {xi, eta};  // ξ e₁ + η e₂ balances g
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  const ScaledProblem problem = scale(Problem::create(p.view()).value(), 0);
  Iterate x(problem);
  x.z() << z[0], z[1];
  x.lambda_L() << -xi;
  x.lambda_R() << -eta;
  Images images(problem);
  images.evaluate(problem, x);
  return classify(images, x);
}

TEST(Stationarity, IsReportedBySignsOfTheMultipliersOfBiactivePairs) {
  EXPECT_EQ(kind(1.0, 1.0), Stationarity::strong);
  EXPECT_EQ(kind(0.0, 1.0), Stationarity::strong);
  EXPECT_EQ(kind(0.0, 0.0), Stationarity::strong);
  EXPECT_EQ(kind(0.0, -1.0), Stationarity::mordukhovich);
  EXPECT_EQ(kind(-1.0, 0.0), Stationarity::mordukhovich);
  EXPECT_EQ(kind(-1.0, -2.0), Stationarity::clarke);
  EXPECT_EQ(kind(1.0, -1.0), Stationarity::weak);
  EXPECT_EQ(kind(-3.0, 1.0), Stationarity::weak);
}

TEST(Stationarity, PairsWithOneSideOpenSayNothing) {
  EXPECT_EQ(kind(-1.0, 0.0, {0.0, 1.0}), Stationarity::strong);
  EXPECT_EQ(kind(0.0, -1.0, {1.0, 0.0}), Stationarity::strong);
}

// Scheel and Scholtes' example: the origin is the minimum, and no multipliers make it strongly stationary.
OwnedProblem without_strong_multipliers() {
  OwnedProblem p;
  p.name = "scheel scholtes";
  p.g = {1.0, 1.0, -1.0};  // min z₁ + z₂ − z₃ s.t. z₃ ≤ 4 z₁, z₃ ≤ 4 z₂
  p.C = compress(2, 3, {{0, 0, 1, 1}, {0, 2, 1, 2}, {4.0, -1.0, 4.0, -1.0}}, "C").value();
  p.d = {0.0, 0.0};
  p.L = compress(1, 3, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 3, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  return p;
}

TEST(Stationarity, AMinimumWithoutStrongMultipliersIsDecidedByItsBranches) {
  const Solution s = solve_in_process(without_strong_multipliers().view()).value();
  ASSERT_EQ(s.status, Status::solved) << s.detail;
  EXPECT_NEAR(s.objective, 0.0, 1e-9);
  EXPECT_NE(s.stationarity, Stationarity::strong);
  EXPECT_NE(s.stationarity, Stationarity::unknown);
  ASSERT_TRUE(s.b_stationary.has_value());
  EXPECT_TRUE(*s.b_stationary);
}

TEST(Stationarity, BranchesAreNotTriedWithoutABudgetForThem) {
  Options options;
  options.max_local_search_factorizations = 0;
  EXPECT_FALSE(
      solve_in_process(without_strong_multipliers().view(), options).value().b_stationary.has_value());
}

TEST(Stationarity, AnswersOfSmallProblemsHaveNoDescentLeft) {
  for (const auto& [problem, optimum] : testing::small_problems()) {
    const Solution s = solve_in_process(problem.view()).value();
    ASSERT_EQ(s.status, Status::solved) << problem.name;
    EXPECT_TRUE(s.b_stationary.value_or(false)) << problem.name << " is " << to_string(s.stationarity);
  }
}

TEST(Stationarity, IsUnknownForWhatIsNotSolved) {
  Options options;
  options.max_iterations = 1;
  const auto problem = testing::public_example().problem;
  EXPECT_EQ(solve_in_process(problem.view(), options).value().stationarity, Stationarity::unknown);
}

}  // namespace
}  // namespace marble
